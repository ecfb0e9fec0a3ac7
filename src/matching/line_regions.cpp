// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/line_regions.h"

#include "agreeing_segments.h"
#include "view_servo/features/side_correlation.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/line_homography.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

namespace view_servo
{
namespace
{
constexpr AffinityLimits AFFINITY_LIMITS;  // of local maps
constexpr std::size_t MIN_HOMOGRAPHY = 8;  // matches from which on a homography is fitted rather than an affine map
constexpr int BATCH = 32;                  // candidates evaluated side by side; fixed, so that results are

double supportOf(double share)
{
  return 0.3 + 0.7 * share;
}

double support(const std::vector<SegmentMatch>& matches)
{
  double sum = 0.0;
  for (const SegmentMatch& match : matches)
  {
    sum += supportOf(match.share);
  }
  return sum;
}

/** Smallest and largest coordinates of what a region matches in the reference image [px]. */
std::pair<Eigen::Array2d, Eigen::Array2d> extent(const LineRegion& region, const LineFeatures& reference)
{
  Eigen::Array2d low(std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity());
  Eigen::Array2d high = -low;
  for (const SegmentMatch& match : region.matches)
  {
    const Segment& segment = reference.segment(match.reference);
    for (const Eigen::Vector2d& end : { segment.start, segment.end })
    {
      low = low.min(end.array());
      high = high.max(end.array());
    }
  }
  return { low, high };
}

bool contains(const cv::Size& image, const Eigen::Vector2d& at)
{
  return at.x() > 0.0 && at.y() > 0.0 && at.x() < image.width - 1.0 && at.y() < image.height - 1.0;
}

class RegionFinder
{
public:
  RegionFinder(const LineFeatures& reference, const LineFeatures& current, const AssociationMatrix& association,
               const LineRegionParams& params)
    : from_(reference),
      to_(current),
      association_(association),
      params_(params),
      min_cosine_(std::cos(params.max_angle_deg * M_PI / 180.0)),
      votes_(Eigen::MatrixXf::Zero(association.rows(), association.columns()))
  {
    std::vector<double> row_best(static_cast<std::size_t>(association.rows()), 0.0);
    std::vector<double> column_best(static_cast<std::size_t>(association.columns()), 0.0);
    for (const Association& entry : association.entries())
    {
      double& row = row_best[static_cast<std::size_t>(entry.row)];
      double& column = column_best[static_cast<std::size_t>(entry.column)];
      row = std::max(row, entry.weight);
      column = std::max(column, entry.weight);
    }
    for (const Association& entry : association.entries())
    {
      votes_(entry.row, entry.column) =
          static_cast<float>(entry.weight / row_best[static_cast<std::size_t>(entry.row)] +
                             entry.weight / column_best[static_cast<std::size_t>(entry.column)]);
    }
  }

  std::vector<LineRegion> find() const
  {
    const std::vector<Association> candidates = rankedCandidates();
    std::vector<char> claimed(from_.segments().size(), 0);
    std::vector<LineRegion> regions;
    int trials = 0;
    for (std::size_t next = 0; next < candidates.size() && trials < params_.max_trials;)
    {
      std::vector<Association> batch;
      for (; next < candidates.size() && batch.size() < BATCH; ++next)
      {
        if (claimed[static_cast<std::size_t>(candidates[next].row)] == 0)
        {
          batch.push_back(candidates[next]);
        }
      }
      trials += static_cast<int>(batch.size());
      std::vector<std::optional<LineRegion>> seeds(batch.size());
      cv::parallel_for_(cv::Range(0, static_cast<int>(batch.size())), [&](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i)
        {
          seeds[static_cast<std::size_t>(i)] = seed(batch[static_cast<std::size_t>(i)]);
        }
      });
      for (std::size_t i = 0; i < batch.size(); ++i)
      {
        if (!seeds[i] || claimed[static_cast<std::size_t>(batch[i].row)] != 0)
        {
          continue;
        }
        grow(*seeds[i]);
        if (!looksAlike(*seeds[i]))
        {
          continue;
        }
        for (const SegmentMatch& match : seeds[i]->matches)
        {
          claimed[static_cast<std::size_t>(match.reference)] = 1;
        }
        regions.push_back(std::move(*seeds[i]));
      }
    }
    return regions;
  }

  std::optional<LineRegion> grown(const Eigen::Matrix3d& h, const std::vector<SegmentMatch>& matches) const
  {
    LineRegion region{ h, matches, 0.0 };
    grow(region);
    return looksAlike(region) ? std::optional<LineRegion>(std::move(region)) : std::nullopt;
  }

  std::vector<double> supportFartherAway(const std::vector<LineRegion>& regions) const
  {
    const std::vector<Association> candidates = rankedCandidates();
    std::vector<double> most(regions.size(), 0.0);
    cv::parallel_for_(cv::Range(0, static_cast<int>(regions.size())), [&](const cv::Range& range) {
      for (int i = range.start; i < range.end; ++i)
      {
        most[static_cast<std::size_t>(i)] = supportFartherAway(regions[static_cast<std::size_t>(i)], candidates);
      }
    });
    return most;
  }

private:
  /** Area that a homography gives to a small square of area 1 there [px^2]. */
  static double areaOf(const Eigen::Matrix3d& h, const Eigen::Vector2d& at)
  {
    const Eigen::Vector2d to = transfer(h, at);
    return std::abs(
        cross(transfer(h, at + Eigen::Vector2d::UnitX()) - to, transfer(h, at + Eigen::Vector2d::UnitY()) - to));
  }

  double supportFartherAway(const LineRegion& region, const std::vector<Association>& candidates) const
  {
    constexpr int MOST_TRIED = 8;       // if much of the region is elsewhere too, then one of the strongest is
    constexpr double ELSEWHERE = 15.0;  // nearer places are one, as the two edges of a frame are [px]
    constexpr double SMALLER = 0.6;     // of the area
    std::vector<int> own;
    std::vector<char> is_own(from_.segments().size(), 0);
    Eigen::Vector2d middle = Eigen::Vector2d::Zero();
    for (const SegmentMatch& match : region.matches)
    {
      own.push_back(match.reference);
      is_own[static_cast<std::size_t>(match.reference)] = 1;
      middle += reference(match.reference).midpoint() / static_cast<double>(region.matches.size());
    }
    const auto is_elsewhere = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
      return (a - b).norm() > ELSEWHERE;
    };
    double most = 0.0;
    int tried = 0;
    for (std::size_t i = 0; i < candidates.size() && tried < MOST_TRIED; ++i)
    {
      const auto& [row, column, weight] = candidates[i];
      if (is_own[static_cast<std::size_t>(row)] == 0 ||
          !is_elsewhere(transfer(region.h, reference(row).midpoint()), current(column).midpoint()))
      {
        continue;
      }
      ++tried;
      std::optional<LineRegion> other = seed(candidates[i]);
      if (!other)
      {
        continue;
      }
      refitUntilNothingIsGained(*other, own);
      other->matches = agreeing(own, other->h, params_.tolerance);
      if (!other->matches.empty() && is_elsewhere(transfer(region.h, middle), transfer(other->h, middle)) &&
          areaOf(other->h, middle) < SMALLER * areaOf(region.h, middle))
      {
        looksAlike(*other);
        most = std::max(most, other->support);
      }
    }
    return most;
  }

  void refitUntilNothingIsGained(LineRegion& region, const std::vector<int>& of) const
  {
    constexpr int MAX_ROUNDS = 3;
    for (int round = 0; round < MAX_ROUNDS && refit(region, of); ++round)
    {
    }
  }

  /** Candidate matches, those first that stand out in their row and column. */
  std::vector<Association> rankedCandidates() const
  {
    constexpr double LOG_SHARE = 0.3;
    std::vector<Association> ranked = association_.strongestOfRows(params_.max_candidates).entries();
    for (Association& entry : ranked)
    {
      entry.weight = votes_(entry.row, entry.column) + LOG_SHARE * std::log1p(entry.weight);
    }
    std::stable_sort(ranked.begin(), ranked.end(),
                     [](const Association& a, const Association& b) { return a.weight > b.weight; });
    return ranked;
  }

  const Segment& reference(int i) const
  {
    return from_.segments()[static_cast<std::size_t>(i)];
  }
  const Segment& current(int i) const
  {
    return to_.segments()[static_cast<std::size_t>(i)];
  }

  /** A neighbour that may correspond to a neighbour of the counterpart. */
  struct Companion
  {
    int reference;
    int current;
    Eigen::Vector2d reference_at;
    Eigen::Vector2d current_at;
    double along;  ///< place of the intersection on the shared segment [px]
    double current_along;
    double weight;  ///< of their association
  };

  /** Those that meet the candidate's segments in the same sense and on the same side, strongest votes first. */
  std::vector<Companion> companions(int i, int k) const
  {
    constexpr double CLEARLY_ASIDE = 0.25;  // of its length, a midpoint from the line
    const Eigen::Vector2d& di = from_.direction(i);
    const Eigen::Vector2d& dk = to_.direction(k);
    std::vector<Companion> found;
    for (const LineFeatures::Meeting& a : from_.meetings(i))
    {
      const Segment& ra = reference(a.other);
      const double turn = cross(di, ra.end - ra.start);
      const double aside = cross(di, ra.midpoint() - reference(i).start) / ra.length();
      for (const LineFeatures::Meeting& b : to_.meetings(k))
      {
        const Segment& cb = current(b.other);
        if (turn * cross(dk, cb.end - cb.start) < 0.0)
        {
          continue;
        }
        const double other_aside = cross(dk, cb.midpoint() - current(k).start) / cb.length();
        if (aside * other_aside < 0.0 && std::abs(aside) > CLEARLY_ASIDE && std::abs(other_aside) > CLEARLY_ASIDE)
        {
          continue;
        }
        const double weight = votesOf(a.other, b.other);
        if (weight > 0.0)
        {
          found.push_back({ a.other, b.other, a.at, b.at, a.at.dot(di), b.at.dot(dk), weight });
        }
      }
    }
    const std::size_t kept = std::min(found.size(), static_cast<std::size_t>(params_.max_companions));
    std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(kept), found.end(),
                      [](const Companion& a, const Companion& b) {
                        return a.weight != b.weight
                                   ? a.weight > b.weight
                                   : std::pair(a.reference, a.current) < std::pair(b.reference, b.current);
                      });
    found.resize(kept);
    return found;
  }

  /** Votes as a part of the most that either has; neighbours that form no groups have none, and count a little. */
  double votesOf(int i, int k) const
  {
    if (i >= association_.rows() || k >= association_.columns())
    {
      constexpr double UNKNOWN = 1e-3;
      return UNKNOWN;
    }
    return votes_(i, k);
  }

  struct Hypothesis
  {
    double agreement;
    Eigen::Matrix3d map;
  };

  /** The affine map of a candidate with two companions. */
  std::optional<Hypothesis> hypothesis(const Association& candidate, const Companion& a, const Companion& b) const
  {
    constexpr double MIN_APART = 4.0;    // intersections along the shared segment [px]
    constexpr double MAX_REACH = 400.0;  // of the third intersection [px]
    constexpr double END_POINT_WEIGHT = 0.3;
    constexpr double TURNS = 0.15;         // sine of an angle that has a clear sense
    constexpr double SLACK = 1.5;          // of the tolerance, for the three segments themselves
    constexpr double MIN_AGREEMENT = 0.8;  // sum of shares of the three
    if (a.reference == b.reference || a.current == b.current)
    {
      return std::nullopt;
    }
    const Segment& ra = reference(a.reference);
    const Segment& rb = reference(b.reference);
    const Segment& ca = current(a.current);
    const Segment& cb = current(b.current);
    const double along = b.along - a.along;
    const double along_current = b.current_along - a.current_along;
    const double scale = along_current / along;
    if (std::abs(along) < MIN_APART || std::abs(along_current) < MIN_APART ||
        !(scale > 1.0 / AFFINITY_LIMITS.scale_change && scale < AFFINITY_LIMITS.scale_change))
    {
      return std::nullopt;
    }
    const double turn = cross(ra.end - ra.start, rb.end - rb.start) / (ra.length() * rb.length());
    const double turn_current = cross(ca.end - ca.start, cb.end - cb.start) / (ca.length() * cb.length());
    if (turn * turn_current < 0.0 && std::abs(turn) > TURNS && std::abs(turn_current) > TURNS)
    {
      return std::nullopt;
    }
    // Two intersections, and the third or, where there is none, the far ends of the two others.
    Eigen::Vector2d from[4] = { a.reference_at, b.reference_at };
    Eigen::Vector2d to[4] = { a.current_at, b.current_at };
    double weights[4] = { 1.0, 1.0, 1.0, END_POINT_WEIGHT };
    int n = 3;
    const auto third = lineIntersection(ra, rb, LineFeatures::MIN_SINE);
    const auto third_current = lineIntersection(ca, cb, LineFeatures::MIN_SINE);
    if (third && third_current && (*third - a.reference_at).norm() < MAX_REACH)
    {
      from[2] = *third;
      to[2] = *third_current;
    }
    else
    {
      const bool a_starts = startIsFarther(ra, a.reference_at);
      const bool b_starts = startIsFarther(rb, b.reference_at);
      if (a_starts != startIsFarther(ca, a.current_at) || b_starts != startIsFarther(cb, b.current_at))
      {
        return std::nullopt;
      }
      from[2] = a_starts ? ra.start : ra.end;
      to[2] = a_starts ? ca.start : ca.end;
      from[3] = b_starts ? rb.start : rb.end;
      to[3] = b_starts ? cb.start : cb.end;
      weights[2] = END_POINT_WEIGHT;
      n = 4;
    }
    const auto map = plausibleAffinity(from, to, weights, n, AFFINITY_LIMITS);
    if (!map)
    {
      return std::nullopt;
    }
    double sum = 0.0;
    for (const auto& [i, k] : { std::pair(candidate.row, candidate.column), std::pair(a.reference, a.current),
                                std::pair(b.reference, b.current) })
    {
      const double share = SegmentProbe(mapped(*map, i), SLACK * params_.affine_tolerance, min_cosine_)
                               .agreement(current(k), to_.direction(k));
      if (share == 0.0)
      {
        return std::nullopt;
      }
      sum += share;
    }
    return sum >= MIN_AGREEMENT ? std::optional<Hypothesis>({ sum, *map }) : std::nullopt;
  }

  static bool startIsFarther(const Segment& segment, const Eigen::Vector2d& point)
  {
    return (segment.start - point).squaredNorm() > (segment.end - point).squaredNorm();
  }

  Segment mapped(const Eigen::Matrix3d& affinity, int i) const
  {
    const auto apply = [&](const Eigen::Vector2d& x) -> Eigen::Vector2d {
      return affinity.topLeftCorner<2, 2>() * x + affinity.topRightCorner<2, 1>();
    };
    return { apply(reference(i).start), apply(reference(i).end) };
  }

  /** The best map of a candidate as a region of its neighbourhood; empty without enough support. */
  std::optional<LineRegion> seed(const Association& candidate) const
  {
    std::vector<Hypothesis> hypotheses;
    const std::vector<Companion> all = companions(candidate.row, candidate.column);
    for (std::size_t a = 0; a < all.size(); ++a)
    {
      for (std::size_t b = a + 1; b < all.size(); ++b)
      {
        if (const auto found = hypothesis(candidate, all[a], all[b]))
        {
          hypotheses.push_back(*found);
        }
      }
    }
    std::stable_sort(hypotheses.begin(), hypotheses.end(),
                     [](const Hypothesis& a, const Hypothesis& b) { return a.agreement > b.agreement; });
    if (hypotheses.size() > static_cast<std::size_t>(params_.max_hypotheses))
    {
      hypotheses.resize(static_cast<std::size_t>(params_.max_hypotheses));
    }
    constexpr double WORTH_REFINING = 0.6;  // of the support asked for
    std::vector<int> near = from_.neighboursOf(candidate.row);
    near.push_back(candidate.row);
    LineRegion region{ {}, {}, WORTH_REFINING * params_.min_support };
    for (const Hypothesis& tried : hypotheses)
    {
      std::vector<SegmentMatch> matches = agreeing(near, tried.map, params_.affine_tolerance);
      const double sum = support(matches);
      if (sum > region.support)
      {
        region = { tried.map, std::move(matches), sum };
      }
    }
    if (region.matches.empty() || !promises(region))
    {
      return std::nullopt;
    }
    region.support = 0.0;  // at the tolerance of homographies
    refitUntilNothingIsGained(region, near);
    return region.support >= params_.min_support && looksAlike(region) ? std::optional<LineRegion>(std::move(region))
                                                                       : std::nullopt;
  }

  std::vector<SegmentMatch> agreeing(const std::vector<int>& of, const Eigen::Matrix3d& h, double tolerance) const
  {
    return agreeingSegments(from_.segments(), of, to_, h, tolerance, params_.max_angle_deg);
  }

  /** Fits a region's map to its matches and matches anew among `of`; false, and unchanged, when that gains nothing. */
  bool refit(LineRegion& region, const std::vector<int>& of) const
  {
    SegmentPairs pairs;
    for (const SegmentMatch& match : region.matches)
    {
      pairs.push_back({ reference(match.reference), current(match.current) });
    }
    const auto h = pairs.size() >= MIN_HOMOGRAPHY ? homographyFromLines(pairs) : affinityFromLines(pairs);
    if (!h)
    {
      return false;
    }
    std::vector<SegmentMatch> matches = agreeing(of, *h, params_.tolerance);
    const double sum = support(matches);
    constexpr double GAIN = 0.2;
    if (sum < region.support + GAIN)
    {
      return false;
    }
    region = { *h, std::move(matches), sum };
    return true;
  }

  /** Lets a region take in what lies around it as long as it gains. */
  void grow(LineRegion& region) const
  {
    constexpr int MAX_ROUNDS = 15;
    constexpr double MARGIN = 0.3;       // of the region's extent
    constexpr double MIN_MARGIN = 30.0;  // [px]
    for (int round = 0; round < MAX_ROUNDS; ++round)
    {
      const auto [low, high] = extent(region, from_);
      const double margin = std::max(MIN_MARGIN, MARGIN * (high - low).maxCoeff());
      std::vector<int> around;
      for (int i = 0; i < static_cast<int>(from_.segments().size()); ++i)
      {
        const Eigen::Array2d at = reference(i).midpoint().array();
        if ((at >= low - margin).all() && (at <= high + margin).all())
        {
          around.push_back(i);
        }
      }
      if (!refit(region, around))
      {
        return;
      }
    }
  }

  /**
   * Whether what lies beside the best matches of a first, rough map is somewhat alike: refining costs more to find out.
   */
  bool promises(const LineRegion& region) const
  {
    constexpr std::size_t TRIED = 6;
    constexpr double SLACK = 0.1;  // of the mean correlation asked for
    const std::size_t count = std::min(TRIED, region.matches.size());
    double sum = 0.0;
    for (std::size_t i = 0; i < count; ++i)
    {
      sum += correlation(region, region.matches[i]);
    }
    return sum >= (params_.min_mean_correlation - SLACK) * static_cast<double>(count);
  }

  double correlation(const LineRegion& region, const SegmentMatch& match) const
  {
    return sideCorrelation(from_.smoothed(), to_.smoothed(), region.h, reference(match.reference),
                           current(match.current));
  }

  /** Drops the matches whose surroundings differ; false when those of the whole region do. */
  bool looksAlike(LineRegion& region) const
  {
    double sum = 0.0;
    std::vector<SegmentMatch> kept;
    for (SegmentMatch match : region.matches)
    {
      match.correlation = correlation(region, match);
      sum += match.correlation;
      if (match.correlation >= params_.min_correlation)
      {
        kept.push_back(match);
      }
    }
    const double mean = sum / static_cast<double>(region.matches.size());
    region.matches = std::move(kept);
    const bool enough = support(region.matches) >= params_.min_support;
    region.support = 0.0;
    for (const SegmentMatch& match : region.matches)
    {
      region.support += supportOf(match.share) * match.correlation;
    }
    return mean >= params_.min_mean_correlation && enough;
  }

  const LineFeatures& from_;
  const LineFeatures& to_;
  const AssociationMatrix& association_;
  const LineRegionParams& params_;
  double min_cosine_;
  Eigen::MatrixXf votes_;  // the association, each as a part of its row's best and of its column's, added
};

}  // namespace

std::vector<Parameter> parameters(LineRegionParams& params)
{
  return {
    integer("max_candidates", params.max_candidates, "", ">= 1",
            "counterparts tried for a segment, those with most votes"),
    integer("max_trials", params.max_trials, "", ">= 1", "counterparts tried in all, first those that stand out most"),
    integer("max_companions", params.max_companions, "", ">= 2",
            "matches of neighbours tried with a counterpart, those with most votes"),
    integer("max_hypotheses", params.max_hypotheses, "", ">= 1", "affine maps tried for a counterpart"),
    real("affine_tolerance", params.affine_tolerance, "px", "> 0",
         "largest distance across of segments under a local affine map"),
    real("region_tolerance", params.tolerance, "px", "> 0",
         "largest distance across of segments under a region's homography"),
    real("region_max_angle_deg", params.max_angle_deg, "degrees", "(0, 45)",
         "largest angle between a mapped segment and its counterpart"),
    real("region_min_support", params.min_support, "", "> 0", "least sum of a region's matches, whole ones counting 1"),
    real("min_correlation", params.min_correlation, "", "[-1, 1)",
         "least correlation of what lies beside two segments, on the better side"),
    real("min_mean_correlation", params.min_mean_correlation, "", "[-1, 1)",
         "least mean of that correlation over a region's matches"),
  };
}

std::vector<std::string> LineRegionParams::validate() const
{
  return faultsOf(*this);
}

std::vector<LineRegion> findLineRegions(const LineFeatures& reference, const LineFeatures& current,
                                        const AssociationMatrix& association, const LineRegionParams& params)
{
  return RegionFinder(reference, current, association, params).find();
}

std::optional<LineRegion> growLineRegion(const LineFeatures& reference, const LineFeatures& current,
                                         const Eigen::Matrix3d& h, const std::vector<SegmentMatch>& matches,
                                         const LineRegionParams& params)
{
  return RegionFinder(reference, current, AssociationMatrix(), params).grown(h, matches);
}

std::vector<double> supportFartherAway(const LineFeatures& reference, const LineFeatures& current,
                                       const AssociationMatrix& association, const std::vector<LineRegion>& regions,
                                       const LineRegionParams& params)
{
  return RegionFinder(reference, current, association, params).supportFartherAway(regions);
}

LineEvidence& LineEvidence::operator+=(const LineEvidence& other)
{
  seen += other.seen;
  found += other.found;
  tried += other.tried;
  beside += other.beside;
  return *this;
}

std::array<LineEvidence, LINE_DIRECTIONS> evidenceOf(const LineRegion& region, const LineFeatures& reference,
                                                     const LineFeatures& current, const std::vector<char>& others,
                                                     const LineRegionParams& params)
{
  constexpr double ACROSS = 0.7;                    // sine of the least angle of a segment to the direction
  constexpr double ASIDE[] = { 10.0, 17.0, 27.0 };  // [px]
  const auto [low, high] = extent(region, reference);
  const cv::Mat& image = current.smoothed();
  std::vector<std::pair<int, Eigen::Vector2d>> seen;  // index, and direction in the current image
  for (int i = 0; i < static_cast<int>(reference.segments().size()); ++i)
  {
    const Eigen::Array2d at = reference.segment(i).midpoint().array();
    if (others[static_cast<std::size_t>(i)] != 0 || (at < low).any() || (at > high).any())
    {
      continue;
    }
    const auto mapped = transfer(region.h, reference.segment(i));
    if (mapped && contains(image.size(), mapped->midpoint()))
    {
      seen.emplace_back(i, (mapped->end - mapped->start).normalized());
    }
  }
  const auto count_at = [&](const std::vector<int>& of, const Eigen::Vector2d& aside) {
    Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
    shift.topRightCorner<2, 1>() = aside;
    const Eigen::Matrix3d h = shift * region.h;
    const std::vector<SegmentMatch> matches =
        agreeingSegments(reference.segments(), of, current, h, params.tolerance, params.max_angle_deg);
    return static_cast<std::size_t>(std::count_if(matches.begin(), matches.end(), [&](const SegmentMatch& match) {
      return sideCorrelation(reference.smoothed(), current.smoothed(), h, reference.segment(match.reference),
                             current.segment(match.current)) >= params.min_correlation;
    }));
  };
  std::array<LineEvidence, LINE_DIRECTIONS> evidence;
  for (std::size_t axis = 0; axis < evidence.size(); ++axis)
  {
    const double angle = static_cast<double>(axis) * M_PI / static_cast<double>(evidence.size());
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    std::vector<int> across;
    for (const auto& [i, direction] : seen)
    {
      if (std::abs(cross(direction, along)) > ACROSS)
      {
        across.push_back(i);
      }
    }
    LineEvidence& counts = evidence[axis];
    counts.seen = across.size();
    counts.found = count_at(across, Eigen::Vector2d::Zero());
    for (const double distance : ASIDE)
    {
      counts.tried += 2 * across.size();
      counts.beside += count_at(across, distance * along) + count_at(across, -distance * along);
    }
  }
  return evidence;
}

}  // namespace view_servo
