// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/calibration_program.h"
#include "view_servo/geometry/mount_calibration.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/readiness.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** Of a camera on a mobile base: see runCalibration(). */
class MountCalibration
{
public:
  using Result = MountResult;
  static constexpr char NAME[] = "calibrate_mount";
  static constexpr char LAUNCH_ARGUMENTS[] = "homing.launch sim:=false mount:=";

  MountCalibration()
  {
    options.sources = { "", "", "odom", "base_link", "camera", "homography_tracker", true };
    options.poses = 16;
    options.out = "mount.yaml";
  }

  bool readOptions(int argc, char** argv)
  {
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
    addSourceOptions(line, options);
    line.number("height", height_, { -10.0, 10.0 },
                "of the camera's lens above the base's frame, as measured [m]; without, it is kept as tf has it");
    line.flag("floor", params.sees_floor, "the view shows the floor that the base drives on, which tells the height");
    addFileOptions(line, options);
    if (!readCalibrationOptions(line, argc, argv, options))
    {
      return false;
    }
    if (params.sees_floor && height_)
    {
      throw std::runtime_error("say --height or --floor, not both");
    }
    return true;
  }

  void prepare(const HandEyePosesFile& poses)
  {
    setHeight(poses.camera_height, poses.camera_frame, poses.flange_frame);
  }

  void prepare(const HandEyeSession& session)
  {
    const bool needed = !height_ && !params.sees_floor;
    const double patience = needed ? 3.0 : 1.0;  // [s]
    waitUntilReady(
        patience,
        [&] {
          by_tf_ = session.cameraByTf();
          return by_tf_ ? "" : "tf's pose of the camera";
        },
        &detail::shutdownRequested);
    setHeight(cameraHeight(), session.cameraFrame(), options.sources.flange_frame);
  }

  Result calibrate(const HandEyeView& view, const std::vector<HandEyePose>& poses) const
  {
    return calibrateMount(view, poses, params);
  }

  std::string task() const
  {
    return "drive the base to " + std::to_string(options.poses) +
           " poses from which the camera sees it: turn it on the spot, drive straight ahead or back, turn it again, "
           "and let it stand for a second after each";
  }

  std::string advice(const HandEyeSession& session) const
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

  double cameraHeight() const
  {
    return by_tf_ ? by_tf_->translation().z() : NOT_A_NUMBER;
  }

  static std::string describe(const MountResidual& residual)
  {
    return fixed({ residual.pixels }, 2) + " px; odometry since the last one: " + fixed({ 1e3 * residual.way }, 1) +
           " mm, " + fixed({ DEGREES * residual.turn }, 2) + " degrees";
  }
  static std::string objection(const MountResidual& residual)
  {
    return std::string(residual.used ? "" : ": disagrees with the others, left out") +
           (residual.odometry_used ? "" : ": odometry disagrees with the images, left out");
  }

  static std::string describeErrors(const Result& result)
  {
    return "images " + fixed({ result.image_error }, 2) + " px, odometry " + fixed({ 1e2 * result.way_error }, 1) +
           " % of a way and " + fixed({ 1e2 * result.turn_error }, 1) + " % of a turn; the plane was " +
           fixed({ result.distance }, 3) + " m from the view's camera";
  }

  std::string describePose(const Result& result) const
  {
    const auto down = [](const Eigen::Vector3d& axis) {
      return fixed({ -DEGREES * std::asin(std::clamp(axis.z(), -1.0, 1.0)) }, 2);
    };
    const Eigen::Vector3d ahead = result.camera_in_base.linear().col(2);
    const Eigen::Vector3d right = result.camera_in_base.linear().col(0);
    std::string text =
        "its axis points " + fixed({ DEGREES * std::atan2(ahead.y(), ahead.x()) }, 2) + " degrees to the left and " +
        down(ahead) + " degrees down; its right side is " + down(right) +
        " degrees lower than its left one\nstandard deviation: " + fixed({ 1e3 * result.translationSigma() }, 2) +
        " mm on the floor, along the least certain direction, " + fixed({ 1e3 * result.heightSigma() }, 1) +
        " mm in height, " + fixed({ DEGREES * result.rotationSigma() }, 3) + " degrees\n";
    if (by_tf_)
    {
      const Eigen::Isometry3d off = by_tf_->inverse() * result.camera_in_base;
      text += "tf has it " + fixed({ 1e3 * off.translation().norm() }, 1) + " mm and " +
              fixed({ DEGREES * rotationVector(off.linear()).norm() }, 2) +
              " degrees from there: stop what publishes that before the file is published\n";
    }
    return text;
  }

  static Eigen::Isometry3d cameraOf(const Result& result)
  {
    return result.camera_in_base;
  }

  CalibrationOptions options;
  MountParams params;

private:
  /** Says where the camera's height comes from, unless it was given. @param by_tf [m]; NaN: tf does not know it. */
  void setHeight(double by_tf, const std::string& camera_frame, const std::string& base_frame)
  {
    if (params.sees_floor)
    {
      std::cout << "the view shows the floor: the camera's height follows from the calibration" << std::endl;
    }
    else if (height_)
    {
      params.height = *height_;
    }
    else if (!std::isnan(by_tf))
    {
      params.height = by_tf;
      std::cout << "the height of '" << camera_frame << "' above '" << base_frame << "', " << fixed({ by_tf }, 4)
                << " m, is kept as tf has it; --height METRES tells another one" << std::endl;
    }
    else
    {
      throw std::runtime_error(
          "how high '" + camera_frame + "' is above '" + base_frame +
          "' does not show while a base drives on a floor, and tf does not know it: measure it, and say "
          "--height METRES, or --floor when the view shows the floor");
    }
  }

  std::optional<double> height_;            // of the camera above the base's frame, as somebody measured it [m]
  std::optional<Eigen::Isometry3d> by_tf_;  // the camera on the base, as tf has it [m]
};

}  // namespace
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::runCalibration<view_servo::MountCalibration>(argc, argv);
}
