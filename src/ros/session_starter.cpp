// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/session_starter.h"

#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/tracking/plane_tracker_parameters.h"
#include "view_servo/images/image_io.h"
#include "view_servo/views/view_store.h"

#include <ros/console.h>
#include <ros/time.h>

#include <exception>
#include <stdexcept>

namespace view_servo
{
SessionStarterParams SessionStarterParams::read(ParameterReader& reader)
{
  SessionStarterParams params;
  params.views_dir = readViewsDir(reader);
  reader.read("odom_frame", params.odom_frame);
  reader.read("tf_patience", params.tf_patience);
  reader.require(params.tf_patience >= 0.0, "~tf_patience must not be negative [s]");
  reader.read(planeTrackerParameters(params.tracker));
  reader.addFaults(params.tracker.validate());
  return params;
}

SessionStarter::SessionStarter(const SessionStarterParams& params, const FeatureParams& features,
                               const CameraInput& camera)
  : params_(params), camera_(camera), views_(ViewStore(params.views_dir), features)
{
}

SessionStarter::Preparation SessionStarter::prepare(const std::string& view)
{
  Preparation preparation;
  try
  {
    const std::shared_ptr<const PreparedImage> stored = views_.get(view);
    const std::string fault = camera_.fault();
    if (!fault.empty())
    {
      throw std::runtime_error(fault);
    }
    CameraFrame frame;
    try
    {
      frame = camera_.latest();
    }
    catch (const ImageError& error)
    {
      preparation.reason = oneLine(error);
      return preparation;
    }
    requireSameSize(view, stored->grey().size(), *frame.image);
    if (!params_.odom_frame.empty())
    {
      preparation.reason = transforms_.missing(params_.odom_frame, frame.image->header.frame_id, ros::Time(0));
    }
    if (preparation.reason.empty())
    {
      preparation.session = std::make_unique<PlaneSession>(stored, *frame.info, params_.tracker);
    }
  }
  catch (const std::exception& error)
  {
    preparation.refused = true;
    preparation.reason = oneLine(error);
  }
  return preparation;
}

std::optional<Eigen::Isometry3d> SessionStarter::cameraInOdom(const std_msgs::Header& image,
                                                              const std::function<bool()>& given_up) const
{
  if (params_.odom_frame.empty())
  {
    return std::nullopt;
  }
  try
  {
    return toIsometry(
        transforms_.lookUp(params_.odom_frame, image.frame_id, image.stamp, params_.tf_patience, given_up).transform);
  }
  catch (const std::exception& error)
  {
    ROS_WARN_STREAM_THROTTLE(5.0, "an image is followed without odometry: " << oneLine(error));
    return std::nullopt;
  }
}

}  // namespace view_servo
