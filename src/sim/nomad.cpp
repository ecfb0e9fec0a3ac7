// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/nomad.h"

#include "view_servo/parameters/faults.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
constexpr double NOISE_PERIOD = 0.02;  // for which odometry_noise is given [s]

/** Shortens a vector to at most a length. */
Eigen::Vector2d limited(const Eigen::Vector2d& v, double length)
{
  const double norm = v.norm();
  return norm > length ? Eigen::Vector2d(v * (length / norm)) : v;
}

/** A pose (x, y, yaw) after a motion in its own frame, along the arc of constant velocity. */
Eigen::Vector3d moved(const Eigen::Vector3d& pose, const Eigen::Vector3d& motion)
{
  // In the middle of the motion the frame has turned by half: exact to the third order.
  const Eigen::Rotation2Dd middle(pose.z() + 0.5 * motion.z());
  const Eigen::Vector2d to = pose.head<2>() + middle * Eigen::Vector2d(motion.head<2>());
  return { to.x(), to.y(), std::remainder(pose.z() + motion.z(), 2.0 * M_PI) };
}

Eigen::Isometry3d toIsometry(const Eigen::Vector3d& pose)
{
  return planarPose(pose.x(), pose.y(), pose.z());
}

}  // namespace

std::vector<Parameter> parameters(NomadParams& params)
{
  return {
    real("max_speed", params.max_speed, "m/s", "> 0", "largest speed"),
    real("max_turn_rate", params.max_turn_rate, "rad/s", "> 0", "largest turn rate"),
    real("max_acceleration", params.max_acceleration, "m/s^2", "> 0", "largest change of the velocity"),
    real("max_turn_acceleration", params.max_turn_acceleration, "rad/s^2", "> 0", "largest change of the turn rate"),
    real("radius", params.radius, "m", "> 0", "radius of the outline on the floor"),
    choice<bool>("base", params.differential, { { "holonomic", false }, { "differential", true } },
                 "a differential one cannot slide: it does not carry out velocities to the side"),
    real("deadband_speed", params.deadband_speed, "m/s", ">= 0", "slower commands do not move it"),
    real("deadband_turn_rate", params.deadband_turn_rate, "rad/s", ">= 0", "slower commands do not turn it"),
    real("odometry_turn_scale", params.odometry_turn_scale, "", "> 0",
         "turn that odometry measures, divided by the true turn"),
    real("odometry_drift", params.odometry_drift, "", "> -1", "distance measured too long, as a part of it"),
    real("odometry_turn_drift", params.odometry_turn_drift, "rad/m", "", "turn that odometry adds to a distance"),
    real("odometry_noise", params.odometry_noise, "", ">= 0",
         "standard deviation of the motion measured in 20 ms, as a part of it"),
    real("slip_share", params.slip_share, "", "[0, 1)",
         "share of the time in which its wheels slip, for short spells at random: odometry does not notice it"),
    real("slip_loss", params.slip_loss, "", "[0, 1]", "part of the motion that is lost while the wheels slip"),
    real("slip_duration", params.slip_duration, "s", "> 0", "of such a spell, in the mean"),
  };
}

std::vector<std::string> NomadParams::validate() const
{
  return faultsOf(*this);
}

Nomad::Nomad(const World& world, const NomadParams& params)
  : world_(world),
    params_(params),
    rng_(params.seed),
    slip_rng_(params.seed),
    pose_(Eigen::Vector3d::Zero()),
    odometry_(Eigen::Vector3d::Zero())
{
  requireNoFaults("parameters of the base", params.validate());
  setPose(world.goal);
}

void Nomad::setPose(const Eigen::Isometry3d& pose)
{
  if (!pose.matrix().allFinite())
  {
    throw std::invalid_argument("the pose is not finite");
  }
  const Eigen::Vector2d at = pose.translation().head<2>();
  const std::string touched = touchedObstacle(world_, at, params_.radius);
  if (!touched.empty())
  {
    throw std::invalid_argument("the base cannot stand there: " + touched + " is in the way");
  }
  pose_ << at, yawOf(pose);
  halt();
  blocked_by_.clear();
}

void Nomad::halt()
{
  velocity_.setZero();
  commanded_.setZero();
  measured_.setZero();
}

bool Nomad::command(const Velocity& velocity)
{
  if (!velocity.allFinite())
  {
    return false;
  }
  commanded_.head<2>() = limited(velocity.head<2>(), params_.max_speed);
  commanded_.z() = std::clamp(velocity.z(), -params_.max_turn_rate, params_.max_turn_rate);
  if (params_.differential)
  {
    commanded_.y() = 0.0;
  }
  if (commanded_.head<2>().norm() < params_.deadband_speed)
  {
    commanded_.head<2>().setZero();
  }
  if (std::abs(commanded_.z()) < params_.deadband_turn_rate)
  {
    commanded_.z() = 0.0;
  }
  return true;
}

double Nomad::grip(double dt)
{
  if (params_.slip_share == 0.0)
  {
    return 1.0;
  }
  for (grip_left_ -= dt; grip_left_ <= 0.0;)
  {
    slips_ = !slips_;
    const double share = slips_ ? params_.slip_share : 1.0 - params_.slip_share;
    const double mean = params_.slip_duration * share / params_.slip_share;
    grip_left_ -= mean * std::log(1.0 - uniform(slip_rng_, 0.0, 1.0));  // how long it lasts: exponentially distributed
  }
  return slips_ ? 1.0 - params_.slip_loss : 1.0;
}

void Nomad::step(double dt)
{
  const Eigen::Vector2d change = commanded_.head<2>() - velocity_.head<2>();
  velocity_.head<2>() += limited(change, params_.max_acceleration * dt);
  const double turn = params_.max_turn_acceleration * dt;
  velocity_.z() += std::clamp(commanded_.z() - velocity_.z(), -turn, turn);

  Eigen::Vector3d motion = velocity_ * dt;
  const Eigen::Vector3d next = moved(pose_, grip(dt) * motion);
  blocked_by_ = touchedObstacle(world_, next.head<2>(), params_.radius);
  if (blocked_by_.empty())
  {
    pose_ = next;
  }
  else
  {
    velocity_.setZero();
    motion.setZero();
  }

  const double way_noise = params_.odometry_noise * gaussian(rng_);
  const double turn_noise = params_.odometry_noise * gaussian(rng_);
  const double distance = motion.head<2>().norm();
  // What is measured when the noise is so many times as large.
  const auto measured = [&](double times) {
    const double scale = (1.0 + params_.odometry_drift) * (1.0 + times * way_noise);
    const double turned =
        params_.odometry_turn_scale * motion.z() * (1.0 + times * turn_noise) + params_.odometry_turn_drift * distance;
    return Eigen::Vector3d(scale * motion.x(), scale * motion.y(), turned);
  };
  // Over shorter times it is larger, as it averages out in the end; velocities are measured over that period.
  odometry_ = moved(odometry_, measured(std::sqrt(NOISE_PERIOD / dt)));
  measured_ = measured(1.0) / dt;
}

Eigen::Isometry3d Nomad::pose() const
{
  return toIsometry(pose_);
}

Eigen::Isometry3d Nomad::cameraPose() const
{
  return toIsometry(pose_) * world_.camera_on_base;
}

Eigen::Isometry3d Nomad::odometry() const
{
  return toIsometry(odometry_);
}

}  // namespace view_servo::sim
