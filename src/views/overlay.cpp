// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/overlay.h"

#include "view_servo/geometry/homography.h"

#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iomanip>
#include <sstream>
#include <string>

namespace view_servo
{
namespace
{
/** The images are scaled so that their widths add up to something between these [px]. */
constexpr double MIN_OVERLAY_WIDTH = 800.0;
constexpr double MAX_WIDTH = 1600.0;
constexpr double MIN_FOLLOWED_WIDTH = 400.0;  // of a single one [px]

constexpr int GAP = 4;              // between the images [px]
constexpr int CAPTION_HEIGHT = 30;  // [px]
constexpr double LINE_OPACITY = 0.45;
constexpr double DIMMED = 0.6;  // brightness of the images under matched segments

/** More matched segments than these are not numbered: the numbers would hide each other. */
constexpr std::size_t MAX_NUMBERS = 60;

/** Coordinates handed to OpenCV are fixed-point numbers with this many fractional bits. */
constexpr int SHIFT = 4;

/** Parts into which a side of the outline is cut, so that one that crosses the horizon is drawn as far as it goes. */
constexpr int OUTLINE_PARTS = 100;

const cv::Scalar BACKGROUND(32, 32, 32);
const cv::Scalar CAPTION_COLOUR(235, 235, 235);
const cv::Scalar CANDIDATE_COLOUR(150, 150, 150);
const cv::Scalar OUTLINE_COLOUR(80, 255, 255);
const cv::Scalar FOUND_COLOUR(60, 220, 60);
const cv::Scalar MISSING_COLOUR(60, 60, 240);
const cv::Scalar PATH_COLOUR(240, 160, 60);

/** Where an image lies in the picture. */
struct Placement
{
  cv::Rect area;
  double scale;

  /** Pixel of the image -> point of the picture, scaled about the pixels' outer corners as cv::resize() does. */
  Eigen::Vector2d operator()(const Eigen::Vector2d& pixel) const
  {
    const Eigen::Vector2d half(0.5, 0.5);
    return (pixel + half) * scale - half + Eigen::Vector2d(area.x, area.y);
  }
};

/** The part of the picture that shows an image; what is drawn on it ends at the image's border. */
struct Canvas
{
  cv::Mat area;
  Placement place;  ///< in the area

  Canvas(const Placement& placement, cv::Mat& picture)
    : area(picture(placement.area)), place{ cv::Rect(cv::Point(), placement.area.size()), placement.scale }
  {
  }
};

cv::Point fixedPoint(const Eigen::Vector2d& point)
{
  const double one = 1 << SHIFT;
  return { cvRound(point.x() * one), cvRound(point.y() * one) };
}

void drawLine(cv::Mat& picture, const Eigen::Vector2d& from, const Eigen::Vector2d& to, const cv::Scalar& colour,
              int thickness)
{
  cv::line(picture, fixedPoint(from), fixedPoint(to), colour, thickness, cv::LINE_AA, SHIFT);
}

void drawDot(cv::Mat& picture, const Eigen::Vector2d& centre, double radius, const cv::Scalar& colour)
{
  cv::circle(picture, fixedPoint(centre), cvRound(radius * (1 << SHIFT)), colour, cv::FILLED, cv::LINE_AA, SHIFT);
}

/** @param hue in [0, 180). @param saturation, value in [0, 255]. */
cv::Scalar colourOf(double hue, double saturation, double value)
{
  const cv::Mat hsv(1, 1, CV_8UC3, cv::Scalar(hue, saturation, value));
  cv::Mat bgr;
  cv::cvtColor(hsv, bgr, cv::COLOR_HSV2BGR);
  return cv::Scalar(bgr.at<cv::Vec3b>(0, 0));
}

/** Hue by the place from left to right, brightness from top to bottom. */
cv::Scalar colourOf(const Eigen::Vector2d& pixel, const cv::Size& size)
{
  const double x = std::clamp(pixel.x() / size.width, 0.0, 1.0);
  const double y = std::clamp(pixel.y() / size.height, 0.0, 1.0);
  return colourOf(150.0 * x, 210.0, 255.0 - 80.0 * y);
}

/** Hues a golden angle apart: any few that follow each other are unlike. */
cv::Scalar colourOfRank(std::size_t rank)
{
  constexpr double GOLDEN_ANGLE = 137.50776 / 2.0;  // [OpenCV's hue]
  return colourOf(std::fmod(static_cast<double>(rank) * GOLDEN_ANGLE, 180.0), 190.0, 255.0);
}

void drawImage(const cv::Mat& grey, const Placement& placement, cv::Mat& picture)
{
  cv::Mat scaled;
  cv::resize(grey, scaled, placement.area.size(), 0.0, 0.0, placement.scale < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  cv::cvtColor(scaled, picture(placement.area), cv::COLOR_GRAY2BGR);
}

/** The border of a rectangle of pixels, closed. */
Points outline(const cv::Rect& region)
{
  const double left = region.x - 0.5;
  const double top = region.y - 0.5;
  const double right = left + region.width;
  const double bottom = top + region.height;
  const Points corners{ { left, top }, { right, top }, { right, bottom }, { left, bottom }, { left, top } };
  Points points;
  for (std::size_t side = 0; side + 1 < corners.size(); ++side)
  {
    for (int part = 0; part < OUTLINE_PARTS; ++part)
    {
      const double t = static_cast<double>(part) / OUTLINE_PARTS;
      points.emplace_back((1.0 - t) * corners[side] + t * corners[side + 1]);
    }
  }
  points.push_back(corners.front());
  return points;
}

/** A homography up to scale, with the sign for which transfer() takes the inliers as in front of the camera. */
Eigen::Matrix3d facingInliers(const ViewMatch& match)
{
  const auto is_inlier = [](const MatchedPoint& point) {
    return point.inlier;
  };
  const auto inlier = std::find_if(match.matches.begin(), match.matches.end(), is_inlier);
  const bool behind =
      inlier != match.matches.end() && match.matrix.row(2).dot(inlier->position.reference.homogeneous()) < 0.0;
  return behind ? Eigen::Matrix3d(-match.matrix) : match.matrix;
}

/** Draws lines from point to point of an image; parts with NaN or far outside are left out. */
void drawPolyline(const Points& points, const cv::Scalar& colour, int thickness, Canvas canvas)
{
  const double far = 10.0 * MAX_WIDTH;
  const auto drawable = [&](const Eigen::Vector2d& point) {
    return point.allFinite() && point.cwiseAbs().maxCoeff() < far;
  };
  for (std::size_t i = 0; i + 1 < points.size(); ++i)
  {
    const Eigen::Vector2d from = canvas.place(points[i]);
    const Eigen::Vector2d to = canvas.place(points[i + 1]);
    if (drawable(from) && drawable(to))
    {
      drawLine(canvas.area, from, to, colour, thickness);
    }
  }
}

std::string caption(const ViewMatch& match)
{
  if (match.outcome != MatchOutcome::MATCHED)
  {
    return match.message;
  }
  std::ostringstream text;
  text << match.message << ", rms error " << std::fixed << std::setprecision(2) << match.rms_error << " px";
  if (match.planes.size() > 1)
  {
    text << "; beads: further planes";
  }
  return text.str();
}

/** Writes one line, as large as fits. */
void writeCaption(const std::string& text, cv::Mat area)
{
  const int font = cv::FONT_HERSHEY_SIMPLEX;
  const int margin = 8;
  int baseline = 0;
  const cv::Size size = cv::getTextSize(text, font, 1.0, 1, &baseline);
  const double fitting = static_cast<double>(area.cols - 2 * margin) / std::max(size.width, 1);
  const double font_scale = std::min(0.55, fitting);
  const cv::Point origin(margin, area.rows / 2 + cvRound(0.5 * font_scale * size.height));
  cv::putText(area, text, origin, font, font_scale, CAPTION_COLOUR, 1, cv::LINE_AA);
}

void drawMatches(const ViewMatch& match, const cv::Size& reference_size, const Placement& left, const Placement& right,
                 cv::Mat& picture)
{
  cv::Mat lines = picture.clone();
  for (const MatchedPoint& point : match.matches)
  {
    if (point.inlier)
    {
      drawLine(lines, left(point.position.reference), right(point.position.current),
               colourOf(point.position.reference, reference_size), 1);
    }
  }
  // Many lines over an image would hide it.
  cv::addWeighted(lines, LINE_OPACITY, picture, 1.0 - LINE_OPACITY, 0.0, picture);

  for (const MatchedPoint& point : match.matches)
  {
    const cv::Scalar colour = point.inlier ? colourOf(point.position.reference, reference_size) : CANDIDATE_COLOUR;
    const double radius = point.inlier ? 2.5 : 1.5;
    drawDot(picture, left(point.position.reference), radius, colour);
    drawDot(picture, right(point.position.current), radius, colour);
  }
}

/**
 * A matched segment, in two strokes so that it stands out from any ground. Those of the first plane are plain, those of
 * the n-th carry n - 1 white beads, those of none are thin.
 */
void drawSegment(const Segment& segment, int plane, const cv::Scalar& colour, Canvas& canvas)
{
  const Eigen::Vector2d start = canvas.place(segment.start);
  const Eigen::Vector2d end = canvas.place(segment.end);
  const int thickness = plane < 0 ? 1 : 2;
  drawLine(canvas.area, start, end, BACKGROUND, thickness + 2);
  drawLine(canvas.area, start, end, colour, thickness);
  constexpr double BEAD_DISTANCE = 7.0;
  for (int bead = 0; bead < plane; ++bead)
  {
    const double offset = (bead - 0.5 * (plane - 1)) * BEAD_DISTANCE;
    const Eigen::Vector2d at = 0.5 * (start + end) + offset * segment.direction();
    drawDot(canvas.area, at, 3.5, BACKGROUND);
    drawDot(canvas.area, at, 2.5, CAPTION_COLOUR);
  }
}

/** Beside the middle of a segment. */
void drawNumber(const std::string& number, const Segment& segment, const cv::Scalar& colour, Canvas& canvas)
{
  constexpr double FONT_SCALE = 0.4;
  constexpr double DISTANCE = 9.0;
  const int font = cv::FONT_HERSHEY_SIMPLEX;
  const Eigen::Vector2d centre = canvas.place(segment.midpoint()) + DISTANCE * segment.normal();
  int baseline = 0;
  const cv::Size size = cv::getTextSize(number, font, FONT_SCALE, 1, &baseline);
  const cv::Point origin(cvRound(centre.x() - 0.5 * size.width), cvRound(centre.y() + 0.5 * size.height));
  cv::putText(canvas.area, number, origin, font, FONT_SCALE, BACKGROUND, 3, cv::LINE_AA);
  cv::putText(canvas.area, number, origin, font, FONT_SCALE, colour, 1, cv::LINE_AA);
}

/** Matched segments in both images, a pair in one colour, and their intersections. */
void drawLines(const ViewMatch& match, Canvas left, Canvas right)
{
  left.area *= DIMMED;
  right.area *= DIMMED;
  // Where segments cross they hide this; an intersection off them is what needs to be shown.
  constexpr double INTERSECTION_RADIUS = 1.3;
  for (const MatchedPoint& point : match.matches)
  {
    const cv::Scalar& colour = point.inlier ? OUTLINE_COLOUR : CANDIDATE_COLOUR;
    drawDot(left.area, left.place(point.position.reference), INTERSECTION_RADIUS, colour);
    drawDot(right.area, right.place(point.position.current), INTERSECTION_RADIUS, colour);
  }
  // The best come last and so on top.
  for (std::size_t rank = match.lines.size(); rank-- > 0;)
  {
    const MatchedLine& line = match.lines[rank];
    drawSegment(line.reference, line.plane, colourOfRank(rank), left);
    drawSegment(line.current, line.plane, colourOfRank(rank), right);
  }
  for (std::size_t rank = 0; rank < match.lines.size() && match.lines.size() <= MAX_NUMBERS; ++rank)
  {
    const std::string number = std::to_string(rank + 1);
    drawNumber(number, match.lines[rank].reference, colourOfRank(rank), left);
    drawNumber(number, match.lines[rank].current, colourOfRank(rank), right);
  }
}

}  // namespace

cv::Mat drawOverlay(const PreparedImage& reference, const PreparedImage& current, const ViewMatch& match)
{
  const cv::Size reference_size = reference.grey().size();
  const cv::Size current_size = current.grey().size();
  const double width = reference_size.width + current_size.width;
  const double scale = std::clamp(width, MIN_OVERLAY_WIDTH, MAX_WIDTH) / width;
  const auto scaled = [&](const cv::Size& size) {
    return cv::Size(std::max(cvRound(size.width * scale), 1), std::max(cvRound(size.height * scale), 1));
  };
  const Placement left{ cv::Rect(cv::Point(0, 0), scaled(reference_size)), scale };
  const Placement right{ cv::Rect(cv::Point(left.area.width + GAP, 0), scaled(current_size)), scale };
  const cv::Rect images = left.area | right.area;

  cv::Mat picture(images.height + CAPTION_HEIGHT, images.width, CV_8UC3, BACKGROUND);
  drawImage(reference.grey(), left, picture);
  drawImage(current.grey(), right, picture);
  if (match.lines.empty())
  {
    drawMatches(match, reference_size, left, right, picture);
  }
  else
  {
    drawLines(match, { left, picture }, { right, picture });
  }
  if (match.outcome == MatchOutcome::MATCHED && match.model == GeometryModel::HOMOGRAPHY && match.planes.size() < 2)
  {
    Points polygon = outline(reference.region());
    drawPolyline(polygon, OUTLINE_COLOUR, 2, { left, picture });
    const Eigen::Matrix3d h = facingInliers(match);
    std::transform(polygon.begin(), polygon.end(), polygon.begin(),
                   [&](const Eigen::Vector2d& point) { return transfer(h, point); });
    drawPolyline(polygon, OUTLINE_COLOUR, 2, { right, picture });
  }
  writeCaption(caption(match), picture.rowRange(images.height, picture.rows));
  return picture;
}

cv::Mat drawFollowedView(const cv::Mat& current, const FollowedView& view)
{
  const double width = current.cols;
  const double scale = std::clamp(width, MIN_FOLLOWED_WIDTH, MAX_WIDTH) / width;
  const cv::Size size(cvRound(width * scale), std::max(cvRound(current.rows * scale), 1));
  const Placement place{ cv::Rect(cv::Point(), size), scale };
  cv::Mat picture(size.height + CAPTION_HEIGHT, size.width, CV_8UC3, BACKGROUND);
  drawImage(current, place, picture);
  Canvas canvas(place, picture);
  drawPolyline(view.path, PATH_COLOUR, 1, canvas);
  if (view.h.allFinite())
  {
    const auto draw = [&](const Points& points, const cv::Scalar& colour) {
      for (const Eigen::Vector2d& point : points)
      {
        const Eigen::Vector2d at = transfer(view.h, point);
        if (at.allFinite() && (at.array() >= 0.0).all() && at.x() < current.cols && at.y() < current.rows)
        {
          drawDot(canvas.area, canvas.place(at), 2.5, colour);
        }
      }
    };
    draw(view.missing, MISSING_COLOUR);
    draw(view.found, FOUND_COLOUR);
    Points polygon = outline(view.region);
    std::transform(polygon.begin(), polygon.end(), polygon.begin(),
                   [&](const Eigen::Vector2d& point) { return transfer(view.h, point); });
    drawPolyline(polygon, OUTLINE_COLOUR, 2, canvas);
  }
  writeCaption(view.text, picture.rowRange(size.height, picture.rows));
  return picture;
}

}  // namespace view_servo
