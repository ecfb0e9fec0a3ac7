// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/line_features.h"

#include "view_servo/parameters/faults.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
double distanceToPoint(const Segment& segment, const Eigen::Vector2d& point)
{
  const Eigen::Vector2d d = segment.end - segment.start;
  const double along = std::clamp((point - segment.start).dot(d) / d.squaredNorm(), 0.0, 1.0);
  return (point - segment.start - along * d).norm();
}

/** Distance between two segments [px], 0 when they cross. */
double distanceBetween(const Segment& a, const Segment& b)
{
  const Eigen::Vector2d da = a.end - a.start;
  const Eigen::Vector2d db = b.end - b.start;
  if (cross(da, b.start - a.start) * cross(da, b.end - a.start) < 0.0 &&
      cross(db, a.start - b.start) * cross(db, a.end - b.start) < 0.0)
  {
    return 0.0;
  }
  return std::min({ distanceToPoint(a, b.start), distanceToPoint(a, b.end), distanceToPoint(b, a.start),
                    distanceToPoint(b, a.end) });
}

/** The least and the largest offset of a segment's points in a direction [px]. */
std::pair<double, double> offsets(const Eigen::Vector2d& direction, const Segment& segment)
{
  return std::minmax({ direction.dot(segment.start), direction.dot(segment.end) });
}

}  // namespace

std::vector<Parameter> parameters(LineFeatureParams& params)
{
  return joined(
      { parameters(params.groups),
        {
            integer("max_grouped", params.max_grouped, "", "[1, 5000]", "segments that form groups, the longest"),
            integer("neighbours", params.neighbours, "", "[6, 1000]",
                    "nearest neighbours of a segment, by which a hypothesis is judged"),
            integer("neighbour_pairs", params.neighbour_pairs, "", "[2, 100]",
                    "nearest neighbours of a segment, with which hypotheses are made"),
        } });
}

std::vector<std::string> LineFeatureParams::validate() const
{
  return faultsOf(*this);
}

LineFeatures::LineFeatures(const cv::Mat& grey, Segments segments, const LineFeatureParams& params)
  : params_(params), groups_(std::make_unique<std::array<Groups, 2>>())
{
  requireNoFaults("line parameters", params.validate());
  if (grey.type() != CV_8UC1 || grey.empty())
  {
    throw std::invalid_argument("LineFeatures: the image must be 8-bit with one channel");
  }
  requireUsable(segments);
  constexpr double SIGMA = 1.5;
  cv::GaussianBlur(grey, smoothed_, cv::Size(), SIGMA);

  input_.resize(segments.size());
  std::iota(input_.begin(), input_.end(), 0);
  std::stable_sort(input_.begin(), input_.end(), [&](int a, int b) {
    return segments[static_cast<std::size_t>(a)].length() > segments[static_cast<std::size_t>(b)].length();
  });
  segments_.reserve(segments.size());
  for (const int i : input_)
  {
    segments_.push_back(segments[static_cast<std::size_t>(i)]);
    directions_.push_back(segments_.back().direction());
  }

  fillDirectionBins();
  findNeighbours();
}

void LineFeatures::findNeighbours()
{
  const int n = static_cast<int>(segments_.size());
  const std::size_t count = static_cast<std::size_t>(std::min(n, params_.max_grouped));
  near_.resize(count);
  meetings_.resize(count);
  std::vector<Eigen::Vector2d> middles;
  std::vector<double> halves;
  for (const Segment& segment : segments_)
  {
    middles.push_back(segment.midpoint());
    halves.push_back(0.5 * segment.length());
  }
  const double max_distance = params_.groups.max_distance;
  cv::parallel_for_(cv::Range(0, static_cast<int>(count)), [&](const cv::Range& range) {
    std::vector<std::pair<double, int>> distances;
    for (int i = range.start; i < range.end; ++i)
    {
      // First by what a distance is at least, which is quick to say: few of the others come into question.
      const Eigen::Vector2d middle = segment(i).midpoint();
      const double half = 0.5 * segment(i).length();
      distances.clear();
      for (int j = 0; j < n; ++j)
      {
        if (j != i)
        {
          const std::size_t other = static_cast<std::size_t>(j);
          distances.emplace_back((middles[other] - middle).norm() - half - halves[other], j);
        }
      }
      const std::size_t kept = std::min(static_cast<std::size_t>(params_.neighbours), distances.size());
      const auto end_of_kept = distances.begin() + static_cast<std::ptrdiff_t>(kept);
      if (kept < distances.size())
      {
        std::nth_element(distances.begin(), end_of_kept, distances.end());
      }
      double farthest = 0.0;
      for (auto next = distances.begin(); next != end_of_kept; ++next)
      {
        next->first = distanceBetween(segment(i), segment(next->second));
        farthest = std::max(farthest, next->first);
      }
      auto end = end_of_kept;
      for (auto next = end_of_kept; next != distances.end(); ++next)
      {
        if (next->first <= farthest)
        {
          *end++ = { distanceBetween(segment(i), segment(next->second)), next->second };
        }
      }
      std::partial_sort(distances.begin(), end_of_kept, end);
      distances.resize(kept);
      std::vector<Meeting>& meetings = meetings_[static_cast<std::size_t>(i)];
      for (const auto& [distance, j] : distances)
      {
        near_[static_cast<std::size_t>(i)].push_back(j);
        const auto at = lineIntersection(segment(i), segment(j), MIN_SINE);
        if (at && static_cast<int>(meetings.size()) < params_.neighbour_pairs &&
            distanceToPoint(segment(i), *at) < max_distance && distanceToPoint(segment(j), *at) < max_distance)
        {
          meetings.push_back({ j, *at });
        }
      }
    }
  });
}

const LineIndex& LineFeatures::index(LineGrouping groups) const
{
  Groups& wanted = (*groups_)[groups == LineGrouping::PAIRS ? 0 : 1];
  std::call_once(wanted.once, [&] {
    LineGroupParams params = params_.groups;
    params.groups = groups;
    wanted.index = LineIndex({ segments_.begin(), segments_.begin() + groupedCount() }, params);
  });
  return wanted.index;
}

void LineFeatures::fillDirectionBins()
{
  for (int bin = 0; bin < DIRECTIONS; ++bin)
  {
    const double angle = (bin + 0.5) / DIRECTIONS * 2.0 * M_PI - M_PI;
    bins_[static_cast<std::size_t>(bin)].across = { -std::sin(angle), std::cos(angle) };
  }
  for (int i = 0; i < static_cast<int>(segments_.size()); ++i)
  {
    bins_[static_cast<std::size_t>(directionBin(direction(i)))].segments.push_back(i);
  }
  for (DirectionBin& bin : bins_)
  {
    const auto low = [&](int i) {
      return offsets(bin.across, segment(i)).first;
    };
    std::stable_sort(bin.segments.begin(), bin.segments.end(), [&](int a, int b) { return low(a) < low(b); });
    double high = -std::numeric_limits<double>::infinity();
    for (const int i : bin.segments)
    {
      high = std::max(high, offsets(bin.across, segment(i)).second);
      bin.low.push_back(low(i));
      bin.high_here.push_back(high);
    }
  }
}

void LineFeatures::alongside(const Segment& segment, double tolerance, double max_angle_deg,
                             std::vector<int>& found) const
{
  found.clear();
  const int reach = static_cast<int>(std::ceil(max_angle_deg * DIRECTIONS / 360.0));
  const int middle = directionBin(segment.end - segment.start);
  for (int offset = -reach; offset <= reach; ++offset)
  {
    const DirectionBin& bin = bins_[static_cast<std::size_t>((middle + offset + DIRECTIONS) % DIRECTIONS)];
    const auto [low, high] = offsets(bin.across, segment);
    const auto first = std::lower_bound(bin.high_here.begin(), bin.high_here.end(), low - tolerance);
    const auto last = std::upper_bound(bin.low.begin(), bin.low.end(), high + tolerance);
    for (std::ptrdiff_t i = first - bin.high_here.begin(); i < last - bin.low.begin(); ++i)
    {
      found.push_back(bin.segments[static_cast<std::size_t>(i)]);
    }
  }
}

int LineFeatures::directionBin(const Eigen::Vector2d& direction)
{
  const double turns = std::atan2(direction.y(), direction.x()) / (2.0 * M_PI) + 0.5;
  return static_cast<int>(turns * DIRECTIONS) % DIRECTIONS;
}

}  // namespace view_servo
