// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/heading_hypotheses.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/robust/planar_motion_estimator.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/robust/relative_pose_estimator.h"
#include "view_servo/robust/significance.h"

#include <algorithm>
#include <cmath>

namespace view_servo
{
namespace
{
constexpr int SUGGESTIONS = 2;         // motions that one set of matches may suggest
constexpr double SAME_HEADING = 0.12;  // [rad]
constexpr double SAME_YAW = 0.05;      // [rad]
constexpr double LEAST_PART = 0.05;    // of the largest weight, below which a hypothesis is forgotten
constexpr double EPIPOLAR_BAND = 1.2;  // typical length of an epipolar line in an image, in units of level points
constexpr double IMAGE_AREA = 1.1;     // of level points, of an ordinary lens

Correspondences agreeing(const Correspondences& matches, const RelativePose& motion, double threshold, bool wanted)
{
  const RelativePoseEstimator estimator(matches);
  const RelativePoseEstimator::Model model{ motion, motion.essential() };
  Correspondences result;
  for (std::size_t i = 0; i < matches.size(); ++i)
  {
    if ((estimator.error(model, i) <= threshold * threshold) == wanted)
    {
      result.push_back(matches[i]);
    }
  }
  return result;
}

RelativePose toRelative(const PlanarPose& pose)
{
  return { levelRotation(pose.yaw), levelTranslation(pose).normalized() };
}

/** The part on the floor: heading and yaw, distance 1. */
PlanarPose toPlanar(const RelativePose& motion)
{
  const Eigen::Vector3d ahead = motion.rotation.col(2);
  const double heading = std::atan2(-motion.translation.x(), motion.translation.z());
  return { std::cos(heading), std::sin(heading), std::atan2(-ahead.x(), ahead.z()) };
}

/** That a match made by chance agrees with a motion. */
double chanceByArea(double threshold)
{
  return 2.0 * threshold * EPIPOLAR_BAND / IMAGE_AREA;
}

bool same(const PlanarPose& a, const PlanarPose& b)
{
  return std::abs(wrapAngle(a.heading() - b.heading())) < SAME_HEADING && std::abs(wrapAngle(a.yaw - b.yaw)) < SAME_YAW;
}

}  // namespace

std::vector<Parameter> parameters(HeadingHypothesesParams& params)
{
  return {
    choice<CameraMotion>("motion", params.motion,
                         { { "planar", CameraMotion::PLANAR }, { "free", CameraMotion::FREE } },
                         "how the camera moves; free: headings only, no docking"),
    real("inlier_threshold", params.inlier_threshold, "px", "> 0", "largest error of a match that supports a motion"),
    real("max_yaw", params.max_yaw, "rad", "(0, pi/2)", "largest turn between the views"),
    real("min_significance", params.min_significance, "", ">= 0", "-log10 of the false alarms of a motion"),
    real("memory", params.memory, "", "[0, 1)",
         "part of its weight that a hypothesis keeps from one set of matches to the next"),
    integer("max_hypotheses", params.max_hypotheses, "", ">= 1", "hypotheses kept"),
    real("assumed_distance", params.assumed_distance, "m", "> 0", "distance of the view until it is known"),
    natural("seed", params.seed, "seed of all random draws"),
  };
}

std::vector<std::string> HeadingHypothesesParams::validate() const
{
  return faultsOf(*this);
}

HeadingHypotheses::HeadingHypotheses(const HeadingHypothesesParams& params, double focal_length)
  : params_(params), threshold_(params.inlier_threshold / focal_length), rng_(params.seed)
{
}

void HeadingHypotheses::update(const Correspondences& matches, const PlanarPose& camera_in_odom)
{
  for (HeadingHypothesis& hypothesis : hypotheses_)
  {
    hypothesis.weight *= params_.memory;
    confirm(hypothesis, matches, camera_in_odom);
  }

  Correspondences left = matches;
  for (int i = 0; i < SUGGESTIONS; ++i)
  {
    const std::optional<RelativePose> motion = suggest(left);
    if (!motion)
    {
      break;
    }
    const PlanarPose planar = toPlanar(*motion);
    const bool known =
        std::any_of(hypotheses_.begin(), hypotheses_.end(),
                    [&planar](const HeadingHypothesis& hypothesis) { return same(hypothesis.view_in_camera, planar); });
    if (!known)
    {
      HeadingHypothesis hypothesis;
      hypothesis.motion = *motion;
      hypothesis.view_in_odom = compose(
          camera_in_odom, { params_.assumed_distance * planar.x, params_.assumed_distance * planar.y, planar.yaw });
      confirm(hypothesis, matches, camera_in_odom);
      hypotheses_.push_back(hypothesis);
    }
    left = agreeing(left, *motion, threshold_, false);
  }
  keepTheBest();
}

std::optional<RelativePose> HeadingHypotheses::suggest(const Correspondences& matches)
{
  RansacParams ransac_params;
  ransac_params.inlier_threshold = threshold_;
  ransac_params.sampling = Sampling::UNIFORM;
  std::optional<RelativePose> motion;
  int sample_size = 0;
  if (params_.motion == CameraMotion::PLANAR)
  {
    const auto found = ransac(PlanarMotionEstimator(matches, params_.max_yaw), ransac_params, rng_);
    motion = found.model ? std::optional<RelativePose>(toRelative(found.model->pose)) : std::nullopt;
    sample_size = PlanarMotionEstimator::SAMPLE_SIZE;
  }
  else
  {
    const auto found = ransac(RelativePoseEstimator(matches), ransac_params, rng_);
    motion = found.model ? std::optional<RelativePose>(found.model->pose) : std::nullopt;
    sample_size = RelativePoseEstimator::SAMPLE_SIZE;
  }
  if (!motion)
  {
    return std::nullopt;
  }
  const Correspondences support = agreeing(matches, *motion, threshold_, true);
  const Eigen::Matrix3d essential = motion->essential();
  const double among = chanceAmong(support.size(), [&](std::size_t reference, std::size_t current) {
    return sampsonError(essential, { support[reference].reference, support[current].current }) <=
           threshold_ * threshold_;
  });
  const double significance =
      logSignificance(matches.size(), support.size(), sample_size, std::max(chanceByArea(threshold_), among));
  return significance >= params_.min_significance ? motion : std::nullopt;
}

RelativePose HeadingHypotheses::refine(const RelativePose& motion, const Correspondences& support) const
{
  return params_.motion == CameraMotion::PLANAR ? toRelative(refinePlanarMotion(toPlanar(motion), support))
                                                : refineRelativePose(motion, support);
}

void HeadingHypotheses::keepTheBest()
{
  std::stable_sort(hypotheses_.begin(), hypotheses_.end(),
                   [](const HeadingHypothesis& a, const HeadingHypothesis& b) { return a.weight > b.weight; });
  for (std::size_t i = 0; i < hypotheses_.size();)
  {
    // Those that have become the same, that nothing speaks for any more, or that are too many.
    bool drop = i >= static_cast<std::size_t>(params_.max_hypotheses) ||
                hypotheses_[i].weight < LEAST_PART * hypotheses_.front().weight;
    for (std::size_t k = 0; k < i && !drop; ++k)
    {
      drop = same(hypotheses_[k].view_in_camera, hypotheses_[i].view_in_camera);
    }
    if (drop)
    {
      hypotheses_.erase(hypotheses_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    else
    {
      ++i;
    }
  }
}

void HeadingHypotheses::confirm(HeadingHypothesis& hypothesis, const Correspondences& matches,
                                const PlanarPose& camera_in_odom)
{
  constexpr double WIDE = 3.0;        // times the threshold, for matches that a prediction is corrected by
  constexpr double CONFIRMING = 2.0;  // significance; less than at first, as one is expected already
  constexpr double CLOSEST = 0.05;    // the least distance that a hypothesis keeps [m]
  const PlanarPose predicted = compose(inverse(camera_in_odom), hypothesis.view_in_odom);
  const double distance = std::max(predicted.distance(), CLOSEST);
  const PlanarPose direction{ std::cos(predicted.heading()), std::sin(predicted.heading()), predicted.yaw };
  // What tilts a free camera is not foreseen by odometry.
  RelativePose motion = params_.motion == CameraMotion::PLANAR ? toRelative(direction) : hypothesis.motion;
  for (const double width : { WIDE, 1.0 })
  {
    const Correspondences support = agreeing(matches, motion, width * threshold_, true);
    if (support.size() > static_cast<std::size_t>(RelativePoseEstimator::SAMPLE_SIZE))
    {
      motion = refine(motion, support);
    }
  }
  Correspondences support = agreeing(matches, motion, threshold_, true);
  const int sample_size =
      params_.motion == CameraMotion::PLANAR ? PlanarMotionEstimator::SAMPLE_SIZE : RelativePoseEstimator::SAMPLE_SIZE;
  if (logSignificance(matches.size(), support.size(), sample_size, chanceByArea(threshold_)) < CONFIRMING)
  {
    hypothesis.view_in_camera = direction;
    hypothesis.support.clear();
    return;
  }
  const PlanarPose planar = toPlanar(motion);
  hypothesis.motion = motion;
  hypothesis.view_in_camera = planar;
  hypothesis.view_in_odom = compose(camera_in_odom, { distance * planar.x, distance * planar.y, planar.yaw });
  hypothesis.weight += static_cast<double>(support.size()) / static_cast<double>(matches.size());
  hypothesis.support = std::move(support);
  ++hypothesis.updates;
}

}  // namespace view_servo
