// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/scene_finder.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/robust/homography_estimator.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/views/scene_motion.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>

namespace view_servo
{
namespace
{
SceneFinder::Answer without(SceneFinder::Kind kind, std::string reason)
{
  SceneFinder::Answer answer;
  answer.kind = kind;
  answer.reason = std::move(reason);
  return answer;
}

/** How many matches lie off the plane that most lie on. @param focal length, in pixels. */
std::size_t offBestPlane(const Correspondences& matches, double focal)
{
  constexpr double ON_IT = 2.0;   // distance from where the plane's homography sends a point of it, at most [px]
  constexpr double OFF_IT = 3.0;  // and of another one, at least [px]
  Correspondences pixels;         // of a camera without distortion
  for (const Correspondence& match : matches)
  {
    pixels.push_back({ focal * match.reference, focal * match.current });
  }
  RansacParams params;
  params.inlier_threshold = ON_IT;
  params.sampling = Sampling::UNIFORM;
  params.min_iterations = 50;
  params.max_iterations = 300;
  params.local_optimizations = 2;
  Rng rng(1);
  const auto found = ransac(HomographyEstimator(pixels), params, rng);
  if (!found.model)
  {
    return pixels.size();
  }
  return static_cast<std::size_t>(std::count_if(pixels.begin(), pixels.end(), [&](const Correspondence& pair) {
    return !((transfer(found.model->h, pair.reference) - pair.current).norm() < OFF_IT);
  }));
}

}  // namespace

SceneFinder::SceneFinder(const SceneMatcherParams& params) : matcher_(params)
{
}

SceneFinder::Answer SceneFinder::find(const Question& question, const std::function<bool()>& given_up) const
{
  constexpr double THRESHOLD = 1.5;  // of a match that agrees, as in sceneMotion() [px]
  if (question.image.empty())
  {
    return without(Kind::NOTHING, "the image is empty");
  }
  const PreparedImage image(question.image, cv::Rect(), features());
  const ViewMatch match = matcher_.match(*question.view, image, GeometryModel::FUNDAMENTAL, given_up);
  if (match.outcome != MatchOutcome::MATCHED)
  {
    return without(Kind::NOTHING, match.message);
  }
  if (match.model != GeometryModel::FUNDAMENTAL)
  {
    return without(Kind::PLANE, match.message);
  }
  const std::optional<SceneMotion> motion = sceneMotion(match, question.view_camera, question.camera);
  if (!motion)
  {
    return without(Kind::NOTHING, "the matches do not agree with one motion of the camera");
  }
  Answer answer;
  answer.kind = Kind::SCENE;
  const Eigen::Matrix3d of_view = question.view_camera.rectifyingRotation();
  const Eigen::Matrix3d of_image = question.camera.rectifyingRotation();
  answer.motion.rotation = of_image * motion->pose.rotation * of_view.transpose();
  answer.motion.translation = of_image * motion->pose.translation;
  const Eigen::Matrix3d essential = answer.motion.essential();
  const double threshold = THRESHOLD / question.camera.k(0, 0);
  for (const MatchedPoint& point : match.matches)
  {
    const Correspondence pair{
      (of_view * question.view_camera.normalized(point.position.reference).homogeneous()).hnormalized(),
      (of_image * question.camera.normalized(point.position.current).homogeneous()).hnormalized()
    };
    if (point.inlier && pair.reference.allFinite() && pair.current.allFinite() &&
        sampsonError(essential, pair) <= threshold * threshold)
    {
      answer.matches.push_back(pair);
    }
  }
  // What stands out of a plane by so little, or in so few places, is followed better as the plane.
  constexpr std::size_t FEWEST_OFF = 15;
  constexpr double LEAST_SHARE = 0.1;
  const std::size_t off = offBestPlane(answer.matches, question.camera.k(0, 0));
  if (off < FEWEST_OFF || static_cast<double>(off) < LEAST_SHARE * static_cast<double>(answer.matches.size()))
  {
    return without(Kind::PLANE, "all but " + std::to_string(off) + " of " + std::to_string(answer.matches.size()) +
                                    " points lie on one plane");
  }
  return answer;
}

}  // namespace view_servo
