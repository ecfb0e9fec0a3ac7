// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/MatchScene.h"
#include "view_servo/SceneMatches.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/streaming_matcher.h"
#include "view_servo/views/scene_matcher.h"
#include "view_servo/views/scene_motion.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** What a request wants to know. */
enum class SceneModel
{
  FUNDAMENTAL,
  RELATIVE_POSE,
  HOMOGRAPHY
};

SceneModel toModel(const std::string& name)
{
  if (name.empty() || name == "fundamental")
  {
    return SceneModel::FUNDAMENTAL;
  }
  if (name == "relative_pose")
  {
    return SceneModel::RELATIVE_POSE;
  }
  if (name == "homography")
  {
    return SceneModel::HOMOGRAPHY;
  }
  throw std::invalid_argument("model: '" + name + "' is none of fundamental, relative_pose and homography");
}

/** Why the calibration of an image cannot be used; empty when it can. */
std::string faultOf(const std::optional<Camera>& camera, const std::string& name)
{
  if (!camera)
  {
    return "the " + name + " comes without a calibration: name a stored view, or let the camera's image be taken";
  }
  const std::string fault = camera->fault();
  return fault.empty() ? "" : "the calibration of the " + name + " cannot be used: " + fault;
}

/** A match, and the motion between the cameras where it is known. */
struct SceneResult : ViewMatch
{
  std::optional<SceneMotion> motion;
  std::string no_motion;      ///< why `motion` is empty, in one line
  bool needs_motion = false;  ///< without one, the request is not answered
};

/** Finds the motion, or says why there is none. */
void addMotion(SceneResult& result, const MatchedImage& reference, const MatchedImage& current)
{
  result.no_motion = faultOf(reference.camera, "reference");
  if (result.no_motion.empty())
  {
    result.no_motion = faultOf(current.camera, "query");
  }
  if (!result.no_motion.empty())
  {
    return;
  }
  result.motion = sceneMotion(result, *reference.camera, *current.camera);
  if (!result.motion)
  {
    result.no_motion = result.model == GeometryModel::HOMOGRAPHY ? "a plane leaves two motions"
                                                                 : "too few points agree with one motion";
  }
}

/** The fields that answers of the service and messages share. */
template <typename Fields>
void clearFields(Fields& fields)
{
  std::fill(fields.model_matrix.begin(), fields.model_matrix.end(), NOT_A_NUMBER);
  std::fill(fields.epipole_reference.begin(), fields.epipole_reference.end(), NOT_A_NUMBER);
  std::fill(fields.epipole_current.begin(), fields.epipole_current.end(), NOT_A_NUMBER);
  fields.rotation.x = fields.rotation.y = fields.rotation.z = fields.rotation.w = NOT_A_NUMBER;
  fields.direction.x = fields.direction.y = fields.direction.z = NOT_A_NUMBER;
  std::fill(fields.covariance.begin(), fields.covariance.end(), NOT_A_NUMBER);
}

template <typename Fields>
void fillFields(const SceneResult& result, Fields& fields)
{
  fields.points = toPointMatches(result.matches);
  fields.lines = toLineMatches(result.lines);
  if (result.outcome != MatchOutcome::MATCHED)
  {
    return;
  }
  copyRowMajor(result.matrix, fields.model_matrix);
  fields.found = result.model == GeometryModel::HOMOGRAPHY ? "homography" : "fundamental";
  if (result.model == GeometryModel::FUNDAMENTAL)
  {
    Eigen::Map<Eigen::Vector2d>(fields.epipole_reference.data()) = epipolePixel(referenceEpipole(result.matrix));
    Eigen::Map<Eigen::Vector2d>(fields.epipole_current.data()) = epipolePixel(currentEpipole(result.matrix));
  }
  if (result.motion)
  {
    fields.rotation = toMessage(Eigen::Quaterniond(result.motion->pose.rotation));
    fields.direction = toMessage(result.motion->pose.translation);
    Eigen::Map<Eigen::Matrix<double, 6, 6>>(fields.covariance.data()) = result.motion->covariance;  // symmetric
  }
}

/** By points and lines together, as a StreamingMatcher wants it. */
class SceneMatching
{
public:
  using Params = SceneMatcherParams;
  using Service = MatchScene;
  using Message = SceneMatches;
  using Result = SceneResult;
  struct Options
  {
    SceneModel model = SceneModel::FUNDAMENTAL;
  };

  static constexpr const char* TOPIC = "scene_matches";
  static constexpr double RATE = SCENE_RATE;

  explicit SceneMatching(const Params& params) : matcher_(params)
  {
  }

  static std::vector<std::string> thresholds()
  {
    return { "scene_threshold",  "scene_significance",    "plane_correlation",    "inlier_threshold",
             "min_significance", "line_inlier_threshold", "line_min_significance" };
  }

  FeatureParams features() const
  {
    return matcher_.features();
  }

  static void clear(Service::Response& response)
  {
    clearFields(response);
  }

  static Options options(const Service::Request& request)
  {
    return { toModel(request.model) };
  }

  Result match(const MatchedImage& reference, const MatchedImage& current, const Options& options,
               const std::function<bool()>& given_up) const
  {
    const GeometryModel model =
        options.model == SceneModel::HOMOGRAPHY ? GeometryModel::HOMOGRAPHY : GeometryModel::FUNDAMENTAL;
    Result result{ matcher_.match(*reference.image, *current.image, model, given_up), std::nullopt, "", false };
    result.needs_motion = options.model == SceneModel::RELATIVE_POSE;
    if (result.outcome == MatchOutcome::MATCHED)
    {
      addMotion(result, reference, current);
    }
    return result;
  }

  static void fill(const Result& result, Service::Response& response)
  {
    fillFields(result, response);
    if (response.success && result.needs_motion && !result.motion)
    {
      response.success = false;
      response.message += "; the motion is not known: " + result.no_motion;
    }
  }

  static Message toMessage(const Result& result, const MatchLabel& /*label*/)
  {
    Message message;
    message.reason = result.outcome == MatchOutcome::MATCHED ? "" : result.message;
    clearFields(message);
    fillFields(result, message);
    return message;
  }

private:
  SceneMatcher matcher_;
};

}  // namespace

/**
 * Matches images of scenes with depth, such as rooms and buildings, by corners and line segments together: two given
 * ones on request, and, when a view is set, each camera image with that stored view. Where both images are calibrated,
 * the answer has the motion between the cameras, up to the distance.
 *
 * Topics, services and parameters are those of a StreamingMatcher, with parameters(SceneMatcherParams&);
 * config/scene_matcher.yaml has them with their ranges. It publishes `~scene_matches` (view_servo/SceneMatches), and
 * its service is `~match` (view_servo/MatchScene).
 */
using SceneMatcherNode = StreamingMatcher<SceneMatching>;

const NodeType SCENE_MATCHER = nodeType<SceneMatcherNode>("scene_matcher");

}  // namespace view_servo
