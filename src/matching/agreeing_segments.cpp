// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "agreeing_segments.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace view_servo
{
namespace
{
/** Those of the largest shares, each segment at most once; the largest share comes first. */
std::vector<SegmentMatch> oneToOne(std::vector<SegmentMatch> matches, std::size_t references, std::size_t currents)
{
  std::stable_sort(matches.begin(), matches.end(),
                   [](const SegmentMatch& a, const SegmentMatch& b) { return a.share > b.share; });
  std::vector<char> reference_used(references, 0);
  std::vector<char> current_used(currents, 0);
  std::vector<SegmentMatch> kept;
  for (const SegmentMatch& match : matches)
  {
    char& reference = reference_used[static_cast<std::size_t>(match.reference)];
    char& current = current_used[static_cast<std::size_t>(match.current)];
    if (reference == 0 && current == 0)
    {
      reference = current = 1;
      kept.push_back(match);
    }
  }
  return kept;
}

}  // namespace

std::vector<SegmentMatch> agreeingSegments(const Segments& reference, const std::vector<int>& of,
                                           const LineFeatures& current, const Eigen::Matrix3d& h, double tolerance,
                                           double max_angle_deg)
{
  const double min_cosine = std::cos(max_angle_deg * M_PI / 180.0);
  std::vector<SegmentMatch> found;
  std::vector<int> candidates;
  for (const int i : of)
  {
    const auto mapped = transfer(h, reference[static_cast<std::size_t>(i)]);
    if (!mapped)
    {
      continue;
    }
    const SegmentProbe probe(*mapped, tolerance, min_cosine);
    current.alongside(*mapped, tolerance, max_angle_deg, candidates);
    for (const int k : candidates)
    {
      const double share = probe.agreement(current.segment(k), current.direction(k));
      if (share > 0.0)
      {
        found.push_back({ i, k, share });
      }
    }
  }
  return oneToOne(std::move(found), reference.size(), current.segments().size());
}

}  // namespace view_servo
