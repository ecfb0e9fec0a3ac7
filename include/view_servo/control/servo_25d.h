// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/goal_rules.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>

#include <deque>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of 2.5D servoing. */
struct Servo25dParams
{
  double gain = 1.0;                     ///< rate at which a large error decays [1/s], > 0
  double near_gain = 2.5;                ///< likewise, of a small one [1/s], >= gain
  double margin = 0.1;                   ///< of the image's sides, which the chosen point stays out of, [0, 0.3]
  double distance = 0.5;                 ///< d, of the plane from the stored view, until it is known [m], > 0
  double translation_tolerance = 0.001;  ///< of being at the view [m], > 0
  double rotation_tolerance = 0.0015;    ///< likewise [rad], > 0
  double dwell = 0.5;                    ///< time within the tolerances [s], >= 0
  double loss_tolerance = 0.12;          ///< without the view, bridged by what was sent; then it stands [s], [0, 0.5]
  double lost_timeout = 5.0;             ///< without the view, after which it gives up [s], > 0

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(Servo25dParams& params);

/** What has to be brought to its place. */
struct ServoTarget
{
  Eigen::Matrix3d k;      ///< camera matrix, without distortion [px]
  Eigen::Vector2d size;   ///< width and height of the images [px]
  Eigen::Vector2d point;  ///< the chosen point in the stored view, on the plane [px]
};

/** What an image says of the plane. */
struct PlaneView
{
  double stamp = 0.0;              ///< of the image [s]
  EuclideanHomography motion;      ///< X_cur = R X_ref + t
  std::optional<double> distance;  ///< d, of the plane from the stored view [m]
  int inliers = 0;
};

/** The error of 2.5D servoing (Malis, Chaumette & Boudet 1999). */
struct Servo25dError
{
  Eigen::Vector2d point;     ///< (x - x*, y - y*) of the chosen point, in normalised coordinates
  double depth = 0.0;        ///< log(Z / Z*) of the chosen point
  Eigen::Vector3d rotation;  ///< θu by which the camera is turned from where it was stored [rad]
};

/** @param point the chosen point (x*, y*) of the stored view, in normalised coordinates. */
Servo25dError servo25dError(const EuclideanHomography& motion, const Eigen::Vector2d& point);

enum class ServoState
{
  ACQUIRING,  ///< the view has not been found yet
  SERVOING,   ///< drives
  LOST,       ///< stands still until the view is found again
  CONVERGED,  ///< at the view
  FAILED      ///< given up
};

/** What servoing does, and why. Errors are NaN until known. */
struct ServoReport
{
  ServoState state = ServoState::ACQUIRING;
  std::string reason = "looks for the view";                            ///< one line
  double translation_error = std::numeric_limits<double>::quiet_NaN();  ///< of the camera [m]
  double rotation_error = std::numeric_limits<double>::quiet_NaN();     ///< likewise [rad]
  double point_error = std::numeric_limits<double>::quiet_NaN();        ///< of the chosen point [px]
  std::optional<Servo25dError> error;
  Eigen::Vector2d point = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());  ///< where it is [px]
  Eigen::Vector2d gains = Eigen::Vector2d::Ones();  ///< the adaptive ones, of x and y, in [0, 1]
  int inliers = 0;
};

/** How far a goal has come. While it drives the reason stays the same, though numbers change. */
Progress toProgress(const ServoReport& report);

/**
 * Brings a camera to a stored view of a plane by 2.5D servoing (thesis 8.6; Malis, Chaumette & Boudet 1999): a chosen
 * point is led by where it is in the image, the depth by the ratio of its depths, the turn by the rotation, and the
 * interaction matrix, block triangular, keeps them apart. Features, matrices and control law are ViSP's (GPL-2).
 *
 * A wrong distance of the plane makes the camera slower or faster, and lets turns move the chosen point, which they do
 * not with the right one. Adaptive gains keep it in the image: turn and depth slow down to zero as it nears a margin inside the
 * border, in x or in y, while it is led back as before; so it turns round there whatever the distance is.
 *
 * What an image says is old when it is known: the camera has moved on as it was told to since. This is fed forward, so
 * that errors decay as commanded.
 *
 * Limits of speed and acceleration are left to a TwistLimiter, times to the caller.
 */
class Servo25d
{
public:
  /**
   * @throws std::invalid_argument with all faults of the parameters, or when the chosen point is not in the image or lies
   * within the margin.
   */
  Servo25d(const ServoTarget& target, const Servo25dParams& params);
  ~Servo25d();

  /** An image in which the plane was found. Numbers that are not finite are a loss; an older image than the last is none. */
  void add(const PlaneView& view);

  /** An image in which it was not; a few are bridged. @param stamp of the image [s]. @param reason what there is to say of it. */
  void addLoss(double stamp, const std::string& reason);

  /** What the camera was told to do from a time on [s]. */
  void sent(double time, const Twist& twist);

  /** The twist wanted at a time [s], before limits; zero unless the state is SERVOING or CONVERGED. */
  Twist command(double time);

  const ServoReport& report() const
  {
    return report_;
  }

private:
  struct Task;
  struct Sent
  {
    double time;
    Twist twist;
  };

  /** How the camera has moved by what was sent: X_end = motion X_begin. */
  Eigen::Isometry3d motionSince(double begin, double end) const;
  Eigen::Vector2d gainsAt(const Eigen::Vector2d& pixel) const;
  double distance() const;
  void judge(double stamp);

  Servo25dParams params_;
  ServoTarget target_;
  Eigen::Vector2d chosen_;  // the chosen point in normalised coordinates
  std::unique_ptr<Task> task_;
  std::optional<PlaneView> view_;   // the last one
  std::optional<double> distance_;  // d, once it is known [m]
  std::deque<Sent> sent_;
  std::optional<double> lost_since_;
  std::optional<double> within_since_;
  ServoReport report_;
};

}  // namespace view_servo
