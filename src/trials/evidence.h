// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/heading_vote.h"
#include "view_servo/views/view_match.h"

namespace view_servo::sim
{
/** What a matcher finds in an image. */
struct StampedEvidence
{
  double stamp;            ///< of the image [s]
  HeadingEvidence pixels;  ///< matches in pixels of the raw images
};

/** All candidates of a match, weighted by their scores. */
inline StampedEvidence toEvidence(double stamp, const ViewMatch& match)
{
  StampedEvidence result{ stamp, {} };
  for (const MatchedPoint& point : match.matches)
  {
    result.pixels.pairs.push_back(point.position);
    result.pixels.weights.push_back(point.score);
  }
  return result;
}

}  // namespace view_servo::sim
