// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * Robust estimation from points against OpenCV's USAC_MAGSAC, in one run on the same drawn matches, on one thread:
 *
 *     bench_robust fundamental|homography [--runs N] [--seed N] [--set name=value ...]
 *
 * Two cameras of 768x576 before a scene of depth, or a plane; 300 matches with noise of 0.7 px, of which 20 to 70 % are
 * outliers. For each share of outliers: processor time, and the distance of noise-free pairs from the estimated
 * geometry, both medians over N draws, and in brackets as ratios to MAGSAC. For F also with polishFundamental().
 */
#include "options.h"
#include "timing.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <iostream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace
{
using namespace view_servo;  // NOLINT(google-build-using-namespace): a program of its own

constexpr double WIDTH = 768.0;   // [px]
constexpr double HEIGHT = 576.0;  // [px]
constexpr int MATCHES = 300;
constexpr double NOISE = 0.7;      // of each coordinate in both images [px]
constexpr double THRESHOLD = 2.0;  // of inliers [px]

struct Drawn
{
  Correspondences matches;  ///< with noise and outliers
  Correspondences truth;    ///< inliers without noise
};

/** @param planar all points on one plane, else between 2 and 6 m away. */
Drawn draw(double outliers, bool planar, Rng& rng)
{
  const auto between = [&rng](double low, double high) {
    return uniform(rng, low, high);
  };
  Eigen::Matrix3d k;
  k << 700.0, 0.0, 0.5 * WIDTH, 0.0, 700.0, 0.5 * HEIGHT, 0.0, 0.0, 1.0;
  const Eigen::Vector3d axis = Eigen::Vector3d(between(-1.0, 1.0), between(-1.0, 1.0), between(-0.5, 0.5)).normalized();
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(between(0.05, 0.2), axis).toRotationMatrix();
  const Eigen::Vector3d translation(between(-0.6, 0.6), between(-0.3, 0.3), between(-0.6, 0.6));
  const Eigen::Vector3d normal = Eigen::Vector3d(between(-0.5, 0.5), between(-0.5, 0.5), 1.0).normalized();
  const auto inside = [](const Eigen::Vector2d& at) {
    return at.x() >= 0.0 && at.y() >= 0.0 && at.x() < WIDTH && at.y() < HEIGHT;
  };
  Drawn drawn;
  const auto wrong = static_cast<std::size_t>(std::lround(outliers * MATCHES));
  while (drawn.matches.size() < MATCHES)
  {
    const Eigen::Vector2d at(between(0.0, WIDTH), between(0.0, HEIGHT));
    if (drawn.matches.size() < wrong)
    {
      drawn.matches.push_back({ at, { between(0.0, WIDTH), between(0.0, HEIGHT) } });
      continue;
    }
    const Eigen::Vector3d ray = k.inverse() * at.homogeneous();
    const double depth = planar ? 3.0 / normal.dot(ray) : between(2.0, 6.0);
    const Eigen::Vector2d there = (k * (rotation * (depth * ray) + translation)).hnormalized();
    if (!inside(there))
    {
      continue;
    }
    drawn.truth.push_back({ at, there });
    const auto noise = [&rng] {
      return Eigen::Vector2d(NOISE * gaussian(rng), NOISE * gaussian(rng));
    };
    drawn.matches.push_back({ at + noise(), there + noise() });
  }
  for (std::size_t i = drawn.matches.size(); i > 1; --i)
  {
    std::swap(drawn.matches[i - 1], drawn.matches[uniformIndex(rng, i)]);
  }
  return drawn;
}

double rms(const Correspondences& truth, const std::function<double(const Correspondence&)>& squared_error)
{
  double sum = 0.0;
  for (const Correspondence& pair : truth)
  {
    sum += squared_error(pair);
  }
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

std::optional<Eigen::Matrix3d> byMagsac(const Correspondences& matches, bool planar, const RansacParams& params)
{
  std::vector<cv::Point2d> from;
  std::vector<cv::Point2d> to;
  for (const Correspondence& pair : matches)
  {
    from.emplace_back(pair.reference.x(), pair.reference.y());
    to.emplace_back(pair.current.x(), pair.current.y());
  }
  const cv::Mat found =
      planar ? cv::findHomography(from, to, cv::USAC_MAGSAC, THRESHOLD, cv::noArray(), params.max_iterations,
                                  params.confidence)
             : cv::findFundamentalMat(from, to, cv::USAC_MAGSAC, THRESHOLD, params.confidence, params.max_iterations);
  if (found.empty())
  {
    return std::nullopt;
  }
  Eigen::Matrix3d matrix;
  cv::cv2eigen(found, matrix);
  return matrix;
}

std::optional<Eigen::Matrix3d> byRansac(const Correspondences& matches, bool planar, const RansacParams& params)
{
  Rng rng(1);
  if (planar)
  {
    const auto found = ransac(HomographyEstimator(matches), params, rng);
    return found.model ? std::optional<Eigen::Matrix3d>(found.model->h) : std::nullopt;
  }
  return ransac(FundamentalEstimator(matches), params, rng).model;
}

/** As the matchers do it. */
std::optional<Eigen::Matrix3d> byPolishedRansac(const Correspondences& matches, bool planar, const RansacParams& params)
{
  constexpr double HUBER_WIDTH = 1.0;  // [px]
  if (planar)
  {
    return byRansac(matches, planar, params);
  }
  Rng rng(1);
  const auto found = ransac(FundamentalEstimator(matches), params, rng);
  return found.model ? std::optional<Eigen::Matrix3d>(
                           polishFundamental(*found.model, select(matches, found.inliers), HUBER_WIDTH))
                     : std::nullopt;
}

double errorOf(const std::optional<Eigen::Matrix3d>& matrix, bool planar, const Correspondences& truth)
{
  if (!matrix)
  {
    return std::numeric_limits<double>::infinity();
  }
  return rms(truth, [&](const Correspondence& pair) {
    return planar ? ((*matrix * pair.reference.homogeneous()).hnormalized() - pair.current).squaredNorm()
                  : sampsonError(*matrix, pair);
  });
}

struct Method
{
  std::string name;
  std::optional<Eigen::Matrix3d> (*estimate)(const Correspondences&, bool, const RansacParams&);
  std::vector<double> times{};   ///< processor time of each draw [ms]
  std::vector<double> errors{};  ///< [px]
};

Ratios compareAll(bool planar, const RansacParams& params, int runs, std::uint64_t seed)
{
  Ratios ratios;
  cv::setNumThreads(1);
  std::printf("%s from %d matches, %d draws, seed %d, medians: processor time [ms], rms error [px]\n",
              planar ? "H" : "F", MATCHES, runs, static_cast<int>(seed));
  for (const double outliers : { 0.2, 0.4, 0.5, 0.6, 0.7 })
  {
    std::vector<Method> methods = { { "MAGSAC", byMagsac },
                                    { "view_servo", byRansac },
                                    { "polished", byPolishedRansac } };
    methods.resize(planar ? 2 : 3);
    Rng rng(seed);
    for (int run = 0; run < runs; ++run)
    {
      const Drawn drawn = draw(outliers, planar, rng);
      for (Method& method : methods)
      {
        const double start = processorTime();
        const auto found = method.estimate(drawn.matches, planar, params);
        method.times.push_back(processorTime() - start);
        method.errors.push_back(errorOf(found, planar, drawn.truth));
      }
    }
    std::printf("%3.0f %% outliers", 100.0 * outliers);
    for (const Method& method : methods)
    {
      std::printf("   %s %.2f ms (%.2f) %.3f px (%.2f)", method.name.c_str(), medianOf(method.times),
                  medianOf(method.times) / medianOf(methods.front().times), medianOf(method.errors),
                  medianOf(method.errors) / medianOf(methods.front().errors));
    }
    for (auto method = methods.begin() + 1; method != methods.end(); ++method)
    {
      ratios.add(std::string(planar ? "H" : "F") + " with " + std::to_string(std::lround(100.0 * outliers)) +
                     " % outliers, " + method->name + " of " + methods.front().name,
                 medianQuotient(method->times, methods.front().times));
    }
    std::printf("\n");
  }
  return ratios;
}

}  // namespace

int main(int argc, char** argv)
{
  RansacParams params;
  params.inlier_threshold = THRESHOLD;
  params.sampling = Sampling::UNIFORM;  // the draws have no order
  constexpr int RUNS = 100;
  try
  {
    const BenchOptions options = readOptions(argc, argv, RUNS, parameters(params));
    const std::string& mode = options.mode;
    if (mode == "fundamental" || mode == "homography")
    {
      return finish(compareAll(mode == "homography", params, options.runs, options.seed), options);
    }
    std::cerr << "usage: bench_robust fundamental|homography [--runs N] [--seed N] [--write FILE] [--check FILE]\n"
                 "                                           [--set name=value ...]"
              << std::endl;
  }
  catch (const std::exception& error)
  {
    std::cerr << error.what() << std::endl;
  }
  return 2;
}
