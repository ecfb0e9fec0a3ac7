// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera_warp.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace view_servo
{
namespace
{
Eigen::Matrix3d rotationBetween(const Camera& from, const Camera& to)
{
  return to.rectifyingRotation().transpose() * from.rectifyingRotation();
}

bool sameImages(const Camera& a, const Camera& b)
{
  const bool same_lens =
      (a.isPinhole() && b.isPinhole()) || (a.distortion_model == b.distortion_model && a.distortion == b.distortion);
  return same_lens && a.width == b.width && a.height == b.height && a.k == b.k;
}

/** Points on the plane z = 1, turned; NaN where they come behind it. */
Points turned(const Eigen::Matrix3d& rotation, const Points& points)
{
  Points result(points.size());
  std::transform(points.begin(), points.end(), result.begin(), [&](const Eigen::Vector2d& point) {
    const Eigen::Vector3d ray = rotation * point.homogeneous();
    return ray.z() > 0.0 ? Eigen::Vector2d(ray.hnormalized()) : Eigen::Vector2d(Eigen::Vector2d::Constant(NAN));
  });
  return result;
}

/** The largest part of a rectangle without zeros in `mask` that is found by moving its worst side again and again. */
cv::Rect withoutZeros(const cv::Mat& mask, cv::Rect rect)
{
  cv::Mat is_zero;
  cv::Mat sums;
  cv::threshold(mask, is_zero, 0.0, 1.0, cv::THRESH_BINARY_INV);
  cv::integral(is_zero, sums, CV_32S);
  const auto zeros = [&](const cv::Rect& part) {
    const cv::Point end = part.br();
    return sums.at<int>(end.y, end.x) - sums.at<int>(part.y, end.x) - sums.at<int>(end.y, part.x) +
           sums.at<int>(part.y, part.x);
  };
  while (!rect.empty() && zeros(rect) > 0)
  {
    const std::array<cv::Rect, 4> sides = { cv::Rect(rect.x, rect.y, 1, rect.height),
                                            cv::Rect(rect.br().x - 1, rect.y, 1, rect.height),
                                            cv::Rect(rect.x, rect.y, rect.width, 1),
                                            cv::Rect(rect.x, rect.br().y - 1, rect.width, 1) };
    const auto share = [&](const cv::Rect& side) {
      return static_cast<double>(zeros(side)) / side.area();
    };
    const auto worst = std::max_element(sides.begin(), sides.end(),
                                        [&](const cv::Rect& a, const cv::Rect& b) { return share(a) < share(b); }) -
                       sides.begin();
    rect.x += worst == 0 ? 1 : 0;
    rect.y += worst == 2 ? 1 : 0;
    rect.width -= worst < 2 ? 1 : 0;
    rect.height -= worst < 2 ? 0 : 1;
  }
  return rect;
}

}  // namespace

CameraWarp::CameraWarp(const Camera& from, const Camera& to)
  : from_(from), to_(to), rotation_(rotationBetween(from, to))
{
  for (const Camera* camera : { &from_, &to_ })
  {
    const std::string fault = camera->fault();
    if (!fault.empty())
    {
      throw std::invalid_argument(fault);
    }
  }
  constexpr double ROUNDING = 1e-9;
  active_ = !(sameImages(from_, to_) && rotation_.isIdentity(ROUNDING));
}

cv::Mat CameraWarp::image(const cv::Mat& image) const
{
  if (image.size() != cv::Size(from_.width, from_.height))
  {
    throw std::invalid_argument("an image of " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
                                " pixels is not of the camera of " + std::to_string(from_.width) + " x " +
                                std::to_string(from_.height));
  }
  if (!active_)
  {
    return image;
  }
  makeMap();
  constexpr double SHARP_ENOUGH = 1.1;
  const double reduction = from_.k(0, 0) / to_.k(0, 0);
  cv::Mat smooth = image;
  if (reduction > SHARP_ENOUGH)
  {
    const double sigma = 0.5 * std::sqrt(reduction * reduction - 1.0);  // against aliasing
    cv::GaussianBlur(image, smooth, cv::Size(), sigma, sigma, cv::BORDER_REPLICATE);
  }
  cv::Mat warped;
  cv::remap(smooth, warped, positions_, weights_, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return warped;
}

void CameraWarp::makeMap() const
{
  if (!positions_.empty())
  {
    return;
  }
  cv::Mat map(size(), CV_32FC2);
  seen_ = cv::Mat(size(), CV_8UC1);
  constexpr int ROWS = 64;  // at a time: the rays of all pixels of a large image take a gigabyte
  for (int top = 0; top < to_.height; top += ROWS)
  {
    const int bottom = std::min(top + ROWS, to_.height);
    Points pixels;
    pixels.reserve(static_cast<std::size_t>(to_.width) * static_cast<std::size_t>(bottom - top));
    for (int v = top; v < bottom; ++v)
    {
      for (int u = 0; u < to_.width; ++u)
      {
        pixels.emplace_back(u, v);
      }
    }
    const Points at = from_.distorted(turned(rotation_.transpose(), to_.normalized(pixels)));
    std::size_t i = 0;
    for (int v = top; v < bottom; ++v)
    {
      for (int u = 0; u < to_.width; ++u, ++i)
      {
        const bool inside =
            at[i].x() >= 0.0 && at[i].x() <= from_.width - 1.0 && at[i].y() >= 0.0 && at[i].y() <= from_.height - 1.0;
        map.at<cv::Vec2f>(v, u) =
            inside ? cv::Vec2f(static_cast<float>(at[i].x()), static_cast<float>(at[i].y())) : cv::Vec2f::all(-2.0F);
        seen_.at<unsigned char>(v, u) = inside ? 255 : 0;
      }
    }
  }
  cv::convertMaps(map, cv::noArray(), positions_, weights_, CV_16SC2);
}

Eigen::Vector2d CameraWarp::point(const Eigen::Vector2d& pixel) const
{
  return active_ ? to_.distorted(turned(rotation_, from_.normalized(Points{ pixel }))).front() : pixel;
}

cv::Rect CameraWarp::region(const cv::Rect& region) const
{
  constexpr int PARTS = 16;  // of each side: warped sides are curved
  if (!active_)
  {
    return region;
  }
  const cv::Rect image(cv::Point(), size());
  cv::Rect result = image;
  if (!region.empty())
  {
    Eigen::Vector2d least = Eigen::Vector2d::Constant(INFINITY);
    Eigen::Vector2d greatest = -least;
    for (int i = 0; i <= PARTS; ++i)
    {
      const double u = region.x + (region.width - 1.0) * i / PARTS;
      const double v = region.y + (region.height - 1.0) * i / PARTS;
      for (const Eigen::Vector2d& pixel :
           { Eigen::Vector2d(u, region.y), Eigen::Vector2d(u, region.y + region.height - 1.0),
             Eigen::Vector2d(region.x, v), Eigen::Vector2d(region.x + region.width - 1.0, v) })
      {
        const Eigen::Vector2d at = point(pixel);
        if (at.allFinite())
        {
          least = least.cwiseMin(at);
          greatest = greatest.cwiseMax(at);
        }
      }
    }
    const auto within = [](double value, int limit) {
      return std::clamp(value, 0.0, static_cast<double>(limit));
    };
    const cv::Point from(static_cast<int>(std::ceil(within(least.x(), to_.width))),
                         static_cast<int>(std::ceil(within(least.y(), to_.height))));
    const cv::Point to(static_cast<int>(std::floor(within(greatest.x(), to_.width - 1))) + 1,
                       static_cast<int>(std::floor(within(greatest.y(), to_.height - 1))) + 1);
    result = greatest.x() < 0.0 || greatest.y() < 0.0 ? cv::Rect() : cv::Rect(from, to) & image;
  }
  makeMap();
  return withoutZeros(seen_, result);
}

Eigen::Matrix3d CameraWarp::homography() const
{
  return to_.k * rotation_ * from_.k.inverse();
}

}  // namespace view_servo
