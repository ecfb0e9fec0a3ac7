// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/geometry/hand_eye.h"
#include "view_servo/parameters/numbers.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <limits>
#include <vector>

namespace view_servo
{
/** What the parts of calibrateHandEye() share. */
namespace hand_eye
{
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();    // a number that is not known
constexpr double ENDLESS = std::numeric_limits<double>::infinity();  // larger than all errors
constexpr int CORNERS = 4;                                           // of the view's region
constexpr int ROWS = 2 * CORNERS;  // number of errors at a pose: u and v of each corner
constexpr int DISTANCE = 14;       // place of the distance's unknown in a step, see moved()
constexpr int FOCAL_LENGTH = 15;   // and of the focal length's
constexpr int DOF =
    16;  // unknowns: camera on flange (6), view in base (6), direction (2) and distance of the plane, focal length
constexpr int LEAST_POSES = 6;  // fewer determine nothing

using Indices = std::vector<std::size_t>;

/** The unknowns of a calibration. */
struct State
{
  Eigen::Isometry3d camera_in_flange;  ///< pose of the camera in the flange [m]
  Eigen::Isometry3d view_in_base;      ///< pose of the camera that stored the view, in the arm's base [m]
  Eigen::Vector3d normal;              ///< unit normal of the plane in that camera's frame
  double distance;                     ///< of the plane from that camera [m], > 0
  double focal_scale = 1.0;            ///< true focal lengths over those of HandEyeView::k, > 0
};

/** A camera matrix [px] with focal lengths that are so many times as long. */
Eigen::Matrix3d withFocalScale(const Eigen::Matrix3d& k, double scale);

/**
 * A state after a step (DOF x 1): camera on flange, place [m] and rotation [rad] along the flange's axes; view in base
 * likewise; direction of the plane [rad]; logarithm of its distance; logarithm of the focal length's scale.
 */
State moved(const State& state, const Eigen::VectorXd& step);

/** What is known of one HandEyePose, in the form that errors need. */
struct Observation
{
  Eigen::Isometry3d base_in_flange;  ///< inverse of HandEyePose::flange_in_base [m]
  Eigen::Matrix3d calibrated;        ///< R + (t / d) nᵀ, see calibratedHomography()
  Eigen::VectorXd corners;           ///< where the image has the view's corners [px], ROWS x 1
};

/** Poses, and the errors of a state in them. */
class Problem
{
public:
  /**
   * @param view has to outlive this. @param distance of the plane from the view's camera [m]; NaN: not known.
   * @param knows_focal_length that of the view is true.
   */
  Problem(const HandEyeView& view, const std::vector<HandEyePose>& poses, double distance,
          bool knows_focal_length = true);

  std::size_t size() const
  {
    return observations_.size();
  }

  const Observation& observation(std::size_t i) const
  {
    return observations_[i];
  }

  /** Of the plane from the view's camera [m]; NaN: not known. */
  double knownDistance() const
  {
    return known_distance_;
  }

  /**
   * The direction of the plane on which most homographies agree, and the second best when it is another one: which of
   * two is true may be left open by the images, not by the arm.
   */
  std::vector<Eigen::Vector3d> normals() const;

  /** The camera's motion from the view to each pose, when the plane has that normal. */
  std::vector<EuclideanHomography> motionsBefore(const Eigen::Vector3d& normal) const;

  /**
   * Where the view's corners should be, less where they are [px], ROWS x 1. False when a corner is behind the camera.
   */
  bool errors(const State& state, std::size_t i, Eigen::VectorXd& errors) const;
  /** The same with the flange elsewhere than the robot has it [m]. */
  bool errors(const State& state, std::size_t i, const Eigen::Isometry3d& base_in_flange,
              Eigen::VectorXd& errors) const;

  /** Mean squared distance of a pose's corners from where they should be [px²]. */
  double squaredError(const State& state, std::size_t i) const;

  /**
   * Derivatives of errors() by the state, in the order of moved() (ROWS x DOF), and by the flange's place and rotation
   * along its own axes (ROWS x 6) [px per m or rad].
   */
  void linearize(const State& state, std::size_t i, Eigen::MatrixXd& by_state, Eigen::MatrixXd& by_arm) const;
  /** The same with the flange elsewhere than the robot has it [m]. */
  void linearize(const State& state, const Eigen::Isometry3d& base_in_flange, Eigen::MatrixXd& by_state,
                 Eigen::MatrixXd& by_arm) const;

  /** Weight of distanceError(): so large that a known distance is kept; 0 when none is known. */
  double distanceWeight() const;

  /** Weight of log(State::focal_scale), which has to be 0 then: likewise. */
  double focalLengthWeight() const;

  /** How many of the unknowns are known. */
  int knownUnknowns() const;

  /** log(distance of the state / known distance). */
  double distanceError(const State& state) const;

private:
  const HandEyeView& view_;
  double known_distance_;
  bool knows_focal_length_;
  std::vector<Eigen::Vector3d> rays_;  // of the view's corners by its focal length, z = 1
  std::vector<Observation> observations_;
  std::vector<std::vector<EuclideanHomography>> decompositions_;  // of each pose's homography
};

/** The median. @param values at least one. */
double medianOf(std::vector<double> values);

}  // namespace hand_eye
}  // namespace view_servo
