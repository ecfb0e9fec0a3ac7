// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/point_view_matcher.h"

#include "mirror.h"
#include "pair_geometry.h"
#include "repetition.h"
#include "stage_clock.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/robust/orientation.h"
#include "view_servo/robust/significance.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <memory>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr std::size_t MIN_CORNERS = 8;
constexpr int MAX_GUIDED_ROUNDS = 6;

/** Why a geometry that chance does not explain is not believed. */
enum class Refusal
{
  NONE,
  LEFT_OPEN,  ///< by the matches, which do not determine it
  REPEATED,   ///< other places agree with it nearly as well
  MIRRORED    ///< the mirrored image agrees with one better
};

/** Which levels of reference and current image are compared. */
struct LevelPair
{
  int reference;
  int current;
};
// Besides the full images: both blurred (2, 2), the current one smaller by 2 (2, 0), larger by 2 (0, 2), and so on.
constexpr LevelPair OTHER_SCALES[] = { { 2, 2 }, { 2, 0 }, { 0, 2 }, { 4, 4 }, { 3, 0 }, { 0, 3 }, { 4, 0 }, { 0, 4 } };

/** One comparison of two levels. */
struct LevelTrial
{
  LevelPair levels;
  double share;             ///< of the profiles that are searched for
  ProfileSearch search;     ///< how each is
  double min_significance;  ///< that a geometry must have to end the search
};

// A geometry from a quick search, or from a share of the profiles, ends the search only if it is beyond doubt, as most
// are; in the others the rest of the profiles may find a better one.
constexpr double BEYOND_DOUBT = 10.0;  // times the significance asked for

// A symmetric thing that matches in a mirrored image does so with less than this significance or, where it is large,
// with much around it that does not match.
constexpr double POINTS_BEYOND_MIRRORS = 60.0;
constexpr double MOST_CANDIDATES = 0.5;

/**
 * How much better the best associations of some reference corners are than their second best, summed up over the
 * corners where this is most: where two images show the same, a few associations stand out, however many corners there
 * are.
 */
double distinctness(const AssociationMatrix& association, std::size_t rows)
{
  constexpr std::size_t MOST = 30;
  std::vector<double> best(rows, 0.0);
  std::vector<double> second(rows, 0.0);
  for (const Association& entry : association.entries())
  {
    const auto row = static_cast<std::size_t>(entry.row);
    second[row] = std::max(second[row], std::min(best[row], entry.weight));
    best[row] = std::max(best[row], entry.weight);
  }
  std::transform(best.begin(), best.end(), second.begin(), best.begin(), std::minus<>());
  const auto most = best.begin() + static_cast<std::ptrdiff_t>(std::min(MOST, rows));
  std::partial_sort(best.begin(), most, best.end(), std::greater<>());
  return std::accumulate(best.begin(), most, 0.0);
}

/**
 * What to compare, one after the other: first the full images, quickly and then thoroughly. Where that finds nothing,
 * the other scales and sides get a quick look each, and those that promise most are compared thoroughly.
 */
class TrialQueue
{
public:
  /** @param given_up see PointViewMatcher::match(). All have to outlive this. */
  TrialQueue(const PreparedImage& reference, const PreparedImage& current, const PointViewMatcherParams& params,
             const std::function<bool()>& given_up)
    : reference_(reference), current_(current), params_(params), given_up_(given_up)
  {
    if (params.first_share < params.points.search.share)
    {
      trials_.push_back({ { 0, 0 }, params.first_share, quickSearch(), BEYOND_DOUBT * params.min_log_significance });
    }
    trials_.push_back(thorough({ 0, 0 }));
  }

  /** The next one; empty when there is none. */
  std::optional<LevelTrial> next()
  {
    if (given_ == trials_.size() && !looked_)
    {
      looked_ = true;
      for (const LevelPair& levels : promisingLevels())
      {
        trials_.push_back(thorough(levels));
      }
    }
    return given_ < trials_.size() ? std::optional<LevelTrial>(trials_[given_++]) : std::nullopt;
  }

private:
  ProfileSearch quickSearch() const
  {
    const ProfileSearch search = params_.points.search.search;
    return search == ProfileSearch::NEAREST ? ProfileSearch::LEAF : search;
  }

  LevelTrial thorough(const LevelPair& levels) const
  {
    const ProfileSearchParams& search = params_.points.search;
    return { levels, search.share, search.search, params_.min_log_significance };
  }

  std::vector<LevelPair> levelsToLookAt() const
  {
    std::vector<LevelPair> levels;
    if (params_.scale_search)
    {
      levels.insert(levels.end(), std::begin(OTHER_SCALES), std::end(OTHER_SCALES));
    }
    for (int side = PreparedImage::SCALES; params_.side_search && side < PreparedImage::LEVELS; ++side)
    {
      levels.push_back({ side, 0 });
    }
    return levels;
  }

  /**
   * Those whose associations stand out most: of 33 planes that only other scales or sides show, the first one did 29.
   */
  std::vector<LevelPair> promisingLevels() const
  {
    constexpr std::size_t MOST = 2;
    PointMatcherParams look = params_.points;
    look.search.share = std::min(params_.first_share, look.search.share);
    look.search.search = quickSearch();
    const std::vector<LevelPair> levels = levelsToLookAt();
    std::vector<std::pair<double, std::size_t>> promises;
    for (std::size_t i = 0; i < levels.size() && !(given_up_ && given_up_()); ++i)
    {
      const PointFeatures& from = reference_.points(levels[i].reference);
      const PointFeatures& to = current_.points(levels[i].current);
      if (from.corners.size() >= MIN_CORNERS && to.corners.size() >= MIN_CORNERS)
      {
        const AssociationMatrix association =
            associatePoints(from, reference_.profileIndex(levels[i].reference), to, look);
        promises.emplace_back(-distinctness(association, from.corners.size()), i);
      }
    }
    std::sort(promises.begin(), promises.end());
    std::vector<LevelPair> chosen;
    for (std::size_t i = 0; i < std::min(MOST, promises.size()); ++i)
    {
      chosen.push_back(levels[promises[i].second]);
    }
    return chosen;
  }

  const PreparedImage& reference_;
  const PreparedImage& current_;
  const PointViewMatcherParams& params_;
  const std::function<bool()>& given_up_;
  std::vector<LevelTrial> trials_;
  std::size_t given_ = 0;
  bool looked_ = false;
};

Points positions(const std::vector<Corner>& corners)
{
  Points result;
  result.reserve(corners.size());
  for (const Corner& corner : corners)
  {
    result.push_back(corner.position);
  }
  return result;
}

template <typename T>
std::vector<T> chosen(const std::vector<T>& values, const std::vector<int>& indices)
{
  std::vector<T> result;
  result.reserve(indices.size());
  for (const int i : indices)
  {
    result.push_back(values[static_cast<std::size_t>(i)]);
  }
  return result;
}

/** One comparison of two levels: candidates and, if they support one, the geometry. */
class PointAttempt
{
public:
  PointAttempt(const PreparedImage& reference, const PreparedImage& current, const LevelTrial& trial,
               const PairGeometry& geometry, const PointViewMatcherParams& params)
    : reference_(reference),
      current_(current),
      levels_(trial.levels),
      min_significance_(trial.min_significance),
      geometry_(geometry),
      params_(params),
      from_(reference.points(levels_.reference)),
      to_(current.points(levels_.current)),
      level_{ reference.image(levels_.reference),
              current.image(levels_.current),
              from_.corners,
              to_.corners,
              association_,
              candidates_ }
  {
    params_.points.search.share = trial.share;
    params_.points.search.search = trial.search;
  }

  bool hasFeatures() const
  {
    return from_.corners.size() >= MIN_CORNERS && to_.corners.size() >= MIN_CORNERS;
  }

  /**
   * Associates, chooses candidates, fits, finds more matches and checks; true when there is a geometry to be believed.
   */
  bool run(ViewMatch& result, StageClock& clock, Rng& rng)
  {
    associate(clock, rng);
    if (!fit(result, clock, rng))
    {
      inliers_.clear();
      return false;
    }
    if (params_.guided)
    {
      guide(rng);
      clock.finish("guided");
    }
    const std::optional<Eigen::Matrix3d> plane = mainPlane(rng);
    if (params_.unique)
    {
      refusal_ = plane && isRepeated(*plane) ? Refusal::REPEATED : Refusal::NONE;
      clock.finish("unique");
    }
    const bool maybe_mirrored = result.log_significance < POINTS_BEYOND_MIRRORS || agreeingPart() < MOST_CANDIDATES;
    if (refusal_ == Refusal::NONE && params_.refuse_mirrored && maybe_mirrored)
    {
      std::vector<Eigen::Matrix3d> planes;
      if (plane)
      {
        planes.push_back(*plane);
      }
      const bool mirrored =
          isMirrored(reference_, levels_.reference, current_, levels_.current, planes, result.log_significance, rng);
      refusal_ = mirrored ? Refusal::MIRRORED : Refusal::NONE;
      clock.finish("mirror");
    }
    return refusal_ == Refusal::NONE;
  }

  /** Why `run` refused a geometry, NONE when there was none. */
  Refusal refusal() const
  {
    return refusal_;
  }

  /** Writes what was found in the pixels of the full images: inliers, and the candidates of all other corners. */
  void report(bool accepted, ViewMatch& result) const
  {
    const Eigen::Matrix3d reference_map = reference_.toFull(levels_.reference);
    const Eigen::Matrix3d current_map = current_.toFull(levels_.current);
    const auto add = [&](const CornerMatch& match, bool inlier) {
      const Correspondence pair = level_.correspondence(match);
      result.matches.push_back({ { (reference_map * pair.reference.homogeneous()).hnormalized(),
                                   (current_map * pair.current.homogeneous()).hnormalized() },
                                 match.score,
                                 inlier });
    };
    result.matches.clear();
    std::vector<char> used(from_.corners.size(), 0);
    for (const CornerMatch& match : inliers_)
    {
      used[static_cast<std::size_t>(match.row)] = 1;
      add(match, accepted);
    }
    for (const CornerMatch& candidate : candidates_)
    {
      if (used[static_cast<std::size_t>(candidate.row)] == 0)
      {
        add(candidate, false);
      }
    }
    std::stable_sort(result.matches.begin(), result.matches.end(),
                     [](const MatchedPoint& a, const MatchedPoint& b) { return a.score > b.score; });
    if (!accepted)
    {
      return;
    }
    double squares = 0.0;
    for (const CornerMatch& match : inliers_)
    {
      squares += geometry_.squaredError(matrix_, level_.correspondence(match));
    }
    result.outcome = MatchOutcome::MATCHED;
    result.inliers = static_cast<int>(inliers_.size());
    result.rms_error = std::sqrt(squares / static_cast<double>(inliers_.size()));
    result.matrix = geometry_.ofFullImages(matrix_, reference_map, current_map);
    result.reference_level = levels_.reference;
    result.current_level = levels_.current;
  }

private:
  void associate(StageClock& clock, Rng& rng)
  {
    association_ = associatePoints(from_, reference_.profileIndex(levels_.reference), to_, params_.points);
    clock.finish("association");
    associations_ = candidateMatches(association_, params_.points.assignment);
    for (const Association& candidate : associations_)
    {
      candidates_.push_back(level_.toMatch(candidate));
      pairs_.push_back(level_.correspondence(candidates_.back()));
    }
    clock.finish("assignment");
    if (params_.view_consistency == ViewConsistency::BEFORE)
    {
      const std::vector<int> kept = viewConsistentCandidates(pairs_, params_.consistency, rng);
      associations_ = chosen(associations_, kept);
      candidates_ = chosen(candidates_, kept);
      pairs_ = select(pairs_, kept);
      clock.finish("view_consistency");
    }
  }

  /** True when the candidates determine a geometry that chance does not explain, and that is not one of many. */
  bool fit(ViewMatch& result, StageClock& clock, Rng& rng)
  {
    const bool one_hypothesis = params_.estimator == GeometryEstimator::RANSAC;
    const std::optional<PairFit> fit = one_hypothesis
                                           ? geometry_.fitCandidates(associations_, pairs_, result.ransac, rng)
                                           : geometry_.fitAssociation(association_, positions(from_.corners),
                                                                      positions(to_.corners), result.ransac, rng);
    clock.finish("ransac");
    result.log_significance = 0.0;
    if (!fit)
    {
      return false;
    }
    Correspondences supporting;
    for (const Association& match : fit->inliers)
    {
      inliers_.push_back(level_.toMatch(match));
      supporting.push_back(level_.correspondence(inliers_.back()));
    }
    matrix_ = fit->matrix;
    result.log_significance = significance(supporting);
    if (result.log_significance < min_significance_ || !keepsOrientation(supporting))
    {
      return false;
    }
    constexpr double CLEARLY = 1.75;  // walls of windows or tiles have had up to 1.65, rooms 1.9 and more
    if (params_.unique && agreeingPart() < CLEARLY * partOfRivals())
    {
      refusal_ = Refusal::REPEATED;
      return false;
    }
    const Eigen::Matrix3d refined = geometry_.refine(matrix_, supporting);
    const std::optional<Eigen::Matrix3d> settled = geometry_.settle(refined, pairs_, rng);
    if (!settled)
    {
      refusal_ = Refusal::LEFT_OPEN;
      return false;
    }
    matrix_ = *settled;
    if (matrix_ != refined)
    {
      keepAgreeing(candidates_);
    }
    return true;
  }

  /** -log10 of the expected number of geometries among chance matches that as many candidates agree with. */
  double significance(const Correspondences& supporting) const
  {
    const double among = chanceAmong(supporting.size(), [&](std::size_t reference, std::size_t current) {
      return geometry_.agrees(matrix_, { supporting[reference].reference, supporting[current].current });
    });
    const double chance = std::max(geometry_.chance(current_.image(levels_.current).size()), among);
    // Also of several hypotheses the one-to-one candidates judge: they were chosen without regard to the geometry.
    return logSignificance(pairs_.size(), countAgreeing(), geometry_.sampleSize(), chance);
  }

  /** How many candidates agree with the geometry. */
  std::size_t countAgreeing() const
  {
    return static_cast<std::size_t>(std::count_if(
        pairs_.begin(), pairs_.end(), [&](const Correspondence& pair) { return geometry_.agrees(matrix_, pair); }));
  }

  double agreeingPart() const
  {
    return static_cast<double>(countAgreeing()) / static_cast<double>(pairs_.size());
  }

  /** More matches along the geometry that was found, and a better geometry from them. */
  void guide(Rng& rng)
  {
    const Eigen::Matrix3d unguided = matrix_;
    const std::vector<CornerMatch> of_candidates = inliers_;
    for (int round = 0; round < MAX_GUIDED_ROUNDS; ++round)
    {
      const std::vector<CornerMatch> found = geometry_.findAlong(matrix_, level_);
      Correspondences supporting;
      for (const CornerMatch& match : found)
      {
        supporting.push_back(level_.correspondence(match));
      }
      const Eigen::Matrix3d refined = geometry_.refine(matrix_, supporting);
      const std::size_t before = inliers_.size();
      matrix_ = refined;
      keepAgreeing(found);
      const bool grown = inliers_.size() > before + before / 50;
      if (round > 0 && !grown)
      {
        break;
      }
    }
    // What is sought along a geometry speaks for it, right or wrong: the candidates judge.
    if (geometry_.settle(matrix_, pairs_, rng) != matrix_)
    {
      matrix_ = unguided;
      inliers_ = of_candidates;
    }
  }

  /** The plane on which most of what agrees with the geometry lies, in pixels of the full images. */
  std::optional<Eigen::Matrix3d> mainPlane(Rng& rng) const
  {
    Correspondences pairs;
    for (const CornerMatch& match : inliers_)
    {
      pairs.push_back(level_.correspondence(match));
    }
    std::optional<Eigen::Matrix3d> plane = geometry_.mainPlane(matrix_, pairs, rng);
    if (plane)
    {
      *plane = current_.toFull(levels_.current) * *plane * reference_.toFull(levels_.reference).inverse();
    }
    return plane;
  }

  /**
   * Whether what agrees with the geometry is found elsewhere nearly as well, in the full images: periods may be small.
   */
  bool isRepeated(const Eigen::Matrix3d& plane) const
  {
    Correspondences pairs;
    for (const CornerMatch& match : inliers_)
    {
      const Correspondence pair = level_.correspondence(match);
      pairs.push_back({ transfer(reference_.toFull(levels_.reference), pair.reference),
                        transfer(current_.toFull(levels_.current), pair.current) });
    }
    return otherPlace(reference_.grey(), current_.grey(), pairs, current_.points(0).corners, plane).has_value();
  }

  /**
   * Of the reference corners whose candidates agree with the geometry: the part that agrees, too, of the other places
   * that look nearly as much like them. On tiles or windows in rows these are places a number of periods off; and where
   * an epipolar line runs along a row, it passes many of them, whether it is right or not.
   */
  double partOfRivals() const
  {
    constexpr double ALIKE = 0.5;   // of the candidate's weight
    constexpr double APART = 15.0;  // [px]: corners that are nearer are of the same thing
    constexpr int ENOUGH = 20;
    std::vector<const CornerMatch*> of_row(from_.corners.size(), nullptr);
    for (const CornerMatch& candidate : candidates_)
    {
      if (geometry_.agrees(matrix_, level_.correspondence(candidate)))
      {
        of_row[static_cast<std::size_t>(candidate.row)] = &candidate;
      }
    }
    int rivals = 0;
    int agreeing = 0;
    for (const Association& entry : association_.entries())
    {
      const CornerMatch* candidate = of_row[static_cast<std::size_t>(entry.row)];
      const CornerMatch rival = level_.toMatch(entry);
      if (candidate != nullptr && rival.score >= ALIKE * candidate->score &&
          (rival.current - candidate->current).norm() > APART)
      {
        rivals += 1;
        agreeing += geometry_.agrees(matrix_, level_.correspondence(rival)) ? 1 : 0;
      }
    }
    return rivals >= ENOUGH ? static_cast<double>(agreeing) / rivals : 0.0;
  }

  /** Makes those inliers that agree with the geometry. */
  void keepAgreeing(const std::vector<CornerMatch>& matches)
  {
    inliers_.clear();
    std::copy_if(matches.begin(), matches.end(), std::back_inserter(inliers_),
                 [&](const CornerMatch& match) { return geometry_.agrees(matrix_, level_.correspondence(match)); });
  }

  const PreparedImage& reference_;
  const PreparedImage& current_;
  const LevelPair levels_;
  const double min_significance_;
  const PairGeometry& geometry_;
  PointViewMatcherParams params_;
  const PointFeatures& from_;
  const PointFeatures& to_;
  AssociationMatrix association_;
  std::vector<Association> associations_;  ///< one to one
  std::vector<CornerMatch> candidates_;    ///< the same with their positions
  Correspondences pairs_;                  ///< the same again
  const LevelData level_;
  std::vector<CornerMatch> inliers_;
  Eigen::Matrix3d matrix_;
  Refusal refusal_ = Refusal::NONE;
};

std::string whyNot(Refusal refusal, const PreparedImage& reference, const PreparedImage& current,
                   const ViewMatch& result)
{
  switch (refusal)
  {
    case Refusal::REPEATED:
      return REPEATED;
    case Refusal::MIRRORED:
      return MIRRORED;
    case Refusal::LEFT_OPEN:
      return "no geometry found: what matches lies on one plane, which leaves the fundamental matrix open; look for "
             "a homography";
    case Refusal::NONE:
      break;
  }
  if (result.outcome == MatchOutcome::TOO_FEW_FEATURES)
  {
    return "too few corners: " + std::to_string(reference.points(0).corners.size()) + " in the reference, " +
           std::to_string(current.points(0).corners.size()) + " in the current image, " + std::to_string(MIN_CORNERS) +
           " needed in each" + exposureNote(reference, current);
  }
  return "no geometry found: the " + std::to_string(result.matches.size()) +
         " candidate matches do not support one better than chance would" + exposureNote(reference, current);
}

}  // namespace

std::vector<Parameter> parameters(PointViewMatcherParams& params)
{
  return joined({
      parameters(params.points),
      {
          choice<Sampling>("sampling", params.ransac.sampling,
                           { { "uniform", Sampling::UNIFORM }, { "progressive", Sampling::PROGRESSIVE } },
                           "draw all candidates alike, or the best first (PROSAC)"),
          choice<GeometryEstimator>("estimator", params.estimator,
                                    { { "ransac", GeometryEstimator::RANSAC },
                                      { "multi_hypothesis", GeometryEstimator::MULTI_HYPOTHESIS },
                                      { "importance", GeometryEstimator::IMPORTANCE } },
                                    "one candidate a point, or support from all associations (and samples, too)"),
      },
      parameters(params.hypotheses),
      {
          choice<ViewConsistency>("view_consistency", params.view_consistency,
                                  { { "off", ViewConsistency::OFF },
                                    { "before", ViewConsistency::BEFORE },
                                    { "within", ViewConsistency::WITHIN } },
                                  "where the constraint on five points is used"),
      },
      parameters(params.consistency),
      {
          boolean("guided", params.guided, "look for more matches along the geometry found"),
      },
      parameters(params.guidance),
      {
          real("first_share", params.first_share, "", "(0, 1]",
               "part of the profiles that votes at first; all do if it is too little"),
          boolean("scale_search", params.scale_search, "try other scales when the first finds no geometry"),
          boolean("side_search", params.side_search,
                  "then try the reference as it would look from the sides, very obliquely"),
          real("min_significance", params.min_log_significance, "", ">= 0",
               "-log10 of the false alarms a geometry may have"),
          boolean("unique", params.unique, "refuse a view that fits at another place nearly as well"),
          boolean("refuse_mirrored", params.refuse_mirrored,
                  "refuse an image that shows the view better when mirrored"),
          real("min_parallax", params.min_log_parallax, "", ">= 0",
               "-log10 of the false alarms a fundamental matrix may have off its best plane"),
          natural("seed", params.seed, "seed of all random draws"),
      },
      parameters(params.ransac),
  });
}

std::vector<std::string> PointViewMatcherParams::validate() const
{
  std::vector<std::string> faults = faultsOf(*this);
  if (view_consistency == ViewConsistency::BEFORE && estimator != GeometryEstimator::RANSAC)
  {
    faults.emplace_back("view_consistency before filters candidates, which only estimator ransac keeps to");
  }
  return faults;
}

PointViewMatcher::PointViewMatcher(const PointViewMatcherParams& params) : params_(params)
{
  requireNoFaults("matching parameters", params.validate());
}

ViewMatch PointViewMatcher::match(const PreparedImage& reference, const PreparedImage& current, GeometryModel model,
                                  double inlier_threshold, const std::function<bool()>& given_up) const
{
  if (!(inlier_threshold >= 0.0) || std::isinf(inlier_threshold))
  {
    throw std::invalid_argument("inlier_threshold must be a number of pixels, or 0 for the parameter");
  }
  const double threshold = inlier_threshold > 0.0 ? inlier_threshold : params_.ransac.inlier_threshold;
  const std::unique_ptr<const PairGeometry> geometry = makePairGeometry(model, params_, threshold);
  Rng rng(params_.seed);

  ViewMatch result;
  result.model = model;
  StageClock clock(result.stages);
  bool any_features = false;
  bool ended_early = false;
  Refusal refusal = Refusal::NONE;
  TrialQueue trials(reference, current, params_, given_up);
  while (!(ended_early = given_up && given_up()))
  {
    const std::optional<LevelTrial> trial = trials.next();
    clock.finish("looks");
    if (!trial)
    {
      break;
    }
    reference.profileIndex(trial->levels.reference);
    clock.finish("reference");
    current.points(trial->levels.current);
    clock.finish("current");
    PointAttempt attempt(reference, current, *trial, *geometry, params_);
    if (!attempt.hasFeatures())
    {
      continue;
    }
    any_features = true;
    const bool accepted = attempt.run(result, clock, rng);
    if (accepted || (trial->levels.reference == 0 && trial->levels.current == 0))
    {
      // Without a geometry, the candidates of the full images are reported.
      attempt.report(accepted, result);
    }
    refusal = attempt.refusal();
    const bool quick = trial->min_significance > params_.min_log_significance;
    if (accepted || (refusal != Refusal::NONE && !(quick && refusal == Refusal::LEFT_OPEN)))
    {
      break;  // what repeats itself at this scale, or lies on one plane, does at others
    }
  }

  if (result.outcome == MatchOutcome::MATCHED)
  {
    result.message = std::to_string(result.inliers) + " of " + std::to_string(result.matches.size()) +
                     " matches agree with one " + geometry->name();
  }
  else
  {
    result.outcome = any_features || ended_early ? MatchOutcome::NO_GEOMETRY : MatchOutcome::TOO_FEW_FEATURES;
    result.message = ended_early ? "given up" : whyNot(refusal, reference, current, result);
  }
  result.elapsed_ms = clock.total();
  return result;
}

}  // namespace view_servo
