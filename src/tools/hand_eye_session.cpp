// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/hand_eye_session.h"

#include "tools/ros_program.h"
#include "view_servo/SetView.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/readiness.h"
#include "view_servo/views/view_store.h"

#include <ros/service.h>

#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr double PATIENCE = 5.0;  // until what is needed is there [s]

}  // namespace

HandEyeSession::HandEyeSession(const ros::NodeHandle& nh, const HandEyeSources& sources,
                               const std::function<bool()>& given_up)
  : sources_(sources)
{
  const StoredView stored = ViewStore(viewsDir(sources.views_dir)).load(sources.view);
  const auto wait_for = [&](const std::function<std::string()>& missing) {
    const std::string lacking = waitUntilReady(PATIENCE, missing, given_up);
    if (!lacking.empty())
    {
      throw std::runtime_error(lacking);
    }
  };
  ros::NodeHandle node(nh);
  const std::string info_topic = node.resolveName(sources.camera + "/camera_info");
  info_subscriber_ =
      node.subscribe<sensor_msgs::CameraInfo>(info_topic, 1, [this](const sensor_msgs::CameraInfo::ConstPtr& message) {
        const std::lock_guard<std::mutex> lock(mutex_);
        info_ = message;
      });
  sensor_msgs::CameraInfo::ConstPtr info;
  wait_for([&] {
    const std::lock_guard<std::mutex> lock(mutex_);
    info = info_;
    return info ? std::string()
                : "no camera_info comes on '" + info_topic + "': start the camera's driver, or say --camera";
  });
  const Camera camera = toCamera(*info);
  if (const std::string fault = camera.fault(); !fault.empty())
  {
    throw std::runtime_error("'" + info_topic + "': " + fault);
  }
  collector_ = HandEyeCollector(handEyeViewOf(stored, camera));
  camera_frame_ = withoutSlash(info->header.frame_id);
  if (camera_frame_.empty())
  {
    throw std::runtime_error("'" + info_topic + "' has no frame_id: let the camera's driver name the camera's frame");
  }
  wait_for([&] {
    const std::string missing = transforms_.missing(sources_.base_frame, sources_.flange_frame, ros::Time(0));
    return missing.empty() ? missing : missing + ": say " + sources_.frameOptions() + " with the robot's frames";
  });
  const std::string start = sources.tracker + "/start";
  wait_for([&] {
    constexpr bool PRINT_FAILURE = false;
    return ros::service::exists(start, PRINT_FAILURE)
               ? std::string()
               : "the node '" + sources_.tracker + "' does not run: " +
                     (sources_.on_base
                          ? "rosrun view_servo homography_tracker image_raw:=" + sources_.camera +
                                "/image_raw camera_info:=" + sources_.camera + "/camera_info _odom_frame:=\"\""
                          : "roslaunch view_servo arm_servo.launch sim:=false dry_run:=true odom_frame:=none camera:=" +
                                sources_.camera) +
                     " starts it";
  });
  constexpr std::chrono::seconds ANSWER_PATIENCE{ 10 };
  const std::optional<SetView::Response> answer = within(ANSWER_PATIENCE, [start, view = sources.view] {
    SetView service;
    service.request.view = view;
    if (!callService(start, service))
    {
      service.response.success = 0;
      service.response.message = "the service '" + start + "' cannot be called, or has failed: start its node anew";
    }
    return service.response;
  });
  if (!answer)
  {
    throw std::runtime_error("the service '" + start + "' does not answer: its node hangs; start it anew");
  }
  if (answer->success == 0)
  {
    throw std::runtime_error("view '" + sources.view + "' cannot be followed: " + answer->message);
  }
  constexpr std::uint32_t QUEUE = 20;
  homography_subscriber_ =
      node.subscribe<Homography>(sources.tracker + "/homography", QUEUE, [this](const Homography::ConstPtr& message) {
        constexpr std::size_t MOST = 100;
        const std::lock_guard<std::mutex> lock(mutex_);
        inbox_.push_back({ message, Clock::now() });
        if (inbox_.size() > MOST)
        {
          inbox_.pop_front();
        }
      });
}

bool HandEyeSession::update()
{
  constexpr std::chrono::seconds SILENT{ 3 };
  constexpr std::chrono::milliseconds TF_PATIENCE{ 500 };
  bool added = false;
  while (true)
  {
    Received next;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (inbox_.empty())
      {
        break;
      }
      next = inbox_.front();
    }
    const Homography& message = *next.message;
    last_message_ = next.time;
    if (message.view != sources_.view)
    {
      collector_.clear();
      hindrance_ = "'" + sources_.tracker + "' follows " +
                   (message.view.empty() ? "no view" : "another view, '" + message.view + "'") + ": call its ~start";
    }
    else if (message.refused)
    {
      throw std::runtime_error("view '" + message.view + "' cannot be followed: " + message.reason);
    }
    else if (!message.valid)
    {
      collector_.clear();
      hindrance_ = "the view is not followed: " + oneLine(std::runtime_error(message.reason));
    }
    else
    {
      const std::string missing = transforms_.missing(sources_.base_frame, sources_.flange_frame, message.header.stamp);
      if (missing.empty())
      {
        hindrance_.clear();
        added = take(message) || added;
      }
      else if (Clock::now() < next.time + TF_PATIENCE)
      {
        break;  // it may come yet
      }
      else
      {
        hindrance_ = missing + ", when the image was taken";
      }
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!inbox_.empty() && inbox_.front().message == next.message)
    {
      inbox_.pop_front();
    }
  }
  if (Clock::now() > last_message_ + SILENT)
  {
    collector_.clear();
    hindrance_ = "nothing comes from '" + sources_.tracker + "'";
  }
  return added;
}

std::optional<Eigen::Isometry3d> HandEyeSession::cameraByTf() const
{
  constexpr double NO_WAIT = 0.0;
  if (!transforms_.missing(sources_.flange_frame, camera_frame_, ros::Time(0)).empty())
  {
    return std::nullopt;
  }
  return toIsometry(transforms_.lookUp(sources_.flange_frame, camera_frame_, ros::Time(0), NO_WAIT).transform);
}

/** @return whether a pose was added. */
bool HandEyeSession::take(const Homography& message)
{
  constexpr double NO_WAIT = 0.0;
  const Eigen::Isometry3d flange_in_base = toIsometry(
      transforms_.lookUp(sources_.base_frame, sources_.flange_frame, message.header.stamp, NO_WAIT).transform);
  if (!message.header.frame_id.empty())
  {
    camera_frame_ = withoutSlash(message.header.frame_id);
  }
  return collector_.add(message.header.stamp.toSec(), homographyOf(message), flange_in_base);
}

}  // namespace view_servo
