// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/marker_output.h"

#include "view_servo/ros/markers.h"

#include <utility>

namespace view_servo
{
MarkerOutput::MarkerOutput(ros::NodeHandle private_nh)
  : publisher_(private_nh.advertise<visualization_msgs::MarkerArray>("markers", 5, true))
{
}

void MarkerOutput::publish(const visualization_msgs::MarkerArray& markers)
{
  publisher_.publish(markers);
  shown_ = markers;
}

void MarkerOutput::clear()
{
  const visualization_msgs::MarkerArray shown = std::exchange(shown_, visualization_msgs::MarkerArray());
  if (!shown.markers.empty())
  {
    publisher_.publish(deletionOf(shown));
  }
}

}  // namespace view_servo
