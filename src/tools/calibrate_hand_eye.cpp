// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/calibration_program.h"
#include "view_servo/geometry/hand_eye.h"
#include "view_servo/parameters/numbers.h"

#include <Eigen/Geometry>

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** Of a camera on an arm's flange: see runCalibration(). */
class HandEyeCalibration
{
public:
  using Result = HandEyeResult;
  static constexpr char NAME[] = "calibrate_hand_eye";
  static constexpr char LAUNCH_ARGUMENTS[] = "arm_servo.launch sim:=false hand_eye:=";

  HandEyeCalibration()
  {
    options.sources = { "", "", "base_link", "tool0", "camera", "homography_tracker" };
    options.poses = 12;
    options.out = "hand_eye.yaml";
  }

  bool readOptions(int argc, char** argv)
  {
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
    std::optional<double> distance;
    addSourceOptions(line, options);
    line.number("distance", distance, { 0.01, 100.0 },
                "of the plane from the camera where the view was stored, measured square to the plane [m]; without, it "
                "follows from the arm's motion");
    line.flag("focal-length", params.finds_focal_length,
              "Find out, too, by which factor camera_info has the focal lengths wrong; wants more motion");
    addFileOptions(line, options);
    if (!readCalibrationOptions(line, argc, argv, options))
    {
      return false;
    }
    params.distance = distance.value_or(params.distance);
    return true;
  }

  void prepare(const HandEyePosesFile& /*poses*/)
  {
  }
  void prepare(const HandEyeSession& /*session*/)
  {
  }

  Result calibrate(const HandEyeView& view, const std::vector<HandEyePose>& poses) const
  {
    return calibrateHandEye(view, poses, params);
  }

  std::string task() const
  {
    return "bring the arm to " + std::to_string(options.poses) +
           " poses from which the camera sees it, turned about at least two axes, nearer and farther away, and let it "
           "stand for a second at each";
  }

  std::string advice(const HandEyeSession& session) const
  {
    HandEyeMotion motion = handEyeMotion(session.view(), session.poses());
    motion.poses = std::numeric_limits<int>::max();  // that more are needed is said anyway
    const std::vector<std::string> missing = missingMotion(motion, params);
    return session.poses().size() > 1 && !missing.empty()
               ? missing.front()
               : "move the arm to another pose, with the view in the picture, and let it stand for a second";
  }

  static double cameraHeight()
  {
    return NOT_A_NUMBER;
  }

  static std::string describe(const HandEyeResidual& residual)
  {
    return fixed({ residual.pixels }, 2) + " px, " + fixed({ 1e3 * residual.translation }, 2) + " mm, " +
           fixed({ DEGREES * residual.rotation }, 3) + " degrees";
  }
  static std::string objection(const HandEyeResidual& residual)
  {
    return residual.used ? "" : ": disagrees with the others, left out";
  }

  static std::string describeErrors(const Result& result)
  {
    return "images " + fixed({ result.image_error }, 2) + " px, arm " + fixed({ 1e3 * result.translation_error }, 2) +
           " mm and " + fixed({ DEGREES * result.rotation_error }, 3) + " degrees; the plane was " +
           fixed({ result.distance }, 4) + " m from the view's camera";
  }

  std::string describePose(const Result& result) const
  {
    const std::string focal_length =
        params.finds_focal_length ? "focal lengths: " + fixed({ result.focal_scale }, 4) +
                                        " times those of camera_info (standard deviation " +
                                        fixed({ result.focal_sigma }, 4) + "); correct the camera's calibration by it\n"
                                  : "";
    return "standard deviation, along the least certain direction: " + fixed({ 1e3 * result.translationSigma() }, 2) +
           " mm, " + fixed({ DEGREES * result.rotationSigma() }, 3) + " degrees\n" + focal_length;
  }

  static Eigen::Isometry3d cameraOf(const Result& result)
  {
    return result.camera_in_flange;
  }

  CalibrationOptions options;
  HandEyeParams params;
};

}  // namespace
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::runCalibration<view_servo::HandEyeCalibration>(argc, argv);
}
