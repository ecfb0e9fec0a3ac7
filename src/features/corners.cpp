// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/corners.h"

#include "view_servo/images/universal_intrinsics.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

namespace view_servo
{
namespace
{
struct Peak
{
  int u;
  int v;
  float response;
};

/** Sampled Gaussian (order 0) or its first derivative (order 1), scaled to unit gain on a constant or a ramp. */
cv::Mat gaussianKernel(double sigma, int order)
{
  const int radius = std::max(1, static_cast<int>(std::ceil(3.0 * sigma)));
  cv::Mat kernel(1, 2 * radius + 1, CV_32F);
  double gain = 0.0;
  for (int i = -radius; i <= radius; ++i)
  {
    const double gauss = std::exp(-0.5 * i * i / (sigma * sigma));
    const double value = order == 0 ? gauss : i * gauss;
    kernel.at<float>(0, i + radius) = static_cast<float>(value);
    gain += order == 0 ? value : i * value;
  }
  return kernel / gain;
}

/** The Harris measure of every pixel (eq. 2.20-2.24). */
cv::Mat harrisResponse(const cv::Mat& image, const CornerParams& params)
{
  const cv::Mat smooth = gaussianKernel(params.derivative_sigma, 0);
  const cv::Mat derivative = gaussianKernel(params.derivative_sigma, 1);
  const cv::Mat window = gaussianKernel(params.integration_sigma, 0);
  cv::Mat response(image.size(), CV_32F);

  // Stripes of rows are independent: each is filtered from its rows and as many beside them as the kernels reach. They
  // are so narrow that all of what is computed on the way stays in the processor's cache.
  constexpr int STRIPE = 64;  // [rows]
  const int reach = smooth.cols / 2 + window.cols / 2;
  const int stripes = std::max(1, image.rows / STRIPE);
  cv::parallel_for_(cv::Range(0, stripes), [&](const cv::Range& range) {
    for (int stripe = range.start; stripe < range.end; ++stripe)
    {
      const auto begin_of = [&](std::int64_t number) {
        return static_cast<int>(image.rows * number / stripes);
      };
      const int first = begin_of(stripe);
      const int last = begin_of(stripe + 1);
      const int top = std::max(0, first - reach);
      const int bottom = std::min(image.rows, last + reach);
      const cv::Mat part = image.rowRange(top, bottom);
      cv::Mat dx;
      cv::Mat dy;
      const int border = cv::BORDER_REFLECT_101 | cv::BORDER_ISOLATED;
      cv::sepFilter2D(part, dx, CV_32F, derivative, smooth, cv::Point(-1, -1), 0.0, border);
      cv::sepFilter2D(part, dy, CV_32F, smooth, derivative, cv::Point(-1, -1), 0.0, border);
      cv::Mat xx = dx.mul(dx);
      cv::Mat yy = dy.mul(dy);
      cv::Mat xy = dx.mul(dy);
      for (cv::Mat* moment : { &xx, &yy, &xy })
      {
        cv::sepFilter2D(*moment, *moment, CV_32F, window, window, cv::Point(-1, -1), 0.0, border);
      }
      const float k = static_cast<float>(params.k);
      for (int v = first; v < last; ++v)
      {
        const float* a = xx.ptr<float>(v - top);
        const float* b = yy.ptr<float>(v - top);
        const float* c = xy.ptr<float>(v - top);
        float* out = response.ptr<float>(v);
        for (int u = 0; u < image.cols; ++u)
        {
          const float trace = a[u] + b[u];
          out[u] = a[u] * b[u] - c[u] * c[u] - k * trace * trace;
        }
      }
    }
  });
  return response;
}

/** Stronger ones first; a total order, so that the result does not depend on the sorting algorithm. */
bool isStronger(const Peak& a, const Peak& b)
{
  return a.response != b.response ? a.response > b.response : (a.v != b.v ? a.v < b.v : a.u < b.u);
}

/** Whether a pixel may be a maximum, by its neighbours in the same row and column; tells four at once. */
bool anyMayBeMaximum(const float* above, const float* here, const float* below)
{
  const cv::v_float32x4 r = cv::v_load(here);
  const cv::v_float32x4 may = (r > cv::v_setzero_f32()) & (r >= cv::v_load(here - 1)) & (r > cv::v_load(here + 1)) &
                              (r >= cv::v_load(above)) & (r > cv::v_load(below));
  return cv::v_check_any(may);
}

/** In no order. */
std::vector<Peak> localMaxima(const cv::Mat& response, const cv::Mat& mask, int border)
{
  constexpr int LANES = 4;
  std::vector<Peak> peaks;
  const auto is_maximum = [](const float* above, const float* here, const float* below) {
    const float r = here[0];
    // Strict against the neighbours that come later and not strict before: a plateau of two gives one peak.
    return r > 0.0F && r >= here[-1] && r > here[1] && r >= above[-1] && r >= above[0] && r >= above[1] &&
           r > below[-1] && r > below[0] && r > below[1];
  };
  for (int v = border; v < response.rows - border; ++v)
  {
    const float* above = response.ptr<float>(v - 1);
    const float* here = response.ptr<float>(v);
    const float* below = response.ptr<float>(v + 1);
    const unsigned char* wanted = mask.empty() ? nullptr : mask.ptr<unsigned char>(v);
    const int end = response.cols - border;
    for (int u = border; u < end; u += LANES)
    {
      const bool whole = u + LANES < response.cols;
      if (whole && !anyMayBeMaximum(above + u, here + u, below + u))
      {
        continue;
      }
      for (int k = u; k < std::min(u + LANES, end); ++k)
      {
        if (is_maximum(above + k, here + k, below + k) && (wanted == nullptr || wanted[k] != 0))
        {
          peaks.push_back({ k, v, here[k] });
        }
      }
    }
  }
  return peaks;
}

/** Where the quadratic through the 3x3 neighbourhood (least squares) has its maximum, at most one pixel away. */
Eigen::Vector2d refinePeak(const cv::Mat& response, const Peak& peak)
{
  const auto r = [&](int du, int dv) {
    return static_cast<double>(response.at<float>(peak.v + dv, peak.u + du));
  };
  double gu = 0.0;
  double gv = 0.0;
  double huu = 0.0;
  double hvv = 0.0;
  for (int d = -1; d <= 1; ++d)
  {
    gu += (r(1, d) - r(-1, d)) / 6.0;
    gv += (r(d, 1) - r(d, -1)) / 6.0;
    huu += (r(1, d) - 2.0 * r(0, d) + r(-1, d)) / 3.0;
    hvv += (r(d, 1) - 2.0 * r(d, 0) + r(d, -1)) / 3.0;
  }
  const double huv = (r(1, 1) - r(1, -1) - r(-1, 1) + r(-1, -1)) / 4.0;
  const double det = huu * hvv - huv * huv;
  Eigen::Vector2d centre(peak.u, peak.v);
  if (huu >= 0.0 || det <= 0.0)
  {
    return centre;
  }
  const Eigen::Vector2d offset((huv * gv - hvv * gu) / det, (huv * gu - huu * gv) / det);
  return offset.cwiseAbs().maxCoeff() <= 1.0 ? Eigen::Vector2d(centre + offset) : centre;
}

}  // namespace

std::vector<Parameter> parameters(CornerParams& params)
{
  return {
    integer("max_corners", params.max_corners, "", "[1, 5000]", "corners kept in each image, strongest first"),
    real("derivative_sigma", params.derivative_sigma, "px", "[0.3, 20]", "scale of the Harris detector's derivatives"),
    real("integration_sigma", params.integration_sigma, "px", "(0, 20]", "scale of the Harris detector's window"),
    real("harris_k", params.k, "", "[0, 0.25)", "k in R = det(M) - k tr(M)^2"),
    real("corner_distance", params.min_distance, "px", "[0, 1000]", "smallest distance between corners"),
    real("corner_threshold", params.relative_threshold, "", "[0, 1)", "smallest response, as a part of the strongest"),
    integer("corner_border", params.border, "px", ">= 1", "no corner is closer to the image's border"),
  };
}

std::vector<std::string> CornerParams::validate() const
{
  return faultsOf(*this);
}

std::vector<Corner> detectCorners(const cv::Mat& image, const CornerParams& params, const cv::Mat& mask)
{
  if (image.type() != CV_8UC1)
  {
    throw std::invalid_argument("detectCorners: the image must be 8-bit with one channel");
  }
  if (!mask.empty() && (mask.type() != CV_8UC1 || mask.size() != image.size()))
  {
    throw std::invalid_argument("detectCorners: the mask must be 8-bit with one channel and of the image's size");
  }
  std::vector<Corner> corners;
  if (std::min(image.rows, image.cols) <= 2 * params.border)
  {
    return corners;
  }
  const cv::Mat response = harrisResponse(image, params);
  std::vector<Peak> peaks = localMaxima(response, mask, params.border);
  // Most are never looked at: a heap gives one after the other.
  const auto is_weaker = [](const Peak& a, const Peak& b) {
    return isStronger(b, a);
  };
  std::make_heap(peaks.begin(), peaks.end(), is_weaker);
  const double weakest = peaks.empty() ? 0.0 : params.relative_threshold * static_cast<double>(peaks.front().response);

  // Strongest first, each taken unless one already taken is too close; a grid keeps the search local.
  const double cell = params.min_distance + 2.0;  // refinement moves each of two peaks by a pixel at most
  const int grid_cols = static_cast<int>(image.cols / cell) + 1;
  const int grid_rows = static_cast<int>(image.rows / cell) + 1;
  std::vector<std::vector<int>> grid(static_cast<std::size_t>(grid_cols) * static_cast<std::size_t>(grid_rows));
  const auto cell_index = [&](int u, int v) {
    return static_cast<std::size_t>(v) * static_cast<std::size_t>(grid_cols) + static_cast<std::size_t>(u);
  };
  const double min_squared = params.min_distance * params.min_distance;
  for (; !peaks.empty() && static_cast<int>(corners.size()) < params.max_corners; peaks.pop_back())
  {
    std::pop_heap(peaks.begin(), peaks.end(), is_weaker);
    const Peak& peak = peaks.back();
    if (static_cast<double>(peak.response) < weakest)
    {
      break;
    }
    const Eigen::Vector2d position = refinePeak(response, peak);
    const int cu = static_cast<int>(peak.u / cell);
    const int cv = static_cast<int>(peak.v / cell);
    bool free = true;
    for (int gv = std::max(0, cv - 1); gv <= std::min(grid_rows - 1, cv + 1) && free; ++gv)
    {
      for (int gu = std::max(0, cu - 1); gu <= std::min(grid_cols - 1, cu + 1) && free; ++gu)
      {
        for (const int other : grid[cell_index(gu, gv)])
        {
          if ((corners[static_cast<std::size_t>(other)].position - position).squaredNorm() < min_squared)
          {
            free = false;
            break;
          }
        }
      }
    }
    if (free)
    {
      grid[cell_index(cu, cv)].push_back(static_cast<int>(corners.size()));
      corners.push_back({ position, peak.response });
    }
  }
  return corners;
}

}  // namespace view_servo
