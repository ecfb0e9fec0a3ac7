// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/ros_program.h"

#include <ros/console.h>
#include <ros/init.h>
#include <ros/master.h>

#include <stdexcept>

namespace view_servo
{
std::optional<std::vector<std::string>> parseWithoutRosWords(CommandLine& line, int argc, char** argv)
{
  std::vector<std::string> words;
  ros::removeROSArgs(argc, argv, words);
  std::vector<const char*> pointers;
  pointers.reserve(words.size());
  for (const std::string& word : words)
  {
    pointers.push_back(word.c_str());
  }
  return line.parse(static_cast<int>(pointers.size()), pointers.data());
}

void initQuietly(int argc, char** argv, const std::string& name, std::uint32_t options)
{
  ros::init(argc, argv, name, options | ros::init_options::AnonymousName);
  ros::console::set_logger_level(ROSCONSOLE_DEFAULT_NAME, ros::console::levels::Fatal);
  ros::console::notifyLoggerLevelsChanged();
}

void requireMaster()
{
  constexpr std::chrono::seconds PATIENCE{ 3 };
  const std::optional<bool> is_there = within(PATIENCE, [] { return ros::master::check(); });
  if (!is_there)
  {
    throw std::runtime_error("the ROS master at " + ros::master::getURI() +
                             " does not answer: it hangs, or the network drops what is sent to it");
  }
  if (!*is_there)
  {
    throw std::runtime_error("no ROS master answers at " + ros::master::getURI() +
                             ": start the robot's launch file, or set ROS_MASTER_URI");
  }
}

}  // namespace view_servo
