// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/control/approach_law.h"
#include "view_servo/control/arrival_detector.h"
#include "view_servo/control/clock_offset.h"
#include "view_servo/control/course.h"
#include "view_servo/control/goal_rules.h"
#include "view_servo/control/heading_hypotheses.h"
#include "view_servo/control/heading_vote.h"
#include "view_servo/control/odometry_history.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/tracking/view_tracker.h"
#include "view_servo/views/view_structure.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
enum class HomingMode
{
  SERVO,  ///< hypotheses from matches, then docking in image space
  THESIS  ///< chapter 5 as printed: no rotation, the view ahead, step by step, arrival by correlation
};

/** Options of homing. */
struct HomingParams
{
  HomingMode mode = HomingMode::SERVO;
  HeadingVoteParams vote;
  HeadingHypothesesParams hypotheses;
  ArrivalDetectorParams arrival;
  ViewTrackerParams tracker;
  double lost_timeout = 10.0;  ///< homing gives up after this time without a sign of the view [s]

  // Mode SERVO.
  ApproachParams approach;
  double blind_speed = 0.1;            ///< speed while only the heading is known [m/s]
  double dwell = 0.5;                  ///< time that the base has to stay within both tolerances [s]
  double arrival_distance = 0.01;      ///< within it the view counts as reached, though the base still drives [m]
  double arrival_yaw = 0.0175;         ///< yaw error within which the view counts as reached [rad]
  double docking_displacement = 40.0;  ///< homing docks below this median displacement of the view's points [px]
  bool check_motion = true;            ///< whether the view has to be seen to move as odometry says; see PlaceWatch
  double min_similarity = 0.3;         ///< homing ends only where gradientSimilarity() is at least this

  // Mode THESIS.
  double step = 0.02;        ///< length of a step, after which the heading is found anew [m]
  double near_step = 0.01;   ///< length of a step once the similarity has risen suddenly [m]
  double step_speed = 0.08;  ///< speed on a step [m/s]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(HomingParams& params);

enum class HomingState
{
  ACQUIRING,    ///< the view has not been found yet
  APPROACHING,  ///< its direction is known
  NEAR,         ///< what is seen begins to look like the view
  DOCKING,      ///< the last part, in image space
  ARRIVED,
  LOST,   ///< the view was known and is not found any more; the base waits
  FAILED  ///< homing has given up
};

/** What homing knows after an image; numbers that it does not know are NaN. */
struct HomingReport
{
  double stamp = 0.0;  ///< stamp of the last image [s]; 0 before the first
  HomingState state = HomingState::ACQUIRING;
  std::string reason;     ///< why it is in this state, in one line
  std::string manoeuvre;  ///< what a base that cannot slide does at the moment; empty: nothing worth a word
  bool contradicted =
      false;             ///< what is seen does not move as the base does: it is not the view, or not where it seems
  bool trusted = true;   ///< nothing speaks against the view's being where it is seen; see PlaceWatch
  bool at_view = false;  ///< the base is within arrival_distance and arrival_yaw, and the image looks like the view
  /**
   * Direction in base_link to the base's position at the view: 0 = straight ahead, positive to the left [rad],
   * (-pi, pi]. Mode SERVO: predicted by odometry while the view is not found.
   */
  double heading = std::numeric_limits<double>::quiet_NaN();
  double yaw_error = std::numeric_limits<double>::quiet_NaN();  ///< angle still to be turned, counter-clockwise [rad]
  double distance = std::numeric_limits<double>::quiet_NaN();   ///< distance left to drive [m]
  /**
   * Share of the matches (mode SERVO: or tracked points) that agree, [0, 1]; mode THESIS: of the votes in the chosen
   * bin.
   */
  double confidence = 0.0;
  /** HeadingHistogram::votesFor() base_link, of the last matches used; empty before. */
  std::vector<double> histogram;
  /**
   * Right end of the headings in base_link at which the view is expected next, positive to the left; may pass -pi
   * [rad].
   */
  double roi_min = std::numeric_limits<double>::quiet_NaN();
  double roi_max = std::numeric_limits<double>::quiet_NaN();     ///< left end; may pass pi [rad]
  double similarity = std::numeric_limits<double>::quiet_NaN();  ///< gradientSimilarity(), in [-1, 1]
  /**
   * Median distance of the view's points from their places in the view, in the last image in which they were found
   * [px].
   */
  double displacement = std::numeric_limits<double>::quiet_NaN();
  bool tracked = false;  ///< the view's points were found in the last image; if not, only matches show the way
  int inliers = 0;       ///< number of matches or tracked points that agree; mode THESIS: number of all matches
  /**
   * The base's pose at the view, in odometry's frame; empty until its distance is known in metres, and when it is lost.
   */
  std::optional<PlanarPose> goal_in_odom;
  /** Covariance of (x, y, yaw) of goal_in_odom [m, rad]; zero, and without meaning, while that is empty. */
  Eigen::Matrix3d goal_covariance = Eigen::Matrix3d::Zero();
  /** How much later than images odometry is stamped; see ClockOffset [s]. */
  double odometry_delay = std::numeric_limits<double>::quiet_NaN();
};

/** How far a goal has come. */
Progress toProgress(const HomingReport& report);

/** A thing that the stored view shows, whose place is known. */
struct HomingLandmark
{
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the optical frame of the view's camera [m]
  bool supporting = false;  ///< it was found in the last image where the pose of the view puts it
};

/** What homing goes back to. */
struct HomingTarget
{
  cv::Mat image;            ///< the stored view; 8-bit, one channel
  Camera camera;            ///< calibration of the current images; it has no fault
  Camera view_camera;       ///< calibration of `image`; it has no fault
  CameraMount mount;        ///< where the camera is on the base
  ViewStructure structure;  ///< what has been learnt of the view, see Homing::structure(); without points: nothing
};

/**
 * Brings a base back to where a view was stored, from what is matched in the camera's images and from its odometry.
 * Knows no ROS; times are those of the images [s] and may run at any speed, but not back.
 */
class Homing
{
public:
  virtual ~Homing() = default;
  Homing(const Homing&) = delete;
  Homing& operator=(const Homing&) = delete;

  /** Pose of the base in odometry's frame; it may come late. */
  void addOdometry(double stamp, const PlanarPose& base_in_odom)
  {
    if (odometry_.add(stamp, base_in_odom))
    {
      clocks_.addOdometry(stamp, base_in_odom.yaw);
      onOdometry(base_in_odom);
    }
  }

  /**
   * Matches of an image. They may come after newer images, and from several matchers in turn.
   * @param pixels in the raw images, `reference` in the stored one.
   */
  void addMatches(double stamp, const HeadingEvidence& pixels);

  /** @param grey 8-bit, one channel. @throws std::invalid_argument when it has another size than the camera. */
  void addImage(double stamp, const cv::Mat& grey);

  /** Where to go by all that has been added; STAND while that is not known. */
  virtual Course course() const = 0;

  /**
   * Velocity that the base should have now, in base_link: course() applied to the newest odometry, not limited yet.
   * Zero before the first odometry, and for STAND.
   */
  BaseVelocity command() const
  {
    const std::optional<PlanarPose> base = odometry_.newest();
    return base ? along(course(), *base) : BaseVelocity(BaseVelocity::Zero());
  }

  /**
   * What is known of where the things are that the view shows, to be stored with it: once the view's points are tracked
   * and the distance is known in metres, else without points. Points of an earlier structure that are not seen any more
   * where the base has arrived count less from one time to the next, until they are forgotten.
   */
  virtual ViewStructure structure() const
  {
    return {};
  }

  /**
   * Where the things are that the view shows, while its points are tracked and the distance is known in metres; else
   * none.
   */
  virtual std::vector<HomingLandmark> landmarks() const
  {
    return {};
  }

  const HomingReport& report() const
  {
    return report_;
  }

protected:
  Homing(const HomingParams& params, HomingTarget target);

  virtual void onOdometry(const PlanarPose& /*base_in_odom*/)
  {
  }
  virtual void onMatches(double stamp, const HeadingEvidence& evidence, const PlanarPose& camera_in_odom) = 0;
  virtual void onImage(double stamp, const cv::Mat& grey) = 0;

  void setState(HomingState state, const std::string& reason)
  {
    report_.state = state;
    report_.reason = reason;
  }
  bool ended() const
  {
    return report_.state == HomingState::ARRIVED || report_.state == HomingState::FAILED;
  }

  HomingParams params_;
  HomingTarget target_;
  OdometryHistory odometry_;
  ClockOffset clocks_;
  HomingReport report_;
  double started_;     ///< stamp of the first image [s]; NaN before it
  double last_trace_;  ///< stamp of the last image or matches that showed the view [s]

private:
  cv::Mat reference_gradients_;  // gradientMagnitude() of the stored view
};

/** @throws std::invalid_argument with all faults of the parameters, or saying what the target lacks. */
std::unique_ptr<Homing> makeHoming(const HomingParams& params, const HomingTarget& target);

}  // namespace view_servo
