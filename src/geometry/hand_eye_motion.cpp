// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "hand_eye_motion.h"

#include "decompositions.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/rotation_vector.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace view_servo
{
namespace hand_eye
{
void check(const HandEyeView& view, const std::vector<HandEyePose>& poses)
{
  constexpr double NO_ROTATION = 1e-6;
  if (!view.k.allFinite() || !(view.k(0, 0) > 0.0) || !(view.k(1, 1) > 0.0) || !(view.k(2, 2) > 0.0))
  {
    throw std::invalid_argument("the camera is not calibrated: its matrix is none");
  }
  Correspondences corners;
  for (const Eigen::Vector2d& corner : view.corners)
  {
    corners.push_back({ corner, corner });
  }
  if (corners.size() != CORNERS || !isHomographySample(corners))
  {
    throw std::invalid_argument("the view's region needs four corners, no three of them on one line");
  }
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    const Eigen::Isometry3d& flange = poses[i].flange_in_base;
    const Eigen::Matrix3d& r = flange.linear();
    if (!flange.matrix().allFinite() || !(r * r.transpose()).isIdentity(NO_ROTATION) || !(r.determinant() > 0.0))
    {
      throw std::invalid_argument("the flange's pose " + std::to_string(i + 1) + " is no rigid motion");
    }
    if (!poses[i].h.allFinite() || poses[i].h.isZero(0.0))
    {
      throw std::invalid_argument("the homography of pose " + std::to_string(i + 1) + " is none");
    }
  }
}

HandEyeMotion motionOf(const Problem& problem, const std::vector<HandEyePose>& poses, const Eigen::Vector3d& normal)
{
  constexpr double SAME_PLACE = 0.01;          // [m]
  constexpr double SAME_TURN = 2.0 / DEGREES;  // [rad]
  HandEyeMotion motion;
  std::vector<const HandEyePose*> different;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  std::vector<Eigen::Vector3d> turns;
  for (const HandEyePose& pose : poses)
  {
    bool is_new = true;
    for (const HandEyePose* other : different)
    {
      const Eigen::Isometry3d way = other->flange_in_base.inverse() * pose.flange_in_base;
      is_new = is_new && (way.translation().norm() > SAME_PLACE || angleOf(way.linear()) > SAME_TURN);
    }
    if (is_new)
    {
      for (const HandEyePose* other : different)
      {
        turns.push_back(rotationVector(other->flange_in_base.linear().transpose() * pose.flange_in_base.linear()));
        scatter += turns.back() * turns.back().transpose();
      }
      different.push_back(&pose);
    }
  }
  motion.poses = static_cast<int>(different.size());
  const Eigen::Vector3d axis = singularValues(scatter).u.col(0);
  for (const Eigen::Vector3d& turn : turns)
  {
    motion.rotation = std::max(motion.rotation, std::abs(turn.dot(axis)));
    motion.second_rotation = std::max(motion.second_rotation, (turn - axis * turn.dot(axis)).norm());
  }
  if (!normal.allFinite())
  {
    motion.travel = NONE;
    return motion;
  }
  std::vector<Eigen::Vector3d> places;
  for (const EuclideanHomography& homography : problem.motionsBefore(normal))
  {
    places.emplace_back(-homography.rotation.transpose() * homography.translation_over_distance);
    for (const Eigen::Vector3d& place : places)
    {
      motion.travel = std::max(motion.travel, (place - places.back()).norm());
    }
  }
  return motion;
}

HandEyeMotion motionOf(const Problem& problem, const std::vector<HandEyePose>& poses)
{
  const std::vector<Eigen::Vector3d> normals = problem.normals();
  return motionOf(problem, poses, normals.empty() ? Eigen::Vector3d(Eigen::Vector3d::Constant(NONE)) : normals.front());
}

std::string lackOfTravel(double travel, double least)
{
  return (std::isfinite(travel)
              ? "the camera moved by " + rounded(100.0 * travel, 0) + " % of its distance from the plane"
              : std::string("the images do not show that the camera moved")) +
         ": move it by " + rounded(100.0 * least, 0) + " % or more";
}

std::string rounded(double value, int decimals)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

double angleOf(const Eigen::Matrix3d& rotation)
{
  return rotationVector(rotation).norm();
}

}  // namespace hand_eye

HandEyeMotion handEyeMotion(const HandEyeView& view, const std::vector<HandEyePose>& poses)
{
  hand_eye::check(view, poses);
  return hand_eye::motionOf(hand_eye::Problem(view, poses, hand_eye::NONE), poses);
}

std::vector<std::string> missingMotion(const HandEyeMotion& motion, const HandEyeParams& params)
{
  using namespace hand_eye;
  std::vector<std::string> lines;
  const int least = std::max(params.min_poses, LEAST_POSES);
  if (motion.poses < least)
  {
    lines.push_back("there are " + std::to_string(motion.poses) + " different poses: " + std::to_string(least) +
                    " are needed, 1 cm or 2 degrees from one another");
  }
  if (motion.rotation < params.min_rotation)
  {
    lines.push_back("the flange was turned by " + rounded(motion.rotation * DEGREES) + " degrees at most: turn it by " +
                    rounded(params.min_rotation * DEGREES, 0) + " or more, about the camera's axis, say");
  }
  else if (motion.second_rotation < params.min_second_rotation)
  {
    lines.push_back("the flange was turned about one axis only (" + rounded(motion.second_rotation * DEGREES) +
                    " degrees about others): turn it about another axis, too, by " +
                    rounded(params.min_second_rotation * DEGREES, 0) +
                    " degrees or more, so that the plane is seen from aside");
  }
  if (!(motion.travel >= params.min_travel))
  {
    lines.push_back(lackOfTravel(motion.travel, params.min_travel));
  }
  return lines;
}

}  // namespace view_servo
