// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/numbers.h"

#include "support/level_cameras.h"
#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <cstdint>
#include <stdexcept>

namespace view_servo
{
namespace
{
using test::ahead;
using test::CAMERA_HEIGHT;
using test::depthOf;
using test::difference;
using test::levelCamera;
using test::onFloor;
using test::seenBy;

/** Base from the optical frame of a camera that is turned to the left, tilted down and rolled [rad]. */
Eigen::Isometry3d mounted(double x, double y, double yaw, double down, double roll)
{
  Eigen::Isometry3d camera = onFloor({ x, y, yaw }, CAMERA_HEIGHT);
  camera.linear() = camera.linear() * ahead() * Eigen::AngleAxisd(-down, Eigen::Vector3d::UnitX()) *
                    Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ());
  return camera;
}

PlanarPose randomPose(Rng& rng, double reach, double max_yaw)
{
  const double x = uniform(rng, -reach, reach);
  const double y = uniform(rng, -reach, reach);
  return { x, y, uniform(rng, -max_yaw, max_yaw) };
}

void expectPose(const PlanarPose& pose, double x, double y, double yaw)
{
  EXPECT_NEAR(pose.x, x, 1e-12);
  EXPECT_NEAR(pose.y, y, 1e-12);
  EXPECT_NEAR(pose.yaw, yaw, 1e-12);
}

}  // namespace

// ---- poses

TEST(WrapAngle, LiesAboveMinusPiUpToPi)
{
  EXPECT_EQ(wrapAngle(0.0), 0.0);
  EXPECT_EQ(wrapAngle(M_PI), M_PI);
  EXPECT_EQ(wrapAngle(-M_PI), M_PI);
  EXPECT_NEAR(wrapAngle(2.0 * M_PI - 0.1), -0.1, 1e-12);
  EXPECT_NEAR(wrapAngle(0.1 - 2.0 * M_PI), 0.1, 1e-12);
  EXPECT_NEAR(wrapAngle(6.5 * M_PI), 0.5 * M_PI, 1e-12);
  EXPECT_NEAR(wrapAngle(-2.0), -2.0, 1e-12);
}

RC_GTEST_PROP(WrapAngle, KeepsTheDirection, (std::uint64_t seed))
{
  Rng rng(seed);
  const double angle = uniform(rng, -50.0, 50.0);
  const double wrapped = wrapAngle(angle);
  RC_ASSERT(wrapped > -M_PI && wrapped <= M_PI);
  RC_ASSERT(std::abs(std::cos(wrapped) - std::cos(angle)) < 1e-12);
  RC_ASSERT(std::abs(std::sin(wrapped) - std::sin(angle)) < 1e-12);
}

TEST(PlanarPose, HeadingIsPositiveToTheLeft)
{
  EXPECT_NEAR((PlanarPose{ 1.0, 1.0, 0.3 }).heading(), M_PI / 4.0, 1e-12);
  EXPECT_NEAR((PlanarPose{ 0.0, -2.0, 0.3 }).heading(), -M_PI / 2.0, 1e-12);
  EXPECT_NEAR((PlanarPose{ -1.0, 0.0, 0.3 }).heading(), M_PI, 1e-12);
  EXPECT_NEAR((PlanarPose{ 3.0, -4.0, 0.3 }).distance(), 5.0, 1e-12);
}

TEST(PlanarPose, ComposesAndInverts)
{
  // At (1, 2), looking along y: 3 ahead of it is (1, 5).
  expectPose(compose({ 1.0, 2.0, M_PI / 2.0 }, { 3.0, 0.0, -M_PI / 4.0 }), 1.0, 5.0, M_PI / 4.0);
  // Its left is where x is negative.
  expectPose(compose({ 1.0, 2.0, M_PI / 2.0 }, { 0.0, 3.0, M_PI }), -2.0, 2.0, -M_PI / 2.0);
  // The origin lies behind it, and to its left.
  expectPose(inverse({ 1.0, 2.0, M_PI / 2.0 }), -2.0, 1.0, -M_PI / 2.0);
  expectPose(inverse({ 0.0, 0.0, M_PI }), 0.0, 0.0, M_PI);
}

RC_GTEST_PROP(PlanarPose, ComposesAsItsIsometry, (std::uint64_t seed))
{
  Rng rng(seed);
  const PlanarPose a = randomPose(rng, 5.0, M_PI);
  const PlanarPose b = randomPose(rng, 5.0, M_PI);
  const PlanarPose c = randomPose(rng, 5.0, M_PI);
  const PlanarPose ab = compose(a, b);
  RC_ASSERT(difference(ab, toPlanar(onFloor(a) * onFloor(b))) < 1e-12);
  RC_ASSERT(ab.yaw > -M_PI && ab.yaw <= M_PI);
  RC_ASSERT(difference(inverse(a), toPlanar(onFloor(a).inverse())) < 1e-12);
  RC_ASSERT(difference(inverse(ab), compose(inverse(b), inverse(a))) < 1e-12);
  RC_ASSERT(difference(compose(a, inverse(a)), {}) < 1e-12);
  RC_ASSERT(difference(compose(ab, c), compose(a, compose(b, c))) < 1e-12);
}

TEST(PlanarPose, IsThePartOnTheFloor)
{
  Eigen::Isometry3d pose = onFloor({ 1.0, -2.0, 2.5 }, 0.7);
  expectPose(toPlanar(pose), 1.0, -2.0, 2.5);
  pose.rotate(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY()));  // nods
  pose.rotate(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));  // and rolls
  expectPose(toPlanar(pose), 1.0, -2.0, 2.5);
}

// ---- the camera on its base

TEST(CameraMount, OfALevelCameraChangesNoPoint)
{
  const CameraMount mount(mounted(0.2, -0.1, 0.0, 0.0, 0.0));
  EXPECT_TRUE(mount.level_from_camera.isApprox(Eigen::Matrix3d::Identity(), 1e-12));
  expectPose(mount.on_base, 0.2, -0.1, 0.0);
  EXPECT_TRUE(CameraMount().level({ 0.3, 0.4 }).isApprox(Eigen::Vector2d(0.3, 0.4)));
}

TEST(CameraMount, TiltIsAsComputedByHand)
{
  // 30 degrees down: the middle of the image is 30 degrees below the horizon, which is as far above the middle.
  const CameraMount mount(mounted(0.0, 0.0, 0.0, 30.0 * DEGREE, 0.0));
  EXPECT_TRUE(mount.level({ 0.0, 0.0 }).isApprox(Eigen::Vector2d(0.0, std::tan(30.0 * DEGREE)), 1e-12));
  EXPECT_LT(mount.level({ 0.0, -std::tan(30.0 * DEGREE) }).norm(), 1e-12);
  EXPECT_TRUE(mount.unlevel({ 0.0, 0.0 }).isApprox(Eigen::Vector2d(0.0, -std::tan(30.0 * DEGREE)), 1e-12));
  // What is to the right stays there.
  EXPECT_GT(mount.level({ 0.2, 0.0 }).x(), 0.2);
}

RC_GTEST_PROP(CameraMount, MakesTheLevelCamerasPoints, (std::uint64_t seed))
{
  Rng rng(seed);
  const PlanarPose base = randomPose(rng, 3.0, M_PI);
  const double x = uniform(rng, -0.5, 0.5);
  const double y = uniform(rng, -0.5, 0.5);
  const double yaw = uniform(rng, -M_PI, M_PI);
  const double down = uniform(rng, -40.0, 40.0) * DEGREE;
  const Eigen::Isometry3d base_from_camera = mounted(x, y, yaw, down, uniform(rng, -20.0, 20.0) * DEGREE);
  const CameraMount mount(base_from_camera);
  RC_ASSERT(difference(mount.on_base, { x, y, yaw }) < 1e-9);
  const Eigen::Isometry3d camera = onFloor(base) * base_from_camera;
  const Eigen::Isometry3d level = levelCamera(compose(base, { x, y, yaw }));
  for (int i = 0; i < 10; ++i)
  {
    const double u = uniform(rng, -0.6, 0.6);
    const Eigen::Vector2d position(u, uniform(rng, -0.45, 0.45));
    const Eigen::Vector3d point = camera * Eigen::Vector3d(uniform(rng, 0.5, 5.0) * position.homogeneous());
    const Eigen::Vector2d leveled = mount.level(position);
    if (depthOf(level, point) > 0.0)
    {
      RC_ASSERT((leveled - seenBy(level, point)).norm() < 1e-9 * (1.0 + leveled.norm()));
      RC_ASSERT((mount.unlevel(leveled) - position).norm() < 1e-9);
    }
  }
}

TEST(CameraMount, PointsBehindAreNotANumber)
{
  const CameraMount up(mounted(0.0, 0.0, 0.4, -50.0 * DEGREE, 0.0));
  EXPECT_TRUE(up.level({ 0.0, std::tan(-39.0 * DEGREE) }).allFinite());
  EXPECT_TRUE(up.level({ 0.0, std::tan(-41.0 * DEGREE) }).array().isNaN().all());
  EXPECT_TRUE(up.unlevel({ 0.0, std::tan(39.0 * DEGREE) }).allFinite());
  EXPECT_TRUE(up.unlevel({ 0.0, std::tan(41.0 * DEGREE) }).array().isNaN().all());
}

TEST(CameraMount, RefusesACameraThatLooksAtTheFloor)
{
  EXPECT_THROW(CameraMount(mounted(0.0, 0.0, 0.0, M_PI / 2.0, 0.0)), std::invalid_argument);
  EXPECT_THROW(CameraMount(mounted(0.0, 0.0, 1.0, 61.0 * DEGREE, 0.0)), std::invalid_argument);
  EXPECT_THROW(CameraMount(mounted(0.0, 0.0, 1.0, -61.0 * DEGREE, 0.3)), std::invalid_argument);
  EXPECT_NO_THROW(CameraMount(mounted(0.0, 0.0, 1.0, 59.0 * DEGREE, 0.0)));
  EXPECT_NO_THROW(CameraMount(mounted(0.0, 0.0, 1.0, -59.0 * DEGREE, 0.3)));
  Eigen::Isometry3d nowhere = Eigen::Isometry3d::Identity();
  nowhere.linear().fill(NOT_A_NUMBER);
  EXPECT_THROW(CameraMount{ nowhere }, std::invalid_argument);
}

TEST(CameraMount, LeverArmIsAsComputedByHand)
{
  // The camera 0.5 ahead of the base, which turns by 90 degrees to the left on the spot: the camera comes from (0.5, 0)
  // to (0, 0.5).
  const CameraMount ahead_of_it(mounted(0.5, 0.0, 0.0, 0.1, 0.0));
  expectPose(ahead_of_it.ofCamera({ 0.0, 0.0, M_PI / 2.0 }), -0.5, 0.5, M_PI / 2.0);
  expectPose(ahead_of_it.ofBase({ -0.5, 0.5, M_PI / 2.0 }), 0.0, 0.0, M_PI / 2.0);
  // The camera looks to the left: what is ahead of the base is to the camera's right.
  const CameraMount to_the_left(mounted(0.1, 0.3, M_PI / 2.0, 0.1, 0.0));
  expectPose(to_the_left.ofCamera({ 1.0, 0.0, 0.0 }), 0.0, -1.0, 0.0);
  expectPose(to_the_left.ofBase({ 0.0, -1.0, 0.0 }), 1.0, 0.0, 0.0);
}

RC_GTEST_PROP(CameraMount, PosesOfBaseAndCameraAgree, (std::uint64_t seed))
{
  Rng rng(seed);
  const PlanarPose on_base = randomPose(rng, 0.5, M_PI);
  const CameraMount mount(mounted(on_base.x, on_base.y, on_base.yaw, uniform(rng, -0.5, 0.5), 0.1));
  const PlanarPose reference = randomPose(rng, 3.0, M_PI);
  const PlanarPose current = randomPose(rng, 3.0, M_PI);
  const PlanarPose base_in_base = compose(inverse(current), reference);
  const PlanarPose camera_in_camera = compose(inverse(compose(current, on_base)), compose(reference, on_base));
  RC_ASSERT(difference(mount.ofCamera(base_in_base), camera_in_camera) < 1e-9);
  RC_ASSERT(difference(mount.ofBase(camera_in_camera), base_in_base) < 1e-9);
}

}  // namespace view_servo
