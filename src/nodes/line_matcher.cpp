// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/LineMatches.h"
#include "view_servo/MatchLines.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/streaming_matcher.h"
#include "view_servo/views/line_view_matcher.h"

#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
LineGrouping toGrouping(const std::string& name)
{
  if (name.empty() || name == "triplets")
  {
    return LineGrouping::TRIPLETS;
  }
  if (name == "pairs")
  {
    return LineGrouping::PAIRS;
  }
  throw std::invalid_argument("groups: '" + name + "' is neither triplets nor pairs");
}

/** By lines, as a StreamingMatcher wants it. */
class LineMatching
{
public:
  using Params = LineMatcherParams;
  using Service = MatchLines;
  using Result = ViewMatch;
  using Message = LineMatches;
  struct Options
  {
    LineGrouping groups = LineGrouping::TRIPLETS;
  };

  static constexpr const char* TOPIC = "line_matches";
  static constexpr double RATE = LINES_RATE;

  explicit LineMatching(const Params& params) : matcher_(params)
  {
  }

  static std::vector<std::string> thresholds()
  {
    return { "inlier_threshold", "min_significance", "min_correlation", "min_mean_correlation",
             "plane_threshold",  "min_quality",      "min_parallax" };
  }

  FeatureParams features() const
  {
    return { matcher_.params().segments, matcher_.params().features };
  }

  static void clear(Service::Response& response)
  {
    copyRowMajor(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN()), response.fundamental);
  }

  static Options options(const Service::Request& request)
  {
    return { toGrouping(request.groups) };
  }

  Result match(const MatchedImage& reference, const MatchedImage& current, const Options& options,
               const std::function<bool()>& /*given_up*/) const
  {
    return matcher_.match(*reference.image, *current.image, GeometryModel::HOMOGRAPHY, options.groups);
  }

  static void fill(const Result& result, Service::Response& response)
  {
    response.matches = toLineMatches(result.lines);
    response.points = toPointMatches(result.matches);
    response.plane_homographies = toRowMajor(result.planes);
    copyRowMajor(result.fundamental, response.fundamental);
  }

  static Message toMessage(const Result& result, const MatchLabel& /*label*/)
  {
    Message message;
    message.reason = result.outcome == MatchOutcome::MATCHED ? "" : result.message;
    message.matches = toLineMatches(result.lines);
    message.points = toPointMatches(result.matches);
    return message;
  }

private:
  LineViewMatcher matcher_;
};

}  // namespace

/**
 * Matches images by the structure of groups of their line segments: two given ones on request, and, when a view is set,
 * each camera image with that stored view.
 *
 * Topics, services and parameters are those of a StreamingMatcher, with parameters(LineMatcherParams&);
 * config/line_matcher.yaml has them with their ranges. It publishes `~line_matches` (view_servo/LineMatches), and its
 * service is `~match` (view_servo/MatchLines).
 */
using LineMatcherNode = StreamingMatcher<LineMatching>;

const NodeType LINE_MATCHER = nodeType<LineMatcherNode>("line_matcher");

}  // namespace view_servo
