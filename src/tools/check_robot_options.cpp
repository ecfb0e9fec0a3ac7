// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/check_robot_options.h"

#include "tools/command_line.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <stdexcept>

namespace view_servo
{
namespace
{
using check::Setup;

const char* const USAGE =
    "Listens to a robot's topics and says, line by line, what fits and what does not, and what to do.\n"
    "\n"
    "  rosrun view_servo check_robot [homing|arm_servo] [OPTIONS] [NAME:=VALUE...]\n"
    "\n"
    "NAME:=VALUE are arguments of homing.launch or arm_servo.launch, so the same words can be typed for both:\n"
    "  camera:= image:= image_transport:= cmd_vel:= views_dir:= dry_run:= frame_prefix:=\n"
    "  and odom:= base_frame:= base:= of a base, joint_states:= odom_frame:= of an arm.";

/** Arguments that both launch files have, or one of them, and that say nothing about how the robot is wired. */
const std::vector<std::string> PASSED_OVER = { "sim",
                                               "bag",
                                               "play_options",
                                               "view",
                                               "world",
                                               "start",
                                               "groups",
                                               "approach",
                                               "exit",
                                               "patience",
                                               "result",
                                               "config",
                                               "mode",
                                               "target",
                                               "tracker_config",
                                               "matching",
                                               "max_speed",
                                               "timeout",
                                               "max_turn_rate",
                                               "rate",
                                               "line_rate",
                                               "rviz",
                                               "image_noise",
                                               "record",
                                               "report",
                                               "nodelets",
                                               "manager",
                                               "mount",
                                               "fixed_frame",
                                               "hand_eye",
                                               "hand_eye_inverse",
                                               "odometry_drift",
                                               "focal_length_error",
                                               "encoder_noise",
                                               "hand_eye_translation_error",
                                               "hand_eye_rotation_error",
                                               "sim_config" };

std::map<std::string, std::string*> textArguments(Setup& setup)
{
  std::map<std::string, std::string*> arguments = { { "camera", &setup.camera },
                                                    { "image", &setup.image },
                                                    { "image_transport", &setup.image_transport },
                                                    { "cmd_vel", &setup.cmd_vel },
                                                    { "frame_prefix", &setup.frame_prefix },
                                                    { "views_dir", &setup.views_dir } };
  if (setup.is_arm)
  {
    arguments["joint_states"] = &setup.joint_states;
    arguments["odom_frame"] = &setup.odom_frame;
  }
  else
  {
    arguments["odom"] = &setup.odom;
    arguments["base_frame"] = &setup.base_frame;
  }
  return arguments;
}

void setArgument(Setup& setup, const std::string& name, const std::string& value)
{
  const std::map<std::string, std::string*> texts = textArguments(setup);
  const auto found = texts.find(name);
  if (found != texts.end())
  {
    *found->second = name == "odom_frame" && value == "none" ? "" : value;  // as arm_servo.launch takes it
  }
  else if (name == "dry_run")
  {
    if (value != "true" && value != "false")
    {
      throw std::runtime_error("dry_run:= is true or false, not '" + value + "'");
    }
    setup.dry_run = value == "true";
  }
  else if (name == "base" && !setup.is_arm)
  {
    if (value != "holonomic" && value != "differential")
    {
      throw std::runtime_error("base:= is holonomic or differential, not '" + value + "'");
    }
    setup.slides = value == "holonomic";
  }
  else if (std::find(PASSED_OVER.begin(), PASSED_OVER.end(), name) == PASSED_OVER.end())
  {
    throw std::runtime_error(std::string(setup.is_arm ? "arm_servo" : "homing") + ".launch has no argument '" + name +
                             "'");
  }
}

/** The command line in three parts. */
struct Words
{
  std::vector<std::string> options;    ///< what begins with a dash, its values, and the robot
  std::vector<std::string> arguments;  ///< NAME:=VALUE
  std::vector<std::string> for_ros;    ///< such as __ns:=VALUE
};

Words sort(int argc, char** argv)
{
  Words words;
  words.for_ros.push_back(argv[0]);
  for (int i = 1; i < argc; ++i)
  {
    const std::string word = argv[i];
    const bool is_argument = word.find(":=") != std::string::npos && word.front() != '-';
    (!is_argument ? words.options : word.front() == '_' ? words.for_ros : words.arguments).push_back(word);
  }
  return words;
}

}  // namespace

std::optional<CheckOptions> readCheckOptions(int argc, char** argv)
{
  CheckOptions options;
  double degrees = 10.0;
  CommandLine line(USAGE, "Exit status: 0 all is well, 1 there are warnings, 2 there are errors.");
  line.number("seconds", options.seconds, { 1.0, 3600.0 }, "Listen for so long [s]");
  line.flag("json", options.json, "Print one JSON object instead of lines");
  line.text("picture", options.picture,
            "Write the camera's picture with its corners and segments to this file (PNG); default: " + options.picture);
  line.flag("no-picture", options.no_picture, "Write no picture");
  line.flag("move", options.move,
            "Then ask to drive a little, or to be pushed by hand, and check signs, scale and direction of odometry, of "
            "the camera's mount and of commands");
  line.flag("yes", options.yes, "With --move: drive at once, without a question");
  line.number("distance", options.drive.distance, { 0.02, 0.2 }, "With --move: how far to drive [m]");
  line.number("angle", degrees, { 3.0, 15.0 }, "With --move: how far to turn [degrees]");

  const Words words = sort(argc, argv);
  std::vector<const char*> for_options{ argv[0] };
  for (const std::string& word : words.options)
  {
    for_options.push_back(word.c_str());
  }
  const auto robots = line.parse(static_cast<int>(for_options.size()), for_options.data());
  if (!robots)
  {
    return std::nullopt;
  }
  const std::string robot = robots->empty() ? "homing" : robots->front();
  if (robots->size() > 1 || (robot != "homing" && robot != "arm_servo" && robot != "arm"))
  {
    throw CommandLineError("'" + robots->back() + "' is no launch file: say homing or arm_servo");
  }
  options.for_ros = words.for_ros;
  options.setup.is_arm = robot != "homing";
  for (const std::string& argument : words.arguments)
  {
    const std::size_t split = argument.find(":=");
    setArgument(options.setup, argument.substr(0, split), argument.substr(split + 2));
  }
  if (std::find(words.arguments.begin(), words.arguments.end(), "sim:=false") != words.arguments.end())
  {
    options.setup.frame_prefix.clear();  // the launch files put it before simulated frames only
  }
  options.drive.angle = degrees * M_PI / 180.0;
  return options;
}

}  // namespace view_servo
