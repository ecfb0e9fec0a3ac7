// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/edges.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>

namespace view_servo
{
namespace
{
/** A pixel at which the gradient is steepest across the edge. */
struct EdgePixel
{
  int u;
  int v;
  Eigen::Vector2f position;
  Eigen::Vector2f across;  ///< unit vector towards the brighter side
  float magnitude;

  /** Unit vector along the edge, with the brighter side on the left. */
  Eigen::Vector2f along() const
  {
    return { -across.y(), across.x() };
  }
};

/** Gradient of a part of an image [grey levels/px]. */
struct Gradient
{
  cv::Mat du;
  cv::Mat dv;
  cv::Mat magnitude;
};

/** Scharr's operator is in itself a Gaussian derivative of about this variance [px²]. */
constexpr double SCHARR_VARIANCE = 0.35;

Gradient gradientOf(const cv::Mat& grey, double sigma)
{
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32F);
  const double rest = std::sqrt(std::max(0.0, sigma * sigma - SCHARR_VARIANCE));
  if (rest > 0.1)
  {
    const int size = 2 * static_cast<int>(std::ceil(3.0 * rest)) + 1;
    cv::GaussianBlur(smooth, smooth, cv::Size(size, size), rest);
  }
  Gradient gradient;
  constexpr double SCHARR_GAIN = 32.0;
  cv::Scharr(smooth, gradient.du, CV_32F, 1, 0, 1.0 / SCHARR_GAIN);
  cv::Scharr(smooth, gradient.dv, CV_32F, 0, 1, 1.0 / SCHARR_GAIN);
  cv::magnitude(gradient.du, gradient.dv, gradient.magnitude);
  return gradient;
}

/**
 * The pixels inside `inner` that are steeper than their two neighbours along the axis closest to the gradient. The
 * parabola through the three gives the sub-pixel position along that axis: the profile of a straight edge along an axis
 * is the one across it, stretched, and nothing needs to be interpolated (Devernay 1995).
 */
std::vector<EdgePixel> steepestPixels(const Gradient& gradient, const cv::Rect& inner, float threshold)
{
  std::vector<EdgePixel> pixels;
  const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(gradient.magnitude.step1());
  for (int v = inner.y; v < inner.y + inner.height; ++v)
  {
    const float* magnitude = gradient.magnitude.ptr<float>(v);
    const float* du = gradient.du.ptr<float>(v);
    const float* dv = gradient.dv.ptr<float>(v);
    for (int u = inner.x; u < inner.x + inner.width; ++u)
    {
      const float here = magnitude[u];
      if (here < threshold)
      {
        continue;
      }
      const bool horizontal = std::abs(du[u]) > std::abs(dv[u]);
      const std::ptrdiff_t step = horizontal ? 1 : stride;
      const float before = magnitude[u - step];
      const float after = magnitude[u + step];
      // Strict on one side only: of two equal neighbours one is taken.
      if (here <= before || here < after)
      {
        continue;
      }
      const float offset = 0.5F * (before - after) / (before - 2.0F * here + after);
      Eigen::Vector2f position(static_cast<float>(u), static_cast<float>(v));
      position[horizontal ? 0 : 1] += offset;
      pixels.push_back({ u, v, position, Eigen::Vector2f(du[u], dv[u]) / here, here });
    }
  }
  return pixels;
}

/** Links edge pixels to chains: each has at most one successor and one predecessor (Devernay 1995). */
class Linker
{
public:
  Linker(const std::vector<EdgePixel>& pixels, const cv::Size& size)
    : pixels_(pixels),
      index_(size.height + 2 * PADDING, size.width + 2 * PADDING, CV_32S, cv::Scalar(NONE)),
      next_(pixels.size(), NONE),
      previous_(pixels.size(), NONE)
  {
    for (std::size_t i = 0; i < pixels.size(); ++i)
    {
      index_.at<int>(pixels[i].v + PADDING, pixels[i].u + PADDING) = static_cast<int>(i);
    }
    for (int i = 0; i < static_cast<int>(pixels.size()); ++i)
    {
      link(i, neighbour(i, 1.0F));
      link(neighbour(i, -1.0F), i);
    }
  }

  /** The chains of at least `min_points` pixels of which one is as steep as `threshold`, moved by `origin`. */
  std::vector<EdgeChain> chains(int min_points, float threshold, const Eigen::Vector2d& origin) const
  {
    std::vector<EdgeChain> chains;
    std::vector<bool> taken(pixels_.size(), false);
    EdgeChain chain;
    for (int i = 0; i < static_cast<int>(pixels_.size()); ++i)
    {
      if (taken[at(i)])
      {
        continue;
      }
      int first = i;
      while (previous_[at(first)] != NONE && previous_[at(first)] != i)
      {
        first = previous_[at(first)];
      }
      chain.clear();
      float steepest = 0.0F;
      int pixel = first;
      for (; pixel != NONE && !taken[at(pixel)]; pixel = next_[at(pixel)])
      {
        taken[at(pixel)] = true;
        steepest = std::max(steepest, pixels_[at(pixel)].magnitude);
        chain.emplace_back(pixels_[at(pixel)].position.cast<double>() + origin);
      }
      if (static_cast<int>(chain.size()) < min_points || steepest < threshold)
      {
        continue;
      }
      if (pixel != NONE)
      {
        close(chain);
      }
      chains.push_back(chain);
    }
    return chains;
  }

private:
  static constexpr int NONE = -1;
  static constexpr int PADDING = 3;  ///< as far as a pixel's neighbour may lie [px]

  static std::size_t at(int pixel)
  {
    return static_cast<std::size_t>(pixel);
  }

  /** Makes a chain that ends beside its start begin and end at its point farthest from its middle. */
  static void close(EdgeChain& chain)
  {
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& point : chain)
    {
      middle += point / static_cast<double>(chain.size());
    }
    const auto farthest =
        std::max_element(chain.begin(), chain.end(), [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
          return (a - middle).squaredNorm() < (b - middle).squaredNorm();
        });
    std::rotate(chain.begin(), farthest, chain.end());
    chain.push_back(chain.front());
  }

  float squaredDistance(int a, int b) const
  {
    return (pixels_[at(a)].position - pixels_[at(b)].position).squaredNorm();
  }

  /**
   * Of the edge pixels in the 3x3 block around (u, v) the nearest to `pixel` that lies more or less `ahead` of it and
   * whose gradient has turned by less than 90 degrees; NONE if there is none.
   */
  int nearestIn(int u, int v, int pixel, const Eigen::Vector2f& ahead) const
  {
    constexpr float COS_MAX_ASIDE = 0.7F;
    const EdgePixel& here = pixels_[at(pixel)];
    int best = NONE;
    float best_squared = 0.0F;
    for (int dv = -1; dv <= 1; ++dv)
    {
      const int* row = index_.ptr<int>(v + dv + PADDING) + u + PADDING;
      for (int du = -1; du <= 1; ++du)
      {
        const int candidate = row[du];
        if (candidate == NONE || candidate == pixel)
        {
          continue;
        }
        const EdgePixel& there = pixels_[at(candidate)];
        const Eigen::Vector2f step = there.position - here.position;
        const float squared = step.squaredNorm();
        const float forward = ahead.dot(step);
        if (forward > 0.0F && forward * forward >= COS_MAX_ASIDE * COS_MAX_ASIDE * squared &&
            here.across.dot(there.across) > 0.0F && (best == NONE || squared < best_squared))
        {
          best = candidate;
          best_squared = squared;
        }
      }
    }
    return best;
  }

  /**
   * The edge pixel that continues the edge at `pixel` ahead (`sense` 1) or behind (-1): one of the eight neighbours or,
   * where noise broke the edge, one a little farther along it.
   */
  int neighbour(int pixel, float sense) const
  {
    const EdgePixel& here = pixels_[at(pixel)];
    const Eigen::Vector2f ahead = sense * here.along();
    const int adjacent = nearestIn(here.u, here.v, pixel, ahead);
    if (adjacent != NONE)
    {
      return adjacent;
    }
    const Eigen::Vector2f farther = here.position + 1.5F * ahead;
    return nearestIn(cvRound(farther.x()), cvRound(farther.y()), pixel, ahead);
  }

  /** Makes `to` the successor of `from` unless one of them has a nearer one. */
  void link(int from, int to)
  {
    if (from == NONE || to == NONE || next_[at(from)] == to)
    {
      return;
    }
    const float squared = squaredDistance(from, to);
    const int old_next = next_[at(from)];
    const int old_previous = previous_[at(to)];
    if ((old_next != NONE && squaredDistance(from, old_next) <= squared) ||
        (old_previous != NONE && squaredDistance(old_previous, to) <= squared))
    {
      return;
    }
    if (old_next != NONE)
    {
      previous_[at(old_next)] = NONE;
    }
    if (old_previous != NONE)
    {
      next_[at(old_previous)] = NONE;
    }
    next_[at(from)] = to;
    previous_[at(to)] = from;
  }

  const std::vector<EdgePixel>& pixels_;
  cv::Mat index_;
  std::vector<int> next_;
  std::vector<int> previous_;
};

}  // namespace

std::vector<Parameter> edgeParameters(double& sigma, double& low_threshold, double& high_threshold)
{
  return {
    real("edge_sigma", sigma, "px", "[0.6, 20]", "scale of the edges: about 1 for fine, 2 for coarse ones"),
    real("edge_low_threshold", low_threshold, "grey levels/px", "> 0", "canny: least slope all along an edge"),
    real("edge_high_threshold", high_threshold, "grey levels/px", ">= edge_low_threshold",
         "canny: least slope somewhere on an edge"),
  };
}

std::vector<Parameter> parameters(EdgeParams& params)
{
  return joined({ edgeParameters(params.sigma, params.low_threshold, params.high_threshold),
                  { integer("edge_min_points", params.min_points, "", ">= 2", "pixels of the shortest edge") } });
}

std::vector<std::string> EdgeParams::validate() const
{
  return faultsOf(*this);
}

std::vector<EdgeChain> detectEdges(const cv::Mat& grey, const EdgeParams& params, const cv::Rect& region)
{
  if (grey.type() != CV_8UC1)
  {
    throw std::invalid_argument("detectEdges: the image must be 8-bit with one channel");
  }
  // The outermost pixels have no neighbours to be compared with, and next to them there is often the image's own frame.
  constexpr int BORDER = 2;
  const cv::Rect image(0, 0, grey.cols, grey.rows);
  const cv::Rect inner(BORDER, BORDER, grey.cols - 2 * BORDER, grey.rows - 2 * BORDER);
  const cv::Rect wanted = region.empty() ? inner : inner & region;
  if (wanted.empty())
  {
    return {};
  }
  const int reach = static_cast<int>(std::ceil(3.0 * params.sigma)) + 2;
  const cv::Rect outer =
      image & cv::Rect(wanted.x - reach, wanted.y - reach, wanted.width + 2 * reach, wanted.height + 2 * reach);
  const Gradient gradient = gradientOf(grey(outer), params.sigma);
  const std::vector<EdgePixel> pixels =
      steepestPixels(gradient, wanted - outer.tl(), static_cast<float>(params.low_threshold));

  return Linker(pixels, outer.size())
      .chains(params.min_points, static_cast<float>(params.high_threshold), Eigen::Vector2d(outer.x, outer.y));
}

}  // namespace view_servo
