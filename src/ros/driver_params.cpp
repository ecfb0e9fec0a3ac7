// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/driver_params.h"

#include "view_servo/parameters/faults.h"
#include "view_servo/ros/image_source.h"

#include <algorithm>
#include <set>

namespace view_servo
{
namespace
{
/** The parameters of the driver of a base that none of its parts has. */
std::vector<Parameter> rowsOfHomingDriver(HomingDriverParams& params)
{
  return {
    viewParameter(params.view,
                  "stored view whose direction is estimated whenever no goal is active, and to which the base drives "
                  "when a goal's "
                  "view is empty; empty: nothing is estimated, and such a goal is refused"),
    viewsDirParameter(params.views_dir),
    text("base_frame", params.base_frame,
         "the base's frame: that of commands, and the child frame of odometry; tf must know where the camera is in it"),
    real("image_timeout", params.image_timeout, "s", "> 0", "the base stands when no image has come for so long"),
    real("odometry_timeout", params.odometry_timeout, "s", "> 0",
         "the base stands when no odometry has come for so long"),
    real("odometry_delay", params.odometry_delay, "s", "[-2, 2]",
         "how much later than images of the same moment odometry is stamped: it is taken away from odometry's stamps"),
    real("match_timeout", params.match_timeout, "s", "> 0",
         "while the view's points are not tracked, the base stands when neither kind of matches has come for so long, "
         "or "
         "for three times their usual period where this is longer"),
  };
}

}  // namespace

std::vector<Parameter> parameters(DriverParams& params)
{
  return {
    boolean("dry_run", params.dry_run, "publish commands on cmd_vel_dry instead of cmd_vel, whether enabled or not"),
    real("timeout", params.timeout, "s", "> 0", "time limit of a goal that brings none"),
    real("control_rate", params.control_rate, "Hz", "[10, 1000]", "rate of commands"),
    real("start_patience", params.start_patience, "s", "> 0",
         "how long a goal waits, before it begins, for what it needs: images, their calibration, tf, an answer of a "
         "matcher or "
         "tracker, and somebody who listens to the commands"),
  };
}

std::vector<Parameter> parameters(HomingDriverParams& params)
{
  return joined({
      rowsOfHomingDriver(params),
      parameters(params.node),
      parameters(params.camera),
      parameters(params.homing),
      parameters(params.limits),
  });
}

std::vector<std::string> HomingDriverParams::validate() const
{
  HomingDriverParams copy = *this;
  Faults faults;
  faults.add(viewFaults(view));
  faults.require(!base_frame.empty(), "base_frame must not be empty");
  faults.add(faultsOf(rowsOfHomingDriver(copy)));
  faults.add(faultsOf(node));
  faults.add(faultsOf(camera));
  faults.add(homing.validate());
  faults.add(limits.validate());
  return faults.list();
}

std::vector<Parameter> homingParameters(RouteFollowerParams& params)
{
  const std::set<std::string> others = { "view", "mode", "step", "near_step", "step_speed" };
  std::vector<Parameter> rows = parameters(static_cast<HomingDriverParams&>(params));
  rows.erase(std::remove_if(rows.begin(), rows.end(), [&](const Parameter& row) { return others.count(row.name) > 0; }),
             rows.end());
  return rows;
}

std::vector<Parameter> parameters(RouteFollowerParams& params)
{
  return joined({ parameters(params.guide), homingParameters(params) });
}

std::vector<std::string> RouteFollowerParams::validate() const
{
  RouteGuideParams copy = guide;
  Faults faults;
  faults.add(faultsOf(parameters(copy)));
  faults.add(HomingDriverParams::validate());
  return faults.list();
}

std::vector<Parameter> parameters(ServoDriverParams& params)
{
  return joined({
      {
          viewsDirParameter(params.views_dir),
          real("acquire_timeout", params.acquire_timeout, "s", "> 0",
               "a goal whose view is not found at all ends after this time"),
          real("homography_timeout", params.homography_timeout, "s", "> 0",
               "the camera stands when no homography has come for so long"),
          real("max_homography_age", params.max_homography_age, "s", "> 0",
               "a homography of an image older than this counts as none"),
          real("joint_margin", params.joint_margin, "rad or m", ">= 0",
               "a joint nearer to its limit of robot_description than this, and not on its way back, ends a goal"),
          real("joint_timeout", params.joint_timeout, "s", "> 0",
               "the camera stands when joint_states, once they have come, cease for so long"),
      },
      parameters(params.node),
      parameters(params.servo),
      parameters(params.limits),
  });
}

std::vector<std::string> ServoDriverParams::validate() const
{
  return faultsOf(*this);
}

}  // namespace view_servo
