// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/numbers.h"

#include "sim/puma.h"
#include "support/shipped_files.h"
#include "support/thrown_message.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/SVD>

#include <cmath>
#include <stdexcept>
#include <string>

namespace view_servo::sim
{
/** @file The arm, what is known of it without its code, and how poses and twists are compared. */

using Joints = Puma::Joints;
using State = Puma::State;
using Twist = Puma::Twist;

constexpr double DT = 0.001;  // [s]

/** Of the URDF, written down again. */
inline const Joints LOWER = (Joints() << -2.7925, -0.7854, -3.9270, -1.9199, -1.7453, -4.6426).finished();
inline const Joints UPPER = (Joints() << 2.7925, 3.9270, 0.7854, 2.9671, 1.7453, 4.6426).finished();
inline const Joints MAX_VELOCITY = (Joints() << 1.43, 1.29, 2.13, 3.98, 4.20, 3.98).finished();

/** The URDF's convenient configurations. */
inline const Joints FORWARD = (Joints() << 0.0, 0.9, -3.05, 0.0, 0.579204, 0.0).finished();
inline const Joints DOWN = (Joints() << 0.0, 1.2, -3.1, 0.0, -1.241593, 0.0).finished();

inline Puma makePuma(const PumaParams& params = {})
{
  return Puma(test::pumaUrdf(), params);
}

inline Joints randomJoints(Rng& rng)
{
  Joints joints;
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    joints(i) = uniform(rng, LOWER(i), UPPER(i));
  }
  return joints;
}

/** Normally distributed, with deviations in m/s and rad/s. */
inline Twist randomTwist(Rng& rng, double linear, double angular)
{
  Twist twist;
  for (int i = 0; i < 6; ++i)
  {
    twist(i) = (i < 3 ? linear : angular) * gaussian(rng);
  }
  return twist;
}

inline Eigen::Isometry3d translation(double x, double y, double z)
{
  return Eigen::Isometry3d(Eigen::Translation3d(x, y, z));
}

inline Eigen::Isometry3d rotation(double angle, const Eigen::Vector3d& axis)
{
  return Eigen::Isometry3d(Eigen::AngleAxisd(angle, axis));
}

/** base_link from the optical frame by the Denavit-Hartenberg table. */
inline Eigen::Isometry3d denavitHartenberg(const Joints& q)
{
  const double d[] = { 0.67, 0.0, 0.15005, 0.4318, 0.0, 0.05625 };
  const double a[] = { 0.0, 0.4318, 0.0203, 0.0, 0.0, 0.0 };
  const double alpha[] = { 90.0, 0.0, -90.0, 90.0, -90.0, 0.0 };
  Eigen::Isometry3d flange = Eigen::Isometry3d::Identity();
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    const double ct = std::cos(q(i));
    const double st = std::sin(q(i));
    const double ca = std::cos(alpha[i] * DEGREE);
    const double sa = std::sin(alpha[i] * DEGREE);
    Eigen::Matrix4d m;
    m << ct, -st * ca, st * sa, a[i] * ct,  //
        st, ct * ca, -ct * sa, a[i] * st,   //
        0.0, sa, ca, d[i],                  //
        0.0, 0.0, 0.0, 1.0;
    flange = flange * Eigen::Isometry3d(m);
  }
  Eigen::Isometry3d camera = translation(-0.045, 0.0, 0.06);
  camera.linear() << 0.0, 1.0, 0.0,  //
      -1.0, 0.0, 0.0,                //
      0.0, 0.0, 1.0;
  return flange * camera;
}

/** Pose after moving on with a twist of the own frame for a short time; error of third order in the time. */
inline Eigen::Isometry3d moved(const Eigen::Isometry3d& pose, const Twist& twist, double dt)
{
  const Eigen::Vector3d turn = dt * twist.tail<3>();
  const double angle = turn.norm();
  const Eigen::Vector3d axis = angle > 0.0 ? Eigen::Vector3d(turn / angle) : Eigen::Vector3d::UnitX();
  Eigen::Isometry3d next = pose * rotation(angle, axis);
  next.translation() = pose * (rotation(0.5 * angle, axis) * Eigen::Vector3d(dt * twist.head<3>()));
  return next;
}

/** The twist of `moved`. */
inline Twist twistBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double dt)
{
  const Eigen::Isometry3d relative = from.inverse() * to;
  const Eigen::AngleAxisd turn(relative.linear());
  Twist twist;
  twist << rotation(-0.5 * turn.angle(), turn.axis()) * Eigen::Vector3d(relative.translation()) / dt,
      turn.angle() * turn.axis() / dt;
  return twist;
}

inline double distance(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  return (a.translation() - b.translation()).norm();
}

inline double angle(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  return 2.0 * std::asin((a.linear() - b.linear()).norm() / std::sqrt(8.0));
}

/** Joint velocities -> twist, by differences of poses. */
inline Eigen::JacobiSVD<Eigen::Matrix<double, 6, 6>> decomposedJacobian(const Puma& puma, const Joints& joints)
{
  constexpr double STEP = 1e-5;
  Eigen::Matrix<double, 6, 6> jacobian;
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    const Joints step = STEP * Joints::Unit(i);
    jacobian.col(i) =
        twistBetween(puma.nominalCameraPose(joints - step), puma.nominalCameraPose(joints + step), 2.0 * STEP);
  }
  return Eigen::JacobiSVD<Eigen::Matrix<double, 6, 6>>(jacobian, Eigen::ComputeFullU);
}

/** Smallest singular value of the Jacobian. */
inline double manipulability(const Puma& puma, const Joints& joints)
{
  return decomposedJacobian(puma, joints).singularValues()(5);
}

/** Both configurations, and ones near them, all well away from limits and singularities. */
inline Joints usualJoints(Rng& rng)
{
  Joints joints = uniform(rng, 0.0, 1.0) < 0.5 ? FORWARD : DOWN;
  for (int i = 0; i < Puma::JOINTS; ++i)
  {
    joints(i) += uniform(rng, -0.2, 0.2);
  }
  return joints;
}

/** Until it neither accelerates nor brakes any more. */
inline void accelerate(Puma& puma)
{
  for (int i = 0; i < 500; ++i)
  {
    puma.step(DT);
  }
}

inline std::string thrown(const std::string& urdf_xml, const PumaParams& params = {})
{
  return test::thrownMessage<std::invalid_argument>([&] { Puma(urdf_xml, params); });
}

inline void expectNamed(const std::string& message, const std::string& name)
{
  EXPECT_NE(message.find(name), std::string::npos) << "\"" << message << "\" does not name " << name;
}

}  // namespace view_servo::sim
