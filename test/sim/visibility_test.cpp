// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/visibility.h"
#include "sim/world_reader.h"

#include "sim/nomad.h"
#include "support/cameras.h"
#include "support/shipped_files.h"

#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>

namespace view_servo::sim
{
namespace
{
const Eigen::Vector3d ORIGIN = Eigen::Vector3d::Zero();

/** In the plane x = distance, faces -x; its middle is at (distance, y, z). */
Surface plate(double distance, double y, double z, double width, double height)
{
  Surface surface;
  surface.name = "plate";
  surface.pose = Eigen::Isometry3d::Identity();
  surface.pose.linear() << 0.0, 0.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  surface.pose.translation() << distance, y, z;
  surface.size << width, height;
  surface.texture = 0;
  surface.repeat << 1.0, 1.0;
  return surface;
}

/** A wall 4 m ahead, 40 m wide and high. */
World wallWorld()
{
  World world;
  world.camera = test::pinholeCamera({ 640, 480 }, 500.0, 500.0, 319.5, 239.5);
  world.surfaces = { plate(4.0, 0.0, 0.0, 40.0, 40.0) };
  return world;
}

/** A camera that looks along x, turned to the left by a yaw [rad]. */
Eigen::Isometry3d cameraAt(double x, double y, double yaw = 0.0)
{
  const Eigen::Vector3d position(x, y, 0.0);
  return lookingAt(position, position + Eigen::Vector3d(std::cos(yaw), std::sin(yaw), 0.0), 0.0);
}

double distanceAlong(const World& world, const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                     double nearest = 0.0)
{
  return firstHit(world, origin, direction.normalized(), nearest).value_or(-1.0);
}

}  // namespace

TEST(FirstHit, IsTheDistanceAlongTheRay)
{
  const World world = wallWorld();
  EXPECT_NEAR(distanceAlong(world, ORIGIN, { 1.0, 0.0, 0.0 }), 4.0, 1e-12);
  EXPECT_NEAR(distanceAlong(world, { 1.0, 3.0, -2.0 }, { 1.0, 0.0, 0.0 }), 3.0, 1e-12);
  EXPECT_NEAR(distanceAlong(world, ORIGIN, { 4.0, 3.0, 0.0 }), 5.0, 1e-12);
  EXPECT_NEAR(distanceAlong(world, ORIGIN, { 2.0, -1.0, 2.0 }), 6.0, 1e-12);
  // From behind, too.
  EXPECT_NEAR(distanceAlong(world, { 9.0, 0.0, 0.0 }, { -1.0, 0.0, 0.0 }), 5.0, 1e-12);
}

TEST(FirstHit, IsEmptyWhereNothingIs)
{
  const World world = wallWorld();
  EXPECT_FALSE(firstHit(world, ORIGIN, -Eigen::Vector3d::UnitX()).has_value());
  EXPECT_FALSE(firstHit(world, ORIGIN, Eigen::Vector3d::UnitY()).has_value());  // along the wall
  EXPECT_FALSE(firstHit(World(), ORIGIN, Eigen::Vector3d::UnitX()).has_value());
}

TEST(FirstHit, EndsAtTheEdges)
{
  World world = wallWorld();
  world.surfaces = { plate(4.0, 1.0, 0.5, 1.0, 0.4) };  // y from 0.5 to 1.5, z from 0.3 to 0.7
  const auto hit = [&world](double y, double z) {
    return firstHit(world, { 0.0, y, z }, Eigen::Vector3d::UnitX()).has_value();
  };
  EXPECT_TRUE(hit(1.0, 0.5));
  EXPECT_TRUE(hit(0.51, 0.31));
  EXPECT_TRUE(hit(1.49, 0.69));
  EXPECT_FALSE(hit(0.49, 0.5));
  EXPECT_FALSE(hit(1.51, 0.5));
  EXPECT_FALSE(hit(1.0, 0.29));
  EXPECT_FALSE(hit(1.0, 0.71));
}

TEST(FirstHit, IsOfTheNearestThingBeyondAsked)
{
  World world = wallWorld();
  world.surfaces.push_back(plate(2.5, 0.0, 0.0, 1.0, 1.0));
  world.surfaces.push_back(plate(3.0, 0.0, 0.0, 1.0, 1.0));
  EXPECT_NEAR(distanceAlong(world, ORIGIN, { 1.0, 0.0, 0.0 }), 2.5, 1e-12);
  EXPECT_NEAR(distanceAlong(world, ORIGIN, { 1.0, 0.0, 0.0 }, 2.6), 3.0, 1e-12);
  EXPECT_NEAR(distanceAlong(world, ORIGIN, { 1.0, 0.0, 0.0 }, 3.5), 4.0, 1e-12);
  EXPECT_FALSE(firstHit(world, ORIGIN, Eigen::Vector3d::UnitX(), 4.5).has_value());
  // Beside the small ones.
  EXPECT_NEAR(distanceAlong(world, { 0.0, 0.6, 0.0 }, { 1.0, 0.0, 0.0 }), 4.0, 1e-12);
}

TEST(FirstHit, GroupsAreNotShown)
{
  World world = wallWorld();
  world.surfaces.push_back(plate(2.5, 0.0, 0.0, 1.0, 1.0));
  world.surfaces.back().group = "visitor";
  EXPECT_NEAR(distanceAlong(world, ORIGIN, { 1.0, 0.0, 0.0 }), 4.0, 1e-12);
}

TEST(FirstHit, MeetsTheDesksBackWall)
{
  const World world = readWorld(test::worldFile("desk"));
  // Above all that stands there; the wall is at x = 3.2, the floor 1 m below.
  EXPECT_NEAR(distanceAlong(world, { 0.0, 0.0, 2.2 }, { 1.0, 0.0, 0.0 }), 3.2, 1e-9);
  EXPECT_NEAR(distanceAlong(world, { -1.0, 0.0, 1.0 }, { 0.0, 0.0, -1.0 }), 1.0, 1e-9);
}

TEST(ShareInSight, IsOneFromTheSamePose)
{
  EXPECT_EQ(shareInSight(wallWorld(), cameraAt(0.0, 0.0), cameraAt(0.0, 0.0)), 1.0);
  for (const char* name : { "desk", "cabinet", "corridor" })
  {
    const World world = readWorld(test::worldFile(name));
    const Eigen::Isometry3d pose = Nomad(world, {}).cameraPose();
    EXPECT_EQ(shareInSight(world, pose, pose), 1.0) << name;
  }
}

TEST(ShareInSight, IsThePartThatBothImagesShow)
{
  const World world = wallWorld();
  // Half a field of view to the side: 4 m x 640 / 500 / 2 = 2.56 m.
  EXPECT_NEAR(shareInSight(world, cameraAt(0.0, 0.0), cameraAt(0.0, 2.56)), 0.5, 0.03);
  EXPECT_EQ(shareInSight(world, cameraAt(0.0, 0.0), cameraAt(0.0, 5.4)), 0.0);
  // Twice as near: half as wide and half as high. From further away all of it.
  EXPECT_NEAR(shareInSight(world, cameraAt(0.0, 0.0), cameraAt(2.0, 0.0)), 0.25, 0.03);
  EXPECT_EQ(shareInSight(world, cameraAt(0.0, 0.0), cameraAt(-2.0, 0.0)), 1.0);
}

TEST(ShareInSight, IsZeroWhenTurnedAway)
{
  const World world = wallWorld();
  EXPECT_EQ(shareInSight(world, cameraAt(0.0, 0.0), cameraAt(0.0, 0.0, M_PI)), 0.0);
  EXPECT_EQ(shareInSight(world, cameraAt(0.0, 0.0), cameraAt(0.0, 0.0, -1.5)), 0.0);
  // Nothing seen, nothing shared.
  EXPECT_EQ(shareInSight(world, cameraAt(0.0, 0.0, M_PI), cameraAt(0.0, 0.0, M_PI)), 0.0);
}

TEST(ShareInSight, FallsWithATurn)
{
  const World world = wallWorld();
  double last = 1.0;
  for (const double yaw : { 0.1, 0.3, 0.6, 0.9 })
  {
    const double share = shareInSight(world, cameraAt(0.0, 0.0), cameraAt(0.0, 0.0, yaw));
    EXPECT_LT(share, last - 0.05) << yaw;
    EXPECT_NEAR(share, shareInSight(world, cameraAt(0.0, 0.0), cameraAt(0.0, 0.0, -yaw)), 0.05);
    last = share;
  }
}

TEST(ShareInSight, CountsNotWhatIsHidden)
{
  World world = wallWorld();
  const Eigen::Isometry3d reference = cameraAt(0.0, 0.0);
  const Eigen::Isometry3d behind = cameraAt(-2.0, 0.0);
  // 1 m behind the reference camera, which does not see it; from behind it hides the left half, then all.
  world.surfaces.push_back(plate(-1.0, 5.0, 0.0, 10.0, 10.0));
  EXPECT_NEAR(shareInSight(world, reference, behind), 0.5, 0.03);
  world.surfaces.back() = plate(-1.0, 0.0, 0.0, 10.0, 10.0);
  EXPECT_EQ(shareInSight(world, reference, behind), 0.0);
  // Behind the current camera, too, it hides nothing.
  world.surfaces.back() = plate(-3.0, 0.0, 0.0, 10.0, 10.0);
  EXPECT_EQ(shareInSight(world, reference, behind), 1.0);
}

TEST(RegionSeenFrom, IsWhereTheSameSurfaceIsInTheOtherImage)
{
  World world = wallWorld();
  world.goal = cameraAt(0.0, 0.0);
  world.region = cv::Rect(220, 140, 200, 200);
  EXPECT_EQ(regionSeenFrom(world, world.goal), world.region);
  // A fifth nearer, everything is a quarter farther from the middle, which is at 319.5, 239.5.
  EXPECT_EQ(regionSeenFrom(world, cameraAt(0.8, 0.0)), cv::Rect(195, 115, 250, 250));
  // 0.8 m to the left, by 500 / 4 pixels a metre to the right.
  EXPECT_EQ(regionSeenFrom(world, cameraAt(0.0, 0.8)), cv::Rect(320, 140, 200, 200));
  // What leaves the image is cut off, and what is behind the camera is not there.
  EXPECT_EQ(regionSeenFrom(world, cameraAt(0.0, 2.4)), cv::Rect(520, 140, 120, 200));
  EXPECT_TRUE(regionSeenFrom(world, cameraAt(0.0, 0.0, M_PI)).empty());
  world.region = cv::Rect();
  EXPECT_EQ(regionSeenFrom(world, cameraAt(2.0, 0.0)), cv::Rect(0, 0, 640, 480));
}

}  // namespace view_servo::sim
