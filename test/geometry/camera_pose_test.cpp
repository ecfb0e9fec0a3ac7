// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera_pose.h"

#include "support/synthetic_scene.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

namespace view_servo
{
TEST(CameraPose, HasTheCovarianceOfTheMotionThatItComesFrom)
{
  Rng rng(1);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = test::randomRotation(rng, 0.7);
  motion.translation() << 0.3, -0.2, 0.5;
  const Eigen::Isometry3d pose = cameraPoseAfter(motion, Eigen::Matrix<double, 6, 6>::Zero()).view_from_current;
  EXPECT_LT((pose.matrix() - motion.inverse().matrix()).norm(), 1e-12);
  constexpr double STEP = 1e-6;
  for (int i = 0; i < 6; ++i)
  {
    Eigen::Matrix<double, 6, 1> step = Eigen::Matrix<double, 6, 1>::Zero();
    step[i] = STEP;
    Eigen::Isometry3d other = motion;
    other.linear() = rotationFromVector(step.head<3>()) * motion.linear();
    other.translation() += step.tail<3>();
    const Eigen::Isometry3d moved = other.inverse();
    Eigen::Matrix<double, 6, 1> change;
    change << moved.translation() - pose.translation(), rotationVector(moved.linear() * pose.linear().transpose());
    const Eigen::Matrix<double, 6, 6> expected = change * change.transpose() / (STEP * STEP);
    EXPECT_LT((cameraPoseAfter(motion, step * step.transpose() / (STEP * STEP)).covariance - expected).norm(), 1e-4)
        << i;
  }
}

}  // namespace view_servo
