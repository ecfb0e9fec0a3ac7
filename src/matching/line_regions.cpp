// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/line_regions.h"

#include "view_servo/geometry/line_homography.h"
#include "view_servo/matching/line_groups.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double MIN_OVERLAP = 0.35;       // of the shorter segment, for two to agree
constexpr double MAX_SCALE_CHANGE = 5.0;   // of a local map
constexpr double MAX_ANISOTROPY = 6.0;     // ratio of a local map's singular values, about
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

/** A segment in the current image that others are compared with, most of which are soon told not to agree. */
class Probe
{
public:
  Probe(const Segment& segment, double tolerance, double min_cosine)
    : segment_(segment),
      tolerance_(tolerance),
      min_cosine_(min_cosine),
      along_(segment.end - segment.start),
      least_(min_cosine * along_.norm()),
      low_(segment.start.array().min(segment.end.array()) - tolerance),
      high_(segment.start.array().max(segment.end.array()) + tolerance)
  {
  }

  /** The share that both have in common, 0 when they do not agree. @param direction of the other, a unit vector. */
  double agreement(const Segment& other, const Eigen::Vector2d& direction) const
  {
    if (along_.dot(direction) < least_ || (other.start.array().max(other.end.array()) < low_).any() ||
        (other.start.array().min(other.end.array()) > high_).any())
    {
      return 0.0;
    }
    const SegmentAgreement found = compare(segment_, other);
    return found.cosine >= min_cosine_ && found.overlap >= MIN_OVERLAP && found.distance <= tolerance_ ? found.share
                                                                                                       : 0.0;
  }

  /** From start to end [px]. */
  const Eigen::Vector2d& along() const
  {
    return along_;
  }
  /** Component of along() in the direction of a segment that agrees, at least [px]. */
  double least() const
  {
    return least_;
  }

private:
  const Segment segment_;
  const double tolerance_;
  const double min_cosine_;
  const Eigen::Vector2d along_;
  const double least_;
  const Eigen::Array2d low_;
  const Eigen::Array2d high_;
};

/** Best first, each segment at most once. */
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

/** Least-squares affine map of n >= 3 points; empty when it is degenerate, mirrors, or distorts beyond the limits. */
std::optional<Eigen::Matrix3d> plausibleAffinity(const Eigen::Vector2d* from, const Eigen::Vector2d* to,
                                                 const double* weights, int n)
{
  Eigen::Vector2d mean_from = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_to = Eigen::Vector2d::Zero();
  double sum = 0.0;
  for (int i = 0; i < n; ++i)
  {
    mean_from += weights[i] * from[i];
    mean_to += weights[i] * to[i];
    sum += weights[i];
  }
  mean_from /= sum;
  mean_to /= sum;
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d mixed = Eigen::Matrix2d::Zero();
  for (int i = 0; i < n; ++i)
  {
    spread += weights[i] * (from[i] - mean_from) * (from[i] - mean_from).transpose();
    mixed += weights[i] * (to[i] - mean_to) * (from[i] - mean_from).transpose();
  }
  constexpr double FLAT = 1e-3;  // of the squared trace
  if (!(spread.determinant() > FLAT * spread.trace() * spread.trace()))
  {
    return std::nullopt;
  }
  Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
  map.topLeftCorner<2, 2>() = mixed * spread.inverse();
  map.topRightCorner<2, 1>() = mean_to - map.topLeftCorner<2, 2>() * mean_from;
  const double determinant = map.topLeftCorner<2, 2>().determinant();
  // (s1² + s2²) / (s1 s2), about s1 / s2 when they differ.
  const double anisotropy = map.topLeftCorner<2, 2>().squaredNorm() / determinant;
  if (!(determinant > 1.0 / (MAX_SCALE_CHANGE * MAX_SCALE_CHANGE) &&
        determinant < MAX_SCALE_CHANGE * MAX_SCALE_CHANGE && anisotropy < MAX_ANISOTROPY))
  {
    return std::nullopt;
  }
  return map;
}

/** Bilinear intensities of an 8-bit image. */
class Sampler
{
public:
  explicit Sampler(const cv::Mat& image)
    : data_(image.data),
      step_(image.step),
      last_u_(static_cast<float>(image.cols - 1)),
      last_v_(static_cast<float>(image.rows - 1))
  {
  }

  bool contains(float u, float v) const
  {
    return u >= 0.0F && v >= 0.0F && u < last_u_ && v < last_v_;
  }

  float at(float u, float v) const
  {
    const int left = static_cast<int>(u);
    const int top = static_cast<int>(v);
    const float fu = u - static_cast<float>(left);
    const float fv = v - static_cast<float>(top);
    const unsigned char* p = data_ + static_cast<std::size_t>(top) * step_ + left;
    const unsigned char* q = p + step_;
    const float above = static_cast<float>(p[0]) + fu * static_cast<float>(p[1] - p[0]);
    const float below = static_cast<float>(q[0]) + fu * static_cast<float>(q[1] - q[0]);
    return above + fv * (below - above);
  }

private:
  const unsigned char* data_;
  std::size_t step_;
  float last_u_;
  float last_v_;
};

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

private:
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
        !(scale > 1.0 / MAX_SCALE_CHANGE && scale < MAX_SCALE_CHANGE))
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
    const auto third = lineIntersection(ra, rb, LineFeatures::MIN_ANGLE);
    const auto third_current = lineIntersection(ca, cb, LineFeatures::MIN_ANGLE);
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
    const auto map = plausibleAffinity(from, to, weights, n);
    if (!map)
    {
      return std::nullopt;
    }
    double sum = 0.0;
    for (const auto& [i, k] : { std::pair(candidate.row, candidate.column), std::pair(a.reference, a.current),
                                std::pair(b.reference, b.current) })
    {
      const double share =
          Probe(mapped(*map, i), SLACK * params_.affine_tolerance, min_cosine_).agreement(current(k), to_.direction(k));
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
    std::vector<int> near = from_.near(candidate.row);
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
    for (int round = 0; round < 3; ++round)
    {
      if (!refit(region, near))
      {
        break;
      }
    }
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
      Eigen::Array2d low(std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity());
      Eigen::Array2d high = -low;
      for (const SegmentMatch& match : region.matches)
      {
        for (const Eigen::Vector2d& end : { reference(match.reference).start, reference(match.reference).end })
        {
          low = low.min(end.array());
          high = high.max(end.array());
        }
      }
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

  /** Whether what lies beside the best matches of a first, rough map is somewhat alike: refining costs more to find out. */
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
            "matches of neighbours tried with it, those with most votes"),
    integer("max_hypotheses", params.max_hypotheses, "", ">= 1", "affine maps tried for a counterpart"),
    real("affine_tolerance", params.affine_tolerance, "px", "> 0", "of segments under a local affine map, across"),
    real("region_tolerance", params.tolerance, "px", "> 0", "of segments under a region's homography, across"),
    real("region_max_angle_deg", params.max_angle_deg, "degrees", "(0, 45)",
         "largest angle between a mapped segment and its counterpart"),
    real("region_min_support", params.min_support, "", "> 0", "least sum of a region's matches, whole ones counting 1"),
    real("min_correlation", params.min_correlation, "", "[-1, 1)",
         "least correlation of what lies beside two segments, on the better side"),
    real("min_mean_correlation", params.min_mean_correlation, "", "[-1, 1)",
         "least mean of it over a region's matches"),
  };
}

std::vector<std::string> LineRegionParams::validate() const
{
  return faultsOf(*this);
}

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
    const Probe probe(*mapped, tolerance, min_cosine);
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

double sideCorrelation(const cv::Mat& reference, const cv::Mat& current, const Eigen::Matrix3d& h,
                       const Segment& reference_segment, const Segment& current_segment)
{
  constexpr int ALONG = 16;
  constexpr int ACROSS = 6;
  constexpr float FIRST = 1.0F;     // distance of the samples from the segment [px]
  constexpr float STEP = 1.5F;      // [px]
  constexpr int MIN_SAMPLES = 30;   // of a side, within both images
  constexpr float NOISE = 4.0F;     // variance of intensities that means nothing
  constexpr float MIDDLE = 128.0F;  // keeps sums small
  const auto mapped = transfer(h, reference_segment);
  if (!mapped)
  {
    return 0.0;
  }
  // The part that both show, as fractions of the reference segment; what a homography does to fractions is neglected.
  const Eigen::Vector2d direction = current_segment.direction();
  const double start = (mapped->start - current_segment.start).dot(direction);
  const double end = (mapped->end - current_segment.start).dot(direction);
  const double length = current_segment.length();
  const double first = std::clamp((std::clamp(start, 0.0, length) - start) / (end - start), 0.0, 1.0);
  const double last = std::clamp((std::clamp(end, 0.0, length) - start) / (end - start), 0.0, 1.0);

  // The homography is linear in the samples' homogeneous coordinates.
  const Eigen::Vector2d along = reference_segment.end - reference_segment.start;
  const Eigen::Vector2d normal = reference_segment.normal();
  const Eigen::Vector3d start_there = h * reference_segment.start.homogeneous();
  const Eigen::Vector3d along_there = h.leftCols<2>() * along;
  const Eigen::Vector3d normal_there = h.leftCols<2>() * normal;
  const Sampler from(reference);
  const Sampler to(current);

  double best = -1.0;
  for (const double side : { -1.0, 1.0 })
  {
    float sum_a = 0.0F;
    float sum_b = 0.0F;
    float sum_aa = 0.0F;
    float sum_bb = 0.0F;
    float sum_ab = 0.0F;
    int n = 0;
    for (int i = 0; i < ALONG; ++i)
    {
      const double fraction = first + (last - first) * (i + 0.5) / ALONG;
      const Eigen::Vector2f on_line = (reference_segment.start + fraction * along).cast<float>();
      const Eigen::Vector3f on_line_there = (start_there + fraction * along_there).cast<float>();
      const Eigen::Vector2f across = (side * normal).cast<float>();
      const Eigen::Vector3f across_there = (side * normal_there).cast<float>();
      for (int j = 0; j < ACROSS; ++j)
      {
        const float offset = FIRST + STEP * static_cast<float>(j);
        const Eigen::Vector2f at = on_line + offset * across;
        const Eigen::Vector3f seen = on_line_there + offset * across_there;
        const float scale = 1.0F / seen.z();
        const Eigen::Vector2f there = scale * seen.head<2>();
        if (!(seen.z() > 0.0F) || !from.contains(at.x(), at.y()) || !to.contains(there.x(), there.y()))
        {
          continue;
        }
        const float a = from.at(at.x(), at.y()) - MIDDLE;
        const float b = to.at(there.x(), there.y()) - MIDDLE;
        sum_a += a;
        sum_b += b;
        sum_aa += a * a;
        sum_bb += b * b;
        sum_ab += a * b;
        ++n;
      }
    }
    if (n >= MIN_SAMPLES)
    {
      const float samples = static_cast<float>(n);
      const float variance_a = sum_aa / samples - sum_a / samples * (sum_a / samples);
      const float variance_b = sum_bb / samples - sum_b / samples * (sum_b / samples);
      const float covariance = sum_ab / samples - sum_a / samples * (sum_b / samples);
      best = std::max<double>(best, covariance / std::sqrt((variance_a + NOISE) * (variance_b + NOISE)));
    }
  }
  return best;
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

}  // namespace view_servo
