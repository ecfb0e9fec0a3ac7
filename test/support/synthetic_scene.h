// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/cameras.h"

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/robust/ransac.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <utility>
#include <vector>

namespace view_servo
{
namespace test
{
/** @file Problems with known answers, the same on every machine for the same generator state. */

/** RapidCheck draws its cases from this seed, unless the environment sets another. */
inline const bool RAPIDCHECK_SEEDED = setenv("RC_PARAMS", "seed=2002", 0) == 0;

constexpr double IMAGE_WIDTH = 640.0;   // [px]
constexpr double IMAGE_HEIGHT = 480.0;  // [px]

inline Eigen::Vector2d randomPixel(Rng& rng)
{
  const double u = uniform(rng, 0.0, IMAGE_WIDTH - 1.0);
  return { u, uniform(rng, 0.0, IMAGE_HEIGHT - 1.0) };
}

/** Rotation by a normally distributed rotation vector; deviation of its components in radians. */
inline Eigen::Matrix3d randomRotation(Rng& rng, double deviation)
{
  const double x = deviation * gaussian(rng);
  const double y = deviation * gaussian(rng);
  const Eigen::Vector3d v(x, y, deviation * gaussian(rng));
  return v.norm() > 0.0 ? Eigen::AngleAxisd(v.norm(), v.normalized()).toRotationMatrix()
                        : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

struct SceneOptions
{
  int inliers = 100;
  int outliers = 0;     ///< pairs of unrelated positions
  double noise = 0.0;   ///< standard deviation added to each coordinate of the inliers [px]
  bool planar = false;  ///< all points on the plane n^T X = d
  bool shuffle = true;  ///< otherwise the inliers come first
};

/** Two perspective views of random points 3 to 6 units away; the cameras look at the same part of space. */
struct Scene
{
  Eigen::Matrix3d k;  ///< camera matrix of both views
  Eigen::Matrix3d r;  ///< X_cur = R X_ref + t
  Eigen::Vector3d t;
  Eigen::Vector3d n;  ///< plane n^T X_ref = d; meets the points of a planar scene only
  double d;
  Eigen::Matrix3d homography;   ///< of the plane, reference -> current, norm 1
  Eigen::Matrix3d fundamental;  ///< x_cur^T F x_ref = 0, norm 1
  Correspondences pairs;
  std::vector<bool> is_inlier;
};

inline Scene makeScene(const SceneOptions& options, Rng& rng)
{
  Scene scene;
  scene.k = cameraMatrix(600.0, 600.0, 0.5 * IMAGE_WIDTH, 0.5 * IMAGE_HEIGHT);
  // The current camera stands 0.7 to 1.5 to the side and turns to the point 4.5 units before the reference camera.
  const double bearing = uniform(rng, 0.0, 2.0 * M_PI);
  const double baseline = uniform(rng, 0.7, 1.5);
  const Eigen::Vector3d centre(baseline * std::cos(bearing), baseline * std::sin(bearing), uniform(rng, -0.5, 0.5));
  const Eigen::Vector3d target(0.0, 0.0, 4.5);
  const Eigen::Vector3d forward = (target - centre).normalized();
  const Eigen::Vector3d axis = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  scene.r = randomRotation(rng, 0.05) * rotationFromVector(std::acos(forward.z()) * axis);
  scene.t = -scene.r * centre;
  scene.n = randomRotation(rng, 0.25) * Eigen::Vector3d::UnitZ();
  scene.d = scene.n.dot(target);
  const Eigen::Matrix3d k_inverse = scene.k.inverse();
  scene.homography = (scene.k * (scene.r + scene.t * scene.n.transpose() / scene.d) * k_inverse).normalized();
  scene.fundamental = fundamentalOf(scene.k, scene.k, scene.r, scene.t).normalized();

  const auto noise = [&] {
    const double u = options.noise * gaussian(rng);
    return Eigen::Vector2d(u, options.noise * gaussian(rng));
  };
  while (static_cast<int>(scene.pairs.size()) < options.inliers)
  {
    const Eigen::Vector2d reference = randomPixel(rng);
    const Eigen::Vector3d ray = k_inverse * reference.homogeneous();
    const double depth = options.planar ? scene.d / scene.n.dot(ray) : uniform(rng, 3.0, 6.0);
    const Eigen::Vector3d x = scene.k * (scene.r * depth * ray + scene.t);
    const Eigen::Vector2d current = x.hnormalized();
    if (depth > 0.0 && x.z() > 0.0 && current.x() >= 0.0 && current.x() <= IMAGE_WIDTH - 1.0 && current.y() >= 0.0 &&
        current.y() <= IMAGE_HEIGHT - 1.0)
    {
      scene.pairs.push_back({ reference, current });
    }
  }
  for (Correspondence& pair : scene.pairs)
  {
    pair.reference += noise();
    pair.current += noise();
  }
  scene.is_inlier.assign(scene.pairs.size(), true);
  for (int i = 0; i < options.outliers; ++i)
  {
    const Eigen::Vector2d reference = randomPixel(rng);
    scene.pairs.push_back({ reference, randomPixel(rng) });
    scene.is_inlier.push_back(false);
  }
  for (std::size_t i = scene.pairs.size(); options.shuffle && i > 1; --i)
  {
    const std::size_t j = uniformIndex(rng, i);
    std::swap(scene.pairs[i - 1], scene.pairs[j]);
    const bool inlier = scene.is_inlier[i - 1];
    scene.is_inlier[i - 1] = scene.is_inlier[j];
    scene.is_inlier[j] = inlier;
  }
  return scene;
}

/** A scene without outliers. @param noise as in SceneOptions. */
inline Scene makeScene(int points, double noise, std::uint64_t seed, bool planar = false)
{
  Rng rng(seed);
  SceneOptions options;
  options.inliers = points;
  options.noise = noise;
  options.planar = planar;
  return makeScene(options, rng);
}

/** Exact pairs of `count` points in a cube seen in two scaled-orthographic views of different scale and direction. */
inline Correspondences scaledOrthographicPairs(int count, Rng& rng)
{
  Eigen::Matrix<double, 2, 3> views[2];
  Eigen::Vector2d offsets[2];
  for (int i = 0; i < 2; ++i)
  {
    views[i] = uniform(rng, 50.0, 200.0) * randomRotation(rng, 0.8).topRows<2>();
    offsets[i] = randomPixel(rng);
  }
  Correspondences pairs;
  for (int i = 0; i < count; ++i)
  {
    const double x = uniform(rng, -1.0, 1.0);
    const double y = uniform(rng, -1.0, 1.0);
    const Eigen::Vector3d point(x, y, uniform(rng, -1.0, 1.0));
    pairs.push_back({ views[0] * point + offsets[0], views[1] * point + offsets[1] });
  }
  return pairs;
}

/** Distance of two matrices that are equal up to scale and sign, each brought to norm 1. */
inline double projectiveDistance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b)
{
  const Eigen::Matrix3d an = a.normalized();
  const Eigen::Matrix3d bn = b.normalized();
  return std::min((an - bn).norm(), (an + bn).norm());
}

}  // namespace test
}  // namespace view_servo
