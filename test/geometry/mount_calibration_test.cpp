// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/mount_calibration.h"

#include "support/cameras.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** Errors of odometry and images, as standard deviations. */
struct MountNoise
{
  double pixels = 0.0;  ///< of a corner's coordinate [px]
  double way = 0.0;     ///< along and across it, as a part of it
  double turn = 0.0;    ///< as a part of it
};

/** One motion of the base: it turns on the spot, then drives straight on. */
struct Drive
{
  double turn;  ///< [rad]
  double way;   ///< [m]
};

/**
 * As a person drives before a wall: a turn, a stop, a straight way, a stop, and so on, never far from the first place.
 */
std::vector<Drive> drives(Rng& rng, int count)
{
  std::vector<Drive> result;
  double yaw = 0.0;
  double ahead = 0.0;
  for (int i = 0; i < count; ++i)
  {
    if (i % 2 == 0)
    {
      const double next = (i % 4 == 0 ? 1.0 : -1.0) * uniform(rng, 0.15, 0.35);
      result.push_back({ next - yaw, 0.0 });
      yaw = next;
    }
    else
    {
      const double way = (ahead > 0.0 ? -1.0 : 1.0) * uniform(rng, 0.3, 0.7);
      result.push_back({ 0.0, way });
      ahead += way;
    }
  }
  return result;
}

/** A base, its camera, and a plane before it. */
struct MountScene
{
  HandEyeView view;
  Eigen::Isometry3d camera_in_base;
  PlanarPose first{ 0.4, -0.3, 0.5 };  ///< where the view was stored
  Eigen::Vector3d normal;
  double distance;
  double raised = 0.0;  ///< how much higher the camera was when the view was stored [m]

  explicit MountScene(std::uint64_t seed) : rng(seed)
  {
    view.k = test::cameraMatrix(520.0, 525.0, 320.0, 240.0);
    view.corners = { { 170.0, 120.0 }, { 470.0, 120.0 }, { 470.0, 340.0 }, { 170.0, 340.0 } };
    camera_in_base = mounted(uniform(rng, -0.2, 0.2), uniform(rng, -0.15, 0.15), uniform(rng, -0.1, 0.1));
    normal = Eigen::Vector3d(uniform(rng, -0.3, 0.3), uniform(rng, -0.2, 0.2), 1.0).normalized();
    distance = uniform(rng, 1.5, 2.5);
  }

  /** A camera that looks ahead, turned to the left, downwards and about its axis [rad]. */
  Eigen::Isometry3d mounted(double yaw, double pitch, double roll)
  {
    Eigen::Matrix3d ahead;  // x right, y down, z ahead
    ahead << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
    const double x = uniform(rng, -0.25, 0.25);
    const double y = uniform(rng, -0.2, 0.2);
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation() << x, y, uniform(rng, 0.2, 1.2);
    pose.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                    Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                    Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()) * ahead;
    return pose;
  }

  static Eigen::Isometry3d inOdom(const PlanarPose& base)
  {
    return Eigen::Translation3d(base.x, base.y, 0.0) *
           Eigen::Isometry3d(Eigen::AngleAxisd(base.yaw, Eigen::Vector3d::UnitZ()));
  }

  Eigen::Isometry3d viewInOdom() const
  {
    return Eigen::Translation3d(0.0, 0.0, raised) * inOdom(first) * camera_in_base;
  }

  Eigen::Matrix3d seenFrom(const PlanarPose& base, double pixels = 0.0)
  {
    const Eigen::Isometry3d back = (inOdom(base) * camera_in_base).inverse() * viewInOdom();
    const Eigen::Matrix3d h =
        view.k * (back.linear() + back.translation() * normal.transpose() / distance) * view.k.inverse();
    Correspondences corners;
    for (const Eigen::Vector2d& corner : view.corners)
    {
      const double u = pixels * gaussian(rng);
      corners.push_back({ corner, transfer(h, corner) + Eigen::Vector2d(u, pixels * gaussian(rng)) });
    }
    return homographyFromPoints(corners).value();
  }

  /** The poses after each drive, by images and by odometry, which errs; the first is where the view was stored. */
  std::vector<HandEyePose> poses(const std::vector<Drive>& all, const MountNoise& noise = {})
  {
    PlanarPose truth = first;
    PlanarPose odometry{ -1.0, 2.0, 2.5 };
    std::vector<HandEyePose> result{ { inOdom(odometry), seenFrom(truth, noise.pixels) } };
    for (const Drive& drive : all)
    {
      truth = compose(compose(truth, { 0.0, 0.0, drive.turn }), { drive.way, 0.0, 0.0 });
      constexpr double LEVER = 0.1;  // wheels that turn the base move it, too [m]
      const double sigma = std::hypot(noise.way * drive.way, noise.turn * LEVER * drive.turn);
      const double along = drive.way + sigma * gaussian(rng);
      const double across = sigma * gaussian(rng);
      const double off = std::hypot(noise.turn * drive.turn, noise.turn * drive.way) * gaussian(rng);
      odometry = compose(compose(odometry, { 0.0, 0.0, drive.turn + 0.5 * off }), { along, across, 0.5 * off });
      result.push_back({ inOdom(odometry), seenFrom(truth, noise.pixels) });
    }
    return result;
  }

  double millimetres(const MountResult& result) const
  {
    return 1e3 * (result.camera_in_base.translation() - camera_in_base.translation()).norm();
  }
  double degrees(const MountResult& result) const
  {
    return DEGREES * rotationVector(result.camera_in_base.linear().transpose() * camera_in_base.linear()).norm();
  }
  /** Where the height was measured. */
  MountParams measured() const
  {
    MountParams params;
    params.height = camera_in_base.translation().z();
    return params;
  }

  Rng rng;
};

int usedOf(const MountResult& result)
{
  return static_cast<int>(std::count_if(result.residuals.begin(), result.residuals.end(),
                                        [](const MountResidual& residual) { return residual.used; }));
}

int legsLeftOut(const MountResult& result)
{
  return static_cast<int>(std::count_if(result.residuals.begin(), result.residuals.end(),
                                        [](const MountResidual& residual) { return !residual.odometry_used; }));
}

bool names(const MountResult& result, const std::string& what)
{
  return std::any_of(result.missing.begin(), result.missing.end(),
                     [&](const std::string& line) { return line.find(what) != std::string::npos; });
}

}  // namespace

TEST(MountCalibration, IsExactWithoutNoise)
{
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    MountScene scene(seed);
    const MountResult result = calibrateMount(scene.view, scene.poses(drives(scene.rng, 11)), scene.measured());
    ASSERT_TRUE(result.found) << seed << ": " << result.message;
    EXPECT_EQ(usedOf(result), 12) << seed;
    EXPECT_EQ(legsLeftOut(result), 0) << seed;
    EXPECT_LT(scene.millimetres(result), 0.01) << seed;
    EXPECT_LT(scene.degrees(result), 1e-3) << seed;
    EXPECT_NEAR(result.distance, scene.distance, 1e-4) << seed;
    EXPECT_GT(result.normal.dot(scene.normal), 1.0 - 1e-6) << seed;
  }
}

TEST(MountCalibration, StaysWithinItsBoundsWithNoise)
{
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
  {
    MountScene scene(seed);
    const MountResult result =
        calibrateMount(scene.view, scene.poses(drives(scene.rng, 19), { 0.03, 0.003, 0.02 }), scene.measured());
    ASSERT_TRUE(result.found) << seed << ": " << result.message;
    EXPECT_LT(scene.millimetres(result), 3.0) << seed << ", sigma " << 1e3 * result.translationSigma();
    EXPECT_LT(scene.degrees(result), 0.2) << seed << ", sigma " << DEGREES * result.rotationSigma();
  }
}

// Errors are those of the covariance: the 5 of them that do not depend on the measured height, weighed by it, are 5 in
// the mean.
TEST(MountCalibration, TellsHowLargeItsErrorsAre)
{
  constexpr int RUNS = 30;
  for (const MountNoise& noise : { MountNoise{ 0.05, 0.02, 0.02 }, MountNoise{ 0.2, 0.005, 0.05 } })
  {
    double sum = 0.0;
    double image = 0.0;
    double way = 0.0;
    double turn = 0.0;
    int found = 0;
    int used = 0;
    for (int run = 0; run < RUNS; ++run)
    {
      MountScene scene(static_cast<std::uint64_t>(run) + 100);
      MountParams params = scene.measured();
      params.max_translation_sigma = 0.1;
      params.max_rotation_sigma = 0.1;
      const MountResult result = calibrateMount(scene.view, scene.poses(drives(scene.rng, 15), noise), params);
      if (result.found)
      {
        Eigen::Matrix<double, 6, 1> error;
        error << scene.camera_in_base.translation() - result.camera_in_base.translation(),
            rotationVector(scene.camera_in_base.linear() * result.camera_in_base.linear().transpose());
        sum += error.dot(result.covariance.inverse() * error);
        image += result.image_error / RUNS;
        way += result.way_error / RUNS;
        turn += result.turn_error / RUNS;
        used += usedOf(result) - legsLeftOut(result);
        ++found;
      }
    }
    EXPECT_EQ(found, RUNS) << noise.pixels;
    EXPECT_GT(used, 97 * 16 * RUNS / 100) << "good poses are left out";
    const double mean = sum / found / 5.0;
    EXPECT_GT(mean, 0.6) << noise.pixels;
    EXPECT_LT(mean, 1.7) << noise.pixels;
    EXPECT_NEAR(image / noise.pixels, 1.0, 0.2);
    EXPECT_NEAR(way / noise.way, 1.0, 0.35);
    EXPECT_NEAR(turn / noise.turn, 1.0, 0.35);
  }
}

// The wheels are closer to each other than the base believes.
TEST(MountCalibration, IsNotLedAstrayByTurnsThatOdometryMeasuresTooLarge)
{
  MountScene scene(21);
  const std::vector<Drive> all = drives(scene.rng, 15);
  const std::vector<HandEyePose> truth = scene.poses(all, { 0.05, 0.002, 0.0 });
  std::vector<HandEyePose> poses = truth;
  for (std::size_t i = 1; i < poses.size(); ++i)
  {
    PlanarPose leg = compose(inverse(toPlanar(truth[i - 1].flange_in_base)), toPlanar(truth[i].flange_in_base));
    leg.yaw *= 1.05;
    poses[i].flange_in_base = MountScene::inOdom(compose(toPlanar(poses[i - 1].flange_in_base), leg));
  }
  const MountResult result = calibrateMount(scene.view, poses, scene.measured());
  ASSERT_TRUE(result.found) << result.message;
  EXPECT_LT(scene.millimetres(result), 3.0);
  EXPECT_LT(scene.degrees(result), 0.2);
  EXPECT_GT(result.turn_error, 0.02);
}

TEST(MountCalibration, LeavesOutPosesThatContradictTheOthers)
{
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
  {
    MountScene scene(seed);
    std::vector<HandEyePose> poses = scene.poses(drives(scene.rng, 15), { 0.05, 0.005, 0.02 });
    // Another thing was taken for the view; tf was of another time.
    poses[4].h = scene.seenFrom({ 0.9, 0.6, -0.2 });
    poses[9].flange_in_base = poses[9].flange_in_base * Eigen::Translation3d(0.2, 0.15, 0.0);
    const MountResult result = calibrateMount(scene.view, poses, scene.measured());
    ASSERT_TRUE(result.found) << seed << ": " << result.message;
    EXPECT_FALSE(result.residuals[4].used) << seed;
    EXPECT_FALSE(result.residuals[9].used) << seed;
    EXPECT_GE(usedOf(result), 13) << seed;
    EXPECT_LT(scene.millimetres(result), 4.0) << seed;
    EXPECT_LT(scene.degrees(result), 0.3) << seed;
  }
}

TEST(MountCalibration, LeavesOutAWayOnWhichWheelsSlipped)
{
  MountScene scene(22);
  std::vector<HandEyePose> poses = scene.poses(drives(scene.rng, 15), { 0.05, 0.003, 0.02 });
  const Eigen::Isometry3d before = poses[5].flange_in_base;
  for (std::size_t i = 6; i < poses.size(); ++i)
  {
    poses[i].flange_in_base =
        before * MountScene::inOdom({ 0.15, 0.0, 0.1 }) * before.inverse() * poses[i].flange_in_base;
  }
  const MountResult result = calibrateMount(scene.view, poses, scene.measured());
  ASSERT_TRUE(result.found) << result.message;
  EXPECT_EQ(usedOf(result), 16);
  EXPECT_EQ(legsLeftOut(result), 1);
  EXPECT_FALSE(result.residuals[6].odometry_used);
  EXPECT_GT(result.residuals[6].way, 0.1);
  EXPECT_LT(scene.millimetres(result), 3.0);
  EXPECT_LT(scene.degrees(result), 0.2);
}

/** By images a turn is a little less than half a one to the left, by odometry a little less to the right. */
TEST(MountCalibration, TakesHalfTurnsEitherWayRound)
{
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    MountScene scene(seed);
    // At the ceiling, which is seen whatever way the base is turned.
    Eigen::Matrix3d up;
    up << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
    scene.camera_in_base.linear() = up;
    scene.normal = Eigen::Vector3d::UnitZ();
    std::vector<Drive> all;
    for (int i = 0; i < 16; ++i)
    {
      all.push_back({ M_PI + 0.02 * uniform(scene.rng, -1.0, 1.0), 0.0 });
      all.push_back({ 0.0, uniform(scene.rng, 0.3, 0.6) });
      all.push_back({ uniform(scene.rng, 0.5, 0.9), 0.0 });
    }
    const std::vector<HandEyePose> poses = scene.poses(all, { 0.1, 0.005, 0.02 });
    const MountResult result = calibrateMount(scene.view, poses, scene.measured());
    ASSERT_TRUE(result.found) << seed << ": " << result.message;
    EXPECT_LE(legsLeftOut(result), 1) << seed;
  }
}

TEST(MountCalibration, WantsTurns)
{
  MountScene scene(23);
  std::vector<Drive> all;
  for (int i = 0; i < 11; ++i)
  {
    all.push_back({ 0.01, i % 2 == 0 ? 0.4 : -0.3 });
  }
  const MountResult result = calibrateMount(scene.view, scene.poses(all), scene.measured());
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "turn it on the spot")) << result.message;
  EXPECT_EQ(result.missing.size(), 1U) << result.message;
}

TEST(MountCalibration, WantsStraightWays)
{
  MountScene scene(24);
  std::vector<Drive> all;
  for (int i = 0; i < 11; ++i)
  {
    all.push_back({ i % 2 == 0 ? 0.3 + 0.02 * i : -0.4, 0.0 });
  }
  const MountResult result = calibrateMount(scene.view, scene.poses(all), scene.measured());
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "drive straight ahead or back")) << result.message;
}

TEST(MountCalibration, WantsTheCameraToMove)
{
  MountScene scene(25);
  scene.distance = 20.0;
  const MountResult result = calibrateMount(scene.view, scene.poses(drives(scene.rng, 11)), scene.measured());
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "camera moved")) << result.message;
}

TEST(MountCalibration, WantsPosesThatDiffer)
{
  MountScene scene(26);
  std::vector<HandEyePose> poses = scene.poses(drives(scene.rng, 4));
  const MountResult result = calibrateMount(scene.view, poses, scene.measured());
  EXPECT_FALSE(result.found);
  EXPECT_EQ(result.motion.poses, 5);
  EXPECT_TRUE(names(result, "there are 5 different poses: 8 are needed")) << result.message;
  EXPECT_FALSE(calibrateMount(scene.view, {}, scene.measured()).found);
}

TEST(MountCalibration, WantsTheHeight)
{
  MountScene scene(27);
  const std::vector<HandEyePose> poses = scene.poses(drives(scene.rng, 11));
  const MountResult result = calibrateMount(scene.view, poses);
  EXPECT_FALSE(result.found);
  EXPECT_TRUE(names(result, "measure its height")) << result.message;
  MountParams params;
  params.sees_floor = true;
  const MountResult wall = calibrateMount(scene.view, poses, params);
  EXPECT_FALSE(wall.found);
  EXPECT_NE(wall.message.find("is not the floor"), std::string::npos) << wall.message;
}

TEST(MountCalibration, FindsTheHeightAboveTheFloorThatItSees)
{
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
  {
    MountScene scene(seed);
    constexpr double BASE = 0.08;  // of the base's frame above the floor [m]
    scene.camera_in_base = scene.mounted(0.1, 0.7, 0.05);
    scene.camera_in_base.translation().z() = 0.7;
    scene.normal = -scene.camera_in_base.linear().transpose().col(2);
    scene.raised = seed % 2 == 0 ? 0.25 : 0.0;
    scene.distance = 0.7 + BASE + scene.raised;
    std::vector<HandEyePose> poses = scene.poses(drives(scene.rng, 15), { 0.1, 0.005, 0.02 });
    for (HandEyePose& pose : poses)
    {
      pose.flange_in_base.translation().z() = BASE;
    }
    const MountResult without = calibrateMount(scene.view, poses);
    EXPECT_TRUE(names(without, "say that it is the floor")) << without.message;
    MountParams params;
    params.sees_floor = true;
    const MountResult result = calibrateMount(scene.view, poses, params);
    ASSERT_TRUE(result.found) << seed << ": " << result.message;
    EXPECT_LT(scene.millimetres(result), 5.0) << seed;
    EXPECT_LT(scene.degrees(result), 0.2) << seed;
    EXPECT_LT(std::abs(result.camera_in_base.translation().z() - 0.7), 4.0 * result.heightSigma() + 1e-5) << seed;
    EXPECT_LT(result.heightSigma(), 0.01) << seed;
    EXPECT_NEAR(result.view_in_odom.translation().z(), result.distance, 1e-9) << seed;
  }
}

TEST(MountCalibration, RefusesFramesThatHaveNothingToDoWithTheCamera)
{
  MountScene scene(28);
  std::vector<HandEyePose> poses = scene.poses(drives(scene.rng, 15));
  MountScene other(29);
  const std::vector<HandEyePose> others = other.poses(drives(other.rng, 15));
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    poses[i].flange_in_base = others[(7 * i) % poses.size()].flange_in_base;
  }
  EXPECT_FALSE(calibrateMount(scene.view, poses, scene.measured()).found);
  // The frame of an arm's flange is not one of a base.
  poses[3].flange_in_base.rotate(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitX()));
  const MountResult tilted = calibrateMount(scene.view, poses, scene.measured());
  EXPECT_NE(tilted.message.find("not on a level floor: at pose 4"), std::string::npos) << tilted.message;
}

TEST(MountCalibration, RefusesBadInput)
{
  MountScene scene(30);
  const std::vector<HandEyePose> poses = scene.poses(drives(scene.rng, 11));
  HandEyeView view = scene.view;
  view.k.setZero();
  EXPECT_THROW(calibrateMount(view, poses), std::invalid_argument);
  MountParams params;
  params.way_noise = 0.0;
  EXPECT_THROW(calibrateMount(scene.view, poses, params), std::invalid_argument);
  params = {};
  params.height = std::numeric_limits<double>::infinity();
  EXPECT_THROW(calibrateMount(scene.view, poses, params), std::invalid_argument);
}

}  // namespace view_servo
