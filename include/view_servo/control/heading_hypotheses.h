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
  CameraMotion motion = CameraMotion::PLANAR;  ///< which motions of the camera are looked for
  double inlier_threshold = 3.0;  ///< largest Sampson distance of a match that agrees with a hypothesis [px]
  double max_yaw = 0.6;           ///< largest turn between the views that is looked for [rad]
  /** Least -log10 of the expected number of false alarms, for a motion to become a hypothesis. */
  double min_significance = 6.0;
  double memory = 0.7;            ///< part of its weight that a hypothesis keeps from one set of matches to the next
  int max_hypotheses = 5;         ///< at most this many hypotheses are kept, those with the largest weights
  double assumed_distance = 1.0;  ///< distance from the camera at which a new hypothesis puts the view [m]
  std::uint64_t seed = 1;         ///< fixes all random draws

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(HeadingHypothesesParams& params);

/** A place where the stored view may have been taken. */
struct HeadingHypothesis
{
  /**
   * Pose of the view's level camera in odometry's frame [m, rad]. Matches give its direction; its distance from the
   * camera is assumed at first, and later follows from odometry and that assumption.
   */
  PlanarPose view_in_odom;
  /** Pose of the view's level camera in the level camera at the last set of matches, scaled to distance 1. */
  PlanarPose view_in_camera;
  /** After each set: the weight before it times `memory`, plus the share of its matches that agree, if enough do. */
  double weight = 0.0;
  int updates = 0;  ///< number of sets of matches of which enough agreed with it
  /** X_cur = R X_ref + t between the level cameras of the view and of the last set of which enough matches agreed. */
  RelativePose motion;
  Correspondences support;  ///< level points of the last set that agree; empty when these are too few
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

  /**
   * Takes in the matches of one image: updates all hypotheses, and adds one for each new motion. Without matches the
   * hypotheses only lose weight and follow odometry.
   * @param matches level points (see CameraMount) in the stored view and in the image.
   * @param camera_in_odom pose of the level camera in odometry's frame when the image was taken.
   */
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
  /** Drops all but the max_hypotheses of most weight, and sorts these. */
  void keepTheBest();
  /** Updates a hypothesis by the matches that agree with it; without enough of them its support becomes empty. */
  void confirm(HeadingHypothesis& hypothesis, const Correspondences& matches, const PlanarPose& camera_in_odom);

  HeadingHypothesesParams params_;
  double threshold_;  ///< in units of level points
  Rng rng_;
  std::vector<HeadingHypothesis> hypotheses_;
};

}  // namespace view_servo
