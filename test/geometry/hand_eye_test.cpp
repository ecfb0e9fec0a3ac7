// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/hand_eye.h"

#include "support/cameras.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** Errors of arm and images, as standard deviations. */
struct Noise
{
  double pixels = 0.0;    ///< of a corner's coordinate [px]
  double rotation = 0.0;  ///< of the flange, about each axis [rad]
  double place = 0.0;     ///< of the flange, along each axis [m]
};

Eigen::Vector3d gaussianVector(Rng& rng, double sigma)
{
  const double x = gaussian(rng);
  const double y = gaussian(rng);
  return sigma * Eigen::Vector3d(x, y, gaussian(rng));
}

Eigen::Vector3d uniformVector(Rng& rng, double size)
{
  const double x = uniform(rng, -size, size);
  const double y = uniform(rng, -size, size);
  return { x, y, uniform(rng, -size, size) };
}

Eigen::Isometry3d pose(const Eigen::Vector3d& place, const Eigen::Vector3d& turn)
{
  return Eigen::Translation3d(place) * Eigen::Isometry3d(rotationFromVector(turn));
}

/** An arm, its camera, and a plane before them. */
struct Scene
{
  HandEyeView view;
  Eigen::Isometry3d camera_in_flange;
  Eigen::Isometry3d view_in_base;
  Eigen::Vector3d normal;
  double distance;

  explicit Scene(std::uint64_t seed) : rng(seed)
  {
    view.k = test::cameraMatrix(600.0, 610.0, 320.0, 240.0);
    view.corners = { { 180.0, 90.0 }, { 470.0, 90.0 }, { 470.0, 400.0 }, { 180.0, 400.0 } };
    camera_in_flange = pose(uniformVector(rng, 0.15), uniformVector(rng, 2.0));
    view_in_base = pose(uniformVector(rng, 0.6), uniformVector(rng, 2.0));
    normal = Eigen::Vector3d(uniform(rng, -0.4, 0.4), uniform(rng, -0.4, 0.4), 1.0).normalized();
    distance = uniform(rng, 0.3, 0.6);
  }

  /** The arm with the camera at a pose in the view's frame. */
  HandEyePose seenFrom(const Eigen::Isometry3d& camera_in_view, const Noise& noise = {})
  {
    const Eigen::Isometry3d back = camera_in_view.inverse();
    const Eigen::Matrix3d h =
        view.k * (back.linear() + back.translation() * normal.transpose() / distance) * view.k.inverse();
    Correspondences corners;
    for (const Eigen::Vector2d& corner : view.corners)
    {
      const double u = noise.pixels * gaussian(rng);
      corners.push_back({ corner, transfer(h, corner) + Eigen::Vector2d(u, noise.pixels * gaussian(rng)) });
    }
    HandEyePose result;
    result.h = homographyFromPoints(corners).value();
    result.flange_in_base = view_in_base * camera_in_view * camera_in_flange.inverse();
    result.flange_in_base =
        result.flange_in_base * pose(gaussianVector(rng, noise.place), gaussianVector(rng, noise.rotation));
    return result;
  }

  /** A camera that looks at the plane from another place, turned by up to an angle about its axis [rad]. */
  Eigen::Isometry3d elsewhere(double roll = 0.8)
  {
    const Eigen::Vector3d middle = Eigen::Vector3d::UnitZ() * distance / normal.z();
    const Eigen::Vector3d place = 0.4 * distance * uniformVector(rng, 1.0);
    const Eigen::Vector3d ahead = (middle - place).normalized();
    const Eigen::Quaterniond towards = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ahead);
    return Eigen::Translation3d(place) * towards *
           Eigen::AngleAxisd(uniform(rng, -roll, roll), Eigen::Vector3d::UnitZ());
  }

  std::vector<HandEyePose> poses(int count, const Noise& noise = {})
  {
    std::vector<HandEyePose> result;
    for (int i = 0; i < count; ++i)
    {
      result.push_back(seenFrom(elsewhere(), noise));
    }
    return result;
  }

  double millimetres(const HandEyeResult& result) const
  {
    return 1e3 * (result.camera_in_flange.translation() - camera_in_flange.translation()).norm();
  }
  double degrees(const HandEyeResult& result) const
  {
    return rotationVector(result.camera_in_flange.linear().transpose() * camera_in_flange.linear()).norm() / DEGREE;
  }

  Rng rng;
};

int used(const HandEyeResult& result)
{
  return static_cast<int>(std::count_if(result.residuals.begin(), result.residuals.end(),
                                        [](const HandEyeResidual& residual) { return residual.used; }));
}

bool names(const HandEyeResult& result, const std::string& what)
{
  return std::any_of(result.missing.begin(), result.missing.end(),
                     [&](const std::string& line) { return line.find(what) != std::string::npos; });
}

}  // namespace

RC_GTEST_PROP(HandEye, IsExactWithoutNoise, (std::uint64_t seed))
{
  Scene scene(seed);
  const HandEyeResult result = calibrateHandEye(scene.view, scene.poses(12));
  RC_LOG() << result.message;
  RC_ASSERT(result.found);
  RC_ASSERT(used(result) == 12);
  RC_ASSERT(scene.millimetres(result) < 1e-3);
  RC_ASSERT(scene.degrees(result) < 1e-4);
  RC_ASSERT(std::abs(result.distance - scene.distance) < 1e-6);
  RC_ASSERT(result.normal.dot(scene.normal) > 1.0 - 1e-9);
  RC_ASSERT(result.view_in_base.isApprox(scene.view_in_base, 1e-6));
}

RC_GTEST_PROP(HandEye, LeavesOutPosesThatContradictTheOthers, (std::uint64_t seed))
{
  Scene scene(seed);
  std::vector<HandEyePose> poses = scene.poses(12, { 0.05, 2e-4, 1e-4 });
  // The arm was still moving, another thing was matched, and tf was of another time.
  poses[2].flange_in_base = poses[2].flange_in_base * Eigen::Translation3d(0.01, -0.01, 0.01);
  poses[5].h = scene.seenFrom(scene.elsewhere()).h;
  poses[7].flange_in_base = poses[8].flange_in_base;
  const HandEyeResult result = calibrateHandEye(scene.view, poses);
  RC_LOG() << result.message;
  RC_ASSERT(result.found);
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    if (i == 2 || i == 5 || i == 7)
    {
      RC_ASSERT(!result.residuals[i].used);
    }
  }
  RC_ASSERT(used(result) >= 8);
  RC_ASSERT(scene.millimetres(result) < 2.0);
  RC_ASSERT(scene.degrees(result) < 0.3);
}

RC_GTEST_PROP(HandEye, DoesNotDependOnTheFramesOfBaseAndFlange, (std::uint64_t seed))
{
  Scene scene(seed);
  std::vector<HandEyePose> poses = scene.poses(10, { 0.1, 3e-4, 1.5e-4 });
  const HandEyeResult before = calibrateHandEye(scene.view, poses);
  const Eigen::Isometry3d other_base = pose(uniformVector(scene.rng, 1.0), uniformVector(scene.rng, 2.0));
  const Eigen::Isometry3d turned(rotationFromVector(uniformVector(scene.rng, 1.5)));
  for (HandEyePose& one : poses)
  {
    one.flange_in_base = other_base * one.flange_in_base * turned;
    one.h *= -3.0;
  }
  const HandEyeResult after = calibrateHandEye(scene.view, poses);
  RC_ASSERT(before.found == after.found);
  RC_ASSERT((turned * after.camera_in_flange).isApprox(before.camera_in_flange, 1e-4));
  RC_ASSERT(std::abs(after.translationSigma() / before.translationSigma() - 1.0) < 0.02);
}

// Errors are those of the covariance: 6 of them, weighed by it, are 6 in the mean.
TEST(HandEye, TellsHowLargeItsErrorsAre)
{
  struct Case
  {
    Noise noise;
    int poses;
  };
  constexpr int RUNS = 30;
  for (const Case& one :
       { Case{ { 0.3, 1e-6, 5e-7 }, 12 }, Case{ { 0.02, 1e-3, 5e-4 }, 12 }, Case{ { 0.2, 4e-4, 2e-4 }, 20 } })
  {
    double sum = 0.0;
    int found = 0;
    int all = 0;
    for (int run = 0; run < RUNS; ++run)
    {
      Scene scene(static_cast<std::uint64_t>(run) + 1);
      const HandEyeResult result = calibrateHandEye(scene.view, scene.poses(one.poses, one.noise));
      if (result.found)
      {
        Eigen::Matrix<double, 6, 1> error;
        error << scene.camera_in_flange.translation() - result.camera_in_flange.translation(),
            rotationVector(scene.camera_in_flange.linear() * result.camera_in_flange.linear().transpose());
        sum += error.dot(result.covariance.inverse() * error);
        ++found;
        all += used(result);
      }
    }
    EXPECT_GE(found, 95 * RUNS / 100) << one.noise.pixels;
    EXPECT_GT(all, 98 * one.poses * found / 100) << "good poses are left out";
    const double mean = sum / found / 6.0;
    EXPECT_GT(mean, 0.6) << one.noise.pixels;
    EXPECT_LT(mean, 1.7) << one.noise.pixels;
  }
}

TEST(HandEye, TellsTheErrorsOfArmAndImagesApart)
{
  Scene scene(3);
  const HandEyeResult image = calibrateHandEye(scene.view, scene.poses(20, { 0.3, 1e-6, 5e-7 }));
  ASSERT_TRUE(image.found) << image.message;
  EXPECT_NEAR(image.image_error, 0.3, 0.08);
  EXPECT_LT(image.rotation_error, 2e-4);
  const HandEyeResult arm = calibrateHandEye(scene.view, scene.poses(20, { 0.02, 1e-3, 5e-4 }));
  ASSERT_TRUE(arm.found) << arm.message;
  EXPECT_NEAR(arm.rotation_error, 1e-3, 3e-4);
  EXPECT_NEAR(arm.translation_error, 5e-4, 1.5e-4);
  EXPECT_NEAR(arm.image_error, 0.02, 0.01);
}

TEST(HandEye, WantsRotationAboutTwoAxes)
{
  Scene scene(4);
  std::vector<HandEyePose> poses;
  for (int i = 0; i < 12; ++i)
  {
    poses.push_back(
        scene.seenFrom(pose(uniformVector(scene.rng, 0.1), { 0.0, 0.0, 0.1 * i - 0.6 }), { 0.05, 1e-4, 1e-4 }));
  }
  const HandEyeResult result = calibrateHandEye(scene.view, poses);
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "about one axis only")) << result.message;
  EXPECT_EQ(result.missing.size(), 1U) << result.message;
  EXPECT_NEAR(result.motion.rotation, 1.1, 0.01);
}

TEST(HandEye, WantsRotation)
{
  Scene scene(5);
  std::vector<HandEyePose> poses;
  for (int i = 0; i < 12; ++i)
  {
    poses.push_back(scene.seenFrom(pose(uniformVector(scene.rng, 0.1), Eigen::Vector3d::Zero()), { 0.05, 1e-4, 1e-4 }));
  }
  const HandEyeResult result = calibrateHandEye(scene.view, poses);
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "degrees at most: turn it by 20")) << result.message;
}

TEST(HandEye, WantsTheCameraToMove)
{
  Scene scene(6);
  std::vector<HandEyePose> poses;
  for (int i = 0; i < 12; ++i)
  {
    poses.push_back(scene.seenFrom(pose(Eigen::Vector3d::Zero(), uniformVector(scene.rng, 0.3)), { 0.01, 1e-5, 1e-5 }));
  }
  const HandEyeResult result = calibrateHandEye(scene.view, poses);
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "camera moved")) << result.message;
}

TEST(HandEye, WantsPosesThatDiffer)
{
  Scene scene(7);
  std::vector<HandEyePose> poses = scene.poses(4);
  for (int i = 0; i < 8; ++i)
  {
    poses.push_back(poses[static_cast<std::size_t>(i % 4)]);
  }
  const HandEyeResult result = calibrateHandEye(scene.view, poses);
  EXPECT_FALSE(result.found);
  EXPECT_EQ(result.motion.poses, 4);
  EXPECT_TRUE(names(result, "there are 4 different poses: 8 are needed")) << result.message;
  EXPECT_FALSE(calibrateHandEye(scene.view, {}).found);
  EXPECT_FALSE(calibrateHandEye(scene.view, scene.poses(1)).found);
}

// All poses look at one point from one distance: that leaves open how far away the plane is.
TEST(HandEye, TakesAKnownDistance)
{
  Scene scene(12);
  const Eigen::Vector3d middle = Eigen::Vector3d::UnitZ() * scene.distance / scene.normal.z();
  std::vector<HandEyePose> poses;
  for (int i = 0; i < 12; ++i)
  {
    const Eigen::Isometry3d turn(rotationFromVector(uniformVector(scene.rng, 0.4)));
    const Eigen::Isometry3d back(Eigen::Translation3d(0.0, 0.0, -middle.z()));
    poses.push_back(scene.seenFrom(Eigen::Translation3d(middle) * turn * back, { 0.2, 5e-4, 2.5e-4 }));
  }
  const HandEyeResult without = calibrateHandEye(scene.view, poses);
  EXPECT_FALSE(without.found);
  EXPECT_TRUE(names(without, "tell the distance of the plane")) << without.message;

  HandEyeParams params;
  params.distance = scene.distance;
  const HandEyeResult result = calibrateHandEye(scene.view, poses, params);
  ASSERT_TRUE(result.found) << result.message;
  EXPECT_NEAR(result.distance, scene.distance, 1e-6);
  EXPECT_LT(result.distance_sigma, 1e-4);
  EXPECT_LT(scene.millimetres(result), 2.0);
  EXPECT_LT(result.translationSigma(), 1.5e-3);
  params.distance = 0.0;
  EXPECT_THROW(calibrateHandEye(scene.view, poses, params), std::invalid_argument);
}

RC_GTEST_PROP(HandEye, FindsTheFocalLengthWhenAsked, (std::uint64_t seed))
{
  Scene scene(seed);
  const std::vector<HandEyePose> poses = scene.poses(14);
  const double scale = uniform(scene.rng, 0.93, 1.07);
  scene.view.k(0, 0) /= scale;
  scene.view.k(1, 1) /= scale;
  HandEyeParams params;
  params.finds_focal_length = true;
  const HandEyeResult result = calibrateHandEye(scene.view, poses, params);
  RC_ASSERT(result.found);
  RC_ASSERT(used(result) == 14);
  RC_ASSERT(std::abs(result.focal_scale - scale) < 1e-6);
  RC_ASSERT(scene.millimetres(result) < 1e-3);
  RC_ASSERT(scene.degrees(result) < 1e-4);
  for (const HandEyeResidual& residual : result.residuals)
  {
    RC_ASSERT(residual.translation < 1e-6);
  }
}

TEST(HandEye, TellsHowCertainTheFocalLengthIs)
{
  constexpr int RUNS = 40;
  constexpr double WRONG = 1.02;  // camera_info has it 2 % too long
  double squares = 0.0;
  int better = 0;
  for (int run = 0; run < RUNS; ++run)
  {
    Scene scene(static_cast<std::uint64_t>(run));
    const std::vector<HandEyePose> poses = scene.poses(14, { 0.2, 2e-4, 1e-4 });
    scene.view.k(0, 0) *= WRONG;
    scene.view.k(1, 1) *= WRONG;
    HandEyeParams params;
    const HandEyeResult as_told = calibrateHandEye(scene.view, poses, params);
    params.finds_focal_length = true;
    const HandEyeResult found = calibrateHandEye(scene.view, poses, params);
    ASSERT_TRUE(found.found) << found.message;
    EXPECT_NEAR(found.focal_scale, 1.0 / WRONG, 0.01);
    const double error = (found.focal_scale - 1.0 / WRONG) / found.focal_sigma;
    squares += error * error;
    better += !as_told.found || scene.millimetres(found) < scene.millimetres(as_told) ? 1 : 0;
    EXPECT_EQ(as_told.focal_scale, 1.0);
  }
  EXPECT_GT(std::sqrt(squares / RUNS), 0.5);
  EXPECT_LT(std::sqrt(squares / RUNS), 2.0);
  EXPECT_GE(better, RUNS * 8 / 10);
}

TEST(HandEye, SaysWhenThePosesDoNotTellTheFocalLength)
{
  Scene scene(3);
  const std::vector<HandEyePose> poses = scene.poses(10, { 2.0, 2e-3, 1e-3 });
  HandEyeParams params;
  params.finds_focal_length = true;
  const HandEyeResult result = calibrateHandEye(scene.view, poses, params);
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "focal length")) << result.message;
}

TEST(HandEye, RefusesWhatItDoesNotKnowWellEnough)
{
  Scene scene(8);
  const HandEyeResult result = calibrateHandEye(scene.view, scene.poses(10, { 4.0, 0.03, 0.015 }));
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "uncertain") || result.message.find("contradict") != std::string::npos) << result.message;
}

TEST(HandEye, RefusesFramesThatHaveNothingToDoWithTheCamera)
{
  Scene scene(9);
  Scene other(10);
  std::vector<HandEyePose> poses = scene.poses(12);
  for (HandEyePose& one : poses)
  {
    one.flange_in_base = other.seenFrom(other.elsewhere()).flange_in_base;
  }
  const HandEyeResult result = calibrateHandEye(scene.view, poses);
  EXPECT_FALSE(result.found);
  EXPECT_FALSE(result.message.empty());
}

TEST(HandEye, RefusesBadInput)
{
  Scene scene(11);
  const std::vector<HandEyePose> poses = scene.poses(8);
  HandEyeView view = scene.view;
  view.k.setZero();
  EXPECT_THROW(calibrateHandEye(view, poses), std::invalid_argument);
  view = scene.view;
  view.corners[3] = 0.5 * (view.corners[0] + view.corners[1]);
  EXPECT_THROW(calibrateHandEye(view, poses), std::invalid_argument);
  view.corners.pop_back();
  EXPECT_THROW(handEyeMotion(view, poses), std::invalid_argument);
  std::vector<HandEyePose> broken = poses;
  broken[1].flange_in_base.linear() *= 2.0;
  EXPECT_THROW(calibrateHandEye(scene.view, broken), std::invalid_argument);
  broken = poses;
  broken[1].h(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(calibrateHandEye(scene.view, broken), std::invalid_argument);
}

}  // namespace view_servo
