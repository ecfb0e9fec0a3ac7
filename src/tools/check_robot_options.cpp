// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/check_robot_options.h"

#include <boost/program_options.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <sstream>
#include <stdexcept>

namespace view_servo
{
namespace
{
namespace po = boost::program_options;
using check::Setup;

const char* const USAGE =
    "Listens to a robot's topics and says, line by line, what fits and what does not, and what to do.\n"
    "\n"
    "  rosrun view_servo check_robot [homing|arm_servo] [OPTIONS] [NAME:=VALUE...]\n"
    "\n"
    "NAME:=VALUE are arguments of homing.launch or arm_servo.launch, so the same words can be typed for both:\n"
    "  camera:= image_transport:= cmd_vel:= views_dir:= dry_run:= frame_prefix:=\n"
    "  and odom:= base_frame:= of a base, joint_states:= odom_frame:= of an arm.\n"
    "\n"
    "Exit status: 0 all is well, 1 there are warnings, 2 there are errors.\n";

/** Arguments that both launch files have, or one of them, and that say nothing about how the robot is wired. */
const std::vector<std::string> PASSED_OVER = { "sim",
                                               "bag",
                                               "view",
                                               "world",
                                               "start",
                                               "groups",
                                               "exit",
                                               "patience",
                                               "result",
                                               "config",
                                               "mode",
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
                                               "odometry_drift",
                                               "focal_length_error",
                                               "encoder_noise",
                                               "hand_eye_translation_error",
                                               "hand_eye_rotation_error" };

std::map<std::string, std::string*> textArguments(Setup& setup)
{
  std::map<std::string, std::string*> arguments = { { "camera", &setup.camera },
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
    *found->second = value;
  }
  else if (name == "dry_run")
  {
    if (value != "true" && value != "false")
    {
      throw std::runtime_error("dry_run:= is true or false, not '" + value + "'");
    }
    setup.dry_run = value == "true";
  }
  else if (std::find(PASSED_OVER.begin(), PASSED_OVER.end(), name) == PASSED_OVER.end())
  {
    throw std::runtime_error(std::string(setup.is_arm ? "arm_servo" : "homing") + ".launch has no argument '" + name +
                             "'");
  }
}

void requireWithin(const std::string& option, double value, double least, double most)
{
  if (!(value >= least && value <= most))
  {
    std::ostringstream text;
    text << option << " has to be within " << least << " and " << most << ", not " << value;
    throw std::runtime_error(text.str());
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

po::options_description describe(CheckOptions& options, double& degrees)
{
  po::options_description description("Options");
  const auto add = [&](const char* names, const po::value_semantic* value, const char* meaning) {
    description.add_options()(names, value, meaning);
  };
  description.add_options()("help,h", "print this, and end");
  add("seconds", po::value(&options.seconds)->default_value(options.seconds, "10"), "listen for so long [s]");
  add("json", po::bool_switch(&options.json), "print one JSON object instead of lines");
  add("picture", po::value(&options.picture)->default_value(options.picture),
      "write the camera's picture with its corners and segments to this file (PNG)");
  add("no-picture", po::bool_switch(&options.no_picture), "write no picture");
  add("move", po::bool_switch(&options.move),
      "then ask to drive a little, or to be pushed by hand, and check signs, scale and direction of odometry, of the "
      "camera's mount and of commands");
  add("yes", po::bool_switch(&options.yes), "with --move: drive at once, without a question");
  add("distance", po::value(&options.drive.distance)->default_value(options.drive.distance, "0.1"),
      "with --move: how far to drive [m]");
  add("angle", po::value(&degrees)->default_value(degrees, "10"), "with --move: how far to turn [degrees]");
  return description;
}

/** Reads what begins with a dash. @return whether help is wanted. */
bool parse(const std::vector<std::string>& words, const po::options_description& description, std::string& robot)
{
  po::options_description all;
  all.add(description).add_options()("robot", po::value(&robot));
  po::positional_options_description positions;
  positions.add("robot", 1);
  po::variables_map values;
  po::store(po::command_line_parser(words).options(all).positional(positions).run(), values);
  po::notify(values);
  return values.count("help") > 0;
}

}  // namespace

CheckOptions readCheckOptions(int argc, char** argv)
{
  CheckOptions options;
  std::string robot = "homing";
  double degrees = 10.0;
  const Words words = sort(argc, argv);
  options.for_ros = words.for_ros;
  const po::options_description description = describe(options, degrees);
  if (parse(words.options, description, robot))
  {
    std::ostringstream text;
    text << USAGE << '\n' << description;
    options.help = text.str();
    return options;
  }
  if (robot != "homing" && robot != "arm_servo" && robot != "arm")
  {
    throw std::runtime_error("'" + robot + "' is no launch file: say homing or arm_servo");
  }
  options.setup.is_arm = robot != "homing";
  for (const std::string& argument : words.arguments)
  {
    const std::size_t split = argument.find(":=");
    setArgument(options.setup, argument.substr(0, split), argument.substr(split + 2));
  }
  requireWithin("--seconds", options.seconds, 1.0, 3600.0);
  requireWithin("--distance", options.drive.distance, 0.02, 0.2);
  requireWithin("--angle", degrees, 3.0, 15.0);
  options.drive.angle = degrees * M_PI / 180.0;
  return options;
}

}  // namespace view_servo
