// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/profile_experiments.h"

#include "experiments/point_pairs.h"
#include "experiments/statistics.h"
#include "view_servo/matching/point_matcher.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/view_consistency.h"
#include "view_servo/views/point_view_matcher.h"

#include <opencv2/core.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** The features of both images of a pair, for several ways to match them. */
class MatchedFeatures
{
public:
  MatchedFeatures(const PointPair& pair, const PointMatcherParams& params)
    : reference_(extractPointFeatures(pair.reference, params)),
      current_(extractPointFeatures(pair.current, params)),
      index_(reference_.profiles)
  {
  }

  Correspondences candidates(const PointMatcherParams& params) const
  {
    Correspondences pairs;
    for (const Association& match :
         candidateMatches(associatePoints(reference_, index_, current_, params), params.assignment))
    {
      pairs.push_back({ reference_.corners[static_cast<std::size_t>(match.row)].position,
                        current_.corners[static_cast<std::size_t>(match.column)].position });
    }
    return pairs;
  }

private:
  PointFeatures reference_;
  PointFeatures current_;
  ProfileIndex index_;
};

/** What RANSAC leaves of candidates. */
struct Estimate
{
  double inliers = 0.0;
  double correct = 0.0;
  double error = NOT_A_NUMBER;  ///< of the geometry [px]
  double ms = 0.0;
  RansacStatistics statistics;
};

Estimate estimate(const PointPair& pair, const Correspondences& candidates, double view_threshold,
                  const RansacParams& params, std::uint64_t seed)
{
  Rng rng(seed);
  const auto result = ransac(FundamentalEstimator(candidates, view_threshold), params, rng);
  Estimate found;
  found.inliers = static_cast<double>(result.inliers.size());
  found.correct = pair.countCorrect(select(candidates, result.inliers));
  if (result.model && pair.model == GeometryModel::FUNDAMENTAL)
  {
    found.error = pair.geometryError(GeometryModel::FUNDAMENTAL, *result.model);
  }
  found.ms = result.statistics.elapsed_ms;
  found.statistics = result.statistics;
  return found;
}

/** The median of each number; NaN counts as larger than any number. */
Estimate medians(const std::vector<Estimate>& estimates)
{
  const auto of = [&](const auto& member) {
    std::vector<double> values;
    for (const Estimate& one : estimates)
    {
      const double value = member(one);
      values.push_back(std::isnan(value) ? std::numeric_limits<double>::infinity() : value);
    }
    return medianOf(values);
  };
  Estimate middle;
  middle.inliers = of([](const Estimate& one) { return one.inliers; });
  middle.correct = of([](const Estimate& one) { return one.correct; });
  middle.error = of([](const Estimate& one) { return one.error; });
  middle.error = std::isfinite(middle.error) ? middle.error : NOT_A_NUMBER;
  middle.ms = of([](const Estimate& one) { return one.ms; });
  middle.statistics.iterations =
      static_cast<int>(of([](const Estimate& one) { return static_cast<double>(one.statistics.iterations); }));
  middle.statistics.rejected_samples =
      static_cast<int>(of([](const Estimate& one) { return static_cast<double>(one.statistics.rejected_samples); }));
  return middle;
}

// ------------------------------------------------------------------------------------------- figures 6.8 to 6.10

/** A kind of profiles, and the searches among them that a figure compares. */
struct Setting
{
  std::string figure;
  ProfileParams profiles;
  std::vector<ProfileSearchParams> searches;
};

ProfileSearchParams nearestProfiles(int neighbours)
{
  ProfileSearchParams params;
  params.neighbours = neighbours;
  params.epsilon = 0.0;
  return params;
}

ProfileSearchParams profilesWithin(double radius)
{
  ProfileSearchParams params;
  params.search = ProfileSearch::RADIUS;
  params.radius = radius;
  return params;
}

std::vector<Setting> allSettings(bool brief)
{
  const std::size_t step = brief ? 3 : 1;
  const std::vector<double> distances = { 50.0, 100.0, 200.0, 300.0 };  // D_c [px]
  const std::vector<int> counts = { 50, 100, 200, 300 };                // K_c
  const std::vector<ProfileSearchParams> two = { profilesWithin(0.4), nearestProfiles(25) };
  std::vector<Setting> settings;
  ProfileParams profiles;
  profiles.coefficients = 6;
  profiles.selection = PairSelection::RADIUS;
  for (std::size_t i = 0; i < distances.size(); i += step)
  {
    profiles.max_length = distances[i];
    settings.push_back({ "6.8", profiles, two });
  }
  profiles.selection = PairSelection::NEAREST;
  for (std::size_t i = 0; i < counts.size(); i += step)
  {
    profiles.neighbours = counts[i];
    settings.push_back({ "6.9", profiles, two });
  }
  std::vector<ProfileSearchParams> many;
  const std::vector<double> radii = { 0.1, 0.25, 0.5, 1.0, 1.5 };  // D_v
  const std::vector<int> neighbours = { 1, 5, 25, 50 };            // K_v
  for (std::size_t i = 0; i < radii.size(); i += step)
  {
    many.push_back(profilesWithin(radii[i]));
  }
  for (std::size_t i = 0; i < neighbours.size(); i += step)
  {
    many.push_back(nearestProfiles(neighbours[i]));
  }
  profiles.neighbours = ProfileParams().neighbours;
  for (const int coefficients : { 4, 6, 8 })
  {
    profiles.coefficients = coefficients;
    settings.push_back({ "6.10", profiles, many });
  }
  return settings;
}

}  // namespace

void runProfileParametersExperiment(const ExperimentContext& context, std::ostream& csv)
{
  cv::setNumThreads(context.threads > 0 ? context.threads : -1);
  std::vector<PointPair> pairs = { readOxfordPair(context.data, "graf", 3) };
  if (!context.brief)
  {
    pairs.push_back(readOxfordPair(context.data, "boat", 3));
    pairs.push_back(readOxfordPair(context.data, "bikes", 4));
    pairs.push_back(readOxfordPair(context.data, "leuven", 4));
    pairs.push_back(readMertonPoints(context.data, 1, 2));
    pairs.push_back(readKusvodPair(context.data, "box"));
    pairs.push_back(readKusvodPair(context.data, "plant"));
  }
  pairs.push_back(readKusvodPair(context.data, "wash"));
  RansacParams ransac_params;
  ransac_params.inlier_threshold = 1.0;
  const auto runs = static_cast<std::uint64_t>(context.runsOf(PROFILE_RUNS));
  csv << "figure,pair,pairing,pairing_value,coefficients,search,search_value,candidates,correct_candidates,matches,"
         "correct_matches,error_px\n";
  for (const PointPair& pair : pairs)
  {
    for (const Setting& setting : allSettings(context.brief))
    {
      PointMatcherParams params;
      params.corners.max_corners = context.brief ? 200 : 500;
      params.cyclic_order = false;
      params.profiles = setting.profiles;
      const MatchedFeatures features(pair, params);
      for (const ProfileSearchParams& search : setting.searches)
      {
        params.search = search;
        const Correspondences candidates = features.candidates(params);
        std::vector<Estimate> estimates;
        for (std::uint64_t run = 1; run <= runs; ++run)
        {
          estimates.push_back(estimate(pair, candidates, 0.0, ransac_params, context.seedOf(PROFILE_RUNS, run)));
        }
        const Estimate found = medians(estimates);
        const bool near_pairs = setting.profiles.selection == PairSelection::NEAREST;
        const bool near_profiles = search.search == ProfileSearch::NEAREST;
        csv << setting.figure << ',' << pair.name << ',' << (near_pairs ? "Kc" : "Dc") << ','
            << (near_pairs ? setting.profiles.neighbours : setting.profiles.max_length) << ','
            << setting.profiles.coefficients << ',' << (near_profiles ? "Kv" : "Dv") << ','
            << (near_profiles ? search.neighbours : search.radius) << ',' << candidates.size() << ','
            << pair.countCorrect(candidates) << ',' << found.inliers << ',' << found.correct << ',' << found.error
            << '\n';
      }
      std::cerr << pair.name << ", figure " << setting.figure << ": done" << std::endl;
    }
  }
}

// --------------------------------------------------------------------------------------------- tables 6.2 and 6.3

namespace
{
std::vector<PointPair> readConsistencyPairs(const ExperimentContext& context)
{
  std::vector<PointPair> pairs;
  for (const std::string& name : kusvodPairs())
  {
    if (!context.brief || pairs.empty())
    {
      pairs.push_back(readKusvodPair(context.data, name));
    }
  }
  for (int view = 2; view <= 3 && !context.brief; ++view)
  {
    pairs.push_back(readMertonPoints(context.data, 1, view));
  }
  return pairs;
}

/** What each run on one pair found. */
struct ConsistencyRuns
{
  std::vector<Estimate> plain;   ///< without the constraint
  std::vector<Estimate> before;  ///< from the candidates that the constraint keeps
  std::vector<Estimate> within;  ///< from samples that the constraint accepts
  std::vector<Estimate> same;    ///< without the constraint, as many samples as `within` drew
  std::vector<double> kept;
  std::vector<double> kept_correct;
  std::vector<double> filter_ms;
  std::vector<double> factors;  ///< time of `same` by that of `within`
};

void addRun(const PointPair& pair, const Correspondences& candidates, std::uint64_t seed, ConsistencyRuns& runs)
{
  constexpr int SAMPLES = 2000;  // as the thesis has them
  const ViewConsistencyParams consistency;
  RansacParams params;
  params.inlier_threshold = 1.0;
  params.sampling = Sampling::UNIFORM;  // so that the same seed draws the same samples with and without the constraint
  params.min_iterations = SAMPLES;
  params.max_iterations = SAMPLES;
  runs.plain.push_back(estimate(pair, candidates, 0.0, params, seed));

  Rng rng(seed);
  const auto start = std::chrono::steady_clock::now();
  const Correspondences consistent = select(candidates, viewConsistentCandidates(candidates, consistency, rng));
  runs.filter_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  runs.kept.push_back(static_cast<double>(consistent.size()));
  runs.kept_correct.push_back(pair.countCorrect(consistent));
  runs.before.push_back(estimate(pair, consistent, 0.0, params, seed));

  runs.within.push_back(estimate(pair, candidates, consistency.threshold, params, seed));
  const RansacStatistics& statistics = runs.within.back().statistics;
  RansacParams same_samples = params;
  same_samples.max_iterations = statistics.iterations + statistics.rejected_samples;
  same_samples.min_iterations = same_samples.max_iterations;
  runs.same.push_back(estimate(pair, candidates, 0.0, same_samples, seed));
  runs.factors.push_back(runs.same.back().ms / runs.within.back().ms);
}

/** A line of the table but for its first fields, which name the pair and count its candidates. */
void writeMedians(const ConsistencyRuns& runs, std::ostream& csv)
{
  const auto put = [&](const Estimate& found) {
    csv << found.inliers << ',' << found.correct << ',' << found.error << ',';
  };
  put(medians(runs.plain));
  csv << medians(runs.plain).ms << ',' << medianOf(runs.kept) << ',' << medianOf(runs.kept_correct) << ','
      << medianOf(runs.filter_ms) << ',';
  put(medians(runs.before));
  csv << medians(runs.before).ms << ',';
  put(medians(runs.within));
  csv << medians(runs.within).statistics.iterations << ',' << medians(runs.within).statistics.rejected_samples << ','
      << medians(runs.within).ms << ',';
  put(medians(runs.same));
  csv << medians(runs.same).ms << ',' << medianOf(runs.factors) << '\n';
}

}  // namespace

void runViewConsistencyExperiment(const ExperimentContext& context, std::ostream& csv)
{
  cv::setNumThreads(context.threads > 0 ? context.threads : -1);
  const std::vector<PointPair> pairs = readConsistencyPairs(context);
  const auto runs = static_cast<std::uint64_t>(context.runsOf(VIEW_CONSISTENCY_RUNS));
  csv << "pair,votes,candidates,correct_candidates,plain_matches,plain_correct,plain_error_px,plain_ms,"
         "kept,kept_correct,filter_ms,before_matches,before_correct,before_error_px,before_ms,"
         "within_matches,within_correct,within_error_px,samples_solved,samples_refused,within_ms,"
         "same_matches,same_correct,same_error_px,same_ms,factor\n";
  for (const PointPair& pair : pairs)
  {
    for (const bool cyclic : { false, true })
    {
      PointMatcherParams matching;
      matching.cyclic_order = cyclic;
      const Correspondences candidates = MatchedFeatures(pair, matching).candidates(matching);
      ConsistencyRuns found;
      for (std::uint64_t run = 1; run <= runs; ++run)
      {
        addRun(pair, candidates, context.seedOf(VIEW_CONSISTENCY_RUNS, run), found);
      }
      csv << pair.name << ',' << (cyclic ? "cyclic" : "plain") << ',' << candidates.size() << ','
          << pair.countCorrect(candidates) << ',';
      writeMedians(found, csv);
      std::cerr << pair.name << (cyclic ? ", cyclic order" : ", plain votes") << ": " << medianOf(found.factors)
                << " times less time" << std::endl;
    }
  }
}

}  // namespace view_servo
