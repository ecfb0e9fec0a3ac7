// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/hand_eye_session.h"
#include "view_servo/Homography.h"
#include "view_servo/views/hand_eye_file.h"

#include <ros/duration.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <string>
#include <vector>

namespace view_servo
{
/** What is recorded of an arm that is brought from pose to pose before a stored view. */
struct HandEyeRecording
{
  /** @param fixed whether the transforms hold at all times. @throws std::exception for stamps that cannot be. */
  void addTransforms(const tf2_msgs::TFMessage& message, bool fixed);

  tf2::BufferCore frames{ ros::Duration(1e8) };    ///< all that is known of frames, however long it took
  sensor_msgs::CameraInfo::ConstPtr info;          ///< the camera's first calibration; null: there is none
  std::vector<Homography::ConstPtr> homographies;  ///< of the tracker, as they came; null: of another type
};

/**
 * The poses at which the arm stood still. @throws std::runtime_error with what the recording lacks, or what is wrong
 * with it; and as ViewStore::load() does.
 */
HandEyePosesFile posesIn(const HandEyeRecording& recording, const HandEyeSources& sources);

/**
 * The poses at which an arm stood still before a stored view, from a bag that was recorded meanwhile: /tf, /tf_static,
 * the camera's camera_info and the tracker's homographies. What HandEyeSession would have taken is taken, by the same
 * rules.
 * @throws std::runtime_error naming the bag, and what it lacks or what is wrong with it.
 */
HandEyePosesFile readHandEyeBag(const std::string& path, const HandEyeSources& sources);

}  // namespace view_servo
