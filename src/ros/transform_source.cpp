// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/transform_source.h"

#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/shown_text.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/readiness.h"

#include <tf2/exceptions.h>

#include <stdexcept>

namespace view_servo
{
std::string withoutSlash(const std::string& frame)
{
  return frame.substr(!frame.empty() && frame.front() == '/' ? 1 : 0);
}

TransformSource::TransformSource(const ros::NodeHandle& nh) : listener_(buffer_, nh)
{
}

std::string TransformSource::missing(const std::string& target, const std::string& source, const ros::Time& stamp) const
{
  if (target.empty() || source.empty())
  {
    return "tf cannot place a message whose frame_id is empty";
  }
  std::string error;
  try
  {
    if (buffer_.canTransform(withoutSlash(target), withoutSlash(source), stamp, &error))
    {
      return "";
    }
  }
  catch (const std::exception& exception)
  {
    error = oneLine(exception);
  }
  return "tf does not know the frame '" + shown(source) + "' in '" + shown(target) + "'" +
         (error.empty() ? "" : ": " + oneLine(std::runtime_error(error)));
}

geometry_msgs::TransformStamped TransformSource::lookUp(const std::string& target, const std::string& source,
                                                        const ros::Time& stamp, double patience,
                                                        const std::function<bool()>& given_up) const
{
  const std::string lacking = waitUntilReady(
      patience, [&] { return missing(target, source, stamp); }, given_up);
  if (!lacking.empty())
  {
    throw std::runtime_error(lacking);
  }
  try
  {
    return buffer_.lookupTransform(withoutSlash(target), withoutSlash(source), stamp);
  }
  catch (const tf2::TransformException& exception)
  {
    throw std::runtime_error("tf does not know the frame '" + shown(source) + "' in '" + shown(target) +
                             "': " + oneLine(exception));
  }
}

}  // namespace view_servo
