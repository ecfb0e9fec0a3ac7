// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/heading_vote.h"
#include "view_servo/geometry/essential.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/random.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** What is known of how the camera moves. */
enum class CameraMotion
{
  PLANAR,  ///< on a floor, tilted as tf says
  FREE     ///< in any way, as a hand moves it
};

/** Options of the hypotheses of where the stored view is. */
struct HeadingHypothesesParams
{
  CameraMotion motion = CameraMotion::PLANAR;
  double inlier_threshold = 3.0;  ///< largest error of a match that supports one [px]
  double max_yaw = 0.6;           ///< largest turn between the views that is looked for [rad]
  double min_significance = 6.0;  ///< of a new one: -log10 of the number of false alarms to be expected
  double memory = 0.7;            ///< part of its weight that one keeps from one set of matches to the next
  int max_hypotheses = 5;         ///< hypotheses kept at most, those of most weight
  double assumed_distance = 1.0;  ///< distance of the view until it is known [m]
  std::uint64_t seed = 1;

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(HeadingHypothesesParams& params);

/** A place where the stored view may have been taken. */
struct HeadingHypothesis
{
  PlanarPose view_in_odom;    ///< of the view's level camera, whose distance from the last camera pose is a guess
  PlanarPose view_in_camera;  ///< as seen from the last camera pose, of distance 1
  double weight = 0.0;        ///< share of the matches that agree, plus memory times the weight before
  int updates = 0;            ///< sets of matches that agreed with it
  RelativePose motion;        ///< X_cur = R X_ref + t, of which view_in_camera is the part on the floor
  Correspondences support;    ///< last matches that agree
};

/**
 * Keeps several hypotheses of heading and yaw over time, for which thesis 5.5 asks. RANSAC finds one motion among all
 * matches of a set, and another one among those that disagree with the first; motions that are not known yet become new
 * hypotheses. Each hypothesis gains weight by the matches of a set that agree with it. One that repeated structure
 * suggests now and then fades; the true one gains from every set.
 */
class HeadingHypotheses
{
public:
  /** @param focal_length of the level camera [px]. The parameters must be valid. */
  HeadingHypotheses(const HeadingHypothesesParams& params, double focal_length);

  /** @param matches level points of an image. @param camera_in_odom pose of the level camera at its time. */
  void update(const Correspondences& matches, const PlanarPose& camera_in_odom);

  /** Most weight first. */
  const std::vector<HeadingHypothesis>& list() const
  {
    return hypotheses_;
  }

  void clear()
  {
    hypotheses_.clear();
  }

private:
  /** The motion that most matches agree with; empty when chance explains that many. */
  std::optional<RelativePose> suggest(const Correspondences& matches);
  RelativePose refine(const RelativePose& motion, const Correspondences& support) const;
  void keepTheBest();
  void confirm(HeadingHypothesis& hypothesis, const Correspondences& matches, const PlanarPose& camera_in_odom);

  HeadingHypothesesParams params_;
  double threshold_;  ///< in units of level points
  Rng rng_;
  std::vector<HeadingHypothesis> hypotheses_;
};

}  // namespace view_servo
