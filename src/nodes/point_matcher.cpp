// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/streaming_matcher.h"
#include "view_servo/views/point_view_matcher.h"

#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
GeometryModel toModel(const std::string& name)
{
  if (name.empty() || name == "homography")
  {
    return GeometryModel::HOMOGRAPHY;
  }
  if (name == "fundamental")
  {
    return GeometryModel::FUNDAMENTAL;
  }
  throw std::invalid_argument("model: '" + name + "' is neither homography nor fundamental");
}

/** By points, as a StreamingMatcher wants it. */
class PointMatching
{
public:
  using Params = PointViewMatcherParams;
  using Service = MatchPoints;
  using Result = ViewMatch;
  using Message = PointMatches;
  struct Options
  {
    GeometryModel model = GeometryModel::HOMOGRAPHY;
    double inlier_threshold = 0.0;  // [px], 0 = the parameter
  };

  static constexpr const char* TOPIC = "point_matches";
  static constexpr double RATE = POINTS_RATE;

  explicit PointMatching(const Params& params) : matcher_(params)
  {
  }

  static std::vector<std::string> thresholds()
  {
    return { "inlier_threshold", "min_significance", "patch_correlation", "min_parallax" };
  }

  FeatureParams features() const
  {
    return matcher_.params().points;
  }

  static void clear(Service::Response& response)
  {
    copyRowMajor(Eigen::Matrix3d::Constant(NOT_A_NUMBER), response.model_matrix);
    response.rms_error = NOT_A_NUMBER;
  }

  static Options options(const Service::Request& request)
  {
    const Options options{ toModel(request.model), request.inlier_threshold };
    if (!(options.inlier_threshold >= 0.0 && options.inlier_threshold < std::numeric_limits<double>::infinity()))
    {
      throw std::invalid_argument("inlier_threshold: must be a number of pixels, or 0 for the node's own");
    }
    return options;
  }

  Result match(const MatchedImage& reference, const MatchedImage& current, const Options& options,
               const std::function<bool()>& given_up) const
  {
    return matcher_.match(*reference.image, *current.image, options.model, options.inlier_threshold, given_up);
  }

  static void fill(const Result& result, Service::Response& response)
  {
    response.matches = toPointMatches(result.matches);
    if (result.outcome == MatchOutcome::MATCHED)
    {
      copyRowMajor(result.matrix, response.model_matrix);
      response.inliers = result.inliers;
      response.rms_error = result.rms_error;
    }
  }

  static Message toMessage(const Result& result, const MatchLabel& label)
  {
    Message message;
    message.reason = result.outcome == MatchOutcome::MATCHED ? "" : result.message;
    message.matches = toPointMatches(result.matches);
    message.homography = toHomography(result, label.chosen.view, label.header);
    message.homography.goal = label.chosen.goal;
    message.homography.refused = label.refused;
    return message;
  }

private:
  PointViewMatcher matcher_;
};

}  // namespace

/**
 * Matches images by the intensity profiles between their corners: two given ones on request, and, when a view is set,
 * each camera image with that stored view.
 *
 * Topics, services and parameters are those of a StreamingMatcher, with parameters(PointViewMatcherParams&);
 * config/point_matcher.yaml has them with their ranges. It publishes `~point_matches` (view_servo/PointMatches), and
 * its service is `~match` (view_servo/MatchPoints).
 */
using PointMatcherNode = StreamingMatcher<PointMatching>;

const NodeType POINT_MATCHER = nodeType<PointMatcherNode>("point_matcher");

}  // namespace view_servo
