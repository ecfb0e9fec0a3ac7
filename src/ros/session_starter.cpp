// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/session_starter.h"

#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/views/view_store.h"

#include <ros/console.h>
#include <ros/time.h>

#include <exception>
#include <stdexcept>

namespace view_servo
{
std::vector<Parameter> parameters(SessionStarterParams& params)
{
  return joined({
      {
          viewsDirParameter(params.views_dir),
          text("odom_frame", params.odom_frame,
               "frame that stands still while the camera moves, an arm's base or odometry's, in which tf must know the "
               "camera's optical frame; it predicts where the plane is in the next image, and gives the plane's "
               "distance; "
               "empty: do without"),
          real("tf_patience", params.tf_patience, "s", ">= 0",
               "how long an image waits for tf to know where its camera was; then it is followed without"),
          choice<Target>("target", params.target, { { "plane", Target::PLANE }, { "scene", Target::SCENE } },
                         "whether views show one plane, or a scene, which has things at different depths"),
      },
      parameters(params.tracker),
  });
}

SessionStarter::SessionStarter(const ros::NodeHandle& nh, const SessionStarterParams& params,
                               const FeatureParams& features, const CameraInput& camera)
  : params_(params), camera_(camera), views_(ViewStore(viewsDir(params.views_dir)), features), transforms_(nh)
{
}

SessionStarter::Preparation SessionStarter::prepare(const std::string& view)
{
  Preparation preparation;
  try
  {
    const CachedView stored = views_.get(view);
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
    if (!params_.odom_frame.empty())
    {
      preparation.reason = transforms_.missing(params_.odom_frame, frame.image->header.frame_id, ros::Time(0));
    }
    if (preparation.reason.empty())
    {
      preparation.session = std::make_unique<PlaneSession>(stored, *frame.info, params_.tracker, params_.target);
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
