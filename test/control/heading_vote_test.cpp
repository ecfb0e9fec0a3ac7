// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/heading_vote.h"

#include "support/level_matches.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double BIN = M_PI / 180.0;  // of the default parameters

/**
 * Matches of points 1.5 to 6 m away with half a pixel of noise, and of unrelated positions; all weights 1. Made without
 * what is tested: in the reference camera's frame the current one is at `reference_in_current`'s inverse.
 */
HeadingEvidence evidenceOf(const PlanarPose& reference_in_current, int inliers, int outliers, Rng& rng)
{
  HeadingEvidence evidence;
  while (static_cast<int>(evidence.pairs.size()) < inliers)
  {
    const Eigen::Vector2d reference = test::randomPosition(rng);
    const Eigen::Vector3d p = uniform(rng, 1.5, 6.0) * reference.homogeneous();
    const Eigen::Vector3d current = test::inCurrentCamera(p, reference_in_current);
    if (current.z() > 0.3)
    {
      const Eigen::Vector2d seen = test::noisy(reference, rng);
      evidence.pairs.push_back({ seen, test::noisy(current.hnormalized(), rng) });
    }
  }
  for (int i = 0; i < outliers; ++i)
  {
    const Eigen::Vector2d reference = test::randomPosition(rng);
    evidence.pairs.push_back({ reference, test::randomPosition(rng) });
  }
  evidence.weights.assign(evidence.pairs.size(), 1.0);
  return evidence;
}

PlanarPose towards(double heading, double distance, double yaw)
{
  return { distance * std::cos(heading), distance * std::sin(heading), yaw };
}

/** One exact vote for a heading, without turn. */
void addVote(double heading, double weight, HeadingEvidence& evidence)
{
  const double epipole = -std::tan(heading);
  const Eigen::Vector2d away(0.2, 0.15);
  const Eigen::Vector2d horizon(epipole, 0.0);
  evidence.pairs.push_back({ horizon + away, horizon + 2.0 * away });
  evidence.weights.push_back(weight);
}

HeadingHistogram votesFor(const std::vector<std::pair<double, double>>& headings_and_weights,
                          const HeadingVoteParams& params = HeadingVoteParams())
{
  HeadingEvidence evidence;
  for (const auto& [heading, weight] : headings_and_weights)
  {
    addVote(heading, weight, evidence);
  }
  return HeadingHistogram(evidence, 0.0, params);
}

double peakHeading(const HeadingHistogram& histogram)
{
  const std::optional<std::size_t> peak = histogram.peak(-M_PI_2, M_PI_2);
  return peak ? histogram.heading(*peak) : std::numeric_limits<double>::quiet_NaN();
}

double sumOf(const std::vector<double>& values)
{
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace

// ---- the histogram

TEST(HeadingHistogram, BinsReachFromRightToLeft)
{
  for (const int bins : { 3, 181, 200 })
  {
    HeadingVoteParams params;
    params.bins = bins;
    const HeadingHistogram histogram(HeadingEvidence(), 0.0, params);
    ASSERT_EQ(histogram.votes().size(), static_cast<std::size_t>(bins));
    EXPECT_NEAR(histogram.heading(0), -M_PI_2, 1e-12);
    EXPECT_NEAR(histogram.heading(histogram.votes().size() - 1), M_PI_2, 1e-12);
    EXPECT_NEAR(histogram.heading(1) - histogram.heading(0), M_PI / (bins - 1), 1e-12);
  }
}

TEST(HeadingHistogram, PeaksAtTheHeadingAmongFalseMatches)
{
  for (const double heading : { -1.2, -0.6, 0.0, 0.43, 1.0 })
  {
    for (std::uint64_t seed = 1; seed <= 5; ++seed)
    {
      Rng rng(seed);
      const HeadingEvidence evidence = evidenceOf(towards(heading, 0.8, 0.0), 80, 80, rng);
      const HeadingHistogram histogram(evidence, 0.0, HeadingVoteParams());
      EXPECT_NEAR(peakHeading(histogram), heading, 2.0 * DEGREE) << heading << ", seed " << seed;
    }
  }
}

TEST(HeadingHistogram, DoesNotTellAheadFromBehind)
{
  Rng rng(1);
  const HeadingEvidence evidence = evidenceOf(towards(M_PI - 0.4, 0.7, 0.0), 100, 0, rng);
  EXPECT_NEAR(peakHeading(HeadingHistogram(evidence, 0.0, HeadingVoteParams())), -0.4, 2.0 * DEGREE);
}

TEST(HeadingHistogram, TakesTheTurnOut)
{
  for (const double yaw : { -0.3, 0.15, 0.5 })
  {
    for (const double heading : { -0.7, 0.1, 0.6 })
    {
      Rng rng(2);
      const HeadingEvidence evidence = evidenceOf(towards(heading, 0.8, yaw), 120, 60, rng);
      EXPECT_NEAR(peakHeading(HeadingHistogram(evidence, yaw, HeadingVoteParams())), heading, 2.0 * DEGREE)
          << heading << ", " << yaw;
    }
  }
  // Without it the votes are scattered.
  Rng rng(2);
  const HeadingEvidence evidence = evidenceOf(towards(0.1, 0.8, 0.5), 120, 0, rng);
  const HeadingHistogram with(evidence, 0.5, HeadingVoteParams());
  const HeadingHistogram without(evidence, 0.0, HeadingVoteParams());
  EXPECT_GT(with.votes()[*with.peak(-M_PI_2, M_PI_2)], 2.0 * without.votes()[*without.peak(-M_PI_2, M_PI_2)]);
}

TEST(HeadingHistogram, HeadingsFarToTheSideSurviveATurn)
{
  // In the reference camera's frame such an epipole lies beyond +-pi/2, where it stands for the opposite direction.
  for (const auto& [heading, yaw] : { std::make_pair(-1.24, 0.5), std::make_pair(1.24, -0.5) })
  {
    Rng rng(3);
    const HeadingEvidence evidence = evidenceOf(towards(heading, 0.8, yaw), 100, 0, rng);
    EXPECT_NEAR(peakHeading(HeadingHistogram(evidence, yaw, HeadingVoteParams())), heading, 2.0 * DEGREE);
  }
}

TEST(HeadingHistogram, CountsWeights)
{
  EXPECT_NEAR(peakHeading(votesFor({ { 0.5, 1.0 }, { -0.5, 2.0 } })), -0.5, 0.51 * BIN);
  EXPECT_NEAR(peakHeading(votesFor({ { 0.5, 2.0 }, { -0.5, 1.0 } })), 0.5, 0.51 * BIN);
}

TEST(HeadingHistogram, SpreadsVotesWithoutLosingAny)
{
  HeadingVoteParams sharp;
  sharp.smoothing = 0.0;
  const HeadingHistogram one = votesFor({ { 20.0 * BIN, 3.0 } }, sharp);
  EXPECT_NEAR(one.votes()[110], 3.0, 1e-12);
  EXPECT_NEAR(sumOf(one.votes()), 3.0, 1e-12);
  HeadingVoteParams soft;
  soft.smoothing = 2.0 * BIN;
  const HeadingHistogram spread = votesFor({ { 20.0 * BIN, 3.0 } }, soft);
  EXPECT_NEAR(sumOf(spread.votes()), 3.0, 1e-9);
  EXPECT_NEAR(spread.votes()[108], spread.votes()[112], 1e-12);
  EXPECT_NEAR(spread.votes()[112] / spread.votes()[110], std::exp(-0.5), 1e-9);
}

TEST(HeadingHistogram, MatchesThatSayNothingDoNotVote)
{
  HeadingEvidence evidence;
  evidence.pairs = {
    { { 0.2, 0.0 }, { 0.3, 0.0 } },  // on the horizon
    { { 0.2, 0.3 }, { 0.4, 0.3 } },  // as high in both
    { { 0.2, 0.3 }, { 0.2, 0.3 } },  // in the same place
  };
  evidence.weights.assign(3, 1.0);
  EXPECT_EQ(sumOf(HeadingHistogram(evidence, 0.0, HeadingVoteParams()).votes()), 0.0);
  // Behind the camera that looks as the reference did.
  evidence.pairs = { { { 0.2, 0.3 }, { 3.0, 0.4 } } };
  evidence.weights.assign(1, 1.0);
  EXPECT_GT(sumOf(HeadingHistogram(evidence, 0.3, HeadingVoteParams()).votes()), 0.0);
  EXPECT_EQ(sumOf(HeadingHistogram(evidence, 1.4, HeadingVoteParams()).votes()), 0.0);
}

TEST(HeadingHistogram, PeakLiesWithinTheLimits)
{
  const HeadingHistogram histogram = votesFor({ { -0.8, 5.0 }, { 0.3, 2.0 }, { 0.9, 1.0 } });
  const auto at = [&histogram](double min, double max) {
    const std::optional<std::size_t> peak = histogram.peak(min, max);
    return peak ? histogram.heading(*peak) : 9.0;
  };
  EXPECT_NEAR(at(-M_PI_2, M_PI_2), -0.8, 0.51 * BIN);
  EXPECT_NEAR(at(0.0, M_PI_2), 0.3, 0.51 * BIN);
  EXPECT_NEAR(at(0.6, M_PI_2), 0.9, 0.51 * BIN);
  EXPECT_EQ(at(-0.3, 0.0), 9.0);
  EXPECT_EQ(at(0.5, 0.2), 9.0);
  EXPECT_FALSE(HeadingHistogram().peak(-M_PI_2, M_PI_2).has_value());
  EXPECT_FALSE(HeadingHistogram(HeadingEvidence(), 0.0, HeadingVoteParams()).peak(-M_PI_2, M_PI_2).has_value());
}

// ---- the region of interest

TEST(HeadingRegion, IsEverywhereAtFirstButNearTheSides)
{
  const HeadingVoteParams params;
  const HeadingRegion region(params);
  EXPECT_NEAR(region.min(), params.margin - M_PI_2, 1e-12);
  EXPECT_NEAR(region.max(), M_PI_2 - params.margin, 1e-12);
}

TEST(HeadingRegion, MovesAndNarrows)
{
  const HeadingVoteParams params;
  HeadingRegion region(params);
  double half_width = M_PI_2 - params.margin;
  for (const double heading : { 0.3, 0.35, 0.3, 0.25, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3 })
  {
    const std::optional<double> chosen = region.choose(votesFor({ { heading, 1.0 } }));
    ASSERT_TRUE(chosen.has_value());
    EXPECT_NEAR(*chosen, heading, 0.51 * BIN);
    half_width = std::max(params.narrowing * half_width, params.min_half_width);
    EXPECT_NEAR(region.min(), std::max(*chosen - half_width, params.margin - M_PI_2), 1e-12);
    EXPECT_NEAR(region.max(), std::min(*chosen + half_width, M_PI_2 - params.margin), 1e-12);
  }
  EXPECT_NEAR(region.max() - region.min(), 2.0 * params.min_half_width, 1e-12);
}

TEST(HeadingRegion, HigherFalsePeakOutsideIsNotTaken)
{
  const HeadingVoteParams params;
  HeadingRegion region(params);
  for (int i = 0; i < 4; ++i)
  {
    region.choose(votesFor({ { 0.3, 1.0 } }));
  }
  double half_width = 0.5 * (region.max() - region.min());
  const std::optional<double> chosen = region.choose(votesFor({ { 0.35, 1.0 }, { -0.8, 5.0 } }));
  ASSERT_TRUE(chosen.has_value());
  EXPECT_NEAR(*chosen, 0.35, 0.51 * BIN);
  half_width *= params.widening;
  EXPECT_NEAR(0.5 * (region.max() - region.min()), half_width, 1e-12);
  EXPECT_NEAR(0.5 * (region.max() + region.min()), *chosen, 1e-12);
  // When it stays there, the region becomes as wide that it gives in.
  int steps = 0;
  double heading = 0.35;
  while (std::abs(heading + 0.8) > BIN && ++steps < 20)
  {
    heading = *region.choose(votesFor({ { 0.35, 1.0 }, { -0.8, 5.0 } }));
  }
  EXPECT_GE(steps, 2);
  EXPECT_LT(steps, 20);
}

TEST(HeadingRegion, StaysWithinTheMargin)
{
  const HeadingVoteParams params;
  const double limit = M_PI_2 - params.margin;
  HeadingRegion region(params);
  // The sides are not taken, whatever speaks for them.
  EXPECT_NEAR(*region.choose(votesFor({ { 1.5, 9.0 }, { 1.35, 1.0 } })), 1.35, BIN);
  EXPECT_NEAR(region.max(), limit, 1e-12);
  EXPECT_GE(region.min(), -limit);
  // ... nor do they count as the highest peak: the region narrows.
  EXPECT_NEAR(region.min(), 1.35 - params.narrowing * limit, BIN);
  for (int i = 0; i < 30; ++i)
  {
    region.choose(votesFor({ { 1.3, 1.0 }, { -1.3, 9.0 } }));
    EXPECT_LE(region.max(), limit + 1e-12);
    EXPECT_GE(region.min(), -limit - 1e-12);
    EXPECT_LT(region.min(), region.max());
  }
}

TEST(HeadingRegion, ChoosesNothingWithoutVotes)
{
  HeadingRegion region{ HeadingVoteParams() };
  region.choose(votesFor({ { 0.3, 1.0 } }));
  const double min = region.min();
  const double max = region.max();
  EXPECT_FALSE(region.choose(votesFor({})).has_value());
  EXPECT_FALSE(region.choose(votesFor({ { -1.2, 1.0 } })).has_value());  // all outside
  EXPECT_FALSE(region.choose(HeadingHistogram()).has_value());
  EXPECT_EQ(region.min(), min);
  EXPECT_EQ(region.max(), max);
}

// ---- parameters

TEST(HeadingVoteParams, NameAllFaultsAtOnce)
{
  EXPECT_TRUE(HeadingVoteParams().validate().empty());
  HeadingVoteParams params;
  params.bins = 2;
  params.margin = M_PI_2;
  params.smoothing = -0.1;
  params.narrowing = 0.0;
  params.widening = 0.9;
  params.min_half_width = 0.0;
  const std::vector<std::string> faults = params.validate();
  ASSERT_EQ(faults.size(), 6U);
  const std::vector<std::string> names{ "heading_bins",  "heading_margin", "heading_smoothing",
                                        "roi_narrowing", "roi_widening",   "roi_min_half_width" };
  for (std::size_t i = 0; i < names.size(); ++i)
  {
    EXPECT_EQ(faults[i].find(names[i]), 0U) << faults[i];
  }
  params = HeadingVoteParams();
  params.widening = std::numeric_limits<double>::quiet_NaN();
  params.margin = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 2U);
}

TEST(HeadingVoteParams, LeaveRoomForTheRegion)
{
  // The margins leave less than the least width of the region: std::clamp() must not be asked for that.
  HeadingVoteParams params;
  params.margin = 1.5;
  params.min_half_width = 0.1;
  EXPECT_FALSE(params.validate().empty());
}

}  // namespace view_servo
