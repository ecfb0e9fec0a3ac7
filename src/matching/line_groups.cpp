// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/line_groups.h"

#include "view_servo/parameters/faults.h"

#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
/**
 * The digits of a segment's end points with respect to the line of another: 2 on the side of its normal(), 0 on the
 * other, 1 within `collinearity` [px].
 */
int digits(const Segment& line, const Segment& ends, double collinearity)
{
  const Eigen::Vector2d along = line.end - line.start;
  const double limit = collinearity * along.norm();
  const auto digit = [limit](double area) {
    return area > limit ? 2 : (area < -limit ? 0 : 1);
  };
  return 3 * digit(cross(along, ends.start - line.start)) + digit(cross(along, ends.end - line.start));
}

/** A segment whose nearest end point may have been moved to the intersection. */
Segment extended(Segment segment, const Eigen::Vector2d& to)
{
  const bool start_is_nearer = (segment.start - to).squaredNorm() < (segment.end - to).squaredNorm();
  (start_is_nearer ? segment.start : segment.end) = to;
  return segment;
}

double distanceToNearestEnd(const Segment& segment, const Eigen::Vector2d& point)
{
  return std::sqrt(std::min((segment.start - point).squaredNorm(), (segment.end - point).squaredNorm()));
}

bool isVertical(const Segment& segment)
{
  const Eigen::Vector2d d = segment.end - segment.start;
  return std::abs(d.y()) > std::abs(d.x());
}

/** pairHypotheses(), but those of at most `min_weight` have any index, since nobody asks for it. */
std::array<PairHypothesis, 4> likelyHypotheses(const Segment& a, const Segment& b,
                                               const std::optional<Eigen::Vector2d>& intersection, double collinearity,
                                               double min_weight)
{
  if (!intersection)
  {
    const int as_detected = pairIndex(a, b, collinearity);
    return { { { as_detected, 1.0 }, { as_detected, 0.0 }, { as_detected, 0.0 }, { as_detected, 0.0 } } };
  }
  const double wa = std::min(distanceToNearestEnd(a, *intersection) / a.length(), 1.0);
  const double wb = std::min(distanceToNearestEnd(b, *intersection) / b.length(), 1.0);
  const Segment longer_a = extended(a, *intersection);
  const Segment longer_b = extended(b, *intersection);
  const auto hypothesis = [&](const Segment& first, const Segment& second, double weight) {
    constexpr int UNASKED = 0;
    return PairHypothesis{ weight > min_weight ? pairIndex(first, second, collinearity) : UNASKED, weight };
  };
  return { { hypothesis(a, b, wa * wb), hypothesis(longer_a, longer_b, (1.0 - wa) * (1.0 - wb)),
             hypothesis(longer_a, b, (1.0 - wa) * wb), hypothesis(a, longer_b, wa * (1.0 - wb)) } };
}

/** A pair of neighbours: its segments in their order, where their lines meet, and its possible structures. */
struct Pair
{
  int first;
  int second;
  Eigen::Vector2d intersection;
  double distance;  ///< from the farther of the two segments to the intersection [px]
  std::array<PairHypothesis, 4> hypotheses;

  int other(int segment) const
  {
    return segment == first ? second : first;
  }
};

class GroupBuilder
{
public:
  GroupBuilder(const Segments& segments, const LineGroupParams& params)
    : segments_(segments), params_(params), min_sine_(std::sin(params.min_angle_deg * M_PI / 180.0))
  {
    if (params_.order == LineOrder::UPRIGHT)
    {
      for (Segment& segment : segments_)
      {
        const Eigen::Vector2d d = segment.end - segment.start;
        if (isVertical(segment) ? d.y() > 0.0 : d.x() < 0.0)
        {
          segment = segment.reversed();
        }
      }
    }
  }

  std::vector<LineGroup> build()
  {
    findPairs();
    if (params_.groups == LineGrouping::PAIRS)
    {
      for (const Pair& pair : pairs_)
      {
        addPair(pair);
      }
    }
    else
    {
      addTriplets();
    }
    return sorted();
  }

private:
  /** The groups by key, equal keys in the order in which they were formed. */
  std::vector<LineGroup> sorted() const
  {
    // By digits, the last first, each pass leaving what has equal ones in its order; numbers move faster than groups.
    constexpr unsigned DIGIT = 12;  // [bits]
    constexpr std::uint32_t MASK = (1U << DIGIT) - 1U;
    static_assert(8 * PAIR_INDICES * PAIR_INDICES * PAIR_INDICES <= 1 << (2 * DIGIT), "two digits hold every key");
    std::vector<std::uint64_t> order(groups_.size());  // key, and place in groups_
    for (std::size_t i = 0; i < groups_.size(); ++i)
    {
      order[i] = static_cast<std::uint64_t>(groups_[i].key) << 32U | i;
    }
    std::vector<std::uint64_t> next(order.size());
    for (const unsigned shift : { 32U, 32U + DIGIT })
    {
      const auto digit = [shift](std::uint64_t entry) {
        return (entry >> shift) & MASK;
      };
      std::array<std::uint32_t, MASK + 2> starts{};
      for (const std::uint64_t entry : order)
      {
        ++starts[digit(entry) + 1];
      }
      std::partial_sum(starts.begin(), starts.end(), starts.begin());
      for (const std::uint64_t entry : order)
      {
        next[starts[digit(entry)]++] = entry;
      }
      order.swap(next);
    }
    std::vector<LineGroup> sorted;
    sorted.reserve(groups_.size());
    for (const std::uint64_t entry : order)
    {
      sorted.push_back(groups_[static_cast<std::uint32_t>(entry)]);
    }
    return sorted;
  }

  const Segment& segment(int i) const
  {
    return segments_[static_cast<std::size_t>(i)];
  }

  /** The pair in its order, or empty when the two form none. */
  std::optional<Pair> makePair(int i, int j) const
  {
    bool in_order = false;
    if (params_.order == LineOrder::UPRIGHT)
    {
      if (isVertical(segment(i)) == isVertical(segment(j)))
      {
        return std::nullopt;
      }
      in_order = isVertical(segment(i));
    }
    else
    {
      in_order = cross(segment(i).end - segment(i).start, segment(j).end - segment(j).start) > 0.0;
    }
    const auto at = lineIntersection(segment(i), segment(j), min_sine_);
    if (!at)
    {
      return std::nullopt;
    }
    const double distance = std::max(reach(segment(i), *at), reach(segment(j), *at));
    if (!(distance < params_.max_distance))
    {
      return std::nullopt;
    }
    return Pair{ in_order ? i : j, in_order ? j : i, *at, distance, {} };
  }

  /** Distance from a segment to an intersection: the thesis' from its nearest end point, else 0 within the segment. */
  double reach(const Segment& segment, const Eigen::Vector2d& at) const
  {
    const Eigen::Vector2d d = segment.end - segment.start;
    const double along = (at - segment.start).dot(d) / d.squaredNorm();
    if (params_.order == LineOrder::CONTRAST && along >= 0.0 && along <= 1.0)
    {
      return 0.0;
    }
    return distanceToNearestEnd(segment, at);
  }

  void findPairs()
  {
    const int n = static_cast<int>(segments_.size());
    std::vector<Pair> all;
    for (int i = 0; i < n; ++i)
    {
      for (int j = i + 1; j < n; ++j)
      {
        const double apart = (segment(i).midpoint() - segment(j).midpoint()).norm();
        if (apart > 0.5 * (segment(i).length() + segment(j).length()) + 2.0 * params_.max_distance)
        {
          continue;
        }
        if (auto pair = makePair(i, j))
        {
          all.push_back(*pair);
        }
      }
    }
    if (params_.max_neighbours > 0)
    {
      all = closest(all);
    }
    for (Pair& pair : all)
    {
      pair.hypotheses = likelyHypotheses(segment(pair.first), segment(pair.second), pair.intersection,
                                         params_.collinearity, params_.min_weight);
    }
    pairs_ = std::move(all);
  }

  /** Takes pairs, the closest first, as long as neither of their segments has as many as it may. */
  std::vector<Pair> closest(std::vector<Pair>& all) const
  {
    std::stable_sort(all.begin(), all.end(), [](const Pair& a, const Pair& b) { return a.distance < b.distance; });
    std::vector<int> taken(segments_.size(), 0);
    std::vector<Pair> kept;
    for (const Pair& pair : all)
    {
      int& first = taken[static_cast<std::size_t>(pair.first)];
      int& second = taken[static_cast<std::size_t>(pair.second)];
      if (first < params_.max_neighbours && second < params_.max_neighbours)
      {
        ++first;
        ++second;
        kept.push_back(pair);
      }
    }
    return kept;
  }

  void addPair(const Pair& pair)
  {
    for (const PairHypothesis& hypothesis : pair.hypotheses)
    {
      if (hypothesis.weight > params_.min_weight)
      {
        groups_.push_back({ static_cast<std::uint32_t>(hypothesis.index),
                            static_cast<float>(hypothesis.weight),
                            { pair.first, pair.second, -1 } });
      }
    }
  }

  void addTriplets()
  {
    std::vector<std::vector<const Pair*>> of_segment(segments_.size());
    for (const Pair& pair : pairs_)
    {
      of_segment[static_cast<std::size_t>(pair.first)].push_back(&pair);
      of_segment[static_cast<std::size_t>(pair.second)].push_back(&pair);
    }
    for (int shared = 0; shared < static_cast<int>(segments_.size()); ++shared)
    {
      const auto& neighbours = of_segment[static_cast<std::size_t>(shared)];
      for (std::size_t j = 0; j < neighbours.size(); ++j)
      {
        for (std::size_t k = j + 1; k < neighbours.size(); ++k)
        {
          addTriplet(shared, *neighbours[j], *neighbours[k]);
        }
      }
    }
  }

  void addTriplet(int shared, const Pair& a, const Pair& b)
  {
    const Segment& s = segment(shared);
    const Pair* p = &a;
    const Pair* q = &b;
    int c = 0;
    int classes = 0;
    if (params_.order == LineOrder::UPRIGHT)
    {
      // Both others are of the other class: left to right for verticals, bottom to top else, by their midpoints.
      const bool vertical = isVertical(s);
      const Eigen::Vector2d ma = segment(a.other(shared)).midpoint();
      const Eigen::Vector2d mb = segment(b.other(shared)).midpoint();
      if (vertical ? ma.y() < mb.y() : ma.x() > mb.x())
      {
        std::swap(p, q);
      }
      c = vertical ? 1 : 0;
      classes = 2;
    }
    else
    {
      // By their intersections along the shared segment.
      const Eigen::Vector2d d = s.end - s.start;
      if (d.dot(a.intersection) > d.dot(b.intersection))
      {
        std::swap(p, q);
      }
    }
    const int j = p->other(shared);
    const int k = q->other(shared);
    int first = j;
    int second = k;
    if (params_.order == LineOrder::CONTRAST)
    {
      const bool turns = cross(segment(j).end - segment(j).start, segment(k).end - segment(k).start) > 0.0;
      c = (p->first == shared ? 1 : 0) + (q->first == shared ? 2 : 0) + (turns ? 4 : 0);
      classes = 8;
      if (!turns)
      {
        std::swap(first, second);
      }
    }
    const auto meeting = lineIntersection(segment(j), segment(k), min_sine_);
    const auto others =
        likelyHypotheses(segment(first), segment(second), meeting, params_.collinearity, params_.min_weight);
    for (const PairHypothesis& h1 : p->hypotheses)
    {
      for (const PairHypothesis& h2 : q->hypotheses)
      {
        const double both = h1.weight * h2.weight;
        if (both <= params_.min_weight)
        {
          continue;
        }
        for (const PairHypothesis& h3 : others)
        {
          if (both * h3.weight > params_.min_weight)
          {
            groups_.push_back({ tripletKey(h1.index, h2.index, h3.index, c, classes),
                                static_cast<float>(both * h3.weight),
                                { shared, j, k } });
          }
        }
      }
    }
  }

  Segments segments_;
  const LineGroupParams& params_;
  const double min_sine_;  // of the least angle between the lines of a pair
  std::vector<Pair> pairs_;
  std::vector<LineGroup> groups_;
};

/** Votes of some of the current groups for each reference segment (row) and current segment (column). */
std::vector<float> votesOf(const LineIndex& reference, std::vector<LineGroup>::const_iterator group,
                           std::vector<LineGroup>::const_iterator last, std::size_t columns)
{
  std::vector<float> votes(static_cast<std::size_t>(reference.segmentCount()) * columns, 0.0F);
  const std::vector<LineGroup>& stored = reference.groups();
  if (group == last)
  {
    return votes;
  }
  auto end = std::lower_bound(stored.begin(), stored.end(), *group,
                              [](const LineGroup& a, const LineGroup& b) { return a.key < b.key; });
  while (group != last)
  {
    // Both are ordered by key.
    const std::uint32_t key = group->key;
    const auto has_key = [key](const LineGroup& one) {
      return one.key == key;
    };
    const auto begin = std::find_if(end, stored.end(), [key](const LineGroup& one) { return one.key >= key; });
    end = std::find_if_not(begin, stored.end(), has_key);
    const auto next = std::find_if_not(group, last, has_key);
    const float share = begin == end ? 0.0F : 1.0F / static_cast<float>(end - begin);
    for (; group != next; ++group)
    {
      for (auto other = begin; other != end; ++other)
      {
        const float vote = (group->weight + other->weight) * share;
        for (std::size_t k = 0; k < 3 && group->segments[k] >= 0; ++k)
        {
          votes[static_cast<std::size_t>(other->segments[k]) * columns +
                static_cast<std::size_t>(group->segments[k])] += vote;
        }
      }
    }
  }
  return votes;
}

}  // namespace

std::vector<Parameter> parameters(LineGroupParams& params)
{
  return {
    choice<LineOrder>("line_order", params.order,
                      { { "contrast", LineOrder::CONTRAST }, { "upright", LineOrder::UPRIGHT } },
                      "which end is first: bright side left (free of roll), or upwards and to the right"),
    real("group_distance", params.max_distance, "px", "> 0",
         "largest distance from each segment of a pair to where their lines meet"),
    real("group_collinearity", params.collinearity, "px", ">= 0", "a point this close to a line counts as on it"),
    real("group_min_angle_deg", params.min_angle_deg, "degrees", "(0, 90)", "least angle between the lines of a pair"),
    integer("group_neighbours", params.max_neighbours, "", ">= 0",
            "pairs that a segment forms, the closest, 0 = no limit"),
    real("group_min_weight", params.min_weight, "", "[0, 1)", "structures less likely than this are left out"),
  };
}

std::vector<std::string> LineGroupParams::validate() const
{
  return faultsOf(*this);
}

int pairIndex(const Segment& a, const Segment& b, double collinearity)
{
  return 9 * digits(a, b, collinearity) + digits(b, a, collinearity);
}

std::optional<Eigen::Vector2d> lineIntersection(const Segment& a, const Segment& b, double min_sine)
{
  const Eigen::Vector2d da = a.end - a.start;
  const Eigen::Vector2d db = b.end - b.start;
  const double sine = cross(da, db);
  if (!(std::abs(sine) > min_sine * da.norm() * db.norm()))
  {
    return std::nullopt;
  }
  return a.start + da * (cross(b.start - a.start, db) / sine);
}

std::array<PairHypothesis, 4> pairHypotheses(const Segment& a, const Segment& b,
                                             const std::optional<Eigen::Vector2d>& intersection, double collinearity)
{
  constexpr double ALL = -1.0;
  return likelyHypotheses(a, b, intersection, collinearity, ALL);
}

std::uint32_t tripletKey(int p1, int p2, int p3, int c, int classes)
{
  return static_cast<std::uint32_t>(((p1 * PAIR_INDICES + p2) * PAIR_INDICES + p3) * classes + c);
}

void requireUsable(const Segments& segments)
{
  for (std::size_t i = 0; i < segments.size(); ++i)
  {
    if (!segments[i].start.allFinite() || !segments[i].end.allFinite() || !(segments[i].length() > 0.0))
    {
      throw std::invalid_argument("line segment " + std::to_string(i) + " is not finite or has no length");
    }
  }
}

LineIndex::LineIndex(const Segments& segments, const LineGroupParams& params)
  : segment_count_(static_cast<int>(segments.size()))
{
  requireNoFaults("line group parameters", params.validate());
  requireUsable(segments);
  groups_ = GroupBuilder(segments, params).build();
}

AssociationMatrix associateLines(const LineIndex& reference, const LineIndex& current)
{
  constexpr std::size_t PARTS = 2;  // of the current groups, each with votes of its own; fixed, so that sums are
  const std::vector<LineGroup>& seen = current.groups();
  const auto by_key = [](const LineGroup& a, const LineGroup& b) {
    return a.key < b.key;
  };
  const auto middle =
      seen.empty() ? seen.end() : std::lower_bound(seen.begin(), seen.end(), seen[seen.size() / 2], by_key);
  std::array<std::vector<float>, PARTS> votes;
  cv::parallel_for_(cv::Range(0, PARTS), [&](const cv::Range& range) {
    for (int part = range.start; part < range.end; ++part)
    {
      votes[static_cast<std::size_t>(part)] =
          votesOf(reference, part == 0 ? seen.begin() : middle, part == 0 ? middle : seen.end(),
                  static_cast<std::size_t>(current.segmentCount()));
    }
  });
  const std::size_t columns = static_cast<std::size_t>(current.segmentCount());
  std::vector<Association> entries;
  entries.reserve(votes[0].size());
  for (std::size_t i = 0; i < votes[0].size(); ++i)
  {
    const float sum = votes[0][i] + votes[1][i];
    if (sum > 0.0F)
    {
      entries.push_back({ static_cast<int>(i / columns), static_cast<int>(i % columns), static_cast<double>(sum) });
    }
  }
  return { reference.segmentCount(), current.segmentCount(), std::move(entries) };
}

}  // namespace view_servo
