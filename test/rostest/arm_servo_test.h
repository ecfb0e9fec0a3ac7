// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "driver_test.h"
#include "support/cameras.h"

#include "test_paths.h"
#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/tracking/plane_tracker.h"

#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/JointState.h>
#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <mutex>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
inline const cv::Rect REGION(100, 80, 301, 201);
inline constexpr char CAMERA_FRAME[] = "camera_optical_frame";
inline constexpr char FIRST_VIEW[] = "approach";  // of a list; the other one is "goal"

/** An arm that moves a sixth as fast to the side as it is told, and not otherwise, with a camera and a tracker. */
class FakeArm : public FakeRobot
{
public:
  using Action = ServoToViewAction;
  using Command = geometry_msgs::TwistStamped;
  static constexpr const char* NAMESPACE = "driving";
  static constexpr const char* DRIVER = "servo_25d";
  static constexpr const char* ACTION = "servo";
  static constexpr const char* SILENT = "no homograph";
  static std::vector<std::string> program()
  {
    return { SERVO_25D_PATH };
  }

  explicit FakeArm(const std::string& ns) : FakeRobot(ns, DRIVER)
  {
    infos_ = nh_.advertise<sensor_msgs::CameraInfo>("camera_info", 5);
    joints_ = nh_.advertise<sensor_msgs::JointState>("joint_states", 5);
    reconnect();
    start(RATE, [this](int /*cycle*/) { publish(); });
  }
  ~FakeArm() override
  {
    stop();
  }

  void obey(const CommandsOf<Command>& commands)
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    commands_ = &commands;
  }

  /** The tracker goes, with all its connections, and comes back. */
  void reconnect()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    homographies_.shutdown();
    homographies_ = nh_.advertise<Homography>("homography", 5);
  }

  void publishExtremes()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    for (const ros::Time& time : extremeStamps())
    {
      homographies_.publish(homography(header(time)));
      infos_.publish(info(header(time)));
      joints_.publish(joints(header(time), 0.0));
    }
    const std_msgs::Header now = header(ros::Time::now());
    for (const double number : extremeNumbers())
    {
      for (double Homography::*const field : { &Homography::distance, &Homography::rms_error })
      {
        Homography message = homography(now);
        message.*field = number;
        homographies_.publish(message);
      }
      Homography message = homography(now);
      message.rotation.w = number;
      homographies_.publish(message);
      message = homography(now);
      message.normal.x = message.normal.z = number;
      homographies_.publish(message);
      message = homography(now);
      message.translation_over_distance.z = number;
      message.h.fill(number);
      homographies_.publish(message);
      joints_.publish(joints(now, number));
    }
    Homography message = homography(now);
    message.inliers = -1;
    message.header.frame_id.clear();
    homographies_.publish(message);
    sensor_msgs::JointState uneven = joints(now, 0.0);
    uneven.name.resize(3);
    uneven.velocity.resize(7);
    joints_.publish(uneven);
  }

  std::atomic<bool> covered{ false };
  std::atomic<bool> nonsense{ false };
  std::atomic<bool> joints_come{ true };
  std::atomic<bool> keeps_to_first{ false };  // follows no other view than the first one
  std::atomic<bool> refuses_second{ false };  // any view but the first one
  std::atomic<double> offset{ 0.1 };          // of the camera from the view, to its left [m]
  std::atomic<double> joint{ 0.0 };           // where joint5 is [rad]

private:
  void publish()
  {
    const std_msgs::Header now = header(stamp());
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    moveOn();
    if (camera)
    {
      infos_.publish(info(now));
    }
    if (joints_come)
    {
      joints_.publish(joints(now, joint));
    }
    Homography message = homography(now);
    if (answers && fill(message))
    {
      if (keeps_to_first && message.view != FIRST_VIEW)
      {
        message.view = FIRST_VIEW;
        message.goal.clear();
      }
      if (refuses_second && message.view != FIRST_VIEW)
      {
        message.refused = 1;
        message.reason = "it is gone";
      }
      homographies_.publish(message);
    }
  }

  static std_msgs::Header header(const ros::Time& time)
  {
    std_msgs::Header header;
    header.stamp = time;
    header.frame_id = CAMERA_FRAME;
    return header;
  }

  sensor_msgs::CameraInfo info(const std_msgs::Header& header) const
  {
    Camera model = pinholeCamera({ 480, 360 }, focal_length, focal_length, 240.0, 180.0);
    if (!calibrated)
    {
      model.k.setZero();
    }
    model.projection.leftCols<3>() = model.k;
    return toCameraInfo(model, header);
  }

  static sensor_msgs::JointState joints(const std_msgs::Header& header, double position)
  {
    sensor_msgs::JointState message;
    message.header = header;
    message.name = { "joint5" };
    message.position = { position };
    return message;
  }

  /** The plane is 0.5 m away, and faces the camera. */
  Homography homography(const std_msgs::Header& header) const
  {
    constexpr double DISTANCE = 0.5;
    PlaneTrack track;
    if (covered)
    {
      track.state = TrackingState::LOST;
    }
    else
    {
      PlaneEstimate plane;
      plane.motion.rotation.setIdentity();
      plane.motion.translation_over_distance = Eigen::Vector3d(offset_seen_ / DISTANCE, 0.0, 0.0);
      plane.motion.normal = Eigen::Vector3d::UnitZ();
      plane.normal_known = true;
      plane.distance = DISTANCE;
      track.state = TrackingState::TRACKING;
      track.homography.found = true;
      track.homography.supporting = 50;
      track.homography.h.setIdentity();
      track.plane = plane;
    }
    // What a tracker says is told in one line.
    Homography message = toHomography(track, wantedView().view, header, "a hand\nis in front of it\n");
    if (nonsense)
    {
      message.rotation.w = std::numeric_limits<double>::quiet_NaN();
    }
    return message;
  }

  /** Follows the commands, and `offset` where a test has changed it, no faster than an arm moves. */
  void moveOn()
  {
    constexpr double SHARE = 0.15;    // of what it is told
    constexpr double FASTEST = 2e-3;  // change in a cycle [m]
    constexpr double NEAR = 2e-3;     // from where on it stays [m]
    if (offset != offset_told_)
    {
      offset_told_ = offset;
      offset_left_ = offset_told_ - offset_seen_;
    }
    const double step = std::clamp(offset_left_, -FASTEST, FASTEST);
    offset_left_ -= step;
    offset_seen_ += step;
    if (commands_ != nullptr && offset_left_ == 0.0 && std::abs(offset_seen_) > NEAR)
    {
      offset_seen_ -= SHARE * commands_->newest().twist.linear.x / RATE;
    }
  }

  static constexpr double RATE = 30.0;  // [Hz]

  std::mutex publisher_mutex_;
  const CommandsOf<Command>* commands_ = nullptr;
  double offset_told_ = 0.1;  // the last value of `offset` [m]
  double offset_left_ = 0.0;  // how far it has still to be followed [m]
  double offset_seen_ = 0.1;  // [m]
  ros::Publisher homographies_;
  ros::Publisher infos_;
  ros::Publisher joints_;
};

class Servo25dNodeTest : public DriverTest<FakeArm>
{
protected:
  Recorder<ServoError> errors_{ ns_ + "/servo_error" };
};

}  // namespace test
}  // namespace view_servo
