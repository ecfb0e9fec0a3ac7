// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/numbers.h"

#include "check/judgements.h"

#include <cmath>

namespace view_servo::check
{
namespace
{
/** The first few of the names, and how many more there are. */
std::string firstFew(const std::vector<std::string>& names)
{
  constexpr std::size_t MOST = 4;
  std::string text;
  for (std::size_t i = 0; i < names.size() && i < MOST; ++i)
  {
    text += (i == 0 ? "" : ", ") + names[i];
  }
  return text + (names.size() > MOST ? " and " + std::to_string(names.size() - MOST) + " more" : "");
}

Finding judgeOdometryRate(const StreamObservations& stream)
{
  constexpr double SLOW = 10.0;  // [Hz]
  const std::string name = "odometry";
  if (stream.count == 0)
  {
    return error(name, silence(stream, "odometry"),
                 "start what publishes odometry, or say odom:= as its topic is named");
  }
  const std::string found = number(stream.rate, 1) + " Hz on '" + stream.topic + "'";
  if (stream.rate < SLOW)
  {
    return warning(name, found, "publish it at 20 Hz or more: the base steers by it between images");
  }
  if (stream.usual_gap > INPUT_TIMEOUT)
  {
    return warning(
        name, found + ", with pauses of " + shortTime(stream.usual_gap),
        "the base stands in pauses above " + shortTime(INPUT_TIMEOUT) + ": look for a full network or processor");
  }
  return ok(name, found);
}

Finding judgeOdometryStamps(const StreamObservations& stream)
{
  constexpr double OFTEN_LATE = 0.05;  // part of the messages
  const std::string name = "odometry stamps";
  if (!stream.stamp_fault.empty())
  {
    return error(name, stream.stamp_fault, "let who publishes odometry stamp it with the time of the measurement");
  }
  const std::string found = "odometry comes " + shortTime(stream.age) + " after its stamps";
  if (stream.late_share > OFTEN_LATE)
  {
    return warning(name, found + ", " + number(100.0 * stream.late_share, 0) + " % of it after newer messages",
                   "find out why it comes in the wrong order: two sources on one topic, or a lossy network");
  }
  return ok(name, found + ", in order");
}

Finding judgeClocks(const OdometryObservations& odometry, double image_age)
{
  constexpr double FUTURE = 0.02;  // [s]
  constexpr double FAR = 0.2;      // [s]
  const std::string name = "clocks";
  if (!odometry.apart_fault.empty())
  {
    return error(name, odometry.apart_fault,
                 "synchronise the machines' clocks (chrony), set ~odometry_delay, or find out what delays the images");
  }
  const double ahead = image_age - odometry.stream.age;
  const std::string found = "odometry's stamps are " + shortTime(std::abs(ahead)) +
                            (ahead > 0.0 ? " ahead of" : " behind") + " those of the images that come with them";
  if (std::isnan(ahead))
  {
    return warning(name, "stamps of odometry and images cannot be compared", "see the lines about images and odometry");
  }
  if (std::abs(ahead) > FAR || odometry.stream.age < -FUTURE)
  {
    return warning(
        name, found,
        "synchronise the machines' clocks (chrony), and try --move, which measures by how much they are apart");
  }
  return ok(name, found);
}

Finding judgeRest(const OdometryObservations& odometry)
{
  constexpr double MOVED = 0.02;  // [m]
  constexpr double TURNED = 1.0 * DEGREE;
  constexpr double NOISY = 0.003;  // [m]
  constexpr double NOISY_YAW = 0.2 * DEGREE;
  const std::string name = "odometry at rest";
  if (odometry.moved > MOVED || odometry.turned > TURNED)
  {
    return ok(name, "not judged: the base moved " + number(odometry.moved, 2) + " m and " +
                        number(odometry.turned / DEGREE, 0) + " degrees meanwhile");
  }
  const std::string found = "noise of " + number(1e3 * odometry.position_noise, 1) + " mm and " +
                            number(odometry.yaw_noise / DEGREE, 2) + " degrees";
  return odometry.position_noise > NOISY || odometry.yaw_noise > NOISY_YAW
             ? warning(name, found, "let odometry stand still when the wheels do: homing ends by it")
             : ok(name, found);
}

}  // namespace

Findings judgeOdometry(const OdometryObservations& odometry, double image_age)
{
  Findings findings = { judgeOdometryRate(odometry.stream) };
  if (odometry.stream.count == 0)
  {
    return findings;
  }
  findings.push_back(odometry.fault.empty()
                         ? ok("odometry frames", "pose of '" + odometry.child_frame + "' in '" + odometry.frame + "'")
                         : error("odometry frames", odometry.fault,
                                 "one source with the pose of the base's frame (child_frame_id): remap others, publish "
                                 "tf between the frames, or "
                                 "set base_frame:="));
  findings.push_back(judgeOdometryStamps(odometry.stream));
  if (odometry.stream.stamp_fault.empty())
  {
    findings.push_back(judgeClocks(odometry, image_age));
  }
  if (odometry.fault.empty())
  {
    findings.push_back(judgeRest(odometry));
  }
  return findings;
}

Findings judgeCommands(const CommandObservations& commands)
{
  const std::string name = "commands";
  if (commands.dry_run)
  {
    return { ok(name, "dry run: they go to '" + commands.topic + "', and nobody has to listen") };
  }
  const bool only_stamped = commands.listeners.empty() && !commands.stamped_listeners.empty();
  if (commands.listeners.empty() && !only_stamped)
  {
    return { error(name, "nobody listens on '" + commands.topic + "'",
                   "start the robot's driver, say cmd_vel:= as its topic is named, or use dry_run:=true") };
  }
  const std::string found = only_stamped
                                ? firstFew(commands.stamped_listeners) + " listens on '" + commands.stamped_topic + "'"
                                : firstFew(commands.listeners) + " listens on '" + commands.topic + "'";
  if (!only_stamped && !commands.type.empty() && commands.type != "*" && commands.type != commands.wanted_type)
  {
    return { error(name, found + " for " + commands.type + ", commands are " + commands.wanted_type,
                   "put a node between that converts them, or say cmd_vel:= as the right topic is named") };
  }
  if (!commands.publishers.empty())
  {
    return { warning(name, found + ", and " + firstFew(commands.publishers) + " publishes there, too",
                     "stop it, or put a multiplexer (twist_mux) between, so that one node at a time drives") };
  }
  return { ok(name, found) };
}

Findings judgeJoints(const JointObservations& joints)
{
  const std::string name = "joint states";
  const StreamObservations& stream = joints.stream;
  if (stream.count == 0)
  {
    return { warning(name, silence(stream, "joint state"),
                     "say joint_states:= as their topic is named; without them servo_25d watches no joint limits") };
  }
  const std::string found = number(stream.rate, 1) + " Hz on '" + stream.topic + "'";
  if (!joints.described)
  {
    return { warning(name, found + ", but robot_description has no joints that move",
                     "load the arm's URDF into robot_description; without it servo_25d watches no joint limits") };
  }
  const std::string unknown =
      "robot_description has no joints " + firstFew(joints.unknown) + ", of '" + stream.topic + "'";
  if (joints.is_other)
  {
    return { error(name, unknown, "load the URDF of this arm, or say joint_states:= as its own topic is named") };
  }
  if (!joints.fault.empty())
  {
    return { error(name, joints.fault + " on '" + stream.topic + "'",
                   "correct the arm's encoders, or the URDF's limits [rad, m]") };
  }
  if (!joints.silent.empty())
  {
    return { warning(name, found + ", without " + firstFew(joints.silent) + " of robot_description",
                     "publish their states, too, else nobody watches their limits") };
  }
  if (!joints.unknown.empty())
  {
    return { warning(name, unknown, "nothing, unless one of them moves the camera: nobody watches their limits") };
  }
  return { ok(name, found + ", all joints of robot_description, within their limits") };
}

namespace
{
Finding judgeTime(const MachineObservations& machine)
{
  constexpr double STOPPED = 0.01;
  const std::string name = "time";
  if (machine.sim_time)
  {
    return machine.clock_rate < STOPPED
               ? error(name, "use_sim_time is set, and /clock stands still",
                       "start the simulation or rosbag play --clock, or rosparam set use_sim_time false and start all "
                       "nodes anew")
               : ok(name, "simulated, " + number(machine.clock_rate, 2) + " times as fast as the clock on the wall");
  }
  return machine.clock_published
             ? warning(name, "/clock is published, and use_sim_time is not set",
                       "rosparam set use_sim_time true before nodes start, or stop who publishes /clock")
             : ok(name, "of this computer's clock");
}

Finding judgeDisk(const MachineObservations& machine)
{
  constexpr double MEGABYTE = 1e6;
  constexpr double LITTLE = 200.0 * MEGABYTE;
  constexpr double FULL = 10.0 * MEGABYTE;
  const std::string name = "views' disk";
  if (!machine.disk_fault.empty())
  {
    return error(name, machine.disk_fault, "give this user the right to write there, or set views_dir:=");
  }
  const std::string found =
      (machine.disk_free < 1e3 * MEGABYTE ? number(machine.disk_free / MEGABYTE, 0) + " MB"
                                          : number(machine.disk_free / (1e3 * MEGABYTE), 0) + " GB") +
      " free for " + machine.views_dir;
  const std::string remedy = "free some space, or set views_dir:= to another disk";
  return machine.disk_free < FULL     ? error(name, found, remedy)
         : machine.disk_free < LITTLE ? warning(name, found, remedy)
                                      : ok(name, found);
}

Finding judgeProcessor(const MachineObservations& machine)
{
  constexpr double LITTLE = 0.3;  // a matcher and a driver beside it take about as much [cores]
  const std::string name = "processor";
  if (std::isnan(machine.cores_idle))
  {
    return warning(name, "this system does not tell how busy it is", "look by yourself (top)");
  }
  const std::string found = number(machine.cores_idle, 1) + " of " + std::to_string(machine.cores) + " cores idle";
  return machine.cores_idle < LITTLE
             ? warning(name, found,
                       "stop what is not needed, or lower the rate and size of images: matching comes late otherwise")
             : ok(name, found);
}

}  // namespace

Findings judgeMachine(const MachineObservations& machine)
{
  return { judgeTime(machine), judgeDisk(machine), judgeProcessor(machine) };
}

}  // namespace view_servo::check
