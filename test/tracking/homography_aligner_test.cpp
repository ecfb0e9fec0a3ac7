// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/homography_aligner.h"

#include "sim/renderer.h"
#include "sim/world_reader.h"
#include "support/corner_error.h"
#include "support/shipped_files.h"
#include "support/textured_plane.h"
#include "support/thrown_message.h"
#include "view_servo/geometry/homography.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
const cv::Size SIZE(480, 360);

/** The stored view is the middle of a larger picture, so that what comes into sight is textured, too. */
class Plane
{
public:
  explicit Plane(std::uint64_t seed) : picture_(test::texturedPicture(seed, cv::Size(960, 720)))
  {
    to_reference_ << 1.0, 0.0, -240.0, 0.0, 1.0, -180.0, 0.0, 0.0, 1.0;
  }

  cv::Mat seen(const Eigen::Matrix3d& h) const
  {
    return test::warpedPicture(picture_, h * to_reference_, SIZE);
  }
  cv::Mat reference() const
  {
    return seen(Eigen::Matrix3d::Identity());
  }

private:
  cv::Mat picture_;
  Eigen::Matrix3d to_reference_;
};

HomographyAligner trackerOf(const Plane& plane)
{
  return HomographyAligner(plane.reference(), cv::Rect(), HomographyAlignerParams());
}

/** A motion in the image by `pixels` in a direction [rad], in front of another homography. */
Eigen::Matrix3d shifted(const Eigen::Matrix3d& h, double pixels, double direction)
{
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift(0, 2) = pixels * std::cos(direction);
  shift(1, 2) = pixels * std::sin(direction);
  return shift * h;
}

Eigen::Matrix3d rolled(double angle, double scale)
{
  Eigen::Matrix3d h = Eigen::Matrix3d::Identity();
  h.topLeftCorner<2, 2>() = scale * Eigen::Rotation2Dd(angle).toRotationMatrix();
  const Eigen::Vector2d centre(239.5, 179.5);
  h.topRightCorner<2, 1>() = centre - h.topLeftCorner<2, 2>() * centre;
  return h;
}

std::string messageOf(const cv::Mat& reference, const cv::Rect& region, const HomographyAlignerParams& params)
{
  return test::thrownMessage<std::invalid_argument>([&] { HomographyAligner(reference, region, params); });
}

}  // namespace

TEST(HomographyAlignerParams, NameAllFaultsAtOnce)
{
  HomographyAlignerParams params;
  EXPECT_TRUE(params.validate().empty());
  params.max_points = 3;
  params.patch_radius = 1;
  params.levels = 0;
  params.min_correlation = 1.0;
  params.max_residual = 0.0;
  params.min_supporting = 4;
  params.min_support = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 7U);
}

TEST(HomographyAligner, RefusesWhatItCanNotTrack)
{
  const cv::Mat reference = Plane(1).reference();
  HomographyAlignerParams params;
  EXPECT_EQ(messageOf(reference, cv::Rect(), params), "");
  EXPECT_NE(messageOf(cv::Mat(), cv::Rect(), params).find("grey"), std::string::npos);
  EXPECT_NE(messageOf(cv::Mat(100, 100, CV_8UC3), cv::Rect(), params).find("grey"), std::string::npos);
  EXPECT_NE(messageOf(reference, cv::Rect(400, 300, 100, 20), params).find("region"), std::string::npos);
  EXPECT_NE(messageOf(cv::Mat(SIZE, CV_8UC1, cv::Scalar(80)), cv::Rect(), params).find("0 corners"), std::string::npos);
  params.levels = 9;
  EXPECT_NE(messageOf(reference, cv::Rect(), params).find("levels"), std::string::npos);
  const HomographyAligner tracker(reference, cv::Rect(), HomographyAlignerParams());
  EXPECT_THROW(tracker.track(cv::Mat(), Eigen::Matrix3d::Identity()), std::invalid_argument);
  EXPECT_THROW(tracker.track(cv::Mat(100, 100, CV_8UC3), Eigen::Matrix3d::Identity()), std::invalid_argument);
}

TEST(HomographyAligner, FindsTheHomographyToAFractionOfAPixel)
{
  const Plane plane(2);
  const HomographyAligner tracker = trackerOf(plane);
  for (const Eigen::Matrix3d& truth : { Eigen::Matrix3d(Eigen::Matrix3d::Identity()), test::exampleHomography(),
                                        rolled(0.4, 1.0), rolled(-0.2, 1.3), rolled(0.1, 0.75) })
  {
    const cv::Mat image = test::disturbed(plane.seen(truth), 1.0, 0.0, 2.0);
    for (const double direction : { 0.0, 1.6, 3.3, 4.9 })
    {
      const TrackedHomography result = tracker.track(image, shifted(truth, 8.0, direction));
      ASSERT_TRUE(result.found) << truth;
      EXPECT_LT(test::cornerError(result.h, truth, SIZE), 0.15) << truth;
      EXPECT_GT(result.supporting, result.looked_for / 2);
      EXPECT_LE(result.supporting, result.looked_for);
      EXPECT_LT(result.rms, 0.5);
      EXPECT_DOUBLE_EQ(result.h(2, 2), 1.0);
    }
  }
}

TEST(HomographyAligner, FollowsFastMotionWithoutPrediction)
{
  const Plane plane(3);
  const HomographyAligner tracker = trackerOf(plane);
  for (const double direction : { 0.3, 2.0, 4.0 })
  {
    const Eigen::Matrix3d truth = shifted(test::exampleHomography(), 30.0, direction);
    const TrackedHomography result = tracker.track(plane.seen(truth), test::exampleHomography());
    ASSERT_TRUE(result.found) << direction;
    EXPECT_LT(test::cornerError(result.h, truth, SIZE), 0.15) << direction;
  }
}

TEST(HomographyAligner, LightDoesNotMatter)
{
  const Plane plane(4);
  const HomographyAligner tracker = trackerOf(plane);
  const Eigen::Matrix3d truth = test::exampleHomography();
  const cv::Mat image = plane.seen(truth);
  cv::Mat uneven;
  image.convertTo(uneven, CV_32F);
  for (int v = 0; v < uneven.rows; ++v)
  {
    for (int u = 0; u < uneven.cols; ++u)
    {
      uneven.at<float>(v, u) *= 0.6F + 0.4F * static_cast<float>(u) / static_cast<float>(uneven.cols);
    }
  }
  uneven.convertTo(uneven, CV_8U);
  for (const cv::Mat& seen :
       { test::disturbed(image, 0.6, 40.0, 2.0), test::disturbed(image, 1.2, -30.0, 2.0), uneven })
  {
    const TrackedHomography result = tracker.track(seen, shifted(truth, 10.0, 1.0));
    ASSERT_TRUE(result.found);
    EXPECT_LT(test::cornerError(result.h, truth, SIZE), 0.2);
  }
}

TEST(HomographyAligner, IsNotMisledByWhatCoversAPart)
{
  const Plane plane(5);
  const HomographyAligner tracker = trackerOf(plane);
  const cv::Mat other = test::texturedPicture(77, SIZE);
  const Eigen::Matrix3d truth = test::exampleHomography();
  for (const double left : { 0.0, 0.3, 0.6 })
  {
    cv::Mat image = plane.seen(truth);
    const cv::Rect cover(static_cast<int>(left * SIZE.width), 0, static_cast<int>(0.4 * SIZE.width), SIZE.height);
    other(cover).copyTo(image(cover));
    const TrackedHomography result = tracker.track(image, shifted(truth, 6.0, 2.0));
    ASSERT_TRUE(result.found) << left;
    EXPECT_LT(test::cornerError(result.h, truth, SIZE), 0.4) << left;
    EXPECT_LT(result.supporting, 0.8 * result.looked_for) << left;
  }
}

/** They tell more than the corners, whatever the light and what is hidden. */
TEST(HomographyAligner, AllPixelsHaveTheLastWord)
{
  constexpr int PLACES = 8;
  constexpr double DISTANCE = 0.46;  // of the printed face from the world's goal [m]
  sim::World world = sim::readWorld(test::worldFile("rice"));
  world.quality.noise = 2.0;
  sim::SimulatedCamera camera(world, {}, 1);
  const cv::Mat reference = camera.capture(world.goal);
  camera.setLight({ 0.7, 15.0, 0.4 });
  HomographyAlignerParams unrefined;
  unrefined.refine = false;
  const HomographyAligner all_pixels(reference, world.region, HomographyAlignerParams());
  const HomographyAligner corners(reference, world.region, unrefined);
  const auto error = [&world](const Eigen::Matrix3d& h, const Eigen::Matrix3d& truth) {
    double worst = 0.0;
    for (const cv::Point& corner : { world.region.tl(), world.region.br() })
    {
      worst = std::max(worst, (transfer(h, { corner.x, corner.y }) - transfer(truth, { corner.x, corner.y })).norm());
    }
    return worst;
  };
  for (const bool hidden : { false, true })
  {
    double with = 0.0;
    double without = 0.0;
    for (int i = 0; i < PLACES; ++i)
    {
      Eigen::Isometry3d off = Eigen::Isometry3d::Identity();
      off.translation() = 4e-4 * Eigen::Vector3d(std::cos(i), std::sin(i), 0.5);
      off.linear() =
          Eigen::AngleAxisd(1e-3, Eigen::Vector3d(std::sin(2 * i), 0.6, 0.5).normalized()).toRotationMatrix();
      const Eigen::Isometry3d motion = off.inverse();
      const Eigen::Matrix3d truth = world.camera.k *
                                    (motion.linear() + motion.translation() / DISTANCE * Eigen::RowVector3d::UnitZ()) *
                                    world.camera.k.inverse();
      cv::Mat image = camera.capture(world.goal * off);
      if (hidden)
      {
        const cv::Rect part(200, 40, 120, 240);
        test::texturedPicture(50, part.size()).copyTo(image(part));
      }
      const TrackedHomography refined = all_pixels.track(image, Eigen::Matrix3d::Identity());
      const TrackedHomography plain = corners.track(image, Eigen::Matrix3d::Identity());
      ASSERT_TRUE(refined.found && plain.found) << i;
      with += error(refined.h, truth) / PLACES;
      without += error(plain.h, truth) / PLACES;
    }
    EXPECT_LT(with, 0.75 * without) << hidden;
    EXPECT_LT(with, 0.1) << hidden;
  }
}

TEST(HomographyAligner, FindsNothingWhereTheViewIsNot)
{
  const Plane plane(6);
  const HomographyAligner tracker = trackerOf(plane);
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  for (const cv::Mat& image : { test::texturedPicture(78, SIZE), test::blotchedPicture(3, 2.0, SIZE),
                                cv::Mat(SIZE, CV_8UC1, cv::Scalar(0)), cv::Mat(SIZE, CV_8UC1, cv::Scalar(200)) })
  {
    const TrackedHomography result = tracker.track(image, identity);
    EXPECT_FALSE(result.found);
    EXPECT_TRUE(std::isnan(result.h(0, 0)));
  }
  // Out of sight, or behind the camera.
  EXPECT_FALSE(tracker.track(plane.reference(), shifted(identity, 2000.0, 0.0)).found);
  EXPECT_FALSE(tracker.track(plane.reference(), -identity).found);
}

TEST(HomographyAligner, FindsTheRightOneOrNone)
{
  const Plane plane(7);
  const HomographyAligner tracker = trackerOf(plane);
  int found = 0;
  for (int i = 0; i < 40; ++i)
  {
    const Eigen::Matrix3d truth = rolled(0.02 * i, 1.0);
    const TrackedHomography result = tracker.track(plane.seen(truth), shifted(truth, 4.0 * i, 0.7 * i));
    if (result.found)
    {
      ++found;
      EXPECT_LT(test::cornerError(result.h, truth, SIZE), 1.0) << i;
    }
  }
  EXPECT_GE(found, 10);
}

TEST(HomographyAligner, BearsAnyPrediction)
{
  const Plane plane(11);
  const HomographyAligner tracker = trackerOf(plane);
  const cv::Mat image = plane.reference();
  cv::RNG rng(1);
  int found = 0;
  for (int i = 0; i < 200; ++i)
  {
    const double wildness = 0.005 * i;
    Eigen::Matrix3d wild = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 9; ++k)
    {
      wild(k / 3, k % 3) += wildness * (k % 3 == 2 ? 200.0 : (k / 3 == 2 ? 4e-3 : 0.8)) * rng.uniform(-1.0, 1.0);
    }
    wild(2, 2) = 1.0;
    const TrackedHomography result = tracker.track(image, wild);
    if (result.found)
    {
      ++found;
      EXPECT_LT(test::cornerError(result.h, Eigen::Matrix3d::Identity(), SIZE), 1.0) << i;
    }
  }
  EXPECT_GT(found, 0);
  EXPECT_LT(found, 200);
  EXPECT_FALSE(tracker.track(image, Eigen::Matrix3d::Zero()).found);
  EXPECT_FALSE(tracker.track(image, Eigen::Matrix3d::Constant(std::nan(""))).found);
}

TEST(HomographyAligner, TracksTheRegionWhateverTheGroundDoes)
{
  const Plane plane(8);
  const Plane ground(9);
  const cv::Rect region(120, 90, 240, 180);
  cv::Mat reference = ground.reference();
  plane.reference()(region).copyTo(reference(region));
  const HomographyAligner tracker(reference, region, HomographyAlignerParams());
  for (const Eigen::Vector2d& point : tracker.points())
  {
    EXPECT_TRUE(region.contains(cv::Point(static_cast<int>(point.x()), static_cast<int>(point.y()))));
  }
  const Eigen::Matrix3d truth = shifted(rolled(0.15, 1.1), 15.0, 1.0);
  cv::Mat mask(SIZE, CV_8UC1, cv::Scalar(0));
  mask(region).setTo(255);
  cv::Mat seen_mask = test::warpedPicture(mask, truth, SIZE);
  cv::threshold(seen_mask, seen_mask, 200, 255, cv::THRESH_BINARY);
  cv::Mat image = ground.seen(shifted(Eigen::Matrix3d::Identity(), 20.0, 4.0));
  plane.seen(truth).copyTo(image, seen_mask);
  const TrackedHomography result = tracker.track(image, rolled(0.15, 1.1));
  ASSERT_TRUE(result.found);
  const Eigen::Vector2d corner(120.0, 90.0);
  EXPECT_LT((transfer(result.h, corner) - transfer(truth, corner)).norm(), 0.3);
  EXPECT_LT(test::cornerError(result.h, truth, SIZE), 0.8);
}

TEST(HomographyAligner, GivesTheSameForTheSame)
{
  const Plane plane(10);
  const cv::Mat image = test::disturbed(plane.seen(test::exampleHomography()), 0.9, 5.0, 3.0);
  const TrackedHomography first = trackerOf(plane).track(image, test::exampleHomography());
  const TrackedHomography second = trackerOf(plane).track(image, test::exampleHomography());
  ASSERT_TRUE(first.found);
  EXPECT_EQ(first.h, second.h);
  EXPECT_EQ(first.supporting, second.supporting);
}

}  // namespace view_servo
