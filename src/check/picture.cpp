// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/picture.h"

#include "view_servo/features/corners.h"
#include "view_servo/features/line_segments.h"
#include "view_servo/images/image_io.h"
#include "view_servo/robust/quantile.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace view_servo::check
{
namespace
{
constexpr double FINE = 1.0;    // scales at which edges are compared [px]
constexpr double COARSE = 3.0;  // [px]

/** Length of the gradient at a scale [grey levels/px]. */
cv::Mat gradientLength(const cv::Mat& grey, double sigma)
{
  cv::Mat smooth;
  grey.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, cv::Size(), sigma);
  cv::Mat dx;
  cv::Mat dy;
  cv::Sobel(smooth, dx, CV_32F, 1, 0, 1, 0.5);
  cv::Sobel(smooth, dy, CV_32F, 0, 1, 1, 0.5);
  cv::Mat length;
  cv::magnitude(dx, dy, length);
  return length;
}

/** Whether a pixel lies on the crest of the gradient's length: not below its neighbours along a row or a column. */
bool isCrest(const cv::Mat& length, int y, int x)
{
  const float value = length.at<float>(y, x);
  const bool along_row = value >= length.at<float>(y, x - 1) && value >= length.at<float>(y, x + 1);
  const bool along_column = value >= length.at<float>(y - 1, x) && value >= length.at<float>(y + 1, x);
  return along_row || along_column;
}

}  // namespace

double edgeWidth(const cv::Mat& grey)
{
  constexpr float CONTRAST = 4.0F;  // of the coarse gradient, well above noise [grey levels/px]
  constexpr std::size_t ENOUGH = 200;
  constexpr double LARGEST = 20.0;  // [px]
  const cv::Mat fine = gradientLength(grey, FINE);
  const cv::Mat coarse = gradientLength(grey, COARSE);
  std::vector<double> widths;
  for (int y = 1; y + 1 < grey.rows; ++y)
  {
    for (int x = 1; x + 1 < grey.cols; ++x)
    {
      if (coarse.at<float>(y, x) < CONTRAST || !isCrest(coarse, y, x))
      {
        continue;
      }
      // At a step that was blurred by s the gradient is proportional to 1 / sqrt(s^2 + scale^2).
      const double ratio = std::pow(fine.at<float>(y, x) / coarse.at<float>(y, x), 2.0);
      const double squared = (COARSE * COARSE - ratio * FINE * FINE) / (ratio - 1.0);
      widths.push_back(ratio <= 1.0 ? LARGEST : std::min(LARGEST, std::sqrt(std::max(0.0, squared))));
    }
  }
  if (widths.size() < ENOUGH)
  {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return medianOf(std::move(widths));
}

PictureMeasures measurePicture(const cv::Mat& grey)
{
  constexpr double WHITE = 250.0;
  PictureMeasures measures;
  measures.lack_of_light = lackOfLight(grey);
  measures.brightness = cv::mean(grey)[0];
  measures.overexposed = cv::countNonZero(grey >= WHITE) / static_cast<double>(grey.total());
  measures.edge_width = edgeWidth(grey);
  measures.corners = static_cast<int>(detectCorners(grey, CornerParams()).size());
  measures.segments = static_cast<int>(detectLineSegments(grey, LineSegmentParams()).size());
  return measures;
}

cv::Mat drawPicture(const cv::Mat& grey, const std::string& text)
{
  constexpr int CAPTION_HEIGHT = 28;  // [px]
  constexpr int SHIFT = 4;            // bits after the point in coordinates
  const cv::Scalar corner_colour(60, 220, 60);
  const cv::Scalar segment_colour(240, 160, 60);
  const auto fixed = [](double x, double y) {
    return cv::Point(cvRound(x * (1 << SHIFT)), cvRound(y * (1 << SHIFT)));
  };
  cv::Mat picture(grey.rows + CAPTION_HEIGHT, grey.cols, CV_8UC3, cv::Scalar(32, 32, 32));
  cv::Mat area = picture(cv::Rect(0, 0, grey.cols, grey.rows));
  cv::cvtColor(grey, area, cv::COLOR_GRAY2BGR);
  for (const Segment& segment : detectLineSegments(grey, LineSegmentParams()))
  {
    cv::line(area, fixed(segment.start.x(), segment.start.y()), fixed(segment.end.x(), segment.end.y()), segment_colour,
             1, cv::LINE_AA, SHIFT);
  }
  for (const Corner& corner : detectCorners(grey, CornerParams()))
  {
    cv::circle(area, fixed(corner.position.x(), corner.position.y()), 2 << SHIFT, corner_colour, cv::FILLED,
               cv::LINE_AA, SHIFT);
  }
  cv::putText(picture, text, cv::Point(8, grey.rows + CAPTION_HEIGHT - 9), cv::FONT_HERSHEY_SIMPLEX, 0.42,
              cv::Scalar(235, 235, 235), 1, cv::LINE_AA);
  return picture;
}

}  // namespace view_servo::check
