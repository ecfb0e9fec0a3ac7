// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/scene_matcher.h"

#include "mirror.h"
#include "repetition.h"
#include "scene_geometry.h"
#include "stage_clock.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/robust/random.h"

#include <cstddef>
#include <optional>
#include <utility>

namespace view_servo
{
namespace
{
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

/** Writes the geometry that lines and points support together, or why it is refused; false when there is none. */
bool findGeometry(const PreparedImage& reference, const PreparedImage& current, const SceneMatcherParams& params,
                  const ViewMatch& lines, const ViewMatch& points, StageClock& clock, ViewMatch& result)
{
  const GeometryModel model = result.model;
  SceneGeometry geometry(reference, current, params);
  Rng rng(params.seed);
  for (std::size_t i = 0; i < lines.planes.size(); ++i)
  {
    geometry.addPlane(lines.planes[i], static_cast<int>(i));
  }
  for (const Eigen::Matrix3d& h : planesOf(positionsOf(points.matches), params.points.ransac.inlier_threshold, rng))
  {
    geometry.addPlane(h, -1);
  }
  clock.finish("planes");
  geometry.collect({ lines.matches, points.matches });
  const bool points_agree = points.outcome == MatchOutcome::MATCHED;
  const bool found =
      model == GeometryModel::FUNDAMENTAL &&
      geometry.fit(points_agree ? std::optional<Eigen::Matrix3d>(points.matrix) : std::nullopt, result.ransac);
  clock.finish("fundamental");

  const std::optional<Eigen::Matrix3d> plane = found ? std::nullopt : geometry.plane();
  if (!found && !plane)
  {
    geometry.reportCandidates(result);
    return false;
  }
  const bool repeated = params.points.unique && geometry.isRepeated();
  clock.finish("unique");
  const bool mirrored = !repeated && params.points.refuse_mirrored &&
                        isMirrored(reference, 0, current, 0, geometry.planes(), geometry.significance(), rng);
  clock.finish("mirror");
  if (repeated || mirrored)
  {
    result.message = repeated ? REPEATED : MIRRORED;
  }
  else if (found)
  {
    geometry.reportFundamental(lines.lines, result);
  }
  else
  {
    geometry.reportPlane(*plane, lines.lines, result);
  }
  geometry.reportCandidates(result);
  if (result.outcome == MatchOutcome::MATCHED)
  {
    result.message = whatIsFound(result, model);
  }
  return true;
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
  if (!findGeometry(reference, current, params_, lines, points, clock, result))
  {
    explainNoGeometry(reference, current, lines, points, result);
  }
  result.elapsed_ms = clock.total();
  return result;
}

}  // namespace view_servo
