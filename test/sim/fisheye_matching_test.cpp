// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
//
// The matchers take pictures as they come. Those of a fisheye are bent, so that no homography fits all of a plane.
#include "sim/renderer.h"
#include "sim/textures.h"
#include "sim/world.h"
#include "view_servo/geometry/camera_warp.h"
#include "view_servo/views/point_view_matcher.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <cmath>
#include <random>

namespace view_servo
{
namespace
{
using sim::World;

/** A fisheye that sees 115 degrees from left to right and 143 across, before a wall of 2 x 1.5 m in the plane z = 0. */
World wallBeforeFisheye(const char* picture, int things)
{
  World world;
  world.camera.width = 640;
  world.camera.height = 480;
  world.camera.distortion_model = "equidistant";
  world.camera.distortion = { 0.0, 0.0, 0.0, 0.0 };
  world.camera.k << 320.0, 0.0, 319.5, 0.0, 320.0, 239.5, 0.0, 0.0, 1.0;
  world.quality = { 2.0, 0.0, 1 };
  world.textures = { sim::drawTexture(picture, { 1600, 1200 }, 128.0, things, 1) };
  world.surfaces = { { "wall", "", Eigen::Isometry3d::Identity(), { 2.0, 1.5 }, 0, { 1.0, 1.0 } } };
  return world;
}

/** A camera that looks at a point near the middle of the wall, from `tilt` beside its normal [rad]. */
Eigen::Isometry3d somewhereBeforeTheWall(double tilt, double distance, std::mt19937& random)
{
  const auto draw = [&](double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
  };
  const double side = draw(0.0, 2.0 * M_PI);
  const Eigen::Vector3d middle(draw(-0.2, 0.2), draw(-0.2, 0.2), 0.0);
  const Eigen::Vector3d out(std::sin(tilt) * std::cos(side), std::sin(tilt) * std::sin(side), std::cos(tilt));
  const Eigen::Vector3d aside = draw(0.0, 0.5) * Eigen::Vector3d(std::cos(3.0 * side), std::sin(3.0 * side), 0.0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = middle + distance * out;
  pose.linear().col(2) = (middle + distance * aside - pose.translation()).normalized();
  pose.linear().col(0) = pose.linear().col(2).cross(Eigen::Vector3d::UnitY()).normalized();
  pose.linear().col(1) = pose.linear().col(2).cross(pose.linear().col(0));
  return pose;
}

/** Where the point of the wall at a pixel of one camera is in the image of another. */
Eigen::Vector2d seenFrom(const Eigen::Isometry3d& there, const Eigen::Isometry3d& here, const Camera& camera,
                         const Eigen::Vector2d& pixel)
{
  const Eigen::Vector3d ray = here.linear() * camera.normalized(pixel).homogeneous();
  const Eigen::Vector3d point = here.translation() - here.translation().z() / ray.z() * ray;
  return camera.project(there.inverse() * point);
}

/** Whether a match is found nine tenths of whose inliers lie within 3 px of the truth. */
bool isSolved(const cv::Mat& reference, const cv::Mat& current, const Camera& camera, const Eigen::Isometry3d& here,
              const Eigen::Isometry3d& there)
{
  const PointViewMatcher matcher{ PointViewMatcherParams() };
  const FeatureParams features = matcher.params().points;
  const ViewMatch match = matcher.match(PreparedImage(reference, {}, features), PreparedImage(current, {}, features),
                                        GeometryModel::HOMOGRAPHY);
  if (match.outcome != MatchOutcome::MATCHED)
  {
    return false;
  }
  int right = 0;
  for (const MatchedPoint& point : match.matches)
  {
    const Correspondence& position = point.position;
    right += point.inlier && (seenFrom(there, here, camera, position.reference) - position.current).norm() < 3.0;
  }
  return right >= 0.9 * match.inliers;
}

TEST(FisheyeMatching, FindsPlanesAsOftenAsInRectifiedImages)
{
  constexpr int PAIRS = 8;  // of each picture
  int raw = 0;
  int rectified = 0;
  for (const auto& [picture, things] : { std::pair("poster", 300), std::pair("print", 300) })
  {
    const World world = wallBeforeFisheye(picture, things);
    const Camera pinhole = world.camera.rectified();
    const CameraWarp warp(world.camera, pinhole);
    sim::SimulatedCamera camera(world, {}, 1);
    std::mt19937 random(2);
    for (int i = 0; i < PAIRS; ++i)
    {
      const Eigen::Isometry3d here = somewhereBeforeTheWall(0.2, 1.0, random);
      const Eigen::Isometry3d there = somewhereBeforeTheWall(0.6 + 0.07 * i, 1.1, random);
      const cv::Mat reference = camera.capture(here);
      const cv::Mat current = camera.capture(there);
      raw += isSolved(reference, current, world.camera, here, there);
      rectified += isSolved(warp.image(reference), warp.image(current), pinhole, here, there);
    }
  }
  EXPECT_GE(rectified, 2 * PAIRS - 4);
  EXPECT_GE(raw, rectified - 1);
}

}  // namespace
}  // namespace view_servo
