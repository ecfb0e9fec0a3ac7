// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "scene_geometry.h"

#include "repetition.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/orientation.h"
#include "view_servo/robust/parallax.h"
#include "view_servo/robust/significance.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>

namespace view_servo
{
namespace
{
constexpr std::size_t MIN_MATCHES = 15;
// Significance of a plane: wrong ones of pairs that show nothing in common had 6.7 at most.
constexpr double PLANE_BEYOND_DOUBT = 15.0;
constexpr double IN_ORDER = 0.75;             // part of the matches of a fundamental matrix, see keepsOrientation()
constexpr double LEAST_CHANCE_BESIDE = 0.01;  // that a corner is found beside a plane
constexpr double SEARCH_RADIUS = 4.0;         // around where a plane sends a corner [px]
}  // namespace

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

SceneGeometry::SceneGeometry(const PreparedImage& reference, const PreparedImage& current,
                             const SceneMatcherParams& params)
  : reference_(reference),
    current_(current),
    params_(params),
    corners_(reference.points(0).corners),
    rng_(params.seed),
    found_(corners_.size())
{
  guidance_.min_correlation = params.plane_correlation;
}

void SceneGeometry::addPlane(const Eigen::Matrix3d& h, int of_lines)
{
  constexpr double LEAST = 6.0;  // significance
  const std::size_t seen = countSeen(corners_, h);
  const std::vector<GuidedMatch> matches = search(corners_, h);
  // What is found beside only lowers the significance: few planes need to be asked for it.
  const bool maybe = -logBinomialTail(seen, matches.size(), LEAST_CHANCE_BESIDE) >= LEAST;
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

void SceneGeometry::collect(const Candidates& candidates)
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
  for (const std::vector<MatchedPoint>* kind :
       { &std::as_const(along_planes), &candidates.intersections, &candidates.corners })
  {
    matches_.insert(matches_.end(), kind->begin(), kind->end());
  }
  pairs_ = positionsOf(matches_);
}

bool SceneGeometry::fit(const std::optional<Eigen::Matrix3d>& other, RansacStatistics& statistics)
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
  for (const std::optional<Eigen::Matrix3d>& hypothesis : { found.model, other })
  {
    if (hypothesis)
    {
      consider(*hypothesis);
    }
  }
  if (best_ && !(best_->margin >= 0.0 && keepsOrientation(agreeing(best_->f), IN_ORDER)))
  {
    best_.reset();  // what is refused is not to judge a plane
  }
  return best_.has_value();
}

bool SceneGeometry::isRepeated()
{
  const auto repeats = [&](const Eigen::Matrix3d& h) {
    return otherPlace(reference_.grey(), current_.grey(), onPlane(h), current_.points(0).corners, h).has_value();
  };
  if (!best_)
  {
    return bestPlane() != nullptr && repeats(bestPlane()->h);
  }
  // Along a row of windows a fundamental matrix agrees with all that are a whole number of windows off.
  Correspondences unique = agreeing(best_->f);
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

double SceneGeometry::significance() const
{
  const Plane* plane = bestPlane();
  return best_ ? best_->significance : plane != nullptr ? plane->significance : 0.0;
}

std::vector<Eigen::Matrix3d> SceneGeometry::planes() const
{
  std::vector<Eigen::Matrix3d> result;
  std::transform(planes_.begin(), planes_.end(), std::back_inserter(result),
                 [](const Plane& plane) { return plane.h; });
  return result;
}

std::optional<Eigen::Matrix3d> SceneGeometry::plane() const
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

void SceneGeometry::reportFundamental(const std::vector<MatchedLine>& lines, ViewMatch& result)
{
  const Eigen::Matrix3d& f = best_->f;
  reportLines(
      lines, [&](const Correspondence& pair) { return agrees(f, pair); }, result);
  report(result, GeometryModel::FUNDAMENTAL, f, [&](const Correspondence& pair) { return sampsonError(f, pair); });
  result.fundamental = f;
  result.log_significance = best_->significance;
}

void SceneGeometry::reportPlane(const Eigen::Matrix3d& h, const std::vector<MatchedLine>& lines, ViewMatch& result)
{
  const Eigen::Matrix3d inverse = h.inverse();
  reportLines(
      lines, [&](const Correspondence& pair) { return liesOn(h, pair); }, result);
  report(result, GeometryModel::HOMOGRAPHY, normalizedHomography(h),
         [&](const Correspondence& pair) { return 0.5 * symmetricTransferError(h, inverse, pair); });
}

void SceneGeometry::reportCandidates(ViewMatch& result)
{
  result.matches = std::move(matches_);
}

/** Null without planes. */
const SceneGeometry::Plane* SceneGeometry::bestPlane() const
{
  const auto best = std::max_element(planes_.begin(), planes_.end(),
                                     [](const Plane& a, const Plane& b) { return a.significance < b.significance; });
  return best == planes_.end() ? nullptr : &*best;
}

bool SceneGeometry::isBeyondDoubt(const Plane* plane)
{
  return plane != nullptr && plane->significance >= PLANE_BEYOND_DOUBT;
}

std::vector<GuidedMatch> SceneGeometry::search(const std::vector<Corner>& corners, const Eigen::Matrix3d& h) const
{
  return searchAlongHomography(reference_.grey(), corners, current_.grey(), h, SEARCH_RADIUS, guidance_);
}

/**
 * Corners off the planes that are seen not far from where one would show them: they say most of the parallax. Each has
 * to be found again from the current image, which fails where something else there looks more like it.
 */
void SceneGeometry::addMatchesNear(const Eigen::Matrix3d& h)
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
std::size_t SceneGeometry::countSeen(const std::vector<Corner>& corners, const Eigen::Matrix3d& h) const
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
double SceneGeometry::chanceBeside(const Eigen::Matrix3d& h) const
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
  return seen > 0 ? std::max(LEAST_CHANCE_BESIDE, static_cast<double>(found) / static_cast<double>(seen)) : 1.0;
}

bool SceneGeometry::agrees(const Eigen::Matrix3d& f, const Correspondence& pair) const
{
  return sampsonError(f, pair) <= params_.inlier_threshold * params_.inlier_threshold;
}

Correspondences SceneGeometry::agreeing(const Eigen::Matrix3d& f) const
{
  Correspondences found;
  std::copy_if(pairs_.begin(), pairs_.end(), std::back_inserter(found),
               [&](const Correspondence& pair) { return agrees(f, pair); });
  return found;
}

bool SceneGeometry::liesOn(const Eigen::Matrix3d& h, const Correspondence& pair) const
{
  return (transfer(h, pair.reference) - pair.current).norm() <= 2.0 * params_.inlier_threshold;
}

Correspondences SceneGeometry::onPlane(const Eigen::Matrix3d& h) const
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
SceneGeometry::Plane SceneGeometry::bestPlaneOf(const Correspondences& pairs)
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

double SceneGeometry::significanceOf(const Eigen::Matrix3d& f) const
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
 * Keeps a fundamental matrix, or one of its best plane and the parallax off it, if that is the best so far. Where
 * little lies far off the plane, what lies near it is told from it by half the threshold.
 */
void SceneGeometry::consider(const Eigen::Matrix3d& hypothesis)
{
  constexpr double FINE = 0.5;
  const Correspondences supporting = agreeing(hypothesis);
  if (supporting.size() < MIN_MATCHES)
  {
    return;
  }
  Plane plane = bestPlaneOf(supporting);
  weigh(hypothesis, plane, params_.inlier_threshold);
  if (best_ && best_->margin < 0.0)
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
void SceneGeometry::weigh(const Eigen::Matrix3d& hypothesis, const Plane& plane, double tolerance)
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
    const bool better =
        best_ && (margin >= 0.0 && best_->margin >= 0.0 ? support > best_->support : margin > best_->margin);
    if (!best_ || better)
    {
      best_ = Choice{ choice, support, evidence, margin };
    }
  }
}

/** Those planes with whose matches the geometry mostly agrees, and the segments that the line matcher found on them. */
template <typename Agrees>
void SceneGeometry::reportLines(const std::vector<MatchedLine>& lines, const Agrees& agrees, ViewMatch& result) const
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
void SceneGeometry::report(ViewMatch& result, GeometryModel model, const Eigen::Matrix3d& matrix,
                           const SquaredError& squared_error)
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

}  // namespace view_servo
