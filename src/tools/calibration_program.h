// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/calibration_files.h"
#include "tools/calibration_options.h"
#include "tools/hand_eye_bag.h"
#include "tools/hand_eye_session.h"
#include "tools/ros_program.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/control_node.h"
#include "view_servo/views/hand_eye_file.h"

#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <iostream>
#include <string>
#include <thread>

namespace view_servo
{
/** The exit status of a program that calibrates. */
enum CalibrationStatus
{
  CALIBRATED = 0,
  NOT_CALIBRATED = 1,    ///< the data do not allow it
  CANNOT_CALIBRATE = 2,  ///< bad input
};

/** Number of the poses that agree with a calibration. */
template <typename Result>
int usedOf(const Result& result)
{
  return static_cast<int>(std::count_if(result.residuals.begin(), result.residuals.end(),
                                        [](const auto& residual) { return residual.used; }));
}

/**
 * Says what came of a calibration, and then writes its file.
 * @param poses that it was computed from.
 * @return CALIBRATED or NOT_CALIBRATED. @throws std::runtime_error when the file cannot be written.
 */
template <typename Calibration>
CalibrationStatus finish(const Calibration& calibration, const HandEyePosesFile& poses,
                         const typename Calibration::Result& result)
{
  const int used = usedOf(result);
  for (std::size_t i = 0; i < result.residuals.size() && used > 0; ++i)
  {
    std::cout << "pose " << i + 1 << ": " << Calibration::describe(result.residuals[i])
              << Calibration::objection(result.residuals[i]) << '\n';
  }
  if (!result.found)
  {
    std::cout << std::flush;
    std::cerr << Calibration::NAME << ": not calibrated: " << result.message << std::endl;
    return NOT_CALIBRATED;
  }
  const Eigen::Isometry3d camera = Calibration::cameraOf(result);
  const std::string share = std::to_string(used) + " of " + std::to_string(result.residuals.size()) + " poses";
  HandEyeFile file;
  file.base_frame = poses.base_frame;
  file.flange_frame = poses.flange_frame;
  file.camera_frame = poses.camera_frame;
  file.camera_in_flange = camera;
  file.covariance = numbersOf(result.covariance);
  file.comment = std::string(Calibration::NAME) + ", " + dateAndTime() + ": view " + poses.view_name + ", " + share;
  const std::string& out = calibration.options.out;
  const std::string numbers = numbersOf(camera);
  std::cout << "errors: " << Calibration::describeErrors(result) << " (standard deviation "
            << fixed({ 1e3 * result.distance_sigma }, 1) << " mm)\n"
            << "'" << file.camera_frame << "' in '" << file.flange_frame << "' by " << share
            << ": x y z qx qy qz qw = " << numbers << '\n'
            << calibration.describePose(result) << std::flush;
  writeHandEyeFile(file, out);
  std::cout << "written to " << out << "; to publish it, one of\n"
            << "  roslaunch view_servo " << Calibration::LAUNCH_ARGUMENTS << out << '\n'
            << "  rosrun view_servo publish_hand_eye _file:=" << std::filesystem::absolute(out).string() << std::endl;
  return CALIBRATED;
}

/**
 * Takes poses, and says what to do next, until enough of them agree, it is of no use to go on, or the program is asked
 * to end. @return the calibration by all that were taken.
 */
template <typename Calibration>
typename Calibration::Result collectPoses(const Calibration& calibration, HandEyeSession& session)
{
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::milliseconds POLL{ 20 };
  constexpr std::chrono::seconds REMINDER{ 5 };
  constexpr std::chrono::seconds LULL{ 1 };  // before anything new is said
  constexpr int MOST_MORE = 8;               // poses beyond those asked for, before it is given up
  const int wanted = calibration.options.poses;
  Clock::time_point reminded = Clock::now();
  std::string said;
  while (!detail::shutdownRequested())
  {
    if (session.update())
    {
      const int count = static_cast<int>(session.poses().size());
      std::cout << "pose " << count << " of " << wanted << " taken; " << std::flush;
      if (count >= calibration.params.min_poses)
      {
        typename Calibration::Result result = calibration.calibrate(session.view(), session.poses());
        const int used = usedOf(result);
        if (result.found && used >= wanted)
        {
          std::cout << "that is enough" << std::endl;
          return result;
        }
        if (used > 0 && !Calibration::objection(result.residuals.back()).empty())
        {
          std::cout << "it disagrees with the others (" << Calibration::describe(result.residuals.back()) << "); ";
        }
        if (count >= wanted + MOST_MORE)
        {
          std::cout << "it is of no use to go on" << std::endl;
          return result;
        }
      }
      std::cout << calibration.advice(session) << std::endl;
      reminded = Clock::now();
    }
    const std::string& hindrance = session.hindrance();
    if (!hindrance.empty() && (hindrance != said || Clock::now() > reminded + REMINDER) &&
        Clock::now() > reminded + LULL)
    {
      std::cout << hindrance << std::endl;
      said = hindrance;
      reminded = Clock::now();
    }
    std::this_thread::sleep_for(POLL);
  }
  return calibration.calibrate(session.view(), session.poses());
}

/** By poses that were recorded before. */
template <typename Calibration>
CalibrationStatus calibrateFromFile(Calibration& calibration)
{
  const CalibrationOptions& options = calibration.options;
  const HandEyePosesFile poses =
      options.fileIsBag() ? readHandEyeBag(options.file, options.sources) : readHandEyePosesFile(options.file);
  std::cout << poses.poses.size() << " poses before view '" << poses.view_name << "' in " << options.file << std::endl;
  calibration.prepare(poses);
  keepPoses(poses, options.keep, Calibration::NAME);
  return finish(calibration, poses, calibration.calibrate(poses.view, poses.poses));
}

/**
 * By poses that somebody brings the robot to meanwhile.
 * @param exit_deadline does not count from the first pose on until all is written, however long that takes after Ctrl-C.
 */
template <typename Calibration>
CalibrationStatus calibrateAtRobot(Calibration& calibration, std::optional<ExitDeadline>& exit_deadline)
{
  const auto from_now_on = [] {
    return true;
  };
  const CalibrationOptions& options = calibration.options;
  requireMaster();
  const ros::NodeHandle nh;
  detail::deferShutdown();
  constexpr std::uint32_t THREADS = 1;
  ros::AsyncSpinner spinner(THREADS);
  spinner.start();
  exit_deadline.emplace(&detail::shutdownRequested, CANNOT_CALIBRATE);
  HandEyeSession session(nh, options.sources, &detail::shutdownRequested);
  calibration.prepare(session);
  std::cout << "view '" << options.sources.view << "': " << calibration.task() << "; Ctrl-C ends it with what there is"
            << std::endl;
  typename Calibration::Result result;
  std::exception_ptr fault;
  exit_deadline.reset();
  try
  {
    result = collectPoses(calibration, session);
  }
  catch (const std::exception&)
  {
    fault = std::current_exception();  // what has been taken is kept all the same
  }
  HandEyePosesFile poses = posesOf(session, options.sources);
  poses.camera_height = calibration.cameraHeight();
  if (!poses.poses.empty())
  {
    keepPoses(poses, options.keep, Calibration::NAME);
  }
  CalibrationStatus status = CANNOT_CALIBRATE;
  try
  {
    status = fault ? status : finish(calibration, poses, result);
  }
  catch (const std::exception&)
  {
    fault = std::current_exception();
  }
  exit_deadline.emplace(from_now_on, status);
  if (fault)
  {
    std::rethrow_exception(fault);
  }
  return status;
}

/**
 * main() of a program that calibrates where a camera is mounted.
 * @tparam Calibration has
 *  - NAME of the program; LAUNCH_ARGUMENTS, the words after "roslaunch view_servo" that are followed by the result's
 *    file;
 *  - options, with all of CalibrationOptions, and readOptions(argc, argv), false when --help was asked for;
 *  - prepare(HandEyePosesFile) and prepare(HandEyeSession), one of which is called first of all;
 *  - params, with min_poses, and calibrate(view, poses), which returns a Result; that has found, message, covariance,
 *    distance_sigma [m] and residuals with `used`, one a pose;
 *  - task(), what to do with the robot; advice(session), what to do next;
 *  - cameraHeight() above the base's frame [m], NaN when it is not known;
 *  - for people: describe(residual); objection(residual), why a pose was left out, or empty; describeErrors(result);
 *    describePose(result), whole lines; cameraOf(result), the camera in the frame that it is mounted on [m].
 */
template <typename Calibration>
int runCalibration(int argc, char** argv)
{
  std::optional<ExitDeadline> exit_deadline;
  try
  {
    Calibration calibration;
    if (!calibration.readOptions(argc, argv))
    {
      return CALIBRATED;  // --help
    }
    if (!calibration.options.file.empty())
    {
      return calibrateFromFile(calibration);
    }
    initQuietly(argc, argv, Calibration::NAME, ros::init_options::NoSigintHandler);
    return calibrateAtRobot(calibration, exit_deadline);
  }
  catch (const std::exception& error)
  {
    std::cerr << Calibration::NAME << ": " << oneLine(error) << '\n';
    return CANNOT_CALIBRATE;
  }
}

}  // namespace view_servo
