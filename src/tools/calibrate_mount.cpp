// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/calibration_files.h"
#include "tools/command_line.h"
#include "tools/hand_eye_bag.h"
#include "tools/hand_eye_session.h"
#include "view_servo/geometry/mount_calibration.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/views/hand_eye_file.h"

#include <ros/console.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/spinner.h>

#include <algorithm>
#include <chrono>
#include <cmath>
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
  HandEyeSources sources{ "", "", "odom", "base_link", "camera", "homography_tracker", true };
  int poses = 16;
  std::optional<double> height;  // of the camera above the base's frame [m]
  bool floor = false;            // the view shows the floor
  std::string file;              // with what was recorded before; empty: the base is there
  std::string keep;              // file for the poses; empty: none
  std::string out = "mount.yaml";
  bool overwrite = false;
};

int usedOf(const MountResult& result)
{
  return static_cast<int>(std::count_if(result.residuals.begin(), result.residuals.end(),
                                        [](const MountResidual& residual) { return residual.used; }));
}

std::string describe(const MountResidual& residual)
{
  return fixed({ residual.pixels }, 2) + " px; odometry since the last one: " + fixed({ 1e3 * residual.way }, 1) +
         " mm, " + fixed({ DEGREES * residual.turn }, 2) + " degrees";
}

/** What to do next. */
std::string advice(const HandEyeSession& session, const MountParams& params)
{
  constexpr double DRIVEN = 0.05;  // a way, and no turn on the spot [m]
  const std::vector<HandEyePose>& poses = session.poses();
  MountMotion motion = mountMotion(session.view(), poses);
  motion.poses = std::numeric_limits<int>::max();  // that more are needed is said anyway
  const std::vector<std::string> missing = missingMotion(motion, params);
  if (poses.size() > 3 && !missing.empty())
  {
    return missing.front();
  }
  const bool driven =
      poses.size() > 1 &&
      (poses[poses.size() - 2].flange_in_base.inverse() * poses.back().flange_in_base).translation().norm() > DRIVEN;
  return std::string(driven ? "turn the base on the spot" : "drive the base straight ahead or back") +
         ", with the view in the picture, and let it stand for a second";
}

/** Tells the parameters how high the camera is, and people where that comes from. @param by_tf NaN: tf does not know. */
void setHeight(const Options& options, double by_tf, const HandEyePosesFile& frames, MountParams& params)
{
  params.sees_floor = options.floor;
  if (options.floor)
  {
    std::cout << "the view shows the floor: the camera's height follows from the calibration" << std::endl;
  }
  else if (options.height)
  {
    params.height = *options.height;
  }
  else if (!std::isnan(by_tf))
  {
    params.height = by_tf;
    std::cout << "the height of '" << frames.camera_frame << "' above '" << frames.flange_frame << "', "
              << fixed({ by_tf }, 4) << " m, is kept as tf has it; --height METRES tells another one" << std::endl;
  }
  else
  {
    throw std::runtime_error(
        "how high '" + frames.camera_frame + "' is above '" + frames.flange_frame +
        "' does not show while a base drives on a floor, and tf does not know it: measure it, and say "
        "--height METRES, or --floor when the view shows the floor");
  }
}

/** Says what came of it, and writes the file. @param by_tf the camera on the base. @return the exit status. */
int finish(const HandEyePosesFile& poses, const MountResult& result, const Options& options,
           const std::optional<Eigen::Isometry3d>& by_tf = std::nullopt)
{
  for (std::size_t i = 0; i < result.residuals.size() && usedOf(result) > 0; ++i)
  {
    const MountResidual& residual = result.residuals[i];
    std::cout << "pose " << i + 1 << ": " << describe(residual)
              << (residual.used ? "" : ": disagrees with the others, left out")
              << (residual.odometry_used ? "" : ": odometry disagrees with the images, left out") << '\n';
  }
  if (!result.found)
  {
    std::cout << std::flush;
    std::cerr << "calibrate_mount: not calibrated: " << result.message << std::endl;
    return NOT_DONE;
  }
  HandEyeFile file;
  file.base_frame = poses.base_frame;
  file.flange_frame = poses.flange_frame;
  file.camera_frame = poses.camera_frame;
  file.camera_in_flange = result.camera_in_base;
  file.covariance = numbersOf(result.covariance);
  file.comment = "calibrate_mount, " + dateAndTime() + ": view " + poses.view_name + ", " +
                 std::to_string(usedOf(result)) + " of " + std::to_string(result.residuals.size()) + " poses";
  writeHandEyeFile(file, options.out);

  const std::string numbers = numbersOf(result.camera_in_base);
  const Eigen::Vector3d ahead = result.camera_in_base.linear().col(2);
  const Eigen::Vector3d right = result.camera_in_base.linear().col(0);
  std::cout << "errors: images " << fixed({ result.image_error }, 2) << " px, odometry "
            << fixed({ 1e2 * result.way_error }, 1) << " % of a way and " << fixed({ 1e2 * result.turn_error }, 1)
            << " % of a turn; the plane was " << fixed({ result.distance }, 3)
            << " m from the view's camera (standard deviation " << fixed({ 1e3 * result.distance_sigma }, 1) << " mm)\n"
            << "'" << file.camera_frame << "' in '" << file.flange_frame << "' by " << usedOf(result) << " of "
            << result.residuals.size() << " poses: x y z qx qy qz qw = " << numbers << '\n'
            << "its axis points " << fixed({ DEGREES * std::atan2(ahead.y(), ahead.x()) }, 2)
            << " degrees to the left and " << fixed({ -DEGREES * std::asin(std::clamp(ahead.z(), -1.0, 1.0)) }, 2)
            << " degrees down; its right side is "
            << fixed({ -DEGREES * std::asin(std::clamp(right.z(), -1.0, 1.0)) }, 2)
            << " degrees lower than its left one\n"
            << "standard deviation: " << fixed({ 1e3 * result.translationSigma() }, 2)
            << " mm on the floor, along the least certain direction, " << fixed({ 1e3 * result.heightSigma() }, 1)
            << " mm in height, " << fixed({ DEGREES * result.rotationSigma() }, 3) << " degrees\n";
  if (by_tf)
  {
    const Eigen::Isometry3d off = by_tf->inverse() * result.camera_in_base;
    std::cout << "tf has it " << fixed({ 1e3 * off.translation().norm() }, 1) << " mm and "
              << fixed({ DEGREES * rotationVector(off.linear()).norm() }, 2)
              << " degrees from there: stop what publishes that before the file is published\n";
  }
  std::cout << "written to " << options.out << "; to publish it, one of\n"
            << "  roslaunch view_servo homing.launch sim:=false mount:=" << options.out << '\n'
            << "  rosrun tf2_ros static_transform_publisher " << numbers << ' ' << file.flange_frame << ' '
            << file.camera_frame << std::endl;
  return DONE;
}

/** Of what was recorded before. @return the exit status. */
int runOffline(const Options& options)
{
  const bool bag = std::filesystem::path(options.file).extension() == ".bag";
  const HandEyePosesFile poses =
      bag ? readHandEyeBag(options.file, options.sources) : readHandEyePosesFile(options.file);
  std::cout << poses.poses.size() << " poses before view '" << poses.view_name << "' in " << options.file << std::endl;
  MountParams params;
  setHeight(options, poses.camera_height, poses, params);
  keepPoses(poses, options.keep, "calibrate_mount");
  return finish(poses, calibrateMount(poses.view, poses.poses, params), options);
}

/** Where tf has the camera on the base; waits a little for it when nothing else tells the height. */
std::optional<Eigen::Isometry3d> cameraByTf(const HandEyeSession& session, bool needed)
{
  constexpr std::chrono::milliseconds POLL{ 20 };
  const Clock::time_point end = Clock::now() + std::chrono::seconds(needed ? 3 : 1);
  std::optional<Eigen::Isometry3d> camera = session.cameraByTf();
  while (!camera && Clock::now() < end && !detail::shutdownRequested())
  {
    std::this_thread::sleep_for(POLL);
    camera = session.cameraByTf();
  }
  return camera;
}

int run(const Options& options)
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
  const std::optional<Eigen::Isometry3d> by_tf = cameraByTf(session, !options.height && !options.floor);
  const auto collected = [&] {
    HandEyePosesFile poses = posesOf(session, options.sources);
    poses.camera_height = by_tf ? by_tf->translation().z() : NOT_A_NUMBER;
    return poses;
  };
  MountParams params;
  setHeight(options, collected().camera_height, collected(), params);
  std::cout << "view '" << options.sources.view << "': drive the base to " << options.poses
            << " poses from which the camera sees it: turn it on the spot, drive straight ahead or back, turn it "
               "again, and let "
               "it stand for a second after each; Ctrl-C ends it with what there is"
            << std::endl;

  const auto end = [&](const MountResult& found) {
    const HandEyePosesFile poses = collected();
    if (!poses.poses.empty())
    {
      keepPoses(poses, options.keep, "calibrate_mount");
    }
    return finish(poses, found, options, by_tf);
  };
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
        const MountResult result = calibrateMount(session.view(), session.poses(), params);
        const int used = usedOf(result);
        if (result.found && used >= options.poses)
        {
          std::cout << "that is enough" << std::endl;
          return end(result);
        }
        if (used > 0 && (!result.residuals.back().used || !result.residuals.back().odometry_used))
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
  return end(calibrateMount(session.view(), session.poses(), params));
}

std::optional<Options> readOptions(int argc, char** argv)
{
  Options options;
  CommandLine line(
      "Finds out where a camera is mounted on a mobile base: somebody drives and turns the base before a stored view "
      "of a\n"
      "plane that homography_tracker follows. Nothing is moved by this program.\n"
      "\n"
      "  rosrun view_servo calibrate_mount --view NAME [OPTIONS]\n"
      "  rosrun view_servo calibrate_mount --file FILE [OPTIONS]",
      "Example: rosrun view_servo calibrate_mount --view poster --base base_link --camera /camera --height 0.42\n"
      "Exit status: 0 calibrated, 1 too little motion or poses that contradict one another, 2 cannot, with one line "
      "on\n"
      "standard error.");
  HandEyeSources& sources = options.sources;
  std::string views_dir;
  line.text("view", sources.view, "stored view of a textured plane, with a region that shows the plane only");
  line.text("odom-frame", sources.base_frame, "tf frame of odometry");
  line.text("base", sources.flange_frame, "tf frame of the base");
  line.text("camera", sources.camera, "namespace of camera_info");
  line.text("tracker", sources.tracker, "name of the node homography_tracker");
  line.text("views-dir", views_dir, "directory of the stored views; empty: $ROS_HOME/view_servo/views");
  line.number("poses", options.poses, { 8.0, 100.0 }, "poses that have to agree");
  line.number("height", options.height, { -10.0, 10.0 },
              "of the camera's lens above the base's frame, as measured [m]; without, it is kept as tf has it");
  line.flag("floor", options.floor, "the view shows the floor that the base drives on, which tells the height");
  line.text("file", options.file,
            "calibrates from what was recorded before: a file of --keep, or a bag (.bag) with tf, camera_info and the "
            "tracker's homographies, for which --view, --odom-frame, --base, --camera and --tracker count");
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
  if (options.floor && options.height)
  {
    throw std::runtime_error("say --height or --floor, not both");
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
    if (!options->file.empty())
    {
      return runOffline(*options);
    }
    ros::init(argc, argv, "calibrate_mount", ros::init_options::NoSigintHandler | ros::init_options::AnonymousName);
    ros::console::set_logger_level(ROSCONSOLE_DEFAULT_NAME, ros::console::levels::Fatal);
    ros::console::notifyLoggerLevelsChanged();
    const ExitDeadline exit_deadline(&detail::shutdownRequested);
    return run(*options);
  }
  catch (const std::exception& error)
  {
    std::cerr << "calibrate_mount: " << oneLine(error) << '\n';
    return CANNOT;
  }
}
