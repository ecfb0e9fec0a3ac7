// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/homing_parameters.h"

namespace view_servo
{
std::vector<Parameter> homingParameters(HomingParams& params, VelocityLimits& limits)
{
  HeadingVoteParams& vote = params.vote;
  HeadingHypothesesParams& hypotheses = params.hypotheses;
  ArrivalDetectorParams& arrival = params.arrival;
  ViewTrackerParams& tracker = params.tracker;
  return {
    choice<HomingMode>("mode", params.mode, { { "servo", HomingMode::SERVO }, { "thesis", HomingMode::THESIS } },
                       "how to home"),
    real("lost_timeout", params.lost_timeout, "without a trace of the view, after which it gives up [s], > 0"),
    real("max_speed", limits.max_speed, "[m/s], > 0"),
    real("max_turn_rate", limits.max_turn_rate, "[rad/s], > 0"),
    real("max_acceleration", limits.max_acceleration, "[m/s^2], > 0"),
    real("max_turn_acceleration", limits.max_turn_acceleration, "[rad/s^2], > 0"),
    real("gain", params.gain, "speed per distance [1/s], > 0"),
    real("turn_gain", params.turn_gain, "turn rate per yaw error [1/s], > 0"),
    real("blind_speed", params.blind_speed, "speed while only the heading is known [m/s], > 0"),
    real("distance_tolerance", params.distance_tolerance, "of having arrived [m], > 0"),
    real("yaw_tolerance", params.yaw_tolerance, "likewise [rad], > 0"),
    real("dwell", params.dwell, "time within the tolerances [s], >= 0"),
    real("arrival_distance", params.arrival_distance, "at which the heading is told as ARRIVED [m], > 0"),
    real("arrival_yaw", params.arrival_yaw, "likewise [rad], > 0"),
    real("min_similarity", params.min_similarity, "of the gradients where homing may end, [-1, 1)"),
    real("docking_displacement", params.docking_displacement,
         "median of the view's points, below which homing docks [px], > 0"),
    choice<CameraMotion>("motion", hypotheses.motion,
                         { { "planar", CameraMotion::PLANAR }, { "free", CameraMotion::FREE } },
                         "how the camera moves; free: headings only, no docking"),
    real("inlier_threshold", hypotheses.inlier_threshold, "largest error of a match that supports a motion [px], > 0"),
    real("max_yaw", hypotheses.max_yaw, "largest turn between the views [rad], (0, pi/2)"),
    real("min_significance", hypotheses.min_significance, "-log10 of the false alarms of a motion, >= 0"),
    real("memory", hypotheses.memory, "part of its weight that a hypothesis keeps from matches to matches, [0, 1)"),
    integer("max_hypotheses", hypotheses.max_hypotheses, "kept, >= 1"),
    real("assumed_distance", hypotheses.assumed_distance, "to the view until it is known [m], > 0"),
    natural("seed", hypotheses.seed, "of all random draws, >= 0"),
    integer("max_landmarks", tracker.max_landmarks, "points of the view that are tracked, >= 8"),
    integer("tracking_window", tracker.window, "side of their patches [px], odd, >= 5"),
    integer("tracking_levels", tracker.levels, "of the pyramid besides the image, [0, 6]"),
    real("tracking_max_residual", tracker.max_residual, "of a point that supports the pose [px], > 0"),
    integer("tracking_min_supporting", tracker.min_supporting, "points that make a pose, >= 4"),
    real("tracking_min_support", tracker.min_support, "part of the points looked for that makes one, (0, 1]"),
    real("tracking_max_scale_difference", tracker.max_scale_difference,
         "between a point's change of size and the typical one, > 0"),
    real("assumed_depth", tracker.assumed_depth, "of the points when nothing is known [m], > 0"),
    integer("heading_bins", vote.bins, "of the histogram of headings, >= 3"),
    real("heading_margin", vote.margin, "headings nearer to +-pi/2 are not taken [rad], [0, pi/2)"),
    real("heading_smoothing", vote.smoothing, "sd that votes are spread by [rad], [0, pi/2)"),
    real("roi_narrowing", vote.narrowing, "of the region of interest when the highest peak is inside, (0, 1]"),
    real("roi_widening", vote.widening, "of it when it is not, >= 1"),
    real("roi_min_half_width", vote.min_half_width, "of the region [rad], (0, pi/2)"),
    real("step", params.step, "thesis: between two headings [m], > 0"),
    real("near_step", params.near_step, "thesis: after the rise of the correlation [m], > 0"),
    real("step_speed", params.step_speed, "thesis: speed of a step [m/s], > 0"),
    real("arrival_rise", arrival.rise, "thesis: sudden rise, in standard deviations of what went before, > 0"),
    real("arrival_min_rise", arrival.min_rise, "thesis: ... and at least, > 0"),
    real("arrival_drop", arrival.drop, "thesis: part of the rise that is lost again past the view, (0, 1)"),
    integer("arrival_min_history", arrival.min_history, "thesis: correlations before any rise counts, >= 2"),
  };
}

}  // namespace view_servo
