// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/world.h"

#include "sim/textures.h"
#include "sim/world_reader.h"
#include "support/shipped_files.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo::sim
{
TEST(World, NamesTheStartsThereAre)
{
  const World world = readWorld(test::worldFile("desk"));
  EXPECT_NO_THROW(world.start("thesis"));
  try
  {
    world.start("theses");
    FAIL();
  }
  catch (const std::invalid_argument& error)
  {
    EXPECT_NE(std::string(error.what()).find("thesis"), std::string::npos) << error.what();
  }
}

TEST(World, ObstaclesAreTouchedByDiscsThatReachThem)
{
  World world;
  world.obstacles = { { "box", { { 1.0, -1.0 }, { 2.0, -1.0 }, { 2.0, 1.0 }, { 1.0, 1.0 } } } };
  EXPECT_EQ(touchedObstacle(world, { 1.5, 0.0 }, 0.1), "box");
  EXPECT_EQ(touchedObstacle(world, { 0.8, 0.0 }, 0.1), "");
  EXPECT_EQ(touchedObstacle(world, { 0.8, 0.0 }, 0.21), "box");
  EXPECT_EQ(touchedObstacle(world, { 0.9, 1.1 }, 0.13), "");  // the corner is farther than the sides
  EXPECT_EQ(touchedObstacle(world, { 0.9, 1.1 }, 0.15), "box");
}

TEST(World, ObstaclesAreThereWithTheirGroupOnly)
{
  const std::vector<Eigen::Vector2d> outline = { { 1.0, -1.0 }, { 2.0, -1.0 }, { 2.0, 1.0 }, { 1.0, 1.0 } };
  World world;
  world.obstacles = { { "person", outline, "people" } };
  EXPECT_EQ(touchedObstacle(withObstaclesOf(world, { "chairs" }), { 1.5, 0.0 }, 0.1), "");
  EXPECT_EQ(touchedObstacle(withObstaclesOf(world, { "chairs", "people" }), { 1.5, 0.0 }, 0.1), "person");
  world.obstacles.push_back({ "box", outline, "" });
  EXPECT_EQ(touchedObstacle(withObstaclesOf(world, {}), { 1.5, 0.0 }, 0.1), "box");
}

TEST(World, CamerasLookAtTheirTarget)
{
  const Eigen::Vector3d position(0.3, -0.2, 0.9);
  const Eigen::Vector3d target(1.0, 0.4, 0.2);
  const Eigen::Isometry3d level = lookingAt(position, target, 0.0);
  const Eigen::Vector3d seen = level.inverse() * target;
  EXPECT_NEAR(seen.x(), 0.0, 1e-12);
  EXPECT_NEAR(seen.y(), 0.0, 1e-12);
  EXPECT_NEAR(seen.z(), (target - position).norm(), 1e-12);
  EXPECT_NEAR(level.linear()(2, 0), 0.0, 1e-12);  // x level
  EXPECT_LT(level.linear()(2, 1), 0.0);           // y down
  EXPECT_NEAR(level.linear().determinant(), 1.0, 1e-12);
  const Eigen::Isometry3d rolled = lookingAt(position, target, 0.3);
  EXPECT_NEAR(Eigen::AngleAxisd(level.linear().transpose() * rolled.linear()).angle(), 0.3, 1e-12);
  EXPECT_TRUE(lookingAt(position, position - Eigen::Vector3d::UnitZ(), 0.0).matrix().allFinite());
}

TEST(World, TrajectoriesAreInterpolated)
{
  const std::vector<Waypoint> trajectory = { { 1.0, planarPose(0.0, 0.0, 0.0) }, { 3.0, planarPose(2.0, 1.0, 1.0) } };
  EXPECT_TRUE(poseAt(trajectory, 0.0).isApprox(planarPose(0.0, 0.0, 0.0)));
  EXPECT_TRUE(poseAt(trajectory, 2.0).isApprox(planarPose(1.0, 0.5, 0.5)));
  EXPECT_TRUE(poseAt(trajectory, 3.0).isApprox(planarPose(2.0, 1.0, 1.0)));
  EXPECT_TRUE(poseAt(trajectory, 9.0).isApprox(planarPose(2.0, 1.0, 1.0)));
}

TEST(World, NoiseAndFocalLengthsCanBeOthers)
{
  const World world = readWorld(test::worldFile("desk"));
  EXPECT_EQ(withImageNoise(world, 7.0).quality.noise, 7.0);
  EXPECT_EQ(withImageNoise(world, 0.0).quality.noise, 0.0);
  EXPECT_EQ(withImageNoise(world, -1.0).quality.noise, world.quality.noise);
  const Camera camera = withFocalLengthError(world.camera, 0.1);
  for (const int i : { 0, 1 })
  {
    EXPECT_DOUBLE_EQ(camera.k(i, i), 1.1 * world.camera.k(i, i));
    EXPECT_DOUBLE_EQ(camera.projection(i, i), 1.1 * world.camera.projection(i, i));
    EXPECT_EQ(camera.k(i, 2), world.camera.k(i, 2));
  }
}

TEST(Textures, AreTheSameForTheSameSeed)
{
  for (const std::string kind : { "blotches", "bricks", "panel", "poster", "print", "wood" })
  {
    const cv::Mat first = drawTexture(kind, cv::Size(120, 90), 130.0, 4, 3);
    EXPECT_EQ(first.size(), cv::Size(120, 90));
    EXPECT_EQ(first.type(), CV_8UC1);
    EXPECT_EQ(cv::norm(first, drawTexture(kind, cv::Size(120, 90), 130.0, 4, 3), cv::NORM_INF), 0.0) << kind;
    EXPECT_GT(cv::norm(first, drawTexture(kind, cv::Size(120, 90), 130.0, 4, 4), cv::NORM_INF), 0.0) << kind;
    EXPECT_NE(textureKinds().find(kind), std::string::npos);
  }
  EXPECT_THROW(drawTexture("marble", cv::Size(10, 10), 128.0, 1, 1), std::invalid_argument);
  EXPECT_THROW(drawTexture("wood", cv::Size(0, 10), 128.0, 1, 1), std::invalid_argument);
}

}  // namespace view_servo::sim
