// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check_ros/test_drive.h"

#include "check/judgements.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/join.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/readiness.h"
#include "view_servo/ros/ros_graph.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

namespace view_servo::check
{
namespace
{
Twist along(int axis, double amount)
{
  Twist way = Twist::Zero();
  way[axis] = amount;
  return way;
}

cv::Mat greyOf(const CameraFrame& frame)
{
  return toGrey(*frame.image);
}

}  // namespace

TestDrive::TestDrive(const RobotCheck& robot, const DriveParams& params, std::function<bool()> given_up)
  : robot_(robot), params_(params), given_up_(std::move(given_up))
{
}

std::vector<TestDrive::Part> TestDrive::parts() const
{
  constexpr int X = 0;
  constexpr int Y = 1;
  constexpr int ABOUT_Z = 5;
  const double d = params_.distance;
  const double a = params_.angle;
  if (robot_.setup().is_arm)
  {
    return { { "right", "left", along(X, d) },
             { "down", "up", along(Y, d) },
             { "roll", "roll back", along(ABOUT_Z, a) } };
  }
  std::vector<Part> parts = { { "forward", "back", along(X, d) } };
  if (robot_.setup().slides)
  {
    parts.push_back({ "left", "right", along(Y, d) });
  }
  parts.push_back({ "turn left", "turn right", along(ABOUT_Z, a) });
  return parts;
}

std::string TestDrive::plan() const
{
  const std::string far = number(100.0 * params_.distance, 0) + " cm";
  const std::string turn = number(params_.angle / DEGREE, 0) + " degrees";
  if (robot_.setup().is_arm)
  {
    return "the camera moves " + far + " to its right and back, " + far + " down and back, and rolls by " + turn +
           " and back";
  }
  return "the base drives " + far + " ahead and back, " +
         (robot_.setup().slides ? far + " to the left and back, " : "") + "and turns by " + turn +
         " to the left and back";
}

std::string TestDrive::refusal(const Findings& findings, bool by_hand) const
{
  std::vector<std::string> in_the_way;
  for (const Finding& finding : findings)
  {
    const bool matters = finding.name != "views' disk" && !(by_hand && finding.name == "commands");
    if (finding.level == Level::ERROR && matters)
    {
      in_the_way.push_back(finding.name);
    }
  }
  if (!in_the_way.empty())
  {
    return "there are errors: " + join(in_the_way, ", ");
  }
  if (by_hand)
  {
    return "";
  }
  if (robot_.setup().dry_run)
  {
    return "dry_run:=true was asked for";
  }
  if (robot_.setup().is_arm && robot_.setup().fixedFrame().empty())
  {
    return "how far the camera moves is known by tf only: say odom_frame:= as the frame that the arm stands in";
  }
  std::vector<std::string> topics = { robot_.setup().commandTopic() };
  if (!robot_.setup().is_arm)
  {
    topics.emplace_back(STAMPED_COMMANDS);
  }
  for (const std::string& name : topics)
  {
    const std::string topic = robot_.nodeHandle().resolveName(name);
    const std::vector<std::string> others = RosGraph().publishers(topic);
    if (!others.empty())
    {
      return join(others, ", ") + " publishes on '" + topic + "', too: stop it first";
    }
  }
  return "";
}

// ----------------------------------------------------------------------------------------------------- measurement

std::string TestDrive::look(Place& place)
{
  constexpr double SETTLED = 0.3;   // more than images take to come [s]
  constexpr double PATIENCE = 4.0;  // [s]
  RobotCheck::wait(SETTLED, given_up_);
  const std::optional<CameraFrame> before = robot_.camera().frame();
  std::optional<CameraFrame> frame;  // the first from now on: what belongs to later ones may always be late
  return waitUntilReady(
      PATIENCE,
      [&]() -> std::string {
        const std::optional<CameraFrame> newest = robot_.camera().frame();
        if (!frame && newest && !(before && newest->image == before->image))
        {
          frame = newest;
          place.frame = *newest;
        }
        return frame ? findPose(place) : "no further image has come on '" + robot_.camera().topics().image + "'";
      },
      given_up_);
}

std::string TestDrive::findPose(Place& place) const
{
  const std_msgs::Header& header = place.frame.image->header;
  if (robot_.odometry() != nullptr)
  {
    place.base = robot_.odometry()->at(header.stamp.toSec());
    return place.base ? "" : "no odometry has come that belongs to the newest image";
  }
  const std::string fixed_frame = robot_.setup().fixedFrame();
  std::string missing = robot_.transforms().missing(fixed_frame, header.frame_id, header.stamp);
  if (missing.empty())
  {
    place.camera = toIsometry(robot_.transforms().lookUp(fixed_frame, header.frame_id, header.stamp, 0.0).transform);
  }
  return missing;
}

PlanarPose TestDrive::baseMotion(const Place& before, const Place& after)
{
  return before.base && after.base ? compose(inverse(*before.base), *after.base) : PlanarPose();
}

CameraMount TestDrive::mount(const CameraFrame& frame) const
{
  return CameraMount(
      toIsometry(robot_.transforms()
                     .lookUp(robot_.setup().fixedFrame(), frame.image->header.frame_id, ros::Time(0), 0.0)
                     .transform));
}

SeenMotion TestDrive::see(const CameraFrame& before, const CameraFrame& after, const Motion& measured,
                          const PlanarPose& base) const
{
  const ImagePair images{ greyOf(before), greyOf(after), toCamera(*after.info) };
  return robot_.setup().is_arm ? seenByHand(images, measured) : seenByBase(images, mount(after), base);
}

Leg TestDrive::measure(const Place& before, const Place& after, const std::string& name, const Twist& way) const
{
  Leg leg;
  leg.name = name;
  leg.turns = way.head<3>().isZero();
  leg.asked = { way.head<3>(), way.tail<3>() };
  leg.measured_by = robot_.setup().is_arm ? "tf" : "odometry";
  const PlanarPose base = baseMotion(before, after);
  leg.measured = before.camera && after.camera ? toMotion(before.camera->inverse() * *after.camera) : toMotion(base);
  leg.seen = see(before.frame, after.frame, leg.measured, base);
  return leg;
}

Finding TestDrive::judgeClocks(const CameraFrame& before) const
{
  constexpr std::size_t MOST = 24;  // images that are matched, for the time's sake
  const std::string name = "move clocks";
  const CameraMount camera_mount = mount(before);
  ClockOffset clocks = robot_.odometry()->clocks();
  const std::size_t count = std::min(trace_.size(), MOST);
  for (std::size_t i = 0; i < count && !given_up_(); ++i)
  {
    const CameraFrame& frame = trace_[i * trace_.size() / count];
    const ImagePair images{ greyOf(before), greyOf(frame), toCamera(*before.info) };
    const SeenMotion seen = seenByBase(images, camera_mount, PlanarPose());
    // Where the picture has hardly changed the base has not turned yet, or is back.
    clocks.addImage(frame.image->header.stamp.toSec(), seen.motion ? -seen.motion->rotation.z() : 0.0);
  }
  const std::optional<double> offset = clocks.estimate();
  if (trace_.size() < ClockOffset::FEWEST_IMAGES)
  {
    return warning(
        name,
        "only " + std::to_string(trace_.size()) +
            " images came during the turns: too few to tell how far the stamps of odometry and images are apart",
        "try a larger --angle, and see the rate of images above");
  }
  if (!offset)
  {
    return warning(name, "the turn was too short to tell how far the stamps of odometry and images are apart",
                   "try a larger --angle");
  }
  const std::string advice = robot_.odometry()->adviceOn(*offset);
  return advice.empty()
             ? ok(name, "odometry's stamps are " + shortTime(std::abs(*offset)) +
                            (*offset > 0.0 ? " later" : " earlier") + " than those of images of the same moment")
             : warning(name, advice, "as it says: ~odometry_delay is a parameter of homing");
}

// ----------------------------------------------------------------------------------------------------------- moves

std::string TestDrive::objection(const std::optional<PlanarPose>& begin)
{
  constexpr double STALE = 1.0;  // without images or odometry the robot stops [s]
  const std::optional<CameraFrame> frame = robot_.camera().frame();
  if (frame && (trace_.empty() || frame->image != trace_.back().image))
  {
    trace_.push_back(*frame);
  }
  if (given_up_())
  {
    return "it was interrupted";
  }
  if (robot_.camera().silence() > STALE)
  {
    return "no image for " + shortTime(STALE) + " on '" + robot_.camera().topics().image + "'";
  }
  if (robot_.odometry() == nullptr)
  {
    return "";
  }
  if (robot_.odometry()->silence() > STALE)
  {
    return "no odometry for " + shortTime(STALE);
  }
  const std::optional<PlanarPose> now = robot_.odometry()->newest();
  const PlanarPose moved = begin && now ? compose(inverse(*begin), *now) : PlanarPose();
  const bool too_far = moved.distance() > 2.0 * params_.distance || std::abs(moved.yaw) > 2.0 * params_.angle;
  return too_far ? "by odometry it moved twice as far as it should" : "";
}

bool TestDrive::driveLeg(Commander& commander, Place& here, const std::string& name, const Twist& way,
                         Findings& findings)
{
  const std::string remedy = "find out why, then begin anew";
  const std::string fault = commander.drive(way, [&] { return objection(here.base); });
  if (!fault.empty())
  {
    findings.push_back(error("move " + name, "stopped: " + fault, remedy));
    return false;
  }
  Place there;
  const std::string lacking = look(there);
  if (!lacking.empty() || given_up_())
  {
    findings.push_back(error("move " + name, "stopped: " + (lacking.empty() ? "it was interrupted" : lacking), remedy));
    return false;
  }
  findings.push_back(judgeLeg(measure(here, there, name, way)));
  here = std::move(there);
  return true;
}

Findings TestDrive::drive()
{
  Findings findings;
  Place here;
  const std::string lacking = look(here);
  if (!lacking.empty())
  {
    return { error("move", lacking, "see the lines above") };
  }
  Commander commander(robot_.nodeHandle(), robot_.setup(), here.frame.image->header.frame_id);
  const std::string unconnected = commander.connect(given_up_);
  if (!unconnected.empty())
  {
    return { error("move", unconnected, "start the robot's driver") };
  }
  for (const Part& part : parts())
  {
    const CameraFrame before = here.frame;
    trace_.clear();
    if (!driveLeg(commander, here, part.name, part.way, findings) ||
        !driveLeg(commander, here, part.back, -part.way, findings))
    {
      return findings;
    }
    if (part.way.head<3>().isZero() && robot_.odometry() != nullptr)
    {
      findings.push_back(judgeClocks(before));
    }
  }
  return findings;
}

Findings TestDrive::followHand(const Prompt& prompt)
{
  Findings findings;
  const std::string what = robot_.setup().is_arm ? "camera" : "base";
  for (const Part& part : parts())
  {
    Place here;
    Place there;
    const double turn = part.way.tail<3>().norm();
    const std::string amount =
        turn > 0.0 ? number(turn / DEGREE, 0) + " degrees" : number(100.0 * part.way.norm(), 0) + " cm";
    std::string fault = look(here);
    std::string wish = "Move the ";
    wish.append(what).append(" by hand: ").append(part.name).append(", by about ").append(amount);
    if (fault.empty() && !prompt(wish))
    {
      return findings;
    }
    fault = fault.empty() ? look(there) : fault;
    if (!fault.empty())
    {
      findings.push_back(error("move " + part.name, fault, "see the lines above"));
      return findings;
    }
    Leg leg = measure(here, there, part.name, part.way);
    leg.by_hand = true;
    findings.push_back(judgeLeg(leg));
  }
  return findings;
}

}  // namespace view_servo::check
