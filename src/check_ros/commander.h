// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check_ros/setup.h"
#include "view_servo/control/velocity_limiter.h"

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>

#include <functional>
#include <mutex>
#include <string>

namespace view_servo::check
{
/** Limits of the test drive, far below those of the drivers. */
inline const VelocityLimits TEST_LIMITS{ 0.05, 0.12, 0.1, 0.3 };

/**
 * Drives a robot over short ways. However a way ends, and when this object ends, zeros are sent. A command that another
 * node sends ends the drive.
 */
class Commander
{
public:
  /** @param camera_frame of an arm's twists; a base's are in its own. */
  Commander(const ros::NodeHandle& nh, const Setup& setup, const std::string& camera_frame);
  ~Commander();
  Commander(const Commander&) = delete;
  Commander& operator=(const Commander&) = delete;

  /** Waits until the robot's driver is connected. @return why it is not, in one line; empty when it is. */
  std::string connect(const std::function<bool()>& given_up);

  /**
   * Drives along `way` and stands still for a moment.
   * @param way translation [m] and rotation vector [rad] in base_link or the camera's frame; one of them is zero.
   * @param objection asked in each cycle of 20 ms; the drive ends when it returns a reason, in one line.
   * @return why the drive ended before its end; empty: it did not.
   */
  std::string drive(const Twist& way, const std::function<std::string()>& objection);

private:
  void publish(const Twist& velocity);
  /** Takes note of a command that a node has sent. */
  void onCommand(const std::string& publisher);
  /** A node that commands the robot besides; empty: there is none. */
  std::string rival() const;
  /** drive() without the zeros at its end. */
  std::string follow(const Twist& way, const std::function<std::string()>& objection);
  void sendZeros();

  const bool is_arm_;
  const std::string frame_;  // of the twists
  ros::Publisher publisher_;
  ros::Publisher stamped_publisher_;  // of a base
  mutable std::mutex mutex_;          // guards rival_
  std::string rival_;
  ros::Subscriber subscriber_;  // these end first
  ros::Subscriber stamped_subscriber_;
};

}  // namespace view_servo::check
