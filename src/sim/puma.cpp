// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/puma.h"

#include "view_servo/parameters/faults.h"

#include <cmath>
#include <cstddef>
#include <memory>
#include <sstream>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
using Joints = Puma::Joints;
using Twist = Puma::Twist;

constexpr double MAX_STEP = 0.002;  // of the integration [s]
constexpr double LONGEST = 60.0;    // time that one call of step() may simulate [s]
constexpr double FASTEST = 1e3;     // faster twists are scaled down to this [m/s, rad/s]; joints are far slower anyway

/** Uniform on the sphere. */
Eigen::Vector3d randomDirection(Rng& rng)
{
  const double x = gaussian(rng);
  const double y = gaussian(rng);
  return Eigen::Vector3d(x, y, gaussian(rng)).normalized();
}

}  // namespace

std::vector<std::string> PumaParams::validate() const
{
  std::vector<std::string> faults = ArmKinematicsParams::validate();
  const auto require = [&](bool right, const char* fault) {
    if (!right)
    {
      faults.emplace_back(fault);
    }
  };
  const auto not_negative = [](double value) {
    return value >= 0.0 && std::isfinite(value);
  };
  require(max_joint_acceleration > 0.0 && std::isfinite(max_joint_acceleration),
          "max_joint_acceleration must be positive");
  require(not_negative(encoder_noise), "encoder_noise must not be negative");
  require(not_negative(hand_eye_translation_error), "hand_eye_translation_error must not be negative");
  require(hand_eye_rotation_error >= 0.0 && hand_eye_rotation_error <= M_PI,
          "hand_eye_rotation_error must lie in [0, pi]");
  return faults;
}

Puma::Puma(const std::string& urdf_xml, const PumaParams& params)
  : params_(params), rng_(params.seed), nominal_from_true_camera_(Eigen::Isometry3d::Identity())
{
  requireNoFaults("parameters of the arm", params.validate());
  kinematics_ = std::make_unique<const ArmKinematics>(urdf_xml, params);
  nominal_from_true_camera_.translation() = params.hand_eye_translation_error * randomDirection(rng_);
  nominal_from_true_camera_.linear() =
      Eigen::AngleAxisd(params.hand_eye_rotation_error, randomDirection(rng_)).toRotationMatrix();
  rest(Joints::Zero().cwiseMax(kinematics_->lower()).cwiseMin(kinematics_->upper()));
}

const std::vector<std::string>& Puma::jointNames() const
{
  return kinematics_->jointNames();
}

void Puma::setJoints(const Joints& joints)
{
  std::vector<std::string> faults;
  for (int i = 0; i < JOINTS; ++i)
  {
    if (!(joints(i) >= kinematics_->lower()(i) && joints(i) <= kinematics_->upper()(i)))
    {
      std::ostringstream fault;
      fault << kinematics_->jointNames()[static_cast<std::size_t>(i)] << " = " << joints(i) << " does not lie in ["
            << kinematics_->lower()(i) << ", " << kinematics_->upper()(i) << "]";
      faults.push_back(fault.str());
    }
  }
  requireNoFaults("joint angles", faults);
  rest(joints);
}

bool Puma::setCameraPose(const Eigen::Isometry3d& camera)
{
  if (!camera.matrix().allFinite())
  {
    return false;
  }
  const auto found = kinematics_->inverse(camera * nominal_from_true_camera_.inverse(), joints_);
  if (found)
  {
    rest(*found);
  }
  return found.has_value();
}

void Puma::rest(const Joints& joints)
{
  joints_ = joints;
  velocities_.setZero();
  twist_.setZero();
  state_ = State::STILL;
  message_.clear();
}

void Puma::halt()
{
  rest(joints_);
}

bool Puma::command(const Twist& twist)
{
  if (!twist.allFinite())
  {
    return false;
  }
  const double speed = twist.cwiseAbs().maxCoeff();
  twist_ = speed > FASTEST ? Twist(FASTEST * (twist / speed)) : twist;
  return true;
}

void Puma::step(double dt)
{
  if (!(dt > 0.0 && dt <= LONGEST))
  {
    throw std::invalid_argument("Puma::step: the time must lie in (0, 60] s");
  }
  const int parts = static_cast<int>(std::ceil(dt / MAX_STEP));
  for (int i = 0; i < parts; ++i)
  {
    advance(dt / parts);
  }
}

void Puma::advance(double dt)
{
  const double acceleration = params_.max_joint_acceleration;
  const Joints middle = joints_ + 0.5 * dt * velocities_;
  const ArmKinematics::Following following = kinematics_->follow(middle, twist_);
  const ArmKinematics::Slowdown speed = kinematics_->withinVelocityLimits(following.velocities);

  // Half of the acceleration is for the camera's path, along which the joints' velocities change with the square of
  // the speed; so the other half is left for speeding up and braking.
  constexpr double AHEAD = 1e-3;  // [s]
  const Joints soon = kinematics_->follow(middle + AHEAD * speed.factor * following.velocities, twist_).velocities;
  const double turning = speed.factor * (soon - following.velocities).cwiseAbs().maxCoeff() / AHEAD;  // [rad/s²]
  const double steady = 1.0 / std::sqrt(std::max(turning / (0.5 * acceleration), 1.0));

  const Joints allowed = steady * speed.factor * following.velocities;
  const ArmKinematics::Slowdown end = kinematics_->beforeEnds(joints_, allowed, dt, 0.5 * acceleration);
  velocities_ = kinematics_->accelerate(joints_, velocities_, end.factor * allowed, dt, acceleration);
  joints_ = (joints_ + dt * velocities_).cwiseMax(kinematics_->lower()).cwiseMin(kinematics_->upper());

  const auto name = [&](int joint) {
    return kinematics_->jointNames()[static_cast<std::size_t>(joint)];
  };
  std::ostringstream message;
  if (twist_.isZero(0.0))
  {
    state_ = velocities_.isZero(0.0) ? State::STILL : State::MOVING;
  }
  else if (end.factor < 1.0)
  {
    state_ = State::AT_LIMIT;
    const bool up = allowed(end.joint) > 0.0;
    message << name(end.joint) << " comes to its " << (up ? "upper" : "lower") << " limit of "
            << (up ? kinematics_->upper() : kinematics_->lower())(end.joint) << " rad";
  }
  else if (following.manipulability < params_.min_manipulability)
  {
    state_ = State::NEAR_SINGULARITY;
    message << "slowed down near a singularity: smallest singular value " << following.manipulability << ", below "
            << params_.min_manipulability;
  }
  else
  {
    state_ = State::MOVING;
    if (steady * speed.factor < 1.0)
    {
      message << "slowed down to " << steady * speed.factor << " of the twist by ";
      message << (steady < speed.factor ? "the limit of accelerations" : "the velocity limit of " + name(speed.joint));
    }
  }
  message_ = message.str();
}

const Joints& Puma::joints() const
{
  return joints_;
}

const Joints& Puma::velocities() const
{
  return velocities_;
}

Joints Puma::measuredJoints()
{
  Joints measured = joints_;
  for (int i = 0; i < JOINTS; ++i)
  {
    measured(i) += params_.encoder_noise * gaussian(rng_);
  }
  return measured;
}

Eigen::Isometry3d Puma::cameraPose() const
{
  return nominalCameraPose(joints_) * nominal_from_true_camera_;
}

Eigen::Isometry3d Puma::nominalCameraPose(const Joints& joints) const
{
  return kinematics_->pose(joints);
}

Puma::State Puma::state() const
{
  return state_;
}

const std::string& Puma::message() const
{
  return message_;
}

}  // namespace view_servo::sim
