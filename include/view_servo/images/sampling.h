// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <cstddef>

namespace view_servo
{
/**
 * Reads an 8-bit image with one channel between its pixels, by bilinear interpolation in single precision. Pixel (0, 0)
 * has its middle at u = 0, v = 0. Does not own the image, which must outlive it.
 */
class BilinearSampler
{
public:
  explicit BilinearSampler(const cv::Mat& image)
    : data_(image.data),
      step_(image.step),
      last_u_(static_cast<float>(image.cols - 1)),
      last_v_(static_cast<float>(image.rows - 1))
  {
  }

  /**
   * Whether at() may be called: 0 <= u < width - 1 and 0 <= v < height - 1, as interpolation reads the pixel to the
   * right and the two below. Compares in the precision of its arguments. False for NaN.
   */
  template <typename Real>
  bool contains(Real u, Real v) const
  {
    return u >= Real(0) && v >= Real(0) && u < static_cast<Real>(last_u_) && v < static_cast<Real>(last_v_);
  }

  /** The grey level, in [0, 255], at a place. The image has to contain() it, which is not checked. */
  float at(float u, float v) const
  {
    const int left = static_cast<int>(u);
    const int top = static_cast<int>(v);
    const float fu = u - static_cast<float>(left);
    const float fv = v - static_cast<float>(top);
    const unsigned char* p = data_ + static_cast<std::size_t>(top) * step_ + left;
    const unsigned char* q = p + step_;
    const float above = static_cast<float>(p[0]) + fu * static_cast<float>(p[1] - p[0]);
    const float below = static_cast<float>(q[0]) + fu * static_cast<float>(q[1] - q[0]);
    return above + fv * (below - above);
  }

  /** at() at `count` places, first + i step; `values` has room for `count` numbers. */
  void alongLine(const Eigen::Vector2f& first, const Eigen::Vector2f& step, int count, float* values) const;
  /**
   * The same for places in homogeneous coordinates, as on a line that a homography maps into this image. Their third
   * coordinates must be positive, which is not checked.
   */
  void alongLine(const Eigen::Vector3f& first, const Eigen::Vector3f& step, int count, float* values) const;

private:
  const unsigned char* data_;
  std::size_t step_;
  float last_u_;
  float last_v_;
};

}  // namespace view_servo
