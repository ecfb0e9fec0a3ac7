// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/goal_rules.h"
#include "view_servo/control/place_watch.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

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
  double gain = 1.0;       ///< rate at which a large error decays [1/s]
  double near_gain = 2.5;  ///< rate at which a small error decays [1/s]
  double margin = 0.1;     ///< strip along each border kept free of the chosen point, as a part of the size
  double distance = 0.5;   ///< d: distance of the plane from the stored view, until it is known [m]
  double translation_tolerance = 0.001;  ///< error of the camera's position at which it has converged [m]
  double rotation_tolerance = 0.0015;    ///< error of its rotation at which it has converged [rad]
  double dwell = 0.5;                    ///< time that it has to stay within both tolerances [s]
  double loss_tolerance = 0.12;          ///< how long the camera drives on without the view, by the commands sent [s]
  double lost_timeout = 5.0;             ///< servoing gives up after this time without the view [s]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(Servo25dParams& params);

/** The point that servoing brings to its place, and the camera that sees it. */
struct ServoTarget
{
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();  ///< camera matrix, without distortion [px]
  Eigen::Vector2d size = Eigen::Vector2d::Zero();   ///< width and height of the images [px]
  Eigen::Vector2d point = Eigen::Vector2d::Zero();  ///< the chosen point in the stored view, on the plane [px]
};

/** What an image shows of the plane. */
struct PlaneView
{
  double stamp = 0.0;              ///< of the image [s]
  EuclideanHomography motion;      ///< X_cur = R X_ref + t
  std::optional<double> distance;  ///< d, of the plane from the stored view [m]; empty until it is known
  int inliers = 0;                 ///< number of points that agree with the homography
};

/** The error of 2.5D servoing (Malis, Chaumette & Boudet 1999). */
struct Servo25dError
{
  Eigen::Vector2d point = Eigen::Vector2d::Zero();  ///< (x - x*, y - y*) of the chosen point, in normalised coordinates
  double depth = 0.0;  ///< log(Z / Z*) of the chosen point: its depth now over that in the stored view
  /**
   * θu: axis times angle of the rotation that turns the camera from where the view was stored to where it is now [rad].
   * The axis has the same coordinates in the optical frames of both.
   */
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
};

/** The error after a motion. @param point the chosen point (x*, y*) of the stored view, in normalised coordinates. */
Servo25dError servo25dError(const EuclideanHomography& motion, const Eigen::Vector2d& point);

/** What servoing does. */
enum class ServoState
{
  ACQUIRING,  ///< the view has not been found yet
  SERVOING,   ///< the camera drives
  LOST,       ///< the camera stands until the view is found again
  CONVERGED,  ///< the camera is at the view
  FAILED      ///< servoing has given up
};

/** What servoing does, and why. Errors are NaN until known. */
struct ServoReport
{
  ServoState state = ServoState::ACQUIRING;
  std::string reason = "looks for the view";  ///< why it is in this state, one line
  /** Distance of the camera from the view [m], by the distance of the plane that is assumed until it is known. */
  double translation_error = std::numeric_limits<double>::quiet_NaN();
  /** Angle by which the camera is turned from the view [rad]. */
  double rotation_error = std::numeric_limits<double>::quiet_NaN();
  double point_error = std::numeric_limits<double>::quiet_NaN();  ///< distance of the chosen point from its place [px]
  std::optional<Servo25dError> error;  ///< error at the last image in which the plane was found; empty before the first
  /** Where the chosen point was in the last image with the plane [px]. */
  Eigen::Vector2d point = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  /**
   * How much the margin slows turning and changes of depth, for the chosen point's x and y, in [0, 1]: 0 is at the
   * margin, 1 is free. The smaller of the two counts.
   */
  Eigen::Vector2d gains = Eigen::Vector2d::Ones();
  int inliers = 0;  ///< points that agree with the last image's homography; 0 when the plane was not found
};

/** How far a goal has come. While it drives the reason stays the same, though numbers change. */
Progress toProgress(const ServoReport& report);

/**
 * Brings a camera to a stored view of a plane by 2.5D servoing (thesis 8.6; Malis, Chaumette & Boudet 1999): a chosen
 * point is controlled by its position in the image, the depth by the ratio of the point's depths, and the orientation
 * by the rotation that is left; the interaction matrix is block triangular, which decouples them. Features, matrices
 * and control law are ViSP's (GPL-2).
 *
 * A wrong distance of the plane makes the camera slower or faster, and makes rotations shift the chosen point; with the
 * right distance they do not. Adaptive gains keep the point in the image: the closer it comes to a margin inside the
 * border, in x or in y, the slower the camera turns and changes the depth, while the point is led back as fast as ever.
 * So the point turns back at the margin, whatever the distance.
 *
 * A view that does not move as the commands move the camera, as a picture of it held before the camera, is not
 * believed: the camera stands, and servoing gives up after params.lost_timeout. The arm may follow at once or up to
 * 0.4 s later.
 *
 * When an image has been evaluated, the camera has already moved on by the commands since. This motion is fed forward,
 * so that errors decay as commanded.
 *
 * A TwistLimiter has to keep the limits of speed and acceleration; times are the caller's.
 */
class Servo25d
{
public:
  /**
   * @throws std::invalid_argument with all faults of the parameters, or when the chosen point is not in the image or
   * lies within the margin.
   */
  Servo25d(const ServoTarget& target, const Servo25dParams& params);
  ~Servo25d();

  /**
   * An image in which the plane was found. One with numbers that are not finite, or with a distance that is not above
   * 0, is a loss. One that is older than the last is ignored, and so is everything after FAILED.
   */
  void add(const PlaneView& view);

  /**
   * An image in which the plane was not found. @param stamp of the image [s]. @param reason why not, for the report.
   */
  void addLoss(double stamp, const std::string& reason);

  /**
   * Sets gain and near_gain of the parameters anew. @throws std::invalid_argument with all faults; nothing is set then.
   */
  void setGains(double gain, double near_gain);

  /** Tells which twist was sent to the camera. @param time from which on the camera follows it [s]. */
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
    double time;  // from which on the camera follows it [s]
    Twist twist;
  };

  /** The camera of an arm that follows each twist after a dead time. */
  struct CommandedCamera
  {
    double dead_time;  // [s]
    PlaceWatch watch;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // at the last image, by the twists sent since the first
  };

  /** Takes the commanded cameras to the time of an image. */
  void moveOnTo(double stamp);
  /** Whether the view may be taken for reached; see PlaceWatch. */
  bool trusted() const;
  /** Whether the view does not move as the camera is told to, whatever the dead time. */
  bool contradicted() const;
  /** How the camera has moved by the twists that were sent: X_end = motion X_begin. */
  Eigen::Isometry3d motionSince(double begin, double end) const;
  /** ServoReport::gains of a chosen point at a pixel. */
  Eigen::Vector2d gainsAt(const Eigen::Vector2d& pixel) const;
  /** d, or params.distance while that is not known [m]. */
  double distance() const;
  void updateReport();
  /** What an image with the view leads to, by how far the view can be believed. */
  void judge(double stamp);

  Servo25dParams params_;
  ServoTarget target_;
  Eigen::Vector2d chosen_;  // the chosen point in normalised coordinates
  std::unique_ptr<Task> task_;
  std::optional<PlaneView> view_;   // the last one
  std::optional<double> distance_;  // d, once it is known [m]
  std::deque<Sent> sent_;
  std::vector<CommandedCamera> cameras_;
  bool interrupted_ = false;             // the view was not seen before the next image
  std::optional<double> moved_until_;    // stamp of the image that the poses of cameras_ are of [s]
  std::optional<double> doubted_since_;  // stamp of the first image that is not believed [s]; empty while they are
  std::optional<double> lost_since_;     // stamp of the first image without the view [s]; empty while it is seen
  std::optional<double>
      within_since_;  // stamp since which both errors are within tolerance [s]; empty while they are not
  ServoReport report_;
};

}  // namespace view_servo
