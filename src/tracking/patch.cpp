// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "patch.h"

#include "view_servo/geometry/homography.h"
#include "view_servo/images/sampling.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace view_servo
{
bool squareIsInside(const Eigen::Matrix3d& h, const Eigen::Vector2d& place, int radius, const cv::Size& size)
{
  for (const int du : { -radius, radius })
  {
    for (const int dv : { -radius, radius })
    {
      // A homography keeps what lies before the camera convex: the corners bound the rest.
      const Eigen::Vector2d corner = transfer(h, { place.x() + du, place.y() + dv });
      if (!(corner.x() >= 1.0 && corner.y() >= 1.0 && corner.x() < size.width - 2.0 && corner.y() < size.height - 2.0))
      {
        return false;
      }
    }
  }
  return true;
}

void warpSquare(const cv::Mat& current, const Eigen::Matrix3d& h, const Eigen::Vector2d& place, int radius,
                std::vector<float>& values)
{
  const BilinearSampler sampler(current);
  const Eigen::Vector3f along = h.col(0).cast<float>();
  std::size_t i = 0;
  for (int dv = -radius; dv <= radius; ++dv)
  {
    Eigen::Vector3f x = (h * Eigen::Vector3d(place.x() - radius, place.y() + dv, 1.0)).cast<float>();
    for (int du = -radius; du <= radius; ++du, ++i)
    {
      const float inverse = 1.0F / x.z();
      values[i] = sampler.at(x.x() * inverse, x.y() * inverse);
      x += along;
    }
  }
}

float normalize(std::vector<float>& values)
{
  constexpr float LEAST_DEVIATION = 2.0F;  // [grey levels]
  const float count = static_cast<float>(values.size());
  float sum = 0.0F;
  float squares = 0.0F;
  for (const float value : values)
  {
    sum += value;
    squares += value * value;
  }
  const float mean = sum / count;
  const float norm = std::sqrt(std::max(0.0F, squares - sum * mean));
  if (!(norm > LEAST_DEVIATION * std::sqrt(count)))
  {
    return 0.0F;
  }
  for (float& value : values)
  {
    value = (value - mean) / norm;
  }
  return norm;
}

void normalizeGradient(const std::vector<float>& values, float norm, std::vector<float>& gradient)
{
  float average = 0.0F;
  float along = 0.0F;
  for (std::size_t i = 0; i < gradient.size(); ++i)
  {
    gradient[i] /= norm;
    average += gradient[i] / static_cast<float>(gradient.size());
    along += gradient[i] * values[i];
  }
  for (std::size_t i = 0; i < gradient.size(); ++i)
  {
    gradient[i] -= average + along * values[i];
  }
}

Patch makePatch(const cv::Mat& image, const Eigen::Vector2d& at, int radius)
{
  const double margin = radius + 2.0;
  Patch patch;
  patch.radius = radius;
  if (!(at.x() >= margin && at.y() >= margin && at.x() < image.cols - margin && at.y() < image.rows - margin))
  {
    return patch;
  }
  const BilinearSampler sampler(image);
  std::vector<float> gradient_u;
  std::vector<float> gradient_v;
  for (int dv = -radius; dv <= radius; ++dv)
  {
    for (int du = -radius; du <= radius; ++du)
    {
      const float u = static_cast<float>(at.x() + du);
      const float v = static_cast<float>(at.y() + dv);
      patch.values.push_back(sampler.at(u, v));
      gradient_u.push_back(0.5F * (sampler.at(u + 1.0F, v) - sampler.at(u - 1.0F, v)));
      gradient_v.push_back(0.5F * (sampler.at(u, v + 1.0F) - sampler.at(u, v - 1.0F)));
    }
  }
  const float norm = normalize(patch.values);
  if (!(norm > 0.0F))
  {
    return patch;
  }
  normalizeGradient(patch.values, norm, gradient_u);
  normalizeGradient(patch.values, norm, gradient_v);
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < gradient_u.size(); ++i)
  {
    const Eigen::Vector2d gradient(gradient_u[i], gradient_v[i]);
    hessian += gradient * gradient.transpose();
  }
  constexpr double NOISE = 3.0;           // of a pixel [grey levels]
  constexpr double DISSIMILARITY = 0.02;  // of a pixel, of the norm of a patch
  constexpr double LEAST_RATIO = 0.02;    // of the Hessian's eigenvalues: less is an edge, which tells one direction
  const double trace = hessian.trace();
  if (!(hessian.determinant() > LEAST_RATIO * trace * trace / 4.0))
  {
    return patch;
  }
  // Values are off by noise, and by as large a part of their contrast as they are not sampled or seen alike.
  patch.information = hessian / (NOISE * NOISE / (norm * norm) + DISSIMILARITY * DISSIMILARITY);
  const Eigen::Matrix2d inverse = hessian.inverse();
  for (std::size_t i = 0; i < gradient_u.size(); ++i)
  {
    const Eigen::Vector2d step = inverse * Eigen::Vector2d(gradient_u[i], gradient_v[i]);
    patch.descent_u.push_back(static_cast<float>(step.x()));
    patch.descent_v.push_back(static_cast<float>(step.y()));
  }
  patch.usable = true;
  return patch;
}

std::optional<PatchAlignment> align(const Patch& patch, const Eigen::Vector2d& at, const cv::Mat& current,
                                    const Eigen::Matrix3d& h, int iterations)
{
  constexpr double CONVERGED = 0.005;  // step [px of the stored view]
  constexpr double LARGEST = 1.5;      // shift, in radii
  const int radius = patch.radius;
  PatchAlignment alignment;
  std::vector<float> values(patch.values.size());
  for (int iteration = 0;; ++iteration)
  {
    const Eigen::Vector2d place = at - alignment.shift;
    alignment.found = transfer(h, place);
    if (!squareIsInside(h, place, radius, current.size()))
    {
      return std::nullopt;
    }
    warpSquare(current, h, place, radius, values);
    if (!(normalize(values) > 0.0F))
    {
      return std::nullopt;
    }
    float shift_u = 0.0F;
    float shift_v = 0.0F;
    float dot = 0.0F;
    for (std::size_t i = 0; i < values.size(); ++i)
    {
      const float difference = values[i] - patch.values[i];
      shift_u += patch.descent_u[i] * difference;
      shift_v += patch.descent_v[i] * difference;
      dot += values[i] * patch.values[i];
    }
    alignment.correlation = static_cast<double>(dot);
    const Eigen::Vector2d shift(shift_u, shift_v);
    alignment.shift += shift;
    if (!(alignment.shift.norm() < LARGEST * radius))
    {
      return std::nullopt;
    }
    if (iteration + 1 >= iterations || shift.norm() < CONVERGED)
    {
      alignment.found = transfer(h, at - alignment.shift);
      return alignment;
    }
  }
}

}  // namespace view_servo
