// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/prepared_image.h"

#include "view_servo/images/image_io.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr int MIN_SIDE = 64;  // of a reduced image [px]
}

PreparedImage::PreparedImage(cv::Mat grey, const cv::Rect& region, const FeatureParams& params)
  : grey_(std::move(grey)), region_(region), params_(params)
{
  if (grey_.type() != CV_8UC1 || grey_.empty())
  {
    throw std::invalid_argument("PreparedImage: the image must be 8-bit with one channel");
  }
  const cv::Rect whole(0, 0, grey_.cols, grey_.rows);
  if (region_.area() > 0 && (region_ & whole) != region_)
  {
    throw std::invalid_argument("PreparedImage: the region of interest leaves the image");
  }
  if (region_.area() <= 0)
  {
    region_ = whole;
  }
}

PreparedImage::Level& PreparedImage::level(int number) const
{
  return levels_.at(static_cast<std::size_t>(number));
}

const cv::Mat& PreparedImage::image(int number) const
{
  Level& wanted = level(number);
  std::call_once(wanted.image_once, [&] {
    if (number == 0)
    {
      wanted.image = grey_;
      return;
    }
    const double scale = std::pow(2.0, -0.5 * number);
    const cv::Size size(static_cast<int>(std::lround(grey_.cols * scale)),
                        static_cast<int>(std::lround(grey_.rows * scale)));
    if (std::min(size.width, size.height) >= MIN_SIDE)
    {
      cv::resize(grey_, wanted.image, size, 0.0, 0.0, cv::INTER_AREA);
    }
  });
  return wanted.image;
}

Eigen::Matrix3d PreparedImage::toFull(int number) const
{
  const cv::Mat& reduced = image(number);
  const double sx = reduced.empty() ? 1.0 : static_cast<double>(grey_.cols) / reduced.cols;
  const double sy = reduced.empty() ? 1.0 : static_cast<double>(grey_.rows) / reduced.rows;
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  map(0, 0) = sx;
  map(1, 1) = sy;
  map(0, 2) = 0.5 * (sx - 1.0);  // the image's edge is half a pixel before the centre of its first pixel
  map(1, 2) = 0.5 * (sy - 1.0);
  return map;
}

const PointFeatures& PreparedImage::points(int number) const
{
  Level& wanted = level(number);
  std::call_once(wanted.points_once, [&] {
    const cv::Mat& reduced = image(number);
    wanted.points.profiles.coefficients = params_.points.profiles.coefficients;
    if (reduced.empty())
    {
      return;
    }
    cv::Mat mask;
    if (region_.size() != grey_.size())
    {
      cv::Mat full = cv::Mat::zeros(grey_.size(), CV_8UC1);
      full(region_).setTo(255);
      cv::resize(full, mask, reduced.size(), 0.0, 0.0, cv::INTER_NEAREST);
    }
    wanted.points = extractPointFeatures(reduced, params_.points, mask);
  });
  return wanted.points;
}

const ProfileIndex& PreparedImage::profileIndex(int number) const
{
  Level& wanted = level(number);
  const PointFeatures& features = points(number);
  std::call_once(wanted.index_once, [&] { wanted.index = std::make_unique<ProfileIndex>(features.profiles); });
  return *wanted.index;
}

const LineFeatures& PreparedImage::lines() const
{
  std::call_once(lines_once_, [&] {
    lines_ = std::make_unique<LineFeatures>(grey_, detectLineSegments(grey_, params_.segments, region_), params_.lines);
  });
  return *lines_;
}

std::string noteOfLight(const PreparedImage& reference, const PreparedImage& current)
{
  std::string note;
  for (const auto& [image, name] : { std::pair(&reference, "reference"), std::pair(&current, "current image") })
  {
    const std::string lack = lackOfLight(image->grey()(image->region()));
    note += lack.empty() ? "" : std::string("; the ") + name + " is " + lack;
  }
  return note;
}

}  // namespace view_servo
