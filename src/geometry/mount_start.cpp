// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "mount_start.h"

#include "decompositions.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/geometry/rotation_vector.h"

#include <algorithm>
#include <cmath>

namespace view_servo::mount
{
namespace
{
/** The poses of the camera by its images, in the frame of the view's camera; places over the plane's distance. */
std::vector<Eigen::Isometry3d> placesOf(const std::vector<EuclideanHomography>& motions)
{
  std::vector<Eigen::Isometry3d> places;
  for (const EuclideanHomography& motion : motions)
  {
    Eigen::Isometry3d place = Eigen::Isometry3d::Identity();
    place.linear() = motion.rotation.transpose();
    place.translation() = -motion.rotation.transpose() * motion.translation_over_distance;
    places.push_back(place);
  }
  return places;
}

Eigen::Vector3d turnBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to)
{
  return rotationVector(to.linear() * from.linear().transpose());
}

/**
 * How far a camera's pose is from one that it reaches from another by a motion on a floor, over what passes: below 1
 * it does.
 */
double leavesFloor(const Eigen::Vector3d& up, const Eigen::Isometry3d& from, const Eigen::Isometry3d& to)
{
  constexpr double TILT = 0.07;   // [rad]
  constexpr double CLIMB = 0.05;  // as a part of the plane's distance
  const Eigen::Vector3d turn = turnBetween(from, to);
  const double tilt = (turn - up * up.dot(turn)).norm();
  const double climb = std::abs(up.dot(to.translation() - from.translation()));
  return std::max(tilt / TILT, climb / CLIMB);
}

/**
 * The upward direction in the view's camera frame, about which most images have the camera turned, and the poses that
 * agree with it.
 * @return false when no two poses are turned against each other.
 */
bool findUp(const std::vector<Eigen::Isometry3d>& places, const std::vector<PlanarPose>& odometry, Eigen::Vector3d& up,
            Indices& used)
{
  constexpr double LEAST_TURN = 0.1;       // that tells an axis [rad]
  constexpr std::size_t MOST_PAIRS = 600;  // that are tried
  const std::size_t n = places.size();
  const std::size_t stride = n * (n - 1) / 2 / MOST_PAIRS + 1;
  double best = hand_eye::ENDLESS;
  std::size_t base = 0;
  std::size_t number = 0;
  for (std::size_t i = 0; i < n; ++i)
  {
    for (std::size_t k = i + 1; k < n; ++k)
    {
      const Eigen::Vector3d turn = turnBetween(places[i], places[k]);
      if (number++ % stride != 0 || turn.norm() < LEAST_TURN)
      {
        continue;
      }
      const Eigen::Vector3d axis = turn.normalized();
      double cost = 0.0;
      for (const Eigen::Isometry3d& place : places)
      {
        cost += std::min(1.0, leavesFloor(axis, places[i], place));
      }
      if (cost < best)
      {
        best = cost;
        base = i;
        up = axis;
      }
    }
  }
  if (!std::isfinite(best))
  {
    return false;
  }
  used.clear();
  for (std::size_t i = 0; i < n; ++i)
  {
    if (leavesFloor(up, places[base], places[i]) < 1.0)
    {
      used.push_back(i);
    }
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < used.size(); ++i)
  {
    for (std::size_t k = i + 1; k < used.size(); ++k)
    {
      const Eigen::Vector3d turn = turnBetween(places[used[i]], places[used[k]]);
      scatter += turn * turn.transpose();
    }
  }
  up = singularValues(scatter).u.col(0);
  double same = 0.0;  // turns of odometry by those of the images
  for (std::size_t k = 1; k < used.size(); ++k)
  {
    const double turn = wrapAngle(odometry[used[k]].yaw - odometry[used[k - 1]].yaw);
    same += std::clamp(turn * up.dot(turnBetween(places[used[k - 1]], places[used[k]])), -0.1, 0.1);
  }
  up *= same < 0.0 ? -1.0 : 1.0;
  return up.allFinite();
}

/** A leg by odometry, and how the camera moved then. */
struct CameraLeg
{
  Eigen::Vector2d way;  // of the base, along its axes at the beginning [m]
  Eigen::Vector2d
      camera_way;        // of the camera, along its axes at the beginning, seen from above; over the plane's distance
  Eigen::Matrix2d turn;  // of both
  double sigma;          // standard deviation of the way [m]
};

/** The camera's place on the base (2) [m], and the plane's distance [m] times cosine and sine of the camera's yaw. */
using Place = Eigen::Vector4d;

/** Where the base's way should be, less where it is [m]: way + (R - I) place = distance Rot(yaw) camera_way. */
Eigen::Vector2d errorOf(const Place& place, const CameraLeg& leg)
{
  const Eigen::Vector2d seen(place(2) * leg.camera_way.x() - place(3) * leg.camera_way.y(),
                             place(3) * leg.camera_way.x() + place(2) * leg.camera_way.y());
  return seen - leg.turn * place.head<2>() + place.head<2>() - leg.way;
}

/** The place by least squares. @param chosen of `legs`: two at least. */
Place placeBy(const std::vector<CameraLeg>& legs, const Indices& chosen)
{
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (const std::size_t i : chosen)
  {
    const CameraLeg& leg = legs[i];
    Eigen::Matrix<double, 2, 4> a;
    a.leftCols<2>() = Eigen::Matrix2d::Identity() - leg.turn;
    a.rightCols<2>() << leg.camera_way.x(), -leg.camera_way.y(), leg.camera_way.y(), leg.camera_way.x();
    a /= leg.sigma;
    normal += a.transpose() * a;
    right += a.transpose() * (leg.way / leg.sigma);
  }
  return solveSymmetric<4>(normal, right);
}

/** The place that most legs agree with; not finite when there is none. */
Place findPlace(const std::vector<CameraLeg>& legs)
{
  constexpr double FAR = 4.0;               // standard deviations, beyond which a leg disagrees
  constexpr std::size_t MOST_PAIRS = 2000;  // that are tried
  const std::size_t n = legs.size();
  const std::size_t stride = n * (n - 1) / 2 / MOST_PAIRS + 1;
  const auto off = [&](const Place& place, const CameraLeg& leg) {
    return errorOf(place, leg).norm() / (FAR * leg.sigma);
  };
  Place best = Place::Constant(hand_eye::NONE);
  double least = hand_eye::ENDLESS;
  std::size_t number = 0;
  for (std::size_t i = 0; i < n; ++i)
  {
    for (std::size_t k = i + 1; k < n; ++k)
    {
      if (number++ % stride != 0)
      {
        continue;
      }
      const Place place = placeBy(legs, { i, k });
      double cost = place.allFinite() ? 0.0 : hand_eye::ENDLESS;
      for (std::size_t l = 0; l < n && cost < least; ++l)
      {
        const double far = off(place, legs[l]);
        cost += std::min(1.0, far * far);
      }
      if (cost < least)
      {
        least = cost;
        best = place;
      }
    }
  }
  constexpr int ROUNDS = 3;
  for (int round = 0; round < ROUNDS && best.allFinite(); ++round)
  {
    Indices agreeing;
    for (std::size_t l = 0; l < n; ++l)
    {
      if (off(best, legs[l]) < 1.0)
      {
        agreeing.push_back(l);
      }
    }
    const Place place = agreeing.size() > 2 ? placeBy(legs, agreeing) : best;
    best = place.allFinite() ? place : best;
  }
  return best;
}

}  // namespace

bool robustStart(const Problem& problem, const std::vector<PlanarPose>& odometry, const MountParams& params,
                 const Eigen::Vector3d& normal, Estimate& estimate, Indices& used)
{
  constexpr double WORSE = 2.0;  // a start may be worse than the result
  const std::vector<EuclideanHomography> motions = problem.motionsBefore(normal);
  const std::vector<Eigen::Isometry3d> places = placesOf(motions);
  Eigen::Vector3d up;
  if (!findUp(places, odometry, up, used) || used.size() < hand_eye::LEAST_POSES)
  {
    return false;
  }
  // The camera turned so that its z axis is up: what is left is a turn about that.
  const Eigen::Matrix3d level =
      Eigen::Quaterniond::FromTwoVectors(places[used.front()].linear().transpose() * up, Eigen::Vector3d::UnitZ())
          .toRotationMatrix();
  std::vector<CameraLeg> legs;
  for (const Leg& leg : legsBetween(used, odometry, params))
  {
    const double turn = up.dot(turnBetween(places[leg.from], places[leg.to]));
    const Eigen::Vector3d way = level * (places[leg.from].linear().transpose() *
                                         (places[leg.to].translation() - places[leg.from].translation()));
    // The images tell the turn better than odometry; the way is kept in the frame half way through it.
    const Eigen::Rotation2Dd correction(0.5 * wrapAngle(turn - leg.motion.yaw));
    legs.push_back({ correction * Eigen::Vector2d(leg.motion.x, leg.motion.y), way.head<2>(),
                     Eigen::Rotation2Dd(turn).toRotationMatrix(), WORSE * leg.way_sigma });
  }
  const Place place = findPlace(legs);
  const double distance = place.tail<2>().norm();
  if (!place.allFinite() || !(distance > 0.0))
  {
    return false;
  }
  hand_eye::State& state = estimate.state;
  state.camera_in_flange = Eigen::Isometry3d::Identity();
  state.camera_in_flange.linear() =
      Eigen::AngleAxisd(std::atan2(place(3), place(2)), Eigen::Vector3d::UnitZ()).toRotationMatrix() * level;
  state.camera_in_flange.translation() << place(0), place(1), 0.0;
  state.normal = normal;
  state.distance = distance;
  Eigen::Isometry3d first = places[used.front()];
  first.translation() *= distance;
  state.view_in_base = inSpace(odometry[used.front()]) * state.camera_in_flange * first.inverse();
  estimate.bases.clear();
  for (const EuclideanHomography& motion : motions)
  {
    estimate.bases.push_back(baseByImage(state, motion));
  }
  return state.view_in_base.matrix().allFinite();
}

}  // namespace view_servo::mount
