// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "rviz_panel/robot_light.h"

#include "view_servo/ros/control_node.h"

#include <diagnostic_msgs/DiagnosticStatus.h>

#include <cstddef>
#include <string>

namespace view_servo
{
namespace
{
constexpr double SILENT = 4.0;  // diagnostics come every second [s]

RobotLight judgeDriver(const DriverState& driver)
{
  RobotLight light;
  light.dry_run = driver.dry_run;
  const std::string reason = driver.status ? driver.status->reason : "";
  const auto say = [&](RobotLight::Colour colour, const std::string& state) {
    light.colour = colour;
    light.text = driver.kind + ": " + state + (reason.empty() || reason == state ? "" : ": " + reason);
    return light;
  };
  if (driver.silence > SILENT)
  {
    light.colour = RobotLight::RED;
    light.text = driver.kind + ": silent for " + std::to_string(static_cast<int>(driver.silence)) + " s";
    return light;
  }
  if (!driver.status)
  {
    return say(RobotLight::AMBER, "it has not said what it does");
  }
  if (driver.enabled && !*driver.enabled)
  {
    light.colour = RobotLight::AMBER;
    const std::size_t place = reason.find(LAST_GOAL);
    light.text = driver.kind + ": disabled, does not drive until Enable" +
                 (place == std::string::npos ? "" : reason.substr(place));
    return light;
  }
  const bool has_error = driver.level >= diagnostic_msgs::DiagnosticStatus::ERROR;
  const RobotLight::Colour moving = has_error ? RobotLight::RED : RobotLight::GREEN;
  switch (driver.status->state)
  {
    case ServoStatus::IDLE:
      return say(moving, "idle");
    case ServoStatus::ACQUIRING:
      return say(has_error ? RobotLight::RED : RobotLight::AMBER, "acquiring");
    case ServoStatus::SERVOING:
      return say(moving, "servoing");
    case ServoStatus::LOST:
      return say(has_error ? RobotLight::RED : RobotLight::AMBER, "lost");
    case ServoStatus::CONVERGED:
      return say(moving, "arrived");
    case ServoStatus::DISABLED:
      return say(has_error ? RobotLight::RED : RobotLight::AMBER, "disabled");
    default:
      return say(RobotLight::RED, "aborted");
  }
}

}  // namespace

RobotLight judgeRobot(const RobotSnapshot& robot)
{
  RobotLight worst;
  worst.text = "no driver";
  for (const DriverState& driver : robot.drivers)
  {
    // One that was there and has gone is silent.
    if (driver.is_there || driver.silence > 0.0)
    {
      const RobotLight light = judgeDriver(driver);
      worst = light.colour > worst.colour ? light : worst;
    }
  }
  worst.text += robot.followed.empty() ? "" : "; " + robot.followed;
  return worst;
}

}  // namespace view_servo
