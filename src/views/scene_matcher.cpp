// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/scene_matcher.h"

#include "mirror.h"
#include "repetition.h"
#include "stage_clock.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/matching/guided_matching.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/orientation.h"
#include "view_servo/robust/parallax.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/significance.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>

namespace view_servo
{
namespace
{
constexpr std::size_t MIN_MATCHES = 15;
// Significance of a plane: wrong ones of pairs that show nothing in common had 6.7 at most.
constexpr double PLANE_BEYOND_DOUBT = 15.0;
constexpr double IN_ORDER = 0.75;      // part of the matches of a fundamental matrix, see keepsOrientation()
constexpr double LEAST_CHANCE = 0.01;  // that a corner is found beside a plane
constexpr double SEARCH_RADIUS = 4.0;  // around where a plane sends a corner [px]

/** A plane that corners confirm. */
struct Plane
{
  Eigen::Matrix3d h;
  double significance;
  int of_lines;  ///< index among the planes of the line matcher; -1: it came from points
};

/** Homographies on which several matches agree; what one takes is left out for the next. */
std::vector<Eigen::Matrix3d> planesOf(Correspondences pairs, double threshold, Rng& rng)
{
  constexpr int MOST = 3;
  constexpr std::size_t FEWEST = 10;
  RansacParams params;
  params.inlier_threshold = threshold;
  params.sampling = Sampling::UNIFORM;
  params.max_iterations = 1000;
  std::vector<Eigen::Matrix3d> planes;
  while (planes.size() < MOST && pairs.size() >= FEWEST)
  {
    const auto found = ransac(HomographyEstimator(pairs), params, rng);
    if (!found.model || found.inliers.size() < FEWEST)
    {
      break;
    }
    planes.push_back(found.model->h);
    Correspondences rest;
    auto inlier = found.inliers.begin();
    for (std::size_t i = 0; i < pairs.size(); ++i)
    {
      if (inlier != found.inliers.end() && static_cast<std::size_t>(*inlier) == i)
      {
        ++inlier;
        continue;
      }
      rest.push_back(pairs[i]);
    }
    pairs = std::move(rest);
  }
  return planes;
}

/** One match of two images. */
class SceneAttempt
{
public:
  SceneAttempt(const PreparedImage& reference, const PreparedImage& current, const SceneMatcherParams& params)
    : reference_(reference),
      current_(current),
      params_(params),
      corners_(reference.points(0).corners),
      rng_(params.seed),
      found_(corners_.size())
  {
    guidance_.min_correlation = params.plane_correlation;
  }

  /** Looks for all corners along the homography of a plane, and keeps it if they are found there and not beside it. */
  void addPlane(const Eigen::Matrix3d& h, int of_lines)
  {
    constexpr double LEAST = 6.0;  // significance
    const std::size_t seen = countSeen(corners_, h);
    const std::vector<GuidedMatch> matches = search(corners_, h);
    // What is found beside only lowers the significance: few planes need to be asked for it.
    const bool maybe = -logBinomialTail(seen, matches.size(), LEAST_CHANCE) >= LEAST;
    const double significance = maybe ? -logBinomialTail(seen, matches.size(), chanceBeside(h)) : 0.0;
    if (significance < LEAST)
    {
      return;
    }
    planes_.push_back({ h, significance, of_lines });
    for (const GuidedMatch& match : matches)
    {
      std::optional<GuidedMatch>& best = found_[static_cast<std::size_t>(match.reference)];
      if (!best || match.correlation > best->correlation)
      {
        best = match;
      }
    }
  }

  /** The most trustworthy matches first: corners along planes, intersections of segments, candidates of corners. */
  void collect(const std::vector<MatchedPoint>& intersections, const std::vector<MatchedPoint>& candidates)
  {
    std::vector<MatchedPoint> along_planes;
    for (const std::optional<GuidedMatch>& match : found_)
    {
      if (match)
      {
        const Eigen::Vector2d& at = corners_[static_cast<std::size_t>(match->reference)].position;
        along_planes.push_back({ { at, match->current }, match->correlation, false });
      }
    }
    for (const std::vector<MatchedPoint>* kind : { &std::as_const(along_planes), &intersections, &candidates })
    {
      matches_.insert(matches_.end(), kind->begin(), kind->end());
    }
    pairs_ = positionsOf(matches_);
  }

  /** The best fundamental matrix, `other` being one that was found before; true if it stands without its best plane. */
  bool fit(const std::optional<Eigen::Matrix3d>& other, RansacStatistics& statistics)
  {
    if (isBeyondDoubt(bestPlane()))
    {
      addMatchesNear(bestPlane()->h);
    }
    if (pairs_.size() < MIN_MATCHES)
    {
      return false;
    }
    RansacParams params;
    params.inlier_threshold = params_.inlier_threshold;
    params.sampling = Sampling::UNIFORM;  // the best are all of one plane
    params.max_iterations = 5000;
    const auto found = ransac(FundamentalEstimator(pairs_), params, rng_);
    statistics = found.statistics;
    std::vector<Eigen::Matrix3d> hypotheses;
    if (found.model)
    {
      hypotheses.push_back(*found.model);
    }
    if (other)
    {
      hypotheses.push_back(*other);
    }
    for (const Eigen::Matrix3d& hypothesis : hypotheses)
    {
      consider(hypothesis);
    }
    return holds();
  }

  /** Whether what agrees lies for the most part on planes that are found elsewhere nearly as well. */
  bool isRepeated()
  {
    const auto repeats = [&](const Eigen::Matrix3d& h) {
      return otherPlace(reference_.grey(), current_.grey(), onPlane(h), current_.points(0).corners, h).has_value();
    };
    if (!matrix_)
    {
      return bestPlane() != nullptr && repeats(bestPlane()->h);
    }
    // Along a row of windows a fundamental matrix agrees with all that are a whole number of windows off.
    Correspondences unique = agreeing(*matrix_);
    const std::size_t all = unique.size();
    std::vector<Eigen::Matrix3d> planes = planesOf(unique, params_.inlier_threshold, rng_);
    for (const Plane& plane : planes_)
    {
      planes.push_back(plane.h);
    }
    for (const Eigen::Matrix3d& h : planes)
    {
      if (repeats(h))
      {
        unique.erase(
            std::remove_if(unique.begin(), unique.end(), [&](const Correspondence& pair) { return liesOn(h, pair); }),
            unique.end());
      }
    }
    return 2 * unique.size() < all;
  }

  /** All that corners confirm. */
  std::vector<Eigen::Matrix3d> planes() const
  {
    std::vector<Eigen::Matrix3d> result;
    std::transform(planes_.begin(), planes_.end(), std::back_inserter(result),
                   [](const Plane& plane) { return plane.h; });
    return result;
  }

  /** The plane that corners confirm best, when it is beyond doubt and not mirrored. */
  std::optional<Eigen::Matrix3d> plane() const
  {
    constexpr std::size_t FEWEST = 30;  // matches: a chessboard has had 21 on another picture's bricks
    const Plane* best = bestPlane();
    if (!isBeyondDoubt(best))
    {
      return std::nullopt;
    }
    const Correspondences on_plane = onPlane(best->h);
    if (on_plane.size() < FEWEST || !keepsOrientation(on_plane))
    {
      return std::nullopt;
    }
    return refineHomography(best->h, on_plane, FIT_HUBER_WIDTH);
  }

  /** @param lines those that the line matcher has found. */
  void reportFundamental(const std::vector<MatchedLine>& lines, ViewMatch& result)
  {
    const Eigen::Matrix3d& f = *matrix_;
    reportLines(
        lines, [&](const Correspondence& pair) { return agrees(f, pair); }, result);
    report(result, GeometryModel::FUNDAMENTAL, f, [&](const Correspondence& pair) { return sampsonError(f, pair); });
    result.fundamental = f;
    result.log_significance = significance_;
  }

  void reportPlane(const Eigen::Matrix3d& h, const std::vector<MatchedLine>& lines, ViewMatch& result)
  {
    const Eigen::Matrix3d inverse = h.inverse();
    reportLines(
        lines, [&](const Correspondence& pair) { return liesOn(h, pair); }, result);
    report(result, GeometryModel::HOMOGRAPHY, normalizedHomography(h),
           [&](const Correspondence& pair) { return 0.5 * symmetricTransferError(h, inverse, pair); });
  }

  void reportCandidates(ViewMatch& result)
  {
    result.matches = std::move(matches_);
  }

private:
  /** Null without planes. */
  const Plane* bestPlane() const
  {
    const auto best = std::max_element(planes_.begin(), planes_.end(),
                                       [](const Plane& a, const Plane& b) { return a.significance < b.significance; });
    return best == planes_.end() ? nullptr : &*best;
  }

  static bool isBeyondDoubt(const Plane* plane)
  {
    return plane != nullptr && plane->significance >= PLANE_BEYOND_DOUBT;
  }

  /** Whether the fundamental matrix is one that chance does not explain, also without its best plane. */
  bool holds() const
  {
    return matrix_ && margin_ >= 0.0 && keepsOrientation(agreeing(*matrix_), IN_ORDER);
  }

  std::vector<GuidedMatch> search(const std::vector<Corner>& corners, const Eigen::Matrix3d& h) const
  {
    return searchAlongHomography(reference_.grey(), corners, current_.grey(), h, SEARCH_RADIUS, guidance_);
  }

  /**
   * Corners off the planes that are seen not far from where one would show them: they say most of the parallax. Each has
   * to be found again from the current image, which fails where something else there looks more like it.
   */
  void addMatchesNear(const Eigen::Matrix3d& h)
  {
    constexpr double NEAR_RADIUS = 24.0;  // [px]
    constexpr double SAME = 1.5;          // place [px]
    std::vector<Corner> others;
    for (std::size_t i = 0; i < corners_.size(); ++i)
    {
      if (!found_[i])
      {
        others.push_back(corners_[i]);
      }
    }
    const std::vector<GuidedMatch> there =
        searchAlongHomography(reference_.grey(), others, current_.grey(), h, NEAR_RADIUS, guidance_);
    std::vector<Corner> seen;
    seen.reserve(there.size());
    for (const GuidedMatch& match : there)
    {
      seen.push_back({ match.current, 0.0F });
    }
    std::vector<MatchedPoint> near;
    for (const GuidedMatch& match :
         searchAlongHomography(current_.grey(), seen, reference_.grey(), h.inverse(), NEAR_RADIUS, guidance_))
    {
      const GuidedMatch& forth = there[static_cast<std::size_t>(match.reference)];
      const Eigen::Vector2d& at = others[static_cast<std::size_t>(forth.reference)].position;
      if ((match.current - at).norm() <= SAME)
      {
        near.push_back({ { at, forth.current }, forth.correlation, false });
      }
    }
    std::stable_sort(near.begin(), near.end(),
                     [](const MatchedPoint& a, const MatchedPoint& b) { return a.score > b.score; });
    matches_.insert(matches_.begin(), near.begin(), near.end());
    pairs_ = positionsOf(matches_);
  }

  /** How many corners a homography sends to where their patch lies in the current image. */
  std::size_t countSeen(const std::vector<Corner>& corners, const Eigen::Matrix3d& h) const
  {
    const double margin = SEARCH_RADIUS + guidance_.patch_radius;
    const double right = current_.grey().cols - 1.0 - margin;
    const double bottom = current_.grey().rows - 1.0 - margin;
    return static_cast<std::size_t>(std::count_if(corners.begin(), corners.end(), [&](const Corner& corner) {
      const Eigen::Vector2d at = transfer(h, corner.position);
      return at.x() >= margin && at.y() >= margin && at.x() < right && at.y() < bottom;
    }));
  }

  /** The share of corners that are found when they are sought where the plane does not say. */
  double chanceBeside(const Eigen::Matrix3d& h) const
  {
    constexpr double BESIDE = 25.0;  // [px]
    constexpr std::size_t EVERY = 3;
    std::vector<Corner> some;
    for (std::size_t i = 0; i < corners_.size(); i += EVERY)
    {
      some.push_back(corners_[i]);
    }
    std::size_t seen = 0;
    std::size_t found = 0;
    for (const double angle : { 0.2, 1.0, 1.8, 2.6, 3.3, 4.1, 4.9, 5.7 })
    {
      Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
      shift.topRightCorner<2, 1>() = BESIDE * Eigen::Vector2d(std::cos(angle), std::sin(angle));
      seen += countSeen(some, shift * h);
      found += search(some, shift * h).size();
    }
    return seen > 0 ? std::max(LEAST_CHANCE, static_cast<double>(found) / static_cast<double>(seen)) : 1.0;
  }

  bool agrees(const Eigen::Matrix3d& f, const Correspondence& pair) const
  {
    return sampsonError(f, pair) <= params_.inlier_threshold * params_.inlier_threshold;
  }

  Correspondences agreeing(const Eigen::Matrix3d& f) const
  {
    Correspondences found;
    std::copy_if(pairs_.begin(), pairs_.end(), std::back_inserter(found),
                 [&](const Correspondence& pair) { return agrees(f, pair); });
    return found;
  }

  bool liesOn(const Eigen::Matrix3d& h, const Correspondence& pair) const
  {
    return (transfer(h, pair.reference) - pair.current).norm() <= 2.0 * params_.inlier_threshold;
  }

  Correspondences onPlane(const Eigen::Matrix3d& h) const
  {
    Correspondences found;
    std::copy_if(pairs_.begin(), pairs_.end(), std::back_inserter(found),
                 [&](const Correspondence& pair) { return liesOn(h, pair); });
    return found;
  }

  /**
   * On which most of these lie: a plane that corners confirm or, where another has clearly more, that one, which nothing
   * confirms.
   */
  Plane bestPlaneOf(const Correspondences& pairs)
  {
    constexpr double CLEARLY = 1.25;
    RansacParams params;
    params.inlier_threshold = 2.0 * params_.inlier_threshold;
    params.sampling = Sampling::UNIFORM;
    params.max_iterations = 1000;
    const auto found = ransac(HomographyEstimator(pairs), params, rng_);
    Plane best{ found.model ? found.model->h : Eigen::Matrix3d(Eigen::Matrix3d::Identity()), 0.0, -1 };
    double most = static_cast<double>(found.inliers.size()) / CLEARLY;
    for (const Plane& plane : planes_)
    {
      const auto on_plane = static_cast<double>(
          std::count_if(pairs.begin(), pairs.end(), [&](const Correspondence& pair) { return liesOn(plane.h, pair); }));
      if (on_plane > most)
      {
        most = on_plane;
        best = plane;
      }
    }
    return best;
  }

  double significanceOf(const Eigen::Matrix3d& f) const
  {
    const Correspondences supporting = agreeing(f);
    const double among = chanceAmong(supporting.size(), [&](std::size_t reference, std::size_t current) {
      return agrees(f, { supporting[reference].reference, supporting[current].current });
    });
    const cv::Mat& image = current_.grey();
    const double diagonal = std::hypot(image.cols, image.rows);
    const double band = 2.0 * params_.inlier_threshold * diagonal;
    const double chance = std::max(std::min(1.0, band / static_cast<double>(image.total())), among);
    return logSignificance(pairs_.size(), supporting.size(), FundamentalEstimator::SAMPLE_SIZE, chance);
  }

  /**
   * Keeps a fundamental matrix, or one of its best plane and the parallax off it, if that is the best so far. Where little
   * lies far off the plane, what lies near it is told from it by half the threshold.
   */
  void consider(const Eigen::Matrix3d& hypothesis)
  {
    constexpr double FINE = 0.5;
    const Correspondences supporting = agreeing(hypothesis);
    if (supporting.size() < MIN_MATCHES)
    {
      return;
    }
    Plane plane = bestPlaneOf(supporting);
    weigh(hypothesis, plane, params_.inlier_threshold);
    if (margin_ < 0.0)
    {
      const double tolerance = FINE * params_.inlier_threshold;
      Correspondences near;
      std::copy_if(supporting.begin(), supporting.end(), std::back_inserter(near),
                   [&](const Correspondence& pair) { return sampsonError(hypothesis, pair) <= tolerance * tolerance; });
      const auto h = view_servo::bestPlane(near, 2.0 * tolerance, rng_);
      plane.h = h.value_or(plane.h);
      weigh(hypothesis, plane, tolerance);
    }
  }

  /** The same for one plane and tolerance. */
  void weigh(const Eigen::Matrix3d& hypothesis, const Plane& plane, double tolerance)
  {
    constexpr int SAMPLES = 1500;
    const double tests = std::log10(2.0);  // tolerances that may be tried
    const Parallax parallax(plane.h, pairs_, tolerance);
    std::vector<Eigen::Matrix3d> choices{ polishFundamental(hypothesis, agreeing(hypothesis), FIT_HUBER_WIDTH) };
    if (const auto of_plane = parallax.findFundamental(SAMPLES, rng_))
    {
      choices.push_back(polishFundamental(*of_plane, agreeing(*of_plane), FIT_HUBER_WIDTH));
    }
    for (const Eigen::Matrix3d& choice : choices)
    {
      const double held = parallax.significance(choice) - tests;
      const double significance = significanceOf(choice);
      // A plane that is beyond doubt and what its parallax says determine a fundamental matrix as well as all matches do;
      // but what lies near a plane may be off it because the plane does not fit.
      const bool off_plane = isBeyondDoubt(&plane) && tolerance >= params_.inlier_threshold;
      const double evidence = off_plane ? std::max(significance, held) : significance;
      const double margin = std::min(held - params_.points.min_log_parallax, evidence - params_.min_log_significance);
      // Of those that hold, the one with which most matches agree.
      const std::size_t support = agreeing(choice).size();
      const bool better = margin >= 0.0 && margin_ >= 0.0 ? support > support_ : margin > margin_;
      if (!matrix_ || better)
      {
        matrix_ = choice;
        support_ = support;
        significance_ = evidence;
        margin_ = margin;
      }
    }
  }

  /** Those planes with whose matches the geometry mostly agrees, and the segments that the line matcher found on them. */
  template <typename Agrees>
  void reportLines(const std::vector<MatchedLine>& lines, const Agrees& agrees, ViewMatch& result) const
  {
    for (const Plane& plane : planes_)
    {
      const Correspondences on_plane = onPlane(plane.h);
      const auto agree = static_cast<std::size_t>(std::count_if(on_plane.begin(), on_plane.end(), agrees));
      if (2 * agree <= on_plane.size())
      {
        continue;
      }
      result.planes.push_back(normalizedHomography(plane.h));
      for (const MatchedLine& line : lines)
      {
        if (plane.of_lines >= 0 && line.plane == plane.of_lines)
        {
          result.lines.push_back(line);
          result.lines.back().plane = static_cast<int>(result.planes.size()) - 1;
        }
      }
    }
  }

  template <typename SquaredError>
  void report(ViewMatch& result, GeometryModel model, const Eigen::Matrix3d& matrix, const SquaredError& squared_error)
  {
    double squares = 0.0;
    for (MatchedPoint& match : matches_)
    {
      const double error = squared_error(match.position);
      match.inlier = error <= params_.inlier_threshold * params_.inlier_threshold;
      squares += match.inlier ? error : 0.0;
      result.inliers += match.inlier ? 1 : 0;
    }
    result.outcome = MatchOutcome::MATCHED;
    result.model = model;
    result.matrix = matrix;
    result.rms_error = std::sqrt(squares / std::max(1, result.inliers));
  }

  const PreparedImage& reference_;
  const PreparedImage& current_;
  const SceneMatcherParams& params_;
  const std::vector<Corner>& corners_;
  GuidedParams guidance_;
  Rng rng_;
  std::vector<Plane> planes_;
  std::vector<std::optional<GuidedMatch>> found_;  ///< of each corner, the best along any plane
  std::vector<MatchedPoint> matches_;
  Correspondences pairs_;  ///< positions of matches_
  std::optional<Eigen::Matrix3d> matrix_;
  std::size_t support_ = 0;    ///< matches that agree with matrix_
  double significance_ = 0.0;  ///< of matrix_
  double margin_ = 0.0;        ///< of matrix_: how far it is above what is asked for; negative: not enough
};

/** @param asked the model that was asked for. */
std::string whatIsFound(const ViewMatch& result, GeometryModel asked)
{
  const std::string count = std::to_string(result.inliers) + " of " + std::to_string(result.matches.size()) + " points";
  if (result.model == GeometryModel::HOMOGRAPHY)
  {
    return count + " lie on one plane" +
           (asked == GeometryModel::FUNDAMENTAL ? ", and too little beside it: a homography" : "");
  }
  return count + ", " + std::to_string(result.lines.size()) + " lines and " + std::to_string(result.planes.size()) +
         " planes agree with one fundamental matrix";
}

/** Segments; mirrored ones are matched as well, because that is asked of lines and points together. */
ViewMatch matchLines(const PreparedImage& reference, const PreparedImage& current, LineMatcherParams params)
{
  params.refuse_mirrored = false;
  return LineViewMatcher(params).match(reference, current, GeometryModel::FUNDAMENTAL);
}

/** Corners; none are sought along one geometry, because their matches would speak for that geometry. */
ViewMatch matchPoints(const PreparedImage& reference, const PreparedImage& current, PointViewMatcherParams params,
                      const std::function<bool()>& enough)
{
  params.guided = false;
  params.refuse_mirrored = false;
  return PointViewMatcher(params).match(reference, current, GeometryModel::FUNDAMENTAL, 0.0, enough);
}

/** Tries the planes that the line matcher has found, and those on which matches of corners agree. */
void addPlanes(const ViewMatch& lines, const ViewMatch& points, double threshold, Rng& rng, SceneAttempt& attempt)
{
  for (std::size_t i = 0; i < lines.planes.size(); ++i)
  {
    attempt.addPlane(lines.planes[i], static_cast<int>(i));
  }
  for (const Eigen::Matrix3d& h : planesOf(positionsOf(points.matches), threshold, rng))
  {
    attempt.addPlane(h, -1);
  }
}

/** Says why nothing is found. */
void explainNoGeometry(const PreparedImage& reference, const PreparedImage& current, const ViewMatch& lines,
                       const ViewMatch& points, ViewMatch& result)
{
  if (points.outcome == MatchOutcome::TOO_FEW_FEATURES && lines.outcome == MatchOutcome::TOO_FEW_FEATURES)
  {
    result.outcome = MatchOutcome::TOO_FEW_FEATURES;
    result.message = points.message + "; " + lines.message;
    return;
  }
  result.message = "no geometry found: the " + std::to_string(result.matches.size()) +
                   " candidate matches do not support one better than chance would" + exposureNote(reference, current);
}

}  // namespace

SceneMatcherParams::SceneMatcherParams()
{
  points.points.corners.max_corners = 1000;  // of a whole room 500 are few
}

std::vector<Parameter> sceneParameters(SceneMatcherParams& params)
{
  return {
    real("scene_threshold", params.inlier_threshold, "px", "> 0", "largest distance of a match from its epipolar line"),
    real("plane_correlation", params.plane_correlation, "", "[0, 1)", "least correlation of patches along a plane"),
    real("scene_significance", params.min_log_significance, "", ">= 0",
         "-log10 of the false alarms an answer may have"),
    natural("scene_seed", params.seed, "of the random draws of points and lines together"),
  };
}

std::vector<Parameter> parameters(SceneMatcherParams& params)
{
  return joined({ parameters(params.points), prefixed("line_", parameters(params.lines)), sceneParameters(params) });
}

std::vector<std::string> SceneMatcherParams::validate() const
{
  SceneMatcherParams copy = *this;
  Faults faults;
  faults.add(points.validate());
  faults.add(faultsOf(prefixed("line_", parameters(copy.lines))));
  faults.add(faultsOf(sceneParameters(copy)));
  return faults.list();
}

SceneMatcher::SceneMatcher(const SceneMatcherParams& params) : params_(params)
{
  requireNoFaults("scene matching parameters", params.validate());
}

FeatureParams SceneMatcher::features() const
{
  FeatureParams features;
  features.points = params_.points.points;
  features.segments = params_.lines.segments;
  features.lines = params_.lines.features;
  return features;
}

ViewMatch SceneMatcher::match(const PreparedImage& reference, const PreparedImage& current, GeometryModel model,
                              const std::function<bool()>& given_up) const
{
  ViewMatch result;
  result.model = model;
  StageClock clock(result.stages);

  const ViewMatch lines = matchLines(reference, current, params_.lines);
  clock.finish("lines");
  // Other scales are for where nothing else is.
  int trials = 0;
  const auto enough = [&] {
    return (given_up && given_up()) || (!lines.planes.empty() && ++trials > 2);
  };
  const ViewMatch points = matchPoints(reference, current, params_.points, enough);
  clock.finish("points");
  if (given_up && given_up())
  {
    result.message = "given up";
    result.elapsed_ms = clock.total();
    return result;
  }

  SceneAttempt attempt(reference, current, params_);
  Rng rng(params_.seed);
  addPlanes(lines, points, params_.points.ransac.inlier_threshold, rng, attempt);
  clock.finish("planes");
  attempt.collect(lines.matches, points.matches);
  const bool points_agree = points.outcome == MatchOutcome::MATCHED;
  const bool found =
      model == GeometryModel::FUNDAMENTAL &&
      attempt.fit(points_agree ? std::optional<Eigen::Matrix3d>(points.matrix) : std::nullopt, result.ransac);
  clock.finish("fundamental");

  const std::optional<Eigen::Matrix3d> plane = found ? std::nullopt : attempt.plane();
  const bool repeated = (found || plane) && params_.points.unique && attempt.isRepeated();
  clock.finish("unique");
  const bool mirrored = (found || plane) && !repeated && params_.points.refuse_mirrored &&
                        isMirrored(reference, 0, current, 0, attempt.planes(), rng);
  clock.finish("mirror");
  const bool refused = repeated || mirrored;
  if (found && !refused)
  {
    attempt.reportFundamental(lines.lines, result);
  }
  else if (plane && !refused)
  {
    attempt.reportPlane(*plane, lines.lines, result);
  }
  attempt.reportCandidates(result);
  if (result.outcome == MatchOutcome::MATCHED)
  {
    result.message = whatIsFound(result, model);
  }
  else if (refused)
  {
    result.message = repeated ? REPEATED : MIRRORED;
  }
  else
  {
    explainNoGeometry(reference, current, lines, points, result);
  }
  result.elapsed_ms = clock.total();
  return result;
}

}  // namespace view_servo
