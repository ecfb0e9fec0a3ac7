// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/calibration_files.h"
#include "tools/command_line.h"
#include "tools/hand_eye_bag.h"
#include "tools/hand_eye_session.h"
#include "view_servo/geometry/hand_eye.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/views/hand_eye_file.h"

#include <ros/console.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/spinner.h>

#include <chrono>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <iostream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace view_servo
{
namespace
{
using Clock = std::chrono::steady_clock;

constexpr int DONE = 0;
constexpr int NOT_DONE = 1;
constexpr int CANNOT = 2;

struct Options
{
  HandEyeSources sources{ "", "", "base_link", "tool0", "camera", "homography_tracker" };
  int poses = 12;
  std::optional<double> distance;  // of the plane from the view's camera [m]
  std::string file;                // with what was recorded before; empty: the arm is there
  std::string keep;                // file for the poses; empty: none
  std::string out = "hand_eye.yaml";
  bool overwrite = false;
};

int usedOf(const HandEyeResult& result)
{
  int used = 0;
  for (const HandEyeResidual& residual : result.residuals)
  {
    used += residual.used ? 1 : 0;
  }
  return used;
}

std::string describe(const HandEyeResidual& residual)
{
  return fixed({ residual.pixels }, 2) + " px, " + fixed({ 1e3 * residual.translation }, 2) + " mm, " +
         fixed({ DEGREES * residual.rotation }, 3) + " degrees";
}

/** What to do next. */
std::string advice(const HandEyeSession& session, const HandEyeParams& params)
{
  HandEyeMotion motion = handEyeMotion(session.view(), session.poses());
  motion.poses = std::numeric_limits<int>::max();  // that more are needed is said anyway
  const std::vector<std::string> missing = missingMotion(motion, params);
  return session.poses().size() > 1 && !missing.empty()
             ? missing.front()
             : "move the arm to another pose, with the view in the picture, and let it stand for a second";
}

/** Says what came of it, and writes the file. @return the exit status. */
int finish(const HandEyePosesFile& poses, const HandEyeResult& result, const Options& options)
{
  for (std::size_t i = 0; i < result.residuals.size() && usedOf(result) > 0; ++i)
  {
    std::cout << "pose " << i + 1 << ": " << describe(result.residuals[i])
              << (result.residuals[i].used ? "" : ": disagrees with the others, left out") << '\n';
  }
  if (!result.found)
  {
    std::cout << std::flush;
    std::cerr << "calibrate_hand_eye: not calibrated: " << result.message << std::endl;
    return NOT_DONE;
  }
  HandEyeFile file;
  file.base_frame = poses.base_frame;
  file.flange_frame = poses.flange_frame;
  file.camera_frame = poses.camera_frame;
  file.camera_in_flange = result.camera_in_flange;
  file.covariance = numbersOf(result.covariance);
  file.comment = "calibrate_hand_eye, " + dateAndTime() + ": view " + poses.view_name + ", " +
                 std::to_string(usedOf(result)) + " of " + std::to_string(result.residuals.size()) + " poses";
  writeHandEyeFile(file, options.out);

  const std::string numbers = numbersOf(result.camera_in_flange);
  std::cout << "errors: images " << fixed({ result.image_error }, 2) << " px, arm "
            << fixed({ 1e3 * result.translation_error }, 2) << " mm and "
            << fixed({ DEGREES * result.rotation_error }, 3) << " degrees; the plane was "
            << fixed({ result.distance }, 4) << " m from the view's camera (standard deviation "
            << fixed({ 1e3 * result.distance_sigma }, 1) << " mm)\n"
            << "'" << file.camera_frame << "' in '" << file.flange_frame << "' by " << usedOf(result) << " of "
            << result.residuals.size() << " poses: x y z qx qy qz qw = " << numbers << '\n'
            << "standard deviation, along the least certain direction: "
            << fixed({ 1e3 * result.translationSigma() }, 2) << " mm, "
            << fixed({ DEGREES * result.rotationSigma() }, 3) << " degrees\n"
            << "written to " << options.out << "; to publish it, one of\n"
            << "  roslaunch view_servo arm_servo.launch sim:=false hand_eye:=" << options.out << '\n'
            << "  rosrun tf2_ros static_transform_publisher " << numbers << ' ' << file.flange_frame << ' '
            << file.camera_frame << std::endl;
  return DONE;
}

/** Of what was recorded before. @return the exit status. */
int runOffline(const Options& options, const HandEyeParams& params)
{
  const bool bag = std::filesystem::path(options.file).extension() == ".bag";
  const HandEyePosesFile poses =
      bag ? readHandEyeBag(options.file, options.sources) : readHandEyePosesFile(options.file);
  std::cout << poses.poses.size() << " poses before view '" << poses.view_name << "' in " << options.file << std::endl;
  keepPoses(poses, options.keep, "calibrate_hand_eye");
  return finish(poses, calibrateHandEye(poses.view, poses.poses, params), options);
}

int run(const Options& options, const HandEyeParams& params)
{
  constexpr std::chrono::milliseconds POLL{ 20 };
  constexpr std::chrono::seconds REMINDER{ 5 };
  constexpr int MOST_MORE = 8;  // poses beyond those asked for, before it is given up
  if (!ros::master::check())
  {
    throw std::runtime_error("no ROS master answers at " + ros::master::getURI() +
                             ": start the robot's launch file, or set ROS_MASTER_URI");
  }
  const ros::NodeHandle nh;
  detail::deferShutdown();
  constexpr std::uint32_t THREADS = 1;
  ros::AsyncSpinner spinner(THREADS);
  spinner.start();
  HandEyeSession session(nh, options.sources, &detail::shutdownRequested);
  std::cout
      << "view '" << options.sources.view << "': bring the arm to " << options.poses
      << " poses from which the camera sees it, turned about at least two axes, nearer and farther away, and let it "
         "stand for a second at each; Ctrl-C ends it with what there is"
      << std::endl;

  const auto end = [&](const HandEyeResult& found) {
    const HandEyePosesFile poses = posesOf(session, options.sources);
    if (!poses.poses.empty())
    {
      keepPoses(poses, options.keep, "calibrate_hand_eye");
    }
    return finish(poses, found, options);
  };
  HandEyeResult result;
  Clock::time_point reminded = Clock::now();
  std::string said;
  while (!detail::shutdownRequested())
  {
    if (session.update())
    {
      const int count = static_cast<int>(session.poses().size());
      std::cout << "pose " << count << " of " << options.poses << " taken; " << std::flush;
      if (count >= params.min_poses)
      {
        result = calibrateHandEye(session.view(), session.poses(), params);
        const int used = usedOf(result);
        if (result.found && used >= options.poses)
        {
          std::cout << "that is enough" << std::endl;
          return end(result);
        }
        if (used > 0 && !result.residuals.back().used)
        {
          std::cout << "it disagrees with the others (" << describe(result.residuals.back()) << "); ";
        }
        if (count >= options.poses + MOST_MORE)
        {
          std::cout << "it is of no use to go on" << std::endl;
          return end(result);
        }
      }
      std::cout << advice(session, params) << std::endl;
      reminded = Clock::now();
    }
    const std::string& hindrance = session.hindrance();
    if (!hindrance.empty() && (hindrance != said || Clock::now() > reminded + REMINDER) &&
        Clock::now() > reminded + std::chrono::seconds(1))
    {
      std::cout << hindrance << std::endl;
      said = hindrance;
      reminded = Clock::now();
    }
    std::this_thread::sleep_for(POLL);
  }
  result = calibrateHandEye(session.view(), session.poses(), params);
  return end(result);
}

std::optional<Options> readOptions(int argc, char** argv)
{
  Options options;
  CommandLine line(
      "Finds out where a camera is mounted on an arm's flange: somebody brings the arm to some poses from which\n"
      "homography_tracker follows a stored view of a plane.\n"
      "\n"
      "  rosrun view_servo calibrate_hand_eye --view NAME [OPTIONS]\n"
      "  rosrun view_servo calibrate_hand_eye --file FILE [OPTIONS]",
      "Example: rosrun view_servo calibrate_hand_eye --view shelf --base base_link --flange tool0 --camera /camera\n"
      "Exit status: 0 calibrated, 1 too little motion or poses that contradict one another, 2 cannot, with one line "
      "on\n"
      "standard error.");
  HandEyeSources& sources = options.sources;
  std::string views_dir;
  line.text("view", sources.view, "stored view of a textured plane, with a region that shows the plane only");
  line.text("base", sources.base_frame, "tf frame of the arm's base");
  line.text("flange", sources.flange_frame, "tf frame of what the camera is mounted on");
  line.text("camera", sources.camera, "namespace of camera_info");
  line.text("tracker", sources.tracker, "name of the node homography_tracker");
  line.text("views-dir", views_dir, "directory of the stored views; empty: $ROS_HOME/view_servo/views");
  line.number("poses", options.poses, { 8.0, 100.0 }, "poses that have to agree");
  line.number("distance", options.distance, { 0.01, 100.0 },
              "of the plane from the camera where the view was stored, measured square to the plane [m]; without, it "
              "follows from the arm's motion");
  line.text("file", options.file,
            "calibrates from what was recorded before: a file of --keep, or a bag (.bag) with tf, camera_info and the "
            "tracker's "
            "homographies, for which --view, --base, --flange, --camera and --tracker count");
  line.text("keep", options.keep, "file to write the poses to, for --file");
  line.text("out", options.out, "file to write");
  line.flag("overwrite", options.overwrite, "replace files that exist");
  std::vector<std::string> words;
  ros::removeROSArgs(argc, argv, words);
  std::vector<const char*> pointers;
  pointers.reserve(words.size());
  for (const std::string& word : words)
  {
    pointers.push_back(word.c_str());
  }
  const auto rest = line.parse(static_cast<int>(pointers.size()), pointers.data());
  if (!rest)
  {
    return std::nullopt;  // --help
  }
  if (!rest->empty())
  {
    throw std::runtime_error("'" + rest->front() + "' is not understood: see --help");
  }
  const bool poses_file = !options.file.empty() && std::filesystem::path(options.file).extension() != ".bag";
  if (sources.view.empty() && !poses_file)
  {
    throw std::runtime_error("say which stored view: --view NAME");
  }
  sources.views_dir = views_dir;
  refuseToReplace(options.out, "--out", options.overwrite);
  refuseToReplace(options.keep, "--keep", options.overwrite);
  return options;
}

}  // namespace
}  // namespace view_servo

int main(int argc, char** argv)
{
  using namespace view_servo;
  try
  {
    const std::optional<Options> options = readOptions(argc, argv);
    if (!options)
    {
      return DONE;
    }
    HandEyeParams params;
    params.distance = options->distance.value_or(params.distance);
    if (!options->file.empty())
    {
      return runOffline(*options, params);
    }
    ros::init(argc, argv, "calibrate_hand_eye", ros::init_options::NoSigintHandler | ros::init_options::AnonymousName);
    ros::console::set_logger_level(ROSCONSOLE_DEFAULT_NAME, ros::console::levels::Fatal);
    ros::console::notifyLoggerLevelsChanged();
    const ExitDeadline exit_deadline(&detail::shutdownRequested);
    return run(*options, params);
  }
  catch (const std::exception& error)
  {
    std::cerr << "calibrate_hand_eye: " << oneLine(error) << '\n';
    return CANNOT;
  }
}
