// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/finding.h"
#include "check/motion.h"
#include "check_ros/commander.h"
#include "check_ros/robot_check.h"

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace view_servo::check
{
/** How far the robot is to move. */
struct DriveParams
{
  double distance = 0.1;             ///< length of each straight part [m], (0, 0.2]
  double angle = 10.0 * M_PI / 180;  ///< angle of each turn [rad], above 0, 15 degrees at most
};

/**
 * Moves the robot a little, there and back, and compares command, odometry (of an arm: tf) and images. Refuses while
 * there are errors that would make it meaningless or dangerous.
 */
class TestDrive
{
public:
  /** Says something to the user, and waits until he has done so; false: he does not want to go on. */
  using Prompt = std::function<bool(const std::string& text)>;

  /** @param given_up as in RobotCheck::wait(). `robot` must outlive the drive. */
  TestDrive(const RobotCheck& robot, const DriveParams& params, std::function<bool()> given_up);

  /**
   * Why the robot must not be moved; empty: it may. @param findings what RobotCheck found. @param by_hand whether
   * somebody moves it, without commands.
   */
  std::string refusal(const Findings& findings, bool by_hand) const;

  /** What drive() will do, in words, for the question whether it may. */
  std::string plan() const;

  /** The robot drives by itself. */
  Findings drive();

  /** The user moves the robot, and says after each part that he has. */
  Findings followHand(const Prompt& prompt);

private:
  struct Part
  {
    std::string name;
    std::string back;  ///< name of the same way back
    Twist way;         ///< translation [m] and rotation vector [rad], as Commander::drive() takes them
  };
  /** An image and where the robot was then. */
  struct Place
  {
    CameraFrame frame;
    std::optional<PlanarPose> base;           ///< of a base, in odometry's frame
    std::optional<Eigen::Isometry3d> camera;  ///< of an arm, in the frame that it stands in
  };

  std::vector<Part> parts() const;
  /** Waits for an image from now on and the pose at its stamp. @return why there is none, in one line. */
  std::string look(Place& place);
  /** Sets the pose at the stamp of a place's image. @return why it is not known yet, in one line. */
  std::string findPose(Place& place) const;
  Leg measure(const Place& before, const Place& after, const std::string& name, const Twist& way) const;
  static PlanarPose baseMotion(const Place& before, const Place& after);
  CameraMount mount(const CameraFrame& frame) const;
  SeenMotion see(const CameraFrame& before, const CameraFrame& after, const Motion& measured,
                 const PlanarPose& base) const;
  /** Why the robot has to stop; empty: it may move on. @param begin where it began. */
  std::string objection(const std::optional<PlanarPose>& begin);
  /** Drives one way and judges it. @return false when the drive cannot go on. */
  bool driveLeg(Commander& commander, Place& here, const std::string& name, const Twist& way, Findings& findings);
  /**
   * How far odometry's and the images' stamps are apart, by a turn in `trace_`. @param before the image when it began.
   */
  Finding judgeClocks(const CameraFrame& before) const;

  const RobotCheck& robot_;
  const DriveParams params_;
  const std::function<bool()> given_up_;
  std::vector<CameraFrame> trace_;  // images of the part that is driven
};

}  // namespace view_servo::check
