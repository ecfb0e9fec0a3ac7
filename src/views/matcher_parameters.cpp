// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/matcher_parameters.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>

namespace view_servo
{
namespace
{
/** How RANSAC draws its samples is for the caller to offer. */
void appendRansac(RansacParams& ransac, std::vector<Parameter>& table)
{
  std::vector<Parameter> more{
    real("inlier_threshold", ransac.inlier_threshold, "largest error of an inlier [px], > 0"),
    real("ransac_confidence", ransac.confidence, "wanted probability of an outlier-free sample, (0, 1)"),
    integer("ransac_min_iterations", ransac.min_iterations, "samples drawn at least, >= 0"),
    integer("ransac_max_iterations", ransac.max_iterations, "samples drawn at most, >= 1"),
    integer("ransac_max_rejected", ransac.max_rejected, "samples that a cheap test may refuse, >= 0"),
    integer("local_optimizations", ransac.local_optimizations, "refits of a new best model, 0 = off"),
    boolean("improvement_stage", ransac.improvement_stage, "exchange each datum of the best sample in turn"),
  };
  std::move(more.begin(), more.end(), std::back_inserter(table));
}

std::size_t editDistance(const std::string& a, const std::string& b)
{
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
  {
    row[j] = j;
  }
  for (std::size_t i = 1; i <= a.size(); ++i)
  {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j)
    {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({ replaced, row[j] + 1, row[j - 1] + 1 });
    }
  }
  return row[b.size()];
}

void setIn(const std::vector<Parameter>& table, const std::string& name, const std::string& value)
{
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const Parameter& parameter) { return parameter.name == name; });
  if (found == table.end())
  {
    throw std::invalid_argument("unknown parameter '" + name + "' (did you mean '" + nearestName(table, name) + "'?)");
  }
  if (!found->set(value))
  {
    throw std::invalid_argument("parameter '" + name + "': '" + value + "' is not of type " + found->type);
  }
}

}  // namespace

std::string nearestName(const std::vector<Parameter>& table, const std::string& name)
{
  const auto nearest = std::min_element(table.begin(), table.end(), [&](const Parameter& a, const Parameter& b) {
    return editDistance(a.name, name) < editDistance(b.name, name);
  });
  return nearest == table.end() ? std::string() : nearest->name;
}

std::vector<Parameter> matcherParameters(PointViewMatcherParams& params)
{
  PointMatcherParams& points = params.points;
  CornerParams& corners = points.corners;
  ProfileParams& profiles = points.profiles;
  ProfileSearchParams& search = points.search;
  std::vector<Parameter> table{
    integer("max_corners", corners.max_corners, "corners kept in each image, strongest first, 1 to 5000"),
    real("derivative_sigma", corners.derivative_sigma, "scale of the Harris detector's derivatives [px], (0, 20]"),
    real("integration_sigma", corners.integration_sigma, "scale of the Harris detector's window [px], (0, 20]"),
    real("harris_k", corners.k, "k in R = det(M) - k tr(M)^2, [0, 0.25)"),
    real("corner_distance", corners.min_distance, "smallest distance between corners [px], 0 to 1000"),
    real("corner_threshold", corners.relative_threshold, "smallest response, as a part of the strongest, [0, 1)"),
    integer("corner_border", corners.border, "no corners closer to the image's border [px], >= 1"),
    choice<PairSelection>("pair_selection", profiles.selection,
                          { { "nearest", PairSelection::NEAREST }, { "radius", PairSelection::RADIUS } },
                          "pair each corner with its nearest (K_c) or with all in a radius (D_c)"),
    integer("pair_neighbours", profiles.neighbours, "K_c: corners that each is paired with, >= 1"),
    real("pair_radius", profiles.max_length, "D_c: longest profile [px], > profile_min_length"),
    real("profile_min_length", profiles.min_length, "shortest profile [px], >= 2"),
    integer("coefficients", profiles.coefficients, "N_f: Fourier features a profile, 4, 6 or 8"),
    real("profile_contrast", profiles.min_contrast,
         "least deviation of a profile from its mean [grey levels], (0, 255)"),
    choice<ProfileSearch>("search", search.search,
                          { { "nearest", ProfileSearch::NEAREST }, { "radius", ProfileSearch::RADIUS } },
                          "a profile votes for its nearest (K_v) or for all in a radius (D_v)"),
    integer("search_neighbours", search.neighbours, "K_v: profiles that each votes for, 1 to 1000"),
    real("search_radius", search.radius, "D_v: distance of similar profiles [standard deviations], > 0"),
    real("search_epsilon", search.epsilon, "tolerance of the search for the nearest, 0 = exact, >= 0"),
    real("search_share", search.share, "part of the profiles that votes, those that say most, (0, 1]"),
    choice<AssignmentMethod>("assignment", points.assignment,
                             { { "exact", AssignmentMethod::EXACT }, { "greedy", AssignmentMethod::GREEDY } },
                             "how candidates are taken from the association"),
    boolean("cyclic_order", points.cyclic_order, "align the profiles around corners in cyclic order"),
    real("cyclic_correlation", points.min_correlation, "least correlation of aligned profiles, [0, 1)"),
    integer("cyclic_entries", points.cyclic_entries, "entries aligned in each row and column, 0 = all"),
    choice<Sampling>("sampling", params.ransac.sampling,
                     { { "uniform", Sampling::UNIFORM }, { "progressive", Sampling::PROGRESSIVE } },
                     "draw all candidates alike, or the best first (PROSAC)"),
    choice<GeometryEstimator>("estimator", params.estimator,
                              { { "ransac", GeometryEstimator::RANSAC },
                                { "multi_hypothesis", GeometryEstimator::MULTI_HYPOTHESIS },
                                { "importance", GeometryEstimator::IMPORTANCE } },
                              "one candidate a point, or support from all associations (and samples, too)"),
    integer("hypotheses_per_point", params.hypotheses.entries_per_row,
            "strongest associations of a reference point kept for several hypotheses, >= 1"),
    real("association_weight", params.hypotheses.association_weight,
         "lambda: what the strongest association counts beside the fit [px], >= 0"),
    choice<ViewConsistency>("view_consistency", params.view_consistency,
                            { { "off", ViewConsistency::OFF },
                              { "before", ViewConsistency::BEFORE },
                              { "within", ViewConsistency::WITHIN } },
                            "where the constraint on five points is used"),
    real("consistency_threshold", params.consistency.threshold, "violation of a consistent group, (0, 1]"),
    real("consistency_increments", params.consistency.mean_increments, "counts a candidate, on average, > 0"),
    integer("consistency_max_groups", params.consistency.max_groups, "groups of five drawn at most, >= 1"),
    boolean("guided", params.guided, "look for more matches along the geometry found"),
    integer("patch_radius", params.guidance.patch_radius, "patches compared by guided matching [px], 1 to 50"),
    real("patch_correlation", params.guidance.min_correlation, "least correlation of the patches, [0, 1)"),
    real("first_share", params.first_share,
         "part of the profiles that votes at first, all if it is too little, (0, 1]"),
    boolean("scale_search", params.scale_search, "try other scales when the first finds no geometry"),
    real("min_significance", params.min_log_significance, "-log10 of the false alarms a geometry may have, >= 0"),
    natural("seed", params.seed, "of all random draws, >= 0"),
  };
  appendRansac(params.ransac, table);
  return table;
}

std::vector<Parameter> matcherParameters(LineMatcherParams& params)
{
  LineSegmentParams& segments = params.segments;
  LineFeatureParams& features = params.features;
  LineGroupParams& groups = features.groups;
  LineRegionParams& regions = params.regions;
  std::vector<Parameter> table{
    choice<SegmentDetector>("detector", segments.detector,
                            { { "canny", SegmentDetector::CANNY }, { "lsd", SegmentDetector::LSD } },
                            "subdivided edges, or OpenCV's Line Segment Detector"),
    real("edge_sigma", segments.sigma, "scale of the edges [px], [0.6, 20]: about 1 for fine, 2 for coarse ones"),
    real("edge_low_threshold", segments.low_threshold, "canny: least slope all along an edge [grey levels/px], > 0"),
    real("edge_high_threshold", segments.high_threshold,
         "canny: least slope somewhere on an edge [grey levels/px], >= edge_low_threshold"),
    real("segment_deviation", segments.min_deviation,
         "canny: smaller deviations from a straight line are noise [px], > 0"),
    real("segment_max_deviation", segments.max_deviation,
         "canny: largest deviation of a segment's edge from its line [px], >= segment_deviation"),
    real("segment_significance", segments.min_significance, "canny: least length over greatest deviation, >= 0"),
    real("segment_min_length", segments.min_length, "shortest segment detected [px], (0, 10000]"),
    integer("max_segments", segments.max_segments, "segments detected in each image, the longest, >= 1"),
    choice<LineOrder>("line_order", groups.order,
                      { { "contrast", LineOrder::CONTRAST }, { "upright", LineOrder::UPRIGHT } },
                      "which end is first: bright side left (free of roll), or upwards and to the right"),
    real("group_distance", groups.max_distance, "from each segment of a pair to where their lines meet [px], > 0"),
    real("group_collinearity", groups.collinearity, "a point this close to a line counts as on it [px], >= 0"),
    real("group_min_angle_deg", groups.min_angle_deg, "least angle between the lines of a pair [degrees], (0, 90)"),
    integer("group_neighbours", groups.max_neighbours, "pairs that a segment forms, the closest, 0 = no limit"),
    real("group_min_weight", groups.min_weight, "structures less likely than this are left out, [0, 1)"),
    integer("max_grouped", features.max_grouped, "segments that form groups, the longest, 1 to 5000"),
    integer("neighbours", features.neighbours, "nearest segments of each that judge a hypothesis, 6 to 1000"),
    integer("neighbour_pairs", features.neighbour_pairs, "nearest segments of each that make one, 2 to 100"),
    integer("max_candidates", regions.max_candidates, "counterparts tried for a segment, those with most votes, >= 1"),
    integer("max_trials", regions.max_trials, "counterparts tried in all, those first that stand out most, >= 1"),
    integer("max_companions", regions.max_companions,
            "matches of neighbours tried with it, those with most votes, >= 2"),
    integer("max_hypotheses", regions.max_hypotheses, "affine maps tried for a counterpart, >= 1"),
    real("affine_tolerance", regions.affine_tolerance, "of segments under a local affine map, across [px], > 0"),
    real("region_tolerance", regions.tolerance, "of segments under a region's homography, across [px], > 0"),
    real("region_max_angle_deg", regions.max_angle_deg,
         "largest angle between a mapped segment and its counterpart [degrees], (0, 45)"),
    real("region_min_support", regions.min_support, "least sum of a region's matches, whole ones counting 1, > 0"),
    real("min_correlation", regions.min_correlation,
         "least correlation of what lies beside two segments, on the better side, [-1, 1)"),
    real("min_mean_correlation", regions.min_mean_correlation, "least mean of it over a region's matches, [-1, 1)"),
    real("plane_threshold", params.planes.threshold, "largest error of a line on a plane, across [px], > 0"),
    integer("min_plane_lines", params.planes.min_lines, "lines that make a plane, >= 5"),
    integer("max_planes", params.planes.max_planes, "planes looked for, >= 1"),
    real("min_quality", params.min_quality, "least mean of a match's overlap and correlation, [0, 1)"),
    natural("seed", params.seed, "of all random draws, >= 0"),
  };
  appendRansac(params.ransac, table);
  return table;
}

void setParameter(PointViewMatcherParams& params, const std::string& name, const std::string& value)
{
  setIn(matcherParameters(params), name, value);
}

void setParameter(LineMatcherParams& params, const std::string& name, const std::string& value)
{
  setIn(matcherParameters(params), name, value);
}

}  // namespace view_servo
