// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/renderer.h"
#include "sim/visibility.h"
#include "sim/world_reader.h"
#include "support/shipped_files.h"
#include "view_servo/robust/random.h"
#include "view_servo/tracking/view_tracker.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <cstddef>
#include <map>
#include <memory>
#include <vector>

namespace view_servo
{
namespace test
{
/** What a wrong prediction is off by. */
inline const PlanarPose ODOMETRY_ERROR{ 0.02, -0.015, 0.01 };

/**
 * The desk, stored at its goal. Matches are made by ray casting: the true depths of corners, 1 to 3 m away and not
 * tracked by what is tested.
 */
class Desk
{
public:
  Desk()
    : world_(sim::readWorld(worldFile("desk"))),
      mount_(world_.camera_on_base),
      camera_(world_, {}, 1),
      reference_(camera_.capture(cameraAt(base())))
  {
    std::vector<cv::Point2f> corners;
    cv::goodFeaturesToTrack(reference_, corners, 250, 0.01, 8.0);
    for (const cv::Point2f& corner : corners)
    {
      const Eigen::Vector2d pixel(corner.x, corner.y);
      const Eigen::Vector3d ray = world_.camera.normalized(pixel).homogeneous().normalized();
      const Eigen::Isometry3d camera = cameraAt(base());
      const Eigen::Vector3d direction = camera.linear() * ray;
      if (const auto distance = sim::firstHit(world_, camera.translation(), direction))
      {
        pixels_.push_back(pixel);
        points_.emplace_back(camera.translation() + *distance * direction);
      }
    }
  }

  const sim::World& world() const
  {
    return world_;
  }
  const CameraMount& mount() const
  {
    return mount_;
  }
  const cv::Mat& reference() const
  {
    return reference_;
  }

  /** The base pose where the view was stored. */
  PlanarPose base() const
  {
    return toPlanar(world_.goal);
  }

  /** Where most tests track from. */
  PlanarPose nearIt() const
  {
    return baseBefore(0.25, 0.1, 0.03);
  }

  /** A base pose, as seen from the goal. */
  PlanarPose baseBefore(double back, double left, double yaw) const
  {
    return compose(base(), { -back, left, yaw });
  }

  /** What the camera sees from there; the same each time. */
  cv::Mat image(const PlanarPose& base_pose, const sim::Light& light = {})
  {
    const std::vector<double> key{ base_pose.x, base_pose.y, base_pose.yaw, light.gain, light.offset, light.gradient };
    cv::Mat& image = images_[key];
    if (image.empty())
    {
      camera_.setLight(light);
      image = camera_.capture(cameraAt(base_pose));
    }
    return image;
  }

  /** The pose of the stored view's camera in the current one. */
  PlanarPose truth(const PlanarPose& current) const
  {
    return mount_.ofCamera(compose(inverse(current), base()));
  }

  /** Level points of corners that are in sight; with noise in the current image, and unrelated ones besides. */
  Correspondences matches(const PlanarPose& current, double noise_px, int random, Rng& rng) const
  {
    const Eigen::Isometry3d camera = cameraAt(current);
    Correspondences result;
    for (std::size_t i = 0; i < points_.size(); ++i)
    {
      Eigen::Vector2d pixel = world_.camera.project(camera.inverse() * points_[i]);
      const Eigen::Vector3d back = camera.translation() - points_[i];
      const auto hidden = sim::firstHit(world_, points_[i], back.normalized(), 0.01);
      if (!inImage(pixel) || (hidden && *hidden < back.norm()))
      {
        continue;
      }
      pixel.x() += noise_px * gaussian(rng);
      pixel.y() += noise_px * gaussian(rng);
      result.push_back({ levelOf(pixels_[i]), levelOf(pixel) });
    }
    for (int i = 0; i < random; ++i)
    {
      const double u = uniform(rng, 0.0, 639.0);
      result.push_back(
          { levelOf(pixels_[static_cast<std::size_t>(i) % pixels_.size()]), levelOf({ u, uniform(rng, 0.0, 479.0) }) });
    }
    return result;
  }

  /** A tracker that knows the structure, from two views half a metre apart. */
  ViewTracker tracker(const ViewTrackerParams& params = ViewTrackerParams()) const
  {
    ViewTracker result(reference_, world_.camera, mount_, params);
    Rng rng(1);
    const PlanarPose there = baseBefore(0.5, 0.2, 0.05);
    EXPECT_TRUE(result.start(matches(there, 0.3, 0, rng), truth(there)));
    return result;
  }

private:
  Eigen::Isometry3d cameraAt(const PlanarPose& base_pose) const
  {
    return sim::planarPose(base_pose.x, base_pose.y, base_pose.yaw) * world_.camera_on_base;
  }
  bool inImage(const Eigen::Vector2d& pixel) const
  {
    return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() < world_.camera.width && pixel.y() < world_.camera.height;
  }
  Eigen::Vector2d levelOf(const Eigen::Vector2d& pixel) const
  {
    return mount_.level(world_.camera.normalized(pixel));
  }

  sim::World world_;
  CameraMount mount_;
  sim::SimulatedCamera camera_;
  cv::Mat reference_;
  Points pixels_;                        // of corners of the stored view
  std::vector<Eigen::Vector3d> points_;  // in the world
  std::map<std::vector<double>, cv::Mat> images_;
};

class ViewTrackerTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    desk_ = std::make_unique<Desk>();
  }
  static void TearDownTestSuite()
  {
    desk_.reset();
  }
  static Desk& desk()
  {
    return *desk_;
  }

  /** Found where it truly is, in metres and radians. */
  static void expectFound(const ViewTracker::Result& result, const PlanarPose& truth, double distance, double angle)
  {
    ASSERT_TRUE(result.found) << result.supporting << " of " << result.looked_for;
    EXPECT_LT(std::hypot(result.pose.x - truth.x, result.pose.y - truth.y), distance);
    EXPECT_LT(std::abs(wrapAngle(result.pose.yaw - truth.yaw)), angle);
    EXPECT_LE(result.supporting, result.looked_for);
    EXPECT_LE(result.rms, ViewTrackerParams().max_residual);
  }

  static PlanarPose wrongly(const PlanarPose& truth)
  {
    return { truth.x + ODOMETRY_ERROR.x, truth.y + ODOMETRY_ERROR.y, truth.yaw + ODOMETRY_ERROR.yaw };
  }

private:
  inline static std::unique_ptr<Desk> desk_;
};

}  // namespace test
}  // namespace view_servo
