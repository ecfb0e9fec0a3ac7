// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/line_view_matcher.h"

#include "mirror.h"
#include "repetition.h"
#include "stage_clock.h"
#include "view_servo/features/side_correlation.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/line_homography.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/fundamental_estimator.h"
#include "view_servo/robust/line_homography_estimator.h"
#include "view_servo/robust/parallax.h"
#include "view_servo/robust/significance.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core/utility.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

namespace view_servo
{
namespace
{
/** Support that the best region must have: of 128 pairs of unrelated images none had one of more than 5.6. */
constexpr double BEYOND_CHANCE = 7.0;
// Symmetric things in a mirrored image, as a chessboard, have matched with this significance.
constexpr double LINES_BEYOND_MIRRORS = 120.0;
constexpr double DOUBTFUL = 25.0;  // a significance that calls for more care with that

/** How sure a match is: the mean of what the segments share and of how alike their surroundings look. */
double quality(const SegmentMatch& match)
{
  return 0.5 * (match.share + match.correlation);
}

bool isBetter(const SegmentMatch& a, const SegmentMatch& b)
{
  return quality(a) > quality(b);
}

/** Where the lines of neighbouring segments meet; some places lie beyond the border of the image. */
std::vector<Corner> meetingPlaces(const LineFeatures& features)
{
  constexpr std::size_t MOST = 1500;
  std::vector<Corner> places;
  places.reserve(MOST);
  for (int i = 0; i < features.groupedCount() && places.size() < MOST; ++i)
  {
    for (const LineFeatures::Meeting& meeting : features.meetings(i))
    {
      if (meeting.other > i)
      {
        places.push_back({ meeting.at, 0.0F });
      }
    }
  }
  return places;
}

/** One match of two images. */
class LineAttempt
{
public:
  LineAttempt(const LineFeatures& reference, const LineFeatures& current, const LineMatcherParams& params)
    : from_(reference), to_(current), params_(params), rng_(params.seed)
  {
  }

  /** Regions of matches, none sharing a segment with another, best first. */
  void findRegions(const AssociationMatrix& association)
  {
    std::vector<LineRegion> all = findLineRegions(from_, to_, association, params_.regions);
    std::stable_sort(all.begin(), all.end(), hasMoreSupport);
    if (all.empty() || all.front().support < BEYOND_CHANCE)
    {
      return;
    }
    consolidate(all);
    constexpr int NONE = -1;
    std::vector<int> of_reference(from_.segments().size(), NONE);
    std::vector<int> of_current(to_.segments().size(), NONE);
    for (LineRegion& region : all)
    {
      std::vector<SegmentMatch> fresh;
      std::size_t contradictions = 0;
      for (const SegmentMatch& match : region.matches)
      {
        const int current = of_reference[static_cast<std::size_t>(match.reference)];
        const int reference = of_current[static_cast<std::size_t>(match.current)];
        if (current != NONE || reference != NONE)
        {
          contradictions += current != match.current ? 1 : 0;
        }
        else if (quality(match) >= params_.min_quality && !isBetterExplained(match))
        {
          fresh.push_back(match);
        }
      }
      constexpr std::size_t MIN_FRESH = 4;
      if (fresh.size() < std::max(MIN_FRESH, contradictions))
      {
        continue;
      }
      for (const SegmentMatch& match : fresh)
      {
        of_reference[static_cast<std::size_t>(match.reference)] = match.current;
        of_current[static_cast<std::size_t>(match.current)] = match.reference;
      }
      region.matches = std::move(fresh);
      regions_.push_back(std::move(region));
    }
  }

  /**
   * Drops regions but the best that are found at another place nearly as well, as drawers of a cabinet one drawer off,
   * or farther away with much of their support, as doors along a corridor. The best is judged with all that lies on its
   * plane, see isRepeated().
   */
  void dropRepeatedRegions(const AssociationMatrix& association)
  {
    constexpr double NEARLY = 0.7;  // what has grown at one place is found there more often than by chance
    constexpr double MUCH = 0.3;    // along a corridor, four in five wrong regions had as much, of right ones few
    if (regions_.size() < 2)
    {
      return;
    }
    const std::vector<Corner> places = meetingPlaces(to_);
    const std::vector<double> farther = supportFartherAway(from_, to_, association, regions_, params_.regions);
    std::vector<LineRegion> kept{ std::move(regions_.front()) };
    for (std::size_t i = 1; i < regions_.size(); ++i)
    {
      LineRegion& region = regions_[i];
      if (farther[i] < MUCH * region.support &&
          !otherPlace(from_.smoothed(), to_.smoothed(), positionsOf(junctions(region)), places, region.h, NEARLY))
      {
        kept.push_back(std::move(region));
      }
    }
    regions_ = std::move(kept);
  }

  /**
   * Epipolar geometry of all regions; those that disagree with it are dropped. Besides the intersections, each match
   * gives the point that its region's homography sends its midpoint to: few lines meet, but all say where their region
   * goes.
   */
  RansacStatistics dropInconsistentRegions()
  {
    Correspondences pairs = positionsOf(junctions());
    for (const LineRegion& region : regions_)
    {
      for (const SegmentMatch& match : region.matches)
      {
        pairs.push_back(midpoint(region, match));
      }
    }
    RansacParams ransac_params = params_.ransac;
    ransac_params.sampling = Sampling::UNIFORM;  // the best are all of one region, often a plane
    ransac_params.local_optimizations =
        std::min(ransac_params.local_optimizations, 2);  // it tells right from wrong only
    const auto found = ransac(FundamentalEstimator(pairs, 0.0), ransac_params, rng_);
    if (found.model)
    {
      const double limit = 2.0 * params_.ransac.inlier_threshold;
      const auto disagrees = [&](const LineRegion& region) {
        const auto agreeing =
            std::count_if(region.matches.begin(), region.matches.end(), [&](const SegmentMatch& match) {
              return sampsonError(*found.model, midpoint(region, match)) <= limit * limit;
            });
        return 2 * static_cast<std::size_t>(agreeing) <= region.matches.size();
      };
      regions_.erase(std::remove_if(regions_.begin(), regions_.end(), disagrees), regions_.end());
    }
    return found.statistics;
  }

  /**
   * -log10 of the probability that chance finds as many segments where all regions send them; of four directions, that
   * along which shifts show least: regions of parallel lines leave the homography open however many there are.
   */
  double significance() const
  {
    constexpr int NONE = -1;
    constexpr double LEAST_CHANCE = 0.005;
    std::vector<int> of_reference(from_.segments().size(), NONE);
    for (std::size_t i = 0; i < regions_.size(); ++i)
    {
      for (const SegmentMatch& match : regions_[i].matches)
      {
        of_reference[static_cast<std::size_t>(match.reference)] = static_cast<int>(i);
      }
    }
    std::array<LineEvidence, LINE_DIRECTIONS> all;
    for (std::size_t i = 0; i < regions_.size(); ++i)
    {
      std::vector<char> others(of_reference.size());
      std::transform(of_reference.begin(), of_reference.end(), others.begin(),
                     [&](int region) { return static_cast<char>(region != NONE && region != static_cast<int>(i)); });
      const auto evidence = evidenceOf(regions_[i], from_, to_, others, params_.regions);
      for (std::size_t axis = 0; axis < all.size(); ++axis)
      {
        all[axis] += evidence[axis];
      }
    }
    double least = std::numeric_limits<double>::infinity();
    for (const LineEvidence& evidence : all)
    {
      const double chance = std::max(LEAST_CHANCE, evidence.chance());
      least = std::min(least, -logBinomialTail(evidence.seen, evidence.found, chance));
    }
    return least;
  }

  /** Intersections of neighbours that are matched in the same region, each once. */
  std::vector<MatchedPoint> junctions() const
  {
    std::vector<MatchedPoint> found;
    for (const LineRegion& region : regions_)
    {
      const std::vector<MatchedPoint> of_region = junctions(region);
      found.insert(found.end(), of_region.begin(), of_region.end());
    }
    return found;
  }

  /** All matches, best first. */
  std::vector<SegmentMatch> matches() const
  {
    std::vector<SegmentMatch> all;
    for (const LineRegion& region : regions_)
    {
      all.insert(all.end(), region.matches.begin(), region.matches.end());
    }
    std::stable_sort(all.begin(), all.end(), isBetter);
    return all;
  }

  const std::vector<LineRegion>& regions() const
  {
    return regions_;
  }

  Rng& rng()
  {
    return rng_;
  }

private:
  static bool hasMoreSupport(const LineRegion& a, const LineRegion& b)
  {
    return a.support > b.support;
  }

  /**
   * Several regions may have grown on one plane, each bent by its own wrong matches. Those of all regions that lie near
   * what the best ones say are searched for a homography, from which another region grows.
   */
  void consolidate(std::vector<LineRegion>& regions) const
  {
    constexpr std::size_t BEST = 3;
    // Each match once.
    std::vector<SegmentMatch> all;
    for (const LineRegion& region : regions)
    {
      all.insert(all.end(), region.matches.begin(), region.matches.end());
    }
    std::stable_sort(all.begin(), all.end(), [](const SegmentMatch& a, const SegmentMatch& b) {
      return std::pair(a.reference, a.current) < std::pair(b.reference, b.current);
    });
    all.erase(std::unique(all.begin(), all.end(),
                          [](const SegmentMatch& a, const SegmentMatch& b) {
                            return a.reference == b.reference && a.current == b.current;
                          }),
              all.end());
    std::stable_sort(all.begin(), all.end(), isBetter);

    std::array<std::optional<LineRegion>, BEST> grown;
    cv::parallel_for_(cv::Range(0, static_cast<int>(std::min(BEST, regions.size()))), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i)
      {
        grown[static_cast<std::size_t>(i)] = fromMatchesNear(regions[static_cast<std::size_t>(i)].h, all);
      }
    });
    for (std::optional<LineRegion>& region : grown)
    {
      if (region)
      {
        regions.push_back(std::move(*region));
      }
    }
    std::stable_sort(regions.begin(), regions.end(), hasMoreSupport);
  }

  /** The region that grows from a homography of those of the matches, best first, that lie near what another says. */
  std::optional<LineRegion> fromMatchesNear(const Eigen::Matrix3d& h, const std::vector<SegmentMatch>& matches) const
  {
    constexpr double NEAR = 4.0;  // tolerances
    constexpr std::size_t MIN_LINES = 8;
    constexpr std::size_t MAX_LINES = 120;
    constexpr int MAX_ITERATIONS = 200;
    const double min_cosine = std::cos(params_.regions.max_angle_deg * M_PI / 180.0);
    std::vector<SegmentMatch> near;
    SegmentPairs lines;
    for (std::size_t i = 0; i < matches.size() && near.size() < MAX_LINES; ++i)
    {
      const SegmentPair pair{ from_.segment(matches[i].reference), to_.segment(matches[i].current) };
      const auto mapped = transfer(h, pair.reference);
      if (!mapped)
      {
        continue;
      }
      const SegmentAgreement found = compare(*mapped, pair.current);
      if (found.distance <= NEAR * params_.regions.tolerance && found.cosine >= min_cosine)
      {
        near.push_back(matches[i]);
        lines.push_back(pair);
      }
    }
    if (lines.size() < MIN_LINES)
    {
      return std::nullopt;
    }
    RansacParams ransac_params = params_.ransac;
    ransac_params.inlier_threshold = params_.planes.threshold;
    ransac_params.sampling = Sampling::UNIFORM;
    ransac_params.max_iterations = std::min(ransac_params.max_iterations, MAX_ITERATIONS);
    Rng rng(params_.seed);
    const auto found = ransac(LineHomographyEstimator(lines), ransac_params, rng);
    if (!found.model)
    {
      return std::nullopt;
    }
    std::vector<SegmentMatch> inliers;
    for (const int i : found.inliers)
    {
      inliers.push_back(near[static_cast<std::size_t>(i)]);
    }
    return growLineRegion(from_, to_, found.model->h, inliers, params_.regions);
  }

  /** Intersections of neighbours that are matched in a region, each once. */
  std::vector<MatchedPoint> junctions(const LineRegion& region) const
  {
    std::vector<MatchedPoint> found;
    std::vector<const SegmentMatch*> of_reference(from_.segments().size(), nullptr);
    for (const SegmentMatch& match : region.matches)
    {
      of_reference[static_cast<std::size_t>(match.reference)] = &match;
    }
    for (const SegmentMatch& match : region.matches)
    {
      if (match.reference >= from_.groupedCount())
      {
        continue;
      }
      for (const LineFeatures::Meeting& meeting : from_.meetings(match.reference))
      {
        const SegmentMatch* other = of_reference[static_cast<std::size_t>(meeting.other)];
        if (other == nullptr || (meeting.other < match.reference && knows(meeting.other, match.reference)))
        {
          continue;
        }
        const auto at =
            lineIntersection(to_.segment(match.current), to_.segment(other->current), LineFeatures::MIN_SINE);
        if (at)
        {
          found.push_back({ { meeting.at, *at }, std::min(quality(match), quality(*other)), false });
        }
      }
    }
    return found;
  }

  Correspondence midpoint(const LineRegion& region, const SegmentMatch& match) const
  {
    const Eigen::Vector2d at = from_.segment(match.reference).midpoint();
    return { at, transfer(region.h, at) };
  }

  /** Whether the homography of a better region finds what lies beside a segment at least as well, where it sends it. */
  bool isBetterExplained(const SegmentMatch& match) const
  {
    const Segment& segment = from_.segment(match.reference);
    return std::any_of(regions_.begin(), regions_.end(), [&](const LineRegion& region) {
      const auto mapped = transfer(region.h, segment);
      return mapped &&
             sideCorrelation(from_.smoothed(), to_.smoothed(), region.h, segment, *mapped) >= match.correlation;
    });
  }

  bool knows(int segment, int other) const
  {
    if (segment >= from_.groupedCount())
    {
      return false;
    }
    const std::vector<LineFeatures::Meeting>& meetings = from_.meetings(segment);
    return std::any_of(meetings.begin(), meetings.end(),
                       [other](const LineFeatures::Meeting& meeting) { return meeting.other == other; });
  }

  const LineFeatures& from_;
  const LineFeatures& to_;
  const LineMatcherParams& params_;
  Rng rng_;
  std::vector<LineRegion> regions_;
};

std::string plural(std::size_t count, const std::string& noun)
{
  return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

void reportPlane(const SegmentPairs& lines, const LinePlanes& planes, ViewMatch& result)
{
  const LineHomographyEstimator estimator(lines);
  const LineHomographyEstimator::Model model{ planes.homographies.front(), planes.homographies.front().inverse() };
  double squares = 0.0;
  for (std::size_t i = 0; i < lines.size(); ++i)
  {
    if (planes.of_line[i] == 0)
    {
      squares += estimator.error(model, i);
      ++result.inliers;
    }
  }
  result.outcome = MatchOutcome::MATCHED;
  result.matrix = result.planes.front();
  result.rms_error = std::sqrt(squares / result.inliers);
  result.message = plural(lines.size(), "line") + " matched, " + std::to_string(result.inliers) +
                   " of them on the first of " + plural(planes.homographies.size(), "plane");
}

void reportFundamental(ViewMatch& result)
{
  double squares = 0.0;
  for (const MatchedPoint& point : result.matches)
  {
    if (point.inlier)
    {
      squares += sampsonError(result.fundamental, point.position);
      ++result.inliers;
    }
  }
  result.outcome = MatchOutcome::MATCHED;
  result.matrix = result.fundamental;
  result.rms_error = std::sqrt(squares / result.inliers);
  result.message = plural(result.lines.size(), "line") + " matched, " + std::to_string(result.inliers) + " of " +
                   plural(result.matches.size(), "intersection") + " agree with one fundamental matrix";
}

/**
 * The fundamental matrix of the intersections, best first, or of two planes, if it stands without any of the planes.
 */
std::optional<Eigen::Matrix3d> fundamentalOf(const Correspondences& points, const SegmentPairs& lines,
                                             const LinePlanes& planes, const LineMatcherParams& params, Rng& rng)
{
  const auto stands = [&](const std::optional<Eigen::Matrix3d>& f) {
    return f && std::all_of(planes.homographies.begin(), planes.homographies.end(), [&](const Eigen::Matrix3d& h) {
             return Parallax(h, points, params.planes.threshold).significance(*f) >= params.min_log_parallax;
           });
  };
  auto f = fundamentalOfPoints(points, params.ransac, rng);
  if (!stands(f))
  {
    f = fundamentalOfPlanes(lines, planes);
  }
  return stands(f) ? f : std::nullopt;
}

/** Adds where neighbouring lines meet, best first; true when they, or the planes, determine a fundamental matrix. */
bool addPoints(LineAttempt& attempt, const SegmentPairs& lines, const LinePlanes& planes,
               const LineMatcherParams& params, ViewMatch& result)
{
  result.matches = attempt.junctions();
  std::stable_sort(result.matches.begin(), result.matches.end(),
                   [](const MatchedPoint& a, const MatchedPoint& b) { return a.score > b.score; });
  const std::optional<Eigen::Matrix3d> f =
      fundamentalOf(positionsOf(result.matches), lines, planes, params, attempt.rng());
  if (f)
  {
    result.fundamental = *f;
  }
  const double threshold = params.ransac.inlier_threshold;
  for (MatchedPoint& point : result.matches)
  {
    point.inlier =
        f ? sampsonError(*f, point.position) <= threshold * threshold : liesOnPlane(planes, point.position, threshold);
  }
  return f.has_value();
}

constexpr std::size_t MIN_SEGMENTS = 6;

/** Whether the first plane has more than half of the lines, and they are found elsewhere nearly as well. */
bool isRepeated(const LineFeatures& reference, const LineFeatures& current, const ViewMatch& result)
{
  const auto on_plane =
      std::count_if(result.lines.begin(), result.lines.end(), [](const MatchedLine& line) { return line.plane == 0; });
  if (2 * static_cast<std::size_t>(on_plane) <= result.lines.size())
  {
    return false;
  }
  const Eigen::Matrix3d& plane = result.planes.front();
  const Eigen::Matrix3d inverse = plane.inverse();
  constexpr double NEAR = 3.0;  // [px]
  Correspondences pairs = positionsOf(result.matches);
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(),
                             [&](const Correspondence& pair) {
                               return 0.5 * symmetricTransferError(plane, inverse, pair) > NEAR * NEAR;
                             }),
              pairs.end());
  return otherPlace(reference.smoothed(), current.smoothed(), pairs, meetingPlaces(current), plane).has_value();
}

/** Makes it a result without a geometry; what it was made from stays. */
void refuse(ViewMatch& result)
{
  result.outcome = MatchOutcome::NO_GEOMETRY;
  result.matrix.setConstant(NOT_A_NUMBER);
  result.rms_error = NOT_A_NUMBER;
  result.inliers = 0;
  for (MatchedPoint& match : result.matches)
  {
    match.inlier = false;
  }
}

std::string whyNot(const LineFeatures& reference, const LineFeatures& current, const ViewMatch& result, bool by_chance)
{
  if (result.outcome == MatchOutcome::TOO_FEW_FEATURES)
  {
    return "too few line segments: " + std::to_string(reference.segments().size()) + " in the reference, " +
           std::to_string(current.segments().size()) + " in the current image, " + std::to_string(MIN_SEGMENTS) +
           " needed in each";
  }
  if (result.lines.empty())
  {
    return "no geometry found: no part of the reference's segments falls on segments that look alike";
  }
  if (by_chance)
  {
    return "no geometry found: " + plural(result.lines.size(), "line") +
           " matched, hardly more than chance would match, or all in one direction";
  }
  return "no geometry found: " + plural(result.lines.size(), "line") + " matched, which leave " +
         (result.model == GeometryModel::HOMOGRAPHY ? "the homographies of planes" : "the fundamental matrix") +
         " open";
}

/** The parameters that no stage of line matching has by itself. */
std::vector<Parameter> rowsOfLines(LineMatcherParams& params)
{
  return {
    real("min_quality", params.min_quality, "", "[0, 1)", "least mean of a match's overlap and correlation"),
    real("min_significance", params.min_log_significance, "", ">= 0",
         "-log10 of the probability that chance matches as many lines"),
    boolean("unique", params.unique, "refuse a view that fits at another place nearly as well"),
    boolean("refuse_mirrored", params.refuse_mirrored, "refuse an image that shows the view better when mirrored"),
    real("min_parallax", params.min_log_parallax, "", ">= 0",
         "-log10 of the false alarms a fundamental matrix may have off each plane"),
    natural("seed", params.seed, "seed of all random draws"),
  };
}

}  // namespace

LineMatcherParams::LineMatcherParams()
{
  // The end points of lines are uncertain, and so are intersections: 3 px tells regions apart.
  ransac.inlier_threshold = 3.0;
}

std::vector<Parameter> parameters(LineMatcherParams& params)
{
  return joined({ parameters(params.segments), parameters(params.features), parameters(params.regions),
                  parameters(params.planes), rowsOfLines(params), parameters(params.ransac) });
}

std::vector<std::string> LineMatcherParams::validate() const
{
  LineMatcherParams copy = *this;
  Faults faults;
  faults.add(segments.validate());
  faults.add(features.validate());
  faults.add(regions.validate());
  faults.add(planes.validate());
  faults.add(faultsOf(rowsOfLines(copy)));
  faults.add(ransac.validate());
  return faults.list();
}

LineViewMatcher::LineViewMatcher(const LineMatcherParams& params) : params_(params)
{
  requireNoFaults("line matching parameters", params.validate());
}

ViewMatch LineViewMatcher::match(const PreparedImage& reference, const PreparedImage& current, GeometryModel model,
                                 LineGrouping groups) const
{
  std::vector<StageTime> stages;
  StageClock clock(stages);
  reference.lines();
  clock.finish("reference");
  current.lines();
  clock.finish("current");
  ViewMatch result = match(reference.lines(), current.lines(), model, groups);
  if (result.outcome == MatchOutcome::MATCHED && params_.refuse_mirrored &&
      result.log_significance < LINES_BEYOND_MIRRORS)
  {
    StageClock mirror_clock(result.stages);
    Rng rng(params_.seed);
    // Corners are found in less time in the images of half the size, but fewer.
    const int level = result.log_significance < DOUBTFUL ? 0 : 2;
    if (isMirrored(reference, level, current, level, result.planes, result.log_significance, rng))
    {
      refuse(result);
      result.fundamental.setConstant(NOT_A_NUMBER);
      result.message = MIRRORED;
    }
    mirror_clock.finish("mirror");
  }
  if (result.outcome != MatchOutcome::MATCHED)
  {
    result.message += exposureNote(reference, current);
  }
  result.stages.insert(result.stages.begin(), stages.begin(), stages.end());
  result.elapsed_ms = clock.total();
  return result;
}

ViewMatch LineViewMatcher::match(const LineFeatures& reference, const LineFeatures& current, GeometryModel model,
                                 LineGrouping groups) const
{
  ViewMatch result;
  result.model = model;
  StageClock clock(result.stages);

  LineAttempt attempt(reference, current, params_);
  // Side by side; that of a stored reference is there already.
  cv::parallel_for_(cv::Range(0, 2), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i)
    {
      (i == 0 ? reference : current).index(groups);
    }
  });
  clock.finish("groups");
  const AssociationMatrix association = associateLines(reference.index(groups), current.index(groups));
  clock.finish("association");
  attempt.findRegions(association);
  clock.finish("regions");
  if (params_.unique)
  {
    attempt.dropRepeatedRegions(association);
  }
  clock.finish("repetition");
  result.ransac = attempt.dropInconsistentRegions();
  clock.finish("ransac");
  result.log_significance = attempt.significance();
  clock.finish("significance");

  const std::vector<SegmentMatch> matches = attempt.matches();
  SegmentPairs lines;
  for (const SegmentMatch& match : matches)
  {
    lines.push_back({ reference.segment(match.reference), current.segment(match.current) });
  }
  const LinePlanes planes = findPlanes(lines, params_.planes, params_.ransac, attempt.rng());
  for (std::size_t i = 0; i < lines.size(); ++i)
  {
    result.lines.push_back({ lines[i].reference, lines[i].current, reference.input(matches[i].reference),
                             current.input(matches[i].current), quality(matches[i]), planes.of_line[i] });
  }
  for (const Eigen::Matrix3d& h : planes.homographies)
  {
    result.planes.push_back(normalizedHomography(h));
  }
  clock.finish("planes");
  const bool f = addPoints(attempt, lines, planes, params_, result);
  clock.finish("fundamental");

  const bool by_chance = result.log_significance < params_.min_log_significance;
  const bool repeated = params_.unique && !by_chance && isRepeated(reference, current, result);
  clock.finish("unique");
  if (model == GeometryModel::HOMOGRAPHY && !planes.homographies.empty() && !by_chance && !repeated)
  {
    reportPlane(lines, planes, result);
  }
  else if (model == GeometryModel::FUNDAMENTAL && f && !by_chance && !repeated)
  {
    reportFundamental(result);
  }
  else
  {
    refuse(result);
    if (by_chance || repeated)
    {
      result.fundamental.setConstant(NOT_A_NUMBER);
    }
    if (std::min(reference.segments().size(), current.segments().size()) < MIN_SEGMENTS)
    {
      result.outcome = MatchOutcome::TOO_FEW_FEATURES;
    }
    result.message = repeated ? REPEATED : whyNot(reference, current, result, by_chance);
  }
  result.elapsed_ms = clock.total();
  return result;
}

}  // namespace view_servo
