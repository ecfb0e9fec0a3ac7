// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim_ros/command_listeners.h"

#include "view_servo/ros/ros_graph.h"

#include <ros/console.h>

#include <algorithm>
#include <set>
#include <vector>

namespace view_servo
{
namespace
{
/** Whether a node only records or shows what is published. */
bool onlyShows(const std::string& node)
{
  const std::vector<std::string> beginnings{ "record", "rosbag", "rostopic", "rviz", "rqt", "plot" };
  const std::string name = node.substr(node.rfind('/') + 1);
  return std::any_of(beginnings.begin(), beginnings.end(),
                     [&](const std::string& beginning) { return name.compare(0, beginning.size(), beginning) == 0; });
}

}  // namespace

std::string foreignListener(const std::string& topic, const std::string& action, const std::string& robot)
{
  const RosGraph graph;
  std::set<std::string> commands{ topic };
  for (const std::string& server : graph.publishers(action + "/result"))
  {
    for (const std::string& other : graph.publishedBy(server))
    {
      const std::string type = graph.type(other);
      if (type == "geometry_msgs/Twist" || type == "geometry_msgs/TwistStamped")
      {
        commands.insert(other);
      }
    }
  }
  for (const std::string& command : commands)
  {
    for (const std::string& node : graph.subscribers(command))
    {
      if (node == robot || onlyShows(node))
      {
        continue;
      }
      const std::vector<std::string> topics = graph.publishedBy(node);
      if (std::any_of(topics.begin(), topics.end(), [](const std::string& other) { return other != "/rosout"; }))
      {
        std::string fault = "'";
        fault.append(node).append("' listens on '").append(command);
        fault +=
            "', too, and would move with the simulated robot: for a real robot add sim:=false; to simulate, take a "
            "master of your own, by export ROS_MASTER_URI=http://localhost:11411";
        return fault;
      }
      ROS_WARN_STREAM("'" << node << "' listens on '" << command << "', too: if it is a robot, it will move");
    }
  }
  return "";
}

}  // namespace view_servo
