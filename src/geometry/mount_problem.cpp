// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "mount_problem.h"

#include <Eigen/Geometry>

#include <cmath>

namespace view_servo::mount
{
std::vector<Leg> legsBetween(const Indices& used, const std::vector<PlanarPose>& odometry, const MountParams& params)
{
  constexpr double LEAST_WAY = 1e-3;   // error of a way of no length [m]
  constexpr double LEAST_TURN = 1e-3;  // error of a turn by no angle [rad]
  constexpr double LEVER = 0.1;        // of a base that turns: its wheels wander by a part of their way about it [m]
  std::vector<Leg> legs;
  for (std::size_t k = 1; k < used.size(); ++k)
  {
    Leg leg;
    leg.from = used[k - 1];
    leg.to = used[k];
    leg.motion = compose(inverse(odometry[leg.from]), odometry[leg.to]);
    const double way = leg.motion.distance();
    const double turn = std::abs(leg.motion.yaw);
    // An error of the turn shifts the place where the base turned at the beginning or end of the way rather than all
    // along it.
    const double by_way = std::hypot(params.way_noise * way, 0.5 * params.turn_noise * turn * way);
    const double by_turn = std::hypot(params.turn_noise * turn * LEVER, LEAST_WAY);
    leg.way_sigma = std::hypot(by_way, by_turn);
    leg.on_the_spot = by_way < by_turn;
    leg.turn_sigma = std::hypot(std::hypot(params.turn_noise * turn, params.turn_noise * way), LEAST_TURN);
    legs.push_back(leg);
  }
  return legs;
}

Eigen::Vector3d legError(const Leg& leg, const PlanarPose& from, const PlanarPose& to, Eigen::MatrixXd* by_from,
                         Eigen::MatrixXd* by_to)
{
  const PlanarPose motion = compose(inverse(from), to);
  const Eigen::Matrix2d half = Eigen::Rotation2Dd(-0.5 * motion.yaw).toRotationMatrix();
  // Half of a turn of 179 degrees and half of one of -179 are opposite: the measured one is counted as the other is.
  const double turn_error = wrapAngle(motion.yaw - leg.motion.yaw);
  const Eigen::Matrix2d measured_half = Eigen::Rotation2Dd(-0.5 * (motion.yaw - turn_error)).toRotationMatrix();
  const Eigen::Vector2d way(motion.x, motion.y);
  const Eigen::Vector2d place = half * way;
  Eigen::Vector3d error;
  error << (place - measured_half * Eigen::Vector2d(leg.motion.x, leg.motion.y)) / leg.way_sigma,
      turn_error / leg.turn_sigma;
  if (by_from != nullptr && by_to != nullptr)
  {
    const Eigen::Vector2d turned(-place.y(), place.x());  // how the place moves when it turns to the left
    by_from->setZero(3, 3);
    by_from->topLeftCorner<2, 2>() = -half / leg.way_sigma;
    by_from->block<2, 1>(0, 2) = (-half * Eigen::Vector2d(-way.y(), way.x()) + 0.5 * turned) / leg.way_sigma;
    (*by_from)(2, 2) = -1.0 / leg.turn_sigma;
    by_to->setZero(3, 3);
    by_to->topLeftCorner<2, 2>() = half.transpose() / leg.way_sigma;
    by_to->block<2, 1>(0, 2) = -0.5 * turned / leg.way_sigma;
    (*by_to)(2, 2) = 1.0 / leg.turn_sigma;
  }
  return error;
}

Eigen::Isometry3d inSpace(const PlanarPose& pose)
{
  return Eigen::Translation3d(pose.x, pose.y, 0.0) *
         Eigen::Isometry3d(Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitZ()));
}

PlanarPose baseByImage(const hand_eye::State& state, const EuclideanHomography& motion)
{
  Eigen::Isometry3d camera_from_view = Eigen::Isometry3d::Identity();
  camera_from_view.linear() = motion.rotation;
  camera_from_view.translation() = motion.translation_over_distance * state.distance;
  return toPlanar(state.view_in_base * camera_from_view.inverse() * state.camera_in_flange.inverse());
}

}  // namespace view_servo::mount
