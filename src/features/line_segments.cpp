// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/line_segments.h"

#include "view_servo/features/edges.h"

#include <opencv2/core/version.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr bool LSD_AVAILABLE = CV_VERSION_MAJOR * 10000 + CV_VERSION_MINOR * 100 + CV_VERSION_REVISION >= 40504;

/** How far smoothing rounds an edge off at a corner, in multiples of its sigma. */
constexpr double ROUNDING = 3.0;

/** The points first..last of an edge. */
struct Section
{
  std::size_t first;
  std::size_t last;
};

/** Chooses the sections of an edge that are best seen as straight (Lowe 1987; Rosin and West 1989; thesis 2.8.2). */
class Subdivision
{
public:
  Subdivision(const EdgeChain& edge, const LineSegmentParams& params) : edge_(edge), params_(params)
  {
    divide({ 0, edge.size() - 1 });
  }

  const std::vector<Section>& sections() const
  {
    return sections_;
  }

private:
  /** Adds the best sections of `whole`, and returns the significance of the most significant. */
  double divide(const Section& whole)
  {
    // Long sections are not divided near their ends, so that the depth of the recursion is bounded.
    constexpr std::size_t LONG = 1000;
    constexpr std::size_t SHORTEST = 4;
    const std::size_t size = whole.last - whole.first;
    const std::size_t margin = size > LONG ? size / 4 : 1;
    const Eigen::Vector2d start = edge_[whole.first];
    const Eigen::Vector2d chord = edge_[whole.last] - start;
    const double length = chord.norm();
    const Eigen::Vector2d normal = Eigen::Vector2d(-chord.y(), chord.x()) / length;
    double deviation = 0.0;
    double split_deviation = 0.0;
    std::size_t split = whole.first + size / 2;
    for (std::size_t i = whole.first; i <= whole.last; ++i)
    {
      // The first and the last point of a closed edge are the same.
      const double d = length > 0.0 ? std::abs(normal.dot(edge_[i] - start)) : (edge_[i] - start).norm();
      deviation = std::max(deviation, d);
      if (d > split_deviation && i >= whole.first + margin && i + margin <= whole.last)
      {
        split_deviation = d;
        split = i;
      }
    }
    const double significance = length / std::max(deviation, params_.min_deviation);
    if (size > SHORTEST && deviation > params_.min_deviation)
    {
      const std::size_t mark = sections_.size();
      const double left = divide({ whole.first, split });
      const double right = divide({ split, whole.last });
      if (std::max(left, right) > significance)
      {
        return std::max(left, right);
      }
      sections_.resize(mark);
    }
    sections_.push_back(whole);
    return significance;
  }

  const EdgeChain& edge_;
  const LineSegmentParams& params_;
  std::vector<Section> sections_;
};

/**
 * Total least squares on a section of an edge. The ends are the projections of the points where the edge leaves the
 * line, at or near the section's ends.
 */
Segment fitSegment(const EdgeChain& edge, const Section& section, const LineSegmentParams& params)
{
  // The ends may be rounded off.
  const std::size_t rounded =
      std::min((section.last - section.first) / 4, static_cast<std::size_t>(std::lround(params.sigma)));
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = section.first + rounded; i <= section.last - rounded; ++i)
  {
    mean += edge[i];
  }
  mean /= static_cast<double>(section.last - section.first - 2 * rounded + 1);
  double uu = 0.0;
  double uv = 0.0;
  double vv = 0.0;
  for (std::size_t i = section.first + rounded; i <= section.last - rounded; ++i)
  {
    const Eigen::Vector2d offset = edge[i] - mean;
    uu += offset.x() * offset.x();
    uv += offset.x() * offset.y();
    vv += offset.y() * offset.y();
  }
  const double angle = 0.5 * std::atan2(2.0 * uv, uu - vv);
  const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
  const auto on_line = [&](std::size_t i) {
    const Eigen::Vector2d offset = edge[i] - mean;
    return std::abs(direction.x() * offset.y() - direction.y() * offset.x()) < params.min_deviation;
  };
  const std::size_t reach = static_cast<std::size_t>(std::lround(ROUNDING * params.sigma));
  std::size_t first = section.first;
  while (first > 0 && section.first - first < reach && on_line(first - 1))
  {
    --first;
  }
  std::size_t last = section.last;
  while (last + 1 < edge.size() && last - section.last < reach && on_line(last + 1))
  {
    ++last;
  }
  const auto project = [&](const Eigen::Vector2d& point) {
    return Eigen::Vector2d(mean + direction.dot(point - mean) * direction);
  };
  return { project(edge[first]), project(edge[last]) };
}

/** Where the lines through two segments meet; not finite for parallel ones. */
Eigen::Vector2d intersection(const Segment& a, const Segment& b)
{
  const Eigen::Vector2d normal = b.normal();
  return a.start + normal.dot(b.start - a.start) / normal.dot(a.direction()) * a.direction();
}

/** The segments of an edge, in its order. */
Segments segmentsOf(const EdgeChain& edge, const LineSegmentParams& params)
{
  const Subdivision subdivision(edge, params);
  Segments segments;
  for (const Section& section : subdivision.sections())
  {
    const Segment segment = fitSegment(edge, section, params);
    const Eigen::Vector2d normal = segment.normal();
    double deviation = params.min_deviation;
    for (std::size_t i = section.first; i <= section.last; ++i)
    {
      deviation = std::max(deviation, std::abs(normal.dot(edge[i] - segment.start)));
    }
    if (segment.length() >= params.min_significance * deviation)
    {
      segments.push_back(segment);
    }
  }
  // Segments that nearly meet end at the corner that smoothing has rounded off.
  const double reach = ROUNDING * params.sigma;
  const bool closed = edge.front() == edge.back();
  for (std::size_t i = closed ? 0 : 1; i < segments.size(); ++i)
  {
    Segment& a = segments[i > 0 ? i - 1 : segments.size() - 1];
    Segment& b = segments[i];
    const Eigen::Vector2d corner = intersection(a, b);
    if ((corner - a.end).norm() < reach && (corner - b.start).norm() < reach && a.length() > reach &&
        b.length() > reach)
    {
      a.end = corner;
      b.start = corner;
    }
  }
  return segments;
}

Segments cannySegments(const cv::Mat& grey, const LineSegmentParams& params, const cv::Rect& region)
{
  EdgeParams edge_params;
  edge_params.sigma = params.sigma;
  edge_params.low_threshold = params.low_threshold;
  edge_params.high_threshold = params.high_threshold;
  edge_params.min_points = std::max(2, static_cast<int>(params.min_length / 2.0));
  Segments segments;
  for (const EdgeChain& edge : detectEdges(grey, edge_params, region))
  {
    const Segments found = segmentsOf(edge, params);
    segments.insert(segments.end(), found.begin(), found.end());
  }
  return segments;
}

Segments lsdSegments(const cv::Mat& grey, const LineSegmentParams& params, const cv::Rect& region)
{
  if (!LSD_AVAILABLE)
  {
    throw std::runtime_error("detectLineSegments: OpenCV " CV_VERSION " has no Line Segment Detector");
  }
  const cv::Rect image(0, 0, grey.cols, grey.rows);
  const cv::Rect wanted = region.empty() ? image : image & region;
  Segments segments;
  if (wanted.empty())
  {
    return segments;
  }
  // The detector smooths by 0.6 px of the image reduced by `scale`; 0.8 is its authors' choice.
  const double scale = std::min(1.0, 0.8 / params.sigma);
  std::vector<cv::Vec4f> lines;
  cv::createLineSegmentDetector(cv::LSD_REFINE_STD, scale)->detect(grey(wanted), lines);
  for (const cv::Vec4f& line : lines)
  {
    const Eigen::Vector2d origin(wanted.x, wanted.y);
    segments.push_back({ origin + Eigen::Vector2d(line[0], line[1]), origin + Eigen::Vector2d(line[2], line[3]) });
  }
  return directedByContrast(grey, std::move(segments));
}

/** Sum and number of samples. */
struct Samples
{
  double sum = 0.0;
  int count = 0;
};

void sample(const cv::Mat& grey, const Eigen::Vector2d& position, Samples& samples)
{
  if (position.x() < 0.0 || position.y() < 0.0 || position.x() > grey.cols - 1 || position.y() > grey.rows - 1)
  {
    return;
  }
  const int u = static_cast<int>(position.x());
  const int v = static_cast<int>(position.y());
  const double fu = position.x() - u;
  const double fv = position.y() - v;
  const unsigned char* above = grey.ptr<unsigned char>(v);
  const unsigned char* below = grey.ptr<unsigned char>(std::min(v + 1, grey.rows - 1));
  const int right = std::min(u + 1, grey.cols - 1);
  samples.sum +=
      (1.0 - fv) * ((1.0 - fu) * above[u] + fu * above[right]) + fv * ((1.0 - fu) * below[u] + fu * below[right]);
  ++samples.count;
}

}  // namespace

bool lsdAvailable()
{
  return LSD_AVAILABLE;
}

std::vector<std::string> LineSegmentParams::validate() const
{
  EdgeParams edges;
  edges.sigma = sigma;
  edges.low_threshold = low_threshold;
  edges.high_threshold = high_threshold;
  std::vector<std::string> faults = edges.validate();
  const auto require = [&](bool good, const char* fault) {
    if (!good)
    {
      faults.emplace_back(fault);
    }
  };
  require(min_deviation > 0.0, "min_deviation must be over 0 px");
  require(min_significance >= 0.0, "min_significance must be at least 0");
  require(min_length > 0.0 && min_length <= 10000.0, "min_length must lie in (0, 10000] px");
  require(max_segments >= 1, "max_segments must be at least 1");
  require(detector != SegmentDetector::LSD || LSD_AVAILABLE, "OpenCV " CV_VERSION " has no Line Segment Detector");
  return faults;
}

Segments detectLineSegments(const cv::Mat& grey, const LineSegmentParams& params, const cv::Rect& region)
{
  if (grey.type() != CV_8UC1)
  {
    throw std::invalid_argument("detectLineSegments: the image must be 8-bit with one channel");
  }
  Segments segments =
      params.detector == SegmentDetector::LSD ? lsdSegments(grey, params, region) : cannySegments(grey, params, region);
  const auto too_short = [&](const Segment& segment) {
    return segment.length() < params.min_length;
  };
  segments.erase(std::remove_if(segments.begin(), segments.end(), too_short), segments.end());
  // Stable, so that the result does not depend on the sorting algorithm.
  std::stable_sort(segments.begin(), segments.end(),
                   [](const Segment& a, const Segment& b) { return a.length() > b.length(); });
  if (segments.size() > static_cast<std::size_t>(params.max_segments))
  {
    segments.resize(static_cast<std::size_t>(params.max_segments));
  }
  return segments;
}

double segmentContrast(const cv::Mat& grey, const Segment& segment)
{
  if (grey.type() != CV_8UC1)
  {
    throw std::invalid_argument("segmentContrast: the image must be 8-bit with one channel");
  }
  constexpr int MAX_STEPS = 32;
  const double length = segment.length();
  if (!(length > 0.0) || !std::isfinite(length))
  {
    return std::numeric_limits<double>::quiet_NaN();
  }
  const Eigen::Vector2d normal = segment.normal();
  const int steps = std::min(MAX_STEPS, static_cast<int>(std::ceil(length)));
  Samples left;
  Samples right;
  for (int i = 0; i < steps; ++i)
  {
    const Eigen::Vector2d point = segment.start + (i + 0.5) / steps * (segment.end - segment.start);
    for (const double distance : { 1.0, 2.0 })
    {
      sample(grey, point - distance * normal, left);
      sample(grey, point + distance * normal, right);
    }
  }
  return left.sum / left.count - right.sum / right.count;
}

Segments directedByContrast(const cv::Mat& grey, Segments segments)
{
  for (Segment& segment : segments)
  {
    if (segmentContrast(grey, segment) < 0.0)
    {
      segment = segment.reversed();
    }
  }
  return segments;
}

}  // namespace view_servo
