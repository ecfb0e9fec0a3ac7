// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/prepared_image.h"

#include "view_servo/images/image_io.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr int MIN_SIDE = 64;        // of a reduced image [px]
constexpr int MIN_SIDE_WIDTH = 32;  // of an image from the side, which is compressed in one direction only [px]
}  // namespace

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
    if (number < SCALES)
    {
      reduce(wanted, number);
    }
    else
    {
      lookFromSide(wanted, number - SCALES);
    }
  });
  return wanted.image;
}

void PreparedImage::reduce(Level& wanted, int number) const
{
  wanted.to_full.setIdentity();
  if (number == 0)
  {
    wanted.image = grey_;
    return;
  }
  const double scale = std::pow(2.0, -0.5 * number);
  const cv::Size size(static_cast<int>(std::lround(grey_.cols * scale)),
                      static_cast<int>(std::lround(grey_.rows * scale)));
  if (std::min(size.width, size.height) < MIN_SIDE)
  {
    return;
  }
  cv::resize(grey_, wanted.image, size, 0.0, 0.0, cv::INTER_AREA);
  const double sx = static_cast<double>(grey_.cols) / size.width;
  const double sy = static_cast<double>(grey_.rows) / size.height;
  // The image's edge is half a pixel before the centre of its first pixel.
  wanted.to_full << sx, 0.0, 0.5 * (sx - 1.0), 0.0, sy, 0.5 * (sy - 1.0), 0.0, 0.0, 1.0;
}

void PreparedImage::lookFromSide(Level& wanted, int side) const
{
  constexpr int EDGE = 4;  // of the picture within the level, which shows no corner of the scene [px]
  wanted.to_full.setIdentity();
  // Turned so that the direction of compression is the horizontal one, with the region's bounding box from (0, 0) on.
  const double angle = M_PI * side / SIDES;
  Eigen::Matrix2d turn;
  turn << std::cos(angle), std::sin(angle), -std::sin(angle), std::cos(angle);
  const Eigen::Vector2d first(region_.x, region_.y);
  const Eigen::Vector2d extent(region_.width - 1.0, region_.height - 1.0);
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Vector2d high = -low;
  for (const Eigen::Vector2d& corner :
       { Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(extent.x(), 0.0), extent, Eigen::Vector2d(0.0, extent.y()) })
  {
    const Eigen::Vector2d turned = turn * (first + corner);
    low = low.cwiseMin(turned);
    high = high.cwiseMax(turned);
  }
  const cv::Size turned_size(static_cast<int>(std::ceil(high.x() - low.x())) + 1,
                             static_cast<int>(std::ceil(high.y() - low.y())) + 1);
  const cv::Size size(static_cast<int>(std::lround(turned_size.width / TILT)), turned_size.height);
  constexpr int LONGEST = std::numeric_limits<short>::max() - 1;  // side of an image that cv::warpAffine() takes [px]
  const int longest = std::max({ grey_.cols, grey_.rows, turned_size.width, turned_size.height });
  if (size.width < MIN_SIDE_WIDTH || longest > LONGEST)
  {
    return;
  }
  const cv::Matx23d to_turned(turn(0, 0), turn(0, 1), -low.x(), turn(1, 0), turn(1, 1), -low.y());
  cv::Mat turned;
  cv::warpAffine(grey_, turned, to_turned, turned_size, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  cv::resize(turned, wanted.image, size, 0.0, 0.0, cv::INTER_AREA);
  cv::Mat shown = cv::Mat::zeros(grey_.size(), CV_8UC1);
  shown(region_).setTo(255);
  cv::Mat turned_mask;
  cv::warpAffine(shown, turned_mask, to_turned, turned_size, cv::INTER_NEAREST, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::resize(turned_mask, wanted.mask, size, 0.0, 0.0, cv::INTER_NEAREST);
  cv::erode(wanted.mask, wanted.mask, cv::Mat(), cv::Point(-1, -1), EDGE, cv::BORDER_CONSTANT, cv::Scalar(0));

  const double sx = static_cast<double>(turned_size.width) / size.width;
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity();
  stretch(0, 0) = sx;
  stretch(0, 2) = 0.5 * (sx - 1.0);
  Eigen::Matrix3d back = Eigen::Matrix3d::Identity();
  back.topLeftCorner<2, 2>() = turn.transpose();
  back.topRightCorner<2, 1>() = turn.transpose() * low;
  wanted.to_full = back * stretch;
}

Eigen::Matrix3d PreparedImage::toFull(int number) const
{
  image(number);
  return level(number).to_full;
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
    cv::Mat mask = wanted.mask;
    if (mask.empty() && region_.size() != grey_.size())
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

std::string exposureNote(const PreparedImage& reference, const PreparedImage& current)
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
