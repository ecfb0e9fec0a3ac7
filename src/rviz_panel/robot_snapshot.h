// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ServoStatus.h"

#include <opencv2/core/mat.hpp>

#include <array>
#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Where a robot's nodes and pictures are. */
struct RobotNames
{
  std::string robot_namespace;                          ///< of its nodes; empty: none
  std::string camera_topic = "camera/image_raw";        ///< in that namespace unless it begins with a slash
  std::string overlay_topic = "point_matcher/overlay";  ///< likewise
};

bool operator==(const RobotNames& a, const RobotNames& b);

/** A stored view, or a damaged one. */
struct ListedView
{
  std::string name;
  cv::Mat thumbnail;   ///< 8-bit grey, with the region drawn; empty when it is damaged
  double stamp = 0.0;  ///< of its image [s of ROS time]; 0: not known
  std::string fault;   ///< why it cannot be read; or empty
};

/** The newest picture of a topic. */
struct TopicPicture
{
  std::string topic;                            ///< resolved; empty: none is subscribed
  cv::Mat picture;                              ///< 8-bit BGR; empty while none has come
  std::string fault;                            ///< why the last one cannot be shown; or empty
  std::chrono::steady_clock::time_point since;  ///< when it came, or since when it is waited for
  unsigned count = 0;                           ///< number of pictures so far
};

/** Number of kinds of drivers. */
constexpr std::size_t DRIVERS = 3;

/** What is known of a driver. */
struct DriverState
{
  std::string kind;                   ///< "homing", "servo_25d" or "route_follower"
  bool is_there = false;              ///< whether its action is served
  std::optional<ServoStatus> status;  ///< the last one
  std::optional<bool> enabled;        ///< whether its gate is open; empty: not known
  bool dry_run = false;               ///< whether it runs dry
  int level = 0;                      ///< level of its diagnostics, a constant of diagnostic_msgs/DiagnosticStatus
  double silence = 0.0;               ///< time since its last diagnostics [s]; 0 before the first
};

/** What was left to go at a time, see ServoStatus; NaN: not known. */
struct ErrorSample
{
  std::chrono::steady_clock::time_point time;
  double translation = 0.0;  ///< translation_error [m]
  double rotation = 0.0;     ///< rotation_error [rad]
  double points = 0.0;       ///< point_error [px]
};

/** What came of the last thing that was asked for, for people. */
struct Words
{
  std::string text;     ///< one line; empty: nothing was asked for
  bool is_good = true;  ///< false: it failed
  unsigned count = 0;   ///< number of texts so far
};

/** All that a RobotLink knows. Pictures share their data, which nobody changes. */
struct RobotSnapshot
{
  std::array<DriverState, DRIVERS> drivers;  ///< homing, servo_25d, route_follower
  std::string followed;                      ///< what homography_tracker sees now, for people; empty: nothing
  std::deque<ErrorSample> errors;            ///< of the last minute, oldest first
  std::vector<ListedView> views;
  std::string views_fault;                ///< why they cannot be listed; or empty
  unsigned views_count = 0;               ///< how often `views` has changed so far
  std::vector<std::string> image_topics;  ///< topics of images that the master knows
  TopicPicture camera;
  TopicPicture overlay;
  Words words;
};

}  // namespace view_servo
