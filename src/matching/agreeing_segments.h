// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_homography.h"
#include "view_servo/geometry/line_segment.h"
#include "view_servo/matching/line_features.h"
#include "view_servo/matching/line_regions.h"

#include <Eigen/Core>

#include <vector>

namespace view_servo
{
/**
 * Compares one segment of the current image with many others. Most of them do not agree, which a look at directions and
 * bounding boxes shows before compare() is called.
 */
class SegmentProbe
{
public:
  /** @param tolerance largest distance across [px]. @param min_cosine least cosine of the angle between them. */
  SegmentProbe(const Segment& segment, double tolerance, double min_cosine)
    : segment_(segment),
      tolerance_(tolerance),
      min_cosine_(min_cosine),
      along_(segment.end - segment.start),
      min_along_(min_cosine * along_.norm()),
      low_(segment.start.array().min(segment.end.array()) - tolerance),
      high_(segment.start.array().max(segment.end.array()) + tolerance)
  {
  }

  /**
   * SegmentAgreement::share of the two, or 0 when they do not agree. @param direction from the other's start to its
   * end, a unit vector.
   */
  double agreement(const Segment& other, const Eigen::Vector2d& direction) const
  {
    constexpr double MIN_OVERLAP = 0.35;  // of the shorter segment
    if (along_.dot(direction) < min_along_ || (other.start.array().max(other.end.array()) < low_).any() ||
        (other.start.array().min(other.end.array()) > high_).any())
    {
      return 0.0;
    }
    const SegmentAgreement found = compare(segment_, other);
    const bool agrees = found.cosine >= min_cosine_ && found.overlap >= MIN_OVERLAP && found.distance <= tolerance_;
    return agrees ? found.share : 0.0;
  }

private:
  const Segment segment_;
  const double tolerance_;
  const double min_cosine_;
  const Eigen::Vector2d along_;  // from the segment's start to its end [px]
  const double min_along_;       // component of along_ in the direction of a segment that agrees [px]
  const Eigen::Array2d low_;     // least u and v of the segment's bounding box, widened by the tolerance [px]
  const Eigen::Array2d high_;    // largest u and v of that box [px]
};

/**
 * The one-to-one matches that agree with a homography (x_cur ~ H x_ref) among the reference segments `of`, given by
 * their indices, and all current ones: within `tolerance` [px] across, within `max_angle_deg`, and side by side for a
 * third of the shorter. The largest share comes first.
 */
std::vector<SegmentMatch> agreeingSegments(const Segments& reference, const std::vector<int>& of,
                                           const LineFeatures& current, const Eigen::Matrix3d& h, double tolerance,
                                           double max_angle_deg);

}  // namespace view_servo
