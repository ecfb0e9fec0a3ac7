// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_segment.h"
#include "view_servo/matching/association.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * Groups of line segments and their combinatorial structure (thesis 4.1-4.4; Carlsson 1996): on which side of one
 * segment the end points of another lie. It does not change with the viewpoint as long as each point keeps its side,
 * and never does for coplanar segments in front of the camera.
 */

/** How many segments form a group. */
enum class LineGrouping
{
  PAIRS,    ///< two segments
  TRIPLETS  ///< two pairs that share a segment
};

/** How a segment's start is told from its end, and the first segment of a pair from the second. */
enum class LineOrder
{
  CONTRAST,  ///< start and end as given (brighter side left), a pair by its sense of rotation; works under any roll
  UPRIGHT    ///< thesis 4.1: vertical ones from bottom to top, others left to right; the cameras must not roll
};

/** Options of forming groups. */
struct LineGroupParams
{
  LineGrouping groups = LineGrouping::TRIPLETS;  ///< how many segments a group has
  LineOrder order = LineOrder::CONTRAST;         ///< how the ends of a segment are told apart
  double max_distance = 100.0;  ///< largest distance of each segment of a pair from where their lines meet [px]
  double collinearity = 2.0;    ///< a point this close to a segment's line counts as on it [px]
  double min_angle_deg = 15.0;  ///< least angle between the lines of the two segments of a pair [deg]
  int max_neighbours = 15;      ///< most pairs that a segment forms, the closest ones; 0 = no limit
  double min_weight = 0.1;      ///< structures less likely than this are left out

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(LineGroupParams& params);

/** Number of pair indices: four signs, to base 3. */
constexpr int PAIR_INDICES = 81;

/**
 * Structure of two segments (thesis eq. 4.1, 4.2): the signs of |a1 a2 b1|, |a1 a2 b2|, |b1 b2 a1|, |b1 b2 a2| as the
 * digits of a number to base 3, in [0, 80]. (The thesis prints 81 as its upper end.) A sign is 0 where the point lies
 * within `collinearity` [px] of the segment's line, which is the determinant over the segment's length.
 */
int pairIndex(const Segment& a, const Segment& b, double collinearity);

/** Intersection of the lines through two segments; empty when the sine of their angle is at most `min_sine`. */
std::optional<Eigen::Vector2d> lineIntersection(const Segment& a, const Segment& b, double min_sine);

/** One of the structures that a pair may have had before its segments were broken up, and how likely it is. */
struct PairHypothesis
{
  int index;      ///< as pairIndex() gives it
  double weight;  ///< probability of this structure, [0, 1]
};

/**
 * The four structures of two segments of which neither, either or both may have reached their lines' intersection
 * (thesis 4.2, fig. 4.6), in the order none, both, only a, only b; the weights sum to 1. An extended segment has its
 * nearest end point on the intersection, so that this point's determinant is 0. `intersection` is that of the lines;
 * without one (parallel lines) the first has weight 1.
 */
std::array<PairHypothesis, 4> pairHypotheses(const Segment& a, const Segment& b,
                                             const std::optional<Eigen::Vector2d>& intersection, double collinearity);

/** A pair (third segment -1) or a triplet, whose first segment is the shared one, with one of its structures. */
struct LineGroup
{
  std::uint32_t key;            ///< equal keys: same structure; see tripletKey()
  float weight;                 ///< probability of the structure, (0, 1]
  std::array<int, 3> segments;  ///< their indices; in groups of equal key, segments at the same place correspond
};

/**
 * Key of a triplet: ((p1 * 81 + p2) * 81 + p3) * classes + c, with the indices p1 to p3 of its three pairs, as
 * pairIndex() gives them, and its class c in [0, classes). The thesis' eq. 4.3 adds the class c to the last index,
 * which lets keys collide.
 */
std::uint32_t tripletKey(int p1, int p2, int p3, int c, int classes);

/** @throws std::invalid_argument when a segment is not finite or has no length, naming it by its index. */
void requireUsable(const Segments& segments);

/** The groups of an image's segments, ordered by key. */
class LineIndex
{
public:
  LineIndex() = default;
  /** @throws std::invalid_argument naming the parameters' faults, and as requireUsable(). */
  LineIndex(const Segments& segments, const LineGroupParams& params);

  const std::vector<LineGroup>& groups() const
  {
    return groups_;
  }
  int segmentCount() const
  {
    return segment_count_;
  }

private:
  std::vector<LineGroup> groups_;
  int segment_count_ = 0;
};

/**
 * Votes (thesis 4.4): each group of the current image, of weight w, gives (w_i + w) / n to the association of every
 * segment with its counterpart in each of the n reference groups with the same key, of weights w_i.
 */
AssociationMatrix associateLines(const LineIndex& reference, const LineIndex& current);

}  // namespace view_servo
