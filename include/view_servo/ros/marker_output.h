// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <visualization_msgs/MarkerArray.h>

namespace view_servo
{
/**
 * Publishes on `~markers`, latched. Markers are to be made only while somebody wants them; whoever subscribes later
 * gets those of the next image. Not for several threads at once, but for wanted().
 */
class MarkerOutput
{
public:
  explicit MarkerOutput(ros::NodeHandle private_nh);

  /** Whether somebody subscribes. Safe to call from any thread. */
  bool wanted() const
  {
    return publisher_.getNumSubscribers() > 0;
  }

  void publish(const visualization_msgs::MarkerArray& markers);

  /** Deletes what was published last; also with nobody there, so that a later subscriber does not get what is over. */
  void clear();

private:
  ros::Publisher publisher_;
  visualization_msgs::MarkerArray shown_;
};

}  // namespace view_servo
