// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/renderer.h"

#include "sim/textures.h"
#include "support/cameras.h"
#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <atomic>
#include <cmath>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace view_servo::sim
{
namespace
{
constexpr int FIELDS = 8;
constexpr double SIDE = 0.8;  // of the checker [m]

Camera pinhole()
{
  Camera camera = test::pinholeCamera({ 640, 480 }, 610.0, 605.0, 322.5, 236.0);
  camera.distortion_model = "plumb_bob";
  camera.distortion.assign(5, 0.0);
  return camera;
}

/** A checker in the plane x = 0 that faces -x, its middle in the origin. */
World checkerWorld()
{
  World world;
  world.name = "checker";
  world.camera = pinhole();
  world.background = 128.0;
  world.textures = { drawTexture("checker", cv::Size(1024, 1024), 128.0, FIELDS, 1) };
  Surface surface;
  surface.name = "checker";
  surface.pose = Eigen::Isometry3d::Identity();
  surface.pose.linear() << 0.0, 0.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  surface.size << SIDE, SIDE;
  surface.texture = 0;
  surface.repeat << 1.0, 1.0;
  world.surfaces = { surface };
  return world;
}

/** The checker's inner corners in the world. */
std::vector<Eigen::Vector3d> corners(const World& world)
{
  std::vector<Eigen::Vector3d> all;
  for (int row = 1; row < FIELDS; ++row)
  {
    for (int column = 1; column < FIELDS; ++column)
    {
      const Eigen::Vector3d on_surface(SIDE * (static_cast<double>(column) / FIELDS - 0.5),
                                       SIDE * (static_cast<double>(row) / FIELDS - 0.5), 0.0);
      all.emplace_back(world.surfaces.front().pose * on_surface);
    }
  }
  return all;
}

Eigen::Isometry3d randomView(Rng& rng)
{
  const Eigen::Vector3d position(uniform(rng, -1.4, -0.9), uniform(rng, -0.5, 0.5), uniform(rng, -0.4, 0.4));
  const Eigen::Vector3d target(0.0, uniform(rng, -0.05, 0.05), uniform(rng, -0.05, 0.05));
  return lookingAt(position, target, uniform(rng, -0.6, 0.6));
}

bool isWellInside(const Eigen::Vector2d& pixel)
{
  constexpr double MARGIN = 12.0;
  return pixel.x() > MARGIN && pixel.y() > MARGIN && pixel.x() < 639.0 - MARGIN && pixel.y() < 479.0 - MARGIN;
}

/** Slight blur makes the saddles that cv::cornerSubPix() finds exact to 0.05 px; without it errs by 0.1 px itself. */
cv::Mat blurred(const cv::Mat& image)
{
  cv::Mat result;
  cv::GaussianBlur(image, result, cv::Size(), 1.0);
  return result;
}

/** Where the saddle near a position is in an image. */
Eigen::Vector2d found(const cv::Mat& image, const Eigen::Vector2d& near)
{
  std::vector<cv::Point2f> points = { cv::Point2f(static_cast<float>(near.x()), static_cast<float>(near.y())) };
  cv::cornerSubPix(image, points, cv::Size(6, 6), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-4));
  return { points.front().x, points.front().y };
}

double meanOf(const cv::Mat& image)
{
  return cv::mean(image)[0];
}

}  // namespace

TEST(SimulatedCamera, CornersAreWhereTheHomographySendsThem)
{
  const World world = checkerWorld();
  SimulatedCamera camera(world, {}, 1);
  Rng rng(3);
  int compared = 0;
  for (int trial = 0; trial < 6; ++trial)
  {
    const Eigen::Isometry3d reference = randomView(rng);
    const Eigen::Isometry3d current = randomView(rng);
    const cv::Mat reference_image = blurred(camera.capture(reference));
    const cv::Mat current_image = blurred(camera.capture(current));
    // H = K (R + t nT / d) K^-1, X_cur = R X_ref + t, nT X_ref = d.
    const Eigen::Isometry3d motion = current.inverse() * reference;
    const Eigen::Vector3d normal = reference.linear().transpose() * Eigen::Vector3d::UnitX();
    const double distance = normal.dot(reference.inverse() * Eigen::Vector3d::Zero());
    const Eigen::Matrix3d k = world.camera.k;
    const Eigen::Matrix3d h =
        k * (motion.linear() + motion.translation() * normal.transpose() / distance) * k.inverse();
    for (const Eigen::Vector3d& corner : corners(world))
    {
      const Eigen::Vector2d expected = world.camera.project(reference.inverse() * corner);
      if (!isWellInside(expected) || !isWellInside(world.camera.project(current.inverse() * corner)))
      {
        continue;
      }
      ++compared;
      const Eigen::Vector2d seen = found(reference_image, expected);
      EXPECT_LT((seen - expected).norm(), 0.1);
      const Eigen::Vector2d sent = (h * seen.homogeneous()).hnormalized();
      EXPECT_LT((found(current_image, sent) - sent).norm(), 0.1);
    }
  }
  EXPECT_GT(compared, 150);
}

TEST(SimulatedCamera, DistortsAsItsCalibrationSays)
{
  World world = checkerWorld();
  world.camera.distortion = { -0.2, 0.05, 0.001, -0.001, 0.0 };
  SimulatedCamera camera(world, {}, 1);
  Rng rng(4);
  const Eigen::Isometry3d view = randomView(rng);
  const cv::Mat image = blurred(camera.capture(view));
  double largest = 0.0;
  for (const Eigen::Vector3d& corner : corners(world))
  {
    const Eigen::Vector2d expected = world.camera.project(view.inverse() * corner);
    if (!isWellInside(expected))
    {
      continue;
    }
    EXPECT_LT((found(image, expected) - expected).norm(), 0.1);
    largest = std::max(largest, (pinhole().project(view.inverse() * corner) - expected).norm());
  }
  EXPECT_GT(largest, 2.0);  // it does distort
}

TEST(SimulatedCamera, SameSeedGivesTheSameBytes)
{
  World world = checkerWorld();
  world.quality.noise = 3.0;
  const Eigen::Isometry3d view = lookingAt(Eigen::Vector3d(-1.0, 0.1, 0.0), Eigen::Vector3d::Zero(), 0.0);
  SimulatedCamera first(world, {}, 5);
  SimulatedCamera second(world, {}, 5);
  SimulatedCamera other(world, {}, 6);
  const cv::Mat image = first.capture(view);
  EXPECT_EQ(cv::norm(image, second.capture(view), cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(image, other.capture(view), cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(image, first.capture(view), cv::NORM_INF), 0.0);  // the next image has other noise
}

TEST(SimulatedCamera, LightAndNoiseAreThoseAskedFor)
{
  World world = checkerWorld();
  const Eigen::Isometry3d away = lookingAt(Eigen::Vector3d(-1.0, 0.0, 0.0), Eigen::Vector3d(-2.0, 0.0, 0.0), 0.0);
  SimulatedCamera camera(world, {}, 1);
  EXPECT_EQ(meanOf(camera.capture(away)), 128.0);
  camera.setLight({ 0.7, 12.0, 0.0 });
  EXPECT_NEAR(meanOf(camera.capture(away)), 0.7 * 128.0 + 12.0, 0.51);
  camera.setLight({ 1.0, 0.0, 0.4 });
  const cv::Mat sloped = camera.capture(away);
  EXPECT_NEAR(meanOf(sloped.col(0)), 128.0 * 0.8, 0.51);
  EXPECT_NEAR(meanOf(sloped.col(639)), 128.0 * 1.2, 0.51);

  world.quality.noise = 5.0;
  SimulatedCamera noisy(world, {}, 1);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(noisy.capture(away), mean, deviation);
  EXPECT_NEAR(mean[0], 128.0, 0.1);
  EXPECT_NEAR(deviation[0], 5.0, 0.1);
}

TEST(SimulatedCamera, NearThingsHideFarOnes)
{
  World world = checkerWorld();
  world.textures.push_back(drawTexture("plain", cv::Size(8, 8), 255.0, 1, 1));
  Surface screen = world.surfaces.front();
  screen.group = "screen";
  screen.texture = 1;
  screen.brightness = 0.2;
  screen.pose.translation().x() = -0.3;
  world.surfaces.insert(world.surfaces.begin(), screen);  // what is drawn first does not matter
  const Eigen::Isometry3d view = lookingAt(Eigen::Vector3d(-1.0, 0.0, 0.0), Eigen::Vector3d::Zero(), 0.0);
  const cv::Rect middle(300, 220, 40, 40);
  SimulatedCamera hidden(world, { "screen" }, 1);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(hidden.capture(view)(middle), mean, deviation);
  EXPECT_LT(deviation[0], 0.5);
  // A group is shown only when asked for.
  SimulatedCamera open(world, {}, 1);
  cv::meanStdDev(open.capture(view)(middle), mean, deviation);
  EXPECT_GT(deviation[0], 20.0);
  EXPECT_THROW(SimulatedCamera(world, { "scren" }, 1), std::invalid_argument);
}

TEST(SimulatedCamera, MotionBlurIsTheMeanOverTheExposure)
{
  const World world = checkerWorld();
  SimulatedCamera camera(world, {}, 1);
  const auto view = [](double y) {
    return lookingAt(Eigen::Vector3d(-1.0, y, 0.0), Eigen::Vector3d(0.0, y, 0.0), 0.0);
  };
  cv::Mat sum(480, 640, CV_64F, cv::Scalar(0.0));
  for (const double y : { 0.0, 0.02, 0.04 })
  {
    cv::Mat image;
    camera.capture(view(y)).convertTo(image, CV_64F, 1.0 / 3.0);
    sum += image;
  }
  cv::Mat mean;
  camera.capture({ view(0.0), view(0.02), view(0.04) }).convertTo(mean, CV_64F);
  EXPECT_LT(cv::norm(mean, sum, cv::NORM_INF), 1.01);
  EXPECT_THROW(camera.capture(std::vector<Eigen::Isometry3d>()), std::invalid_argument);
}

TEST(SimulatedCamera, FarTexturesDoNotAlias)
{
  // A fine checker seen from far away is grey, whatever the sub-pixel position.
  World world = checkerWorld();
  world.surfaces.front().repeat << 100.0, 100.0;
  SimulatedCamera camera(world, {}, 1);
  const Eigen::Isometry3d view = lookingAt(Eigen::Vector3d(-3.0, 0.0, 0.0), Eigen::Vector3d::Zero(), 0.1);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(camera.capture(view)(cv::Rect(280, 200, 80, 80)), mean, deviation);
  EXPECT_LT(deviation[0], 2.0);
  EXPECT_GT(mean[0], 60.0);
}

/** As trials in several threads do; some Mesa draw what is of the same size into one buffer. */
TEST(SimulatedCamera, DrawsBesideOthersOfItsSizeInOtherThreadsAsAlone)
{
  constexpr std::size_t CAMERAS = 4;
  constexpr int PICTURES = 8;
  const World world = checkerWorld();
  Rng rng(11);
  std::vector<Eigen::Isometry3d> views;
  std::vector<cv::Mat> alone;
  for (std::size_t i = 0; i < CAMERAS; ++i)
  {
    views.push_back(randomView(rng));
    alone.push_back(SimulatedCamera(world, {}, 1).capture(views.back()));
  }
  std::vector<std::unique_ptr<SimulatedCamera>> cameras;
  for (std::size_t i = 0; i < CAMERAS; ++i)
  {
    cameras.push_back(std::make_unique<SimulatedCamera>(world, std::vector<std::string>{}, 1));
  }
  std::atomic<int> different{ 0 };
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < CAMERAS; ++i)
  {
    threads.emplace_back([&, i] {
      for (int picture = 0; picture < PICTURES; ++picture)
      {
        different += cv::norm(cameras[i]->capture(views[i]), alone[i], cv::NORM_INF) > 0.0;
      }
    });
  }
  for (std::thread& thread : threads)
  {
    thread.join();
  }
  EXPECT_EQ(different, 0);
}

}  // namespace view_servo::sim
