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

struct Line
{
  Eigen::Vector2d point;
  Eigen::Vector2d direction;  ///< unit vector

  double distance(const Eigen::Vector2d& other) const
  {
    const Eigen::Vector2d offset = other - point;
    return std::abs(direction.x() * offset.y() - direction.y() * offset.x());
  }
  Eigen::Vector2d projection(const Eigen::Vector2d& other) const
  {
    return point + direction.dot(other - point) * direction;
  }
};

/** The points first..last of an edge and the line of total least squares, both without ends that are rounded off. */
struct Section
{
  std::size_t first;
  std::size_t last;
  Line line;
  double deviation;  ///< greatest distance of a point from the line [px]
};

/**
 * The straight sections of an edge: recursive subdivision at the point of greatest deviation from the chord, and on the
 * way back up the parts instead of the whole if they are more significant (Lowe 1987; Rosin and West 1989; thesis
 * 2.8.2). Deviations count from the line of total least squares, for a chord is as uncertain as its two end points.
 */
class Subdivision
{
public:
  Subdivision(const EdgeChain& edge, const LineSegmentParams& params) : edge_(edge), params_(params)
  {
    sums_.reserve(edge.size() + 1);
    sums_.emplace_back(Sums::Zero());
    for (const Eigen::Vector2d& point : edge)
    {
      const Eigen::Vector2d p = point - edge.front();
      Sums sums;
      sums << p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y();
      sums_.emplace_back(sums_.back() + sums);
    }
    divide(0, edge.size() - 1);
  }

  const std::vector<Section>& sections() const
  {
    return sections_;
  }

private:
  /** Sums of u, v, u², uv and v² of the first points of the edge. */
  using Sums = Eigen::Matrix<double, 5, 1>;

  /** Total least squares on the points first..last. */
  Line fit(std::size_t first, std::size_t last) const
  {
    const Sums mean = (sums_[last + 1] - sums_[first]) / static_cast<double>(last + 1 - first);
    const double uu = mean[2] - mean[0] * mean[0];
    const double uv = mean[3] - mean[0] * mean[1];
    const double vv = mean[4] - mean[1] * mean[1];
    const double angle = 0.5 * std::atan2(2.0 * uv, uu - vv);
    return { edge_.front() + mean.head<2>(), { std::cos(angle), std::sin(angle) } };
  }

  /** Adds the best sections of the points first..last, and returns the significance of the most significant. */
  double divide(std::size_t first, std::size_t last)
  {
    constexpr std::size_t SHORTEST = 4;
    const std::size_t size = last - first;
    // The ends may be rounded off. Long sections are not divided near them, to bound the depth of the recursion.
    constexpr std::size_t LONG = 1000;
    const std::size_t rounded = std::min(size / 4, static_cast<std::size_t>(std::lround(params_.sigma)));
    const std::size_t margin = size > LONG ? size / 4 : rounded;
    const Line line = fit(first + rounded, last - rounded);
    const Eigen::Vector2d chord = edge_[last] - edge_[first];
    const double length = chord.norm();
    double deviation = 0.0;
    double split_deviation = 0.0;
    std::size_t split = first + size / 2;
    for (std::size_t i = first + rounded; i <= last - rounded; ++i)
    {
      deviation = std::max(deviation, line.distance(edge_[i]));
      const Eigen::Vector2d offset = edge_[i] - edge_[first];
      // The first and the last point of a closed edge are the same.
      const double from_chord =
          length > 0.0 ? std::abs(chord.x() * offset.y() - chord.y() * offset.x()) : offset.norm();
      if (from_chord > split_deviation && i >= first + margin && i <= last - margin)
      {
        split_deviation = from_chord;
        split = i;
      }
    }
    const double significance =
        deviation <= params_.max_deviation ? length / std::max(deviation, params_.min_deviation) : 0.0;
    if (size > SHORTEST && deviation > params_.min_deviation)
    {
      const std::size_t mark = sections_.size();
      const double left = divide(first, split);
      const double right = divide(split, last);
      if (std::max(left, right) > significance)
      {
        return std::max(left, right);
      }
      sections_.resize(mark);
    }
    sections_.push_back({ first, last, line, deviation });
    return significance;
  }

  const EdgeChain& edge_;
  const LineSegmentParams& params_;
  std::vector<Sums> sums_;
  std::vector<Section> sections_;
};

/**
 * The segment of a section. It ends at the projections of the points where the edge leaves the line, which are at or
 * near the section's ends.
 */
Segment segmentOf(const EdgeChain& edge, const Section& section, const LineSegmentParams& params)
{
  const std::size_t reach = static_cast<std::size_t>(std::lround(ROUNDING * params.sigma));
  const auto on_line = [&](std::size_t i) {
    return section.line.distance(edge[i]) < params.min_deviation;
  };
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
  return { section.line.projection(edge[first]), section.line.projection(edge[last]) };
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
    const Segment segment = segmentOf(edge, section, params);
    if (section.deviation <= params.max_deviation &&
        segment.length() >= params.min_significance * std::max(section.deviation, params.min_deviation))
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

std::vector<Parameter> parameters(LineSegmentParams& params)
{
  return joined(
      { { choice<SegmentDetector>(
            "detector", params.detector, { { "canny", SegmentDetector::CANNY }, { "lsd", SegmentDetector::LSD } },
            "subdivided edges, or OpenCV's Line Segment Detector, which its versions 4.1.0 to 4.5.3 do not have") },
        edgeParameters(params.sigma, params.low_threshold, params.high_threshold),
        {
            real("segment_deviation", params.min_deviation, "px", "> 0",
                 "canny: smaller deviations from a straight line are noise"),
            real("segment_max_deviation", params.max_deviation, "px", ">= segment_deviation",
                 "canny: largest deviation of a segment's edge from its line"),
            real("segment_significance", params.min_significance, "", ">= 0",
                 "canny: least length over greatest deviation"),
            real("segment_min_length", params.min_length, "px", "(0, 10000]", "shortest segment detected"),
            integer("max_segments", params.max_segments, "", ">= 1", "segments detected in each image, the longest"),
        } });
}

std::vector<std::string> LineSegmentParams::validate() const
{
  std::vector<std::string> faults = faultsOf(*this);
  if (detector == SegmentDetector::LSD && !LSD_AVAILABLE)
  {
    faults.emplace_back("detector must be canny, as OpenCV " CV_VERSION " has no Line Segment Detector");
  }
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
