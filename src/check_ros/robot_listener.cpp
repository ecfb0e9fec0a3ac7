// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check_ros/robot_listener.h"

#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/arm_conversions.h"
#include "view_servo/ros/base_conversions.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"

#include <ros/message_event.h>
#include <ros/transport_hints.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <limits>
#include <stdexcept>

namespace view_servo::check
{
namespace
{
constexpr double HISTORY = 10.0;  // [s]

/** Subscribes without delay; what `handler` throws is told by `guarded`. */
template <typename Message, typename Handler>
ros::Subscriber listen(const ros::NodeHandle& nh, const std::string& topic, Handler handler)
{
  constexpr std::uint32_t QUEUE_SIZE = 50;
  ros::NodeHandle topics_nh(nh);
  using Event = ros::MessageEvent<const Message>;
  const boost::function<void(const Event&)> callback = [topic, handler](const Event& event) {
    guarded("a message on '" + topic + "'", [&] { handler(event); });
  };
  return topics_nh.subscribe<Message>(topic, QUEUE_SIZE, callback, ros::VoidConstPtr(),
                                      ros::TransportHints().tcpNoDelay());
}

}  // namespace

// ------------------------------------------------------------------------------------------------------- odometry

OdometryListener::OdometryListener(const ros::NodeHandle& nh, const Setup& setup, const TransformSource& transforms,
                                   const CameraListener& camera, double delay)
  : camera_(camera),
    topic_(nh.resolveName(setup.odom)),
    delay_(delay),
    input_("odometry", "'" + topic_ + "'", INPUT_TIMEOUT),
    stamps_("odometry", "'" + topic_ + "'", INPUT_TIMEOUT),
    reader_(input_, transforms, withoutSlash(setup.fixedFrame()), delay),
    history_(HISTORY),
    last_time_(-std::numeric_limits<double>::infinity())
{
  subscriber_ = listen<nav_msgs::Odometry>(nh, topic_, [this](const OdometryReader::Event& e) { onOdometry(e); });
}

void OdometryListener::onOdometry(const OdometryReader::Event& event)
{
  const nav_msgs::Odometry& message = *event.getConstMessage();
  const std::lock_guard<std::mutex> lock(mutex_);
  const ros::Time& stamp = message.header.stamp;
  const DriverInput::Stamp place = stamps_.checkStamp(stamp.isZero() ? stamp : toStamp(stamp.toSec() - delay_));
  stamp_fault_ = place == DriverInput::Stamp::UNUSABLE ? stamps_.problem() : "";
  frame_ = message.header.frame_id;
  child_frame_ = message.child_frame_id;
  meter_.add(steadySeconds(), ageOf(stamp), place == DriverInput::Stamp::LATE);
  compareClocks();
  const std::optional<OdometryReading> reading = reader_.read(event);
  fault_ = reading || !stamp_fault_.empty() ? "" : input_.problem();
  if (reading)
  {
    rest_.add(reading->pose.x, reading->pose.y, reading->pose.yaw);
    history_.add(reading->time, reading->pose);
    clocks_.addOdometry(reading->time, reading->pose.yaw);
    last_time_ = steadySeconds();
  }
}

void OdometryListener::compareClocks()
{
  // Once an image, as homing does: between images the newest one grows old however right its stamp is.
  const int images = camera_.count();
  if (images == compared_images_)
  {
    return;
  }
  compared_images_ = images;
  ++comparisons_;
  const std::string apart = camera_.apart(stamps_);
  if (!apart.empty())
  {
    apart_fault_ = apart;
    ++apart_;
  }
}

OdometryObservations OdometryListener::observations(const RosGraph& graph) const
{
  OdometryObservations odometry;
  const std::lock_guard<std::mutex> lock(mutex_);
  odometry.stream.topic = topic_;
  odometry.stream.publisher = graph.publisher(topic_);
  meter_.fill(odometry.stream);
  rest_.fill(odometry);
  odometry.stream.stamp_fault = stamp_fault_;
  odometry.frame = frame_;
  odometry.child_frame = child_frame_;
  odometry.fault = fault_;
  odometry.apart_fault = 2 * apart_ > comparisons_ ? apart_fault_ : "";
  return odometry;
}

std::optional<PlanarPose> OdometryListener::at(double stamp) const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return history_.at(stamp);
}

std::optional<PlanarPose> OdometryListener::newest() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return history_.newest();
}

ClockOffset OdometryListener::clocks() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return clocks_;
}

double OdometryListener::silence() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return steadySeconds() - last_time_;
}

std::string OdometryListener::adviceOn(double remaining)
{
  const std::lock_guard<std::mutex> lock(mutex_);
  reader_.setRemainingDelay(remaining);
  return reader_.adviceOnDelay();
}

// --------------------------------------------------------------------------------------------------------- joints

JointListener::JointListener(const ros::NodeHandle& nh, const Setup& setup)
  : topic_(nh.resolveName(setup.joint_states)),
    described_(movableJoints(robotDescription(nh))),
    following_(mimicJoints(robotDescription(nh))),
    guard_(jointLimits(robotDescription(nh)), 0.0, 1.0)
{
  subscriber_ = listen<sensor_msgs::JointState>(
      nh, topic_,
      [this](const ros::MessageEvent<const sensor_msgs::JointState>& e) { onJoints(*e.getConstMessage()); });
}

void JointListener::onJoints(const sensor_msgs::JointState& message)
{
  const std::lock_guard<std::mutex> lock(mutex_);
  meter_.add(steadySeconds(), ageOf(message.header.stamp), false);
  names_.insert(message.name.begin(), message.name.end());
  // Several may publish there, each its own joints.
  const std::string fault = guard_.add(steadySeconds(), message.name, message.position, message.velocity);
  fault_ = fault.empty() ? fault_ : fault;
}

JointObservations JointListener::observations(const RosGraph& graph) const
{
  JointObservations joints;
  const std::lock_guard<std::mutex> lock(mutex_);
  joints.stream.topic = topic_;
  joints.stream.publisher = graph.publisher(topic_);
  meter_.fill(joints.stream);
  joints.described = !described_.empty();
  joints.fault = fault_;
  std::set<std::string> known = described_;
  known.insert(following_.begin(), following_.end());
  std::set_difference(names_.begin(), names_.end(), known.begin(), known.end(), std::back_inserter(joints.unknown));
  joints.is_other = !names_.empty() && joints.unknown.size() == names_.size();
  std::set_difference(described_.begin(), described_.end(), names_.begin(), names_.end(),
                      std::back_inserter(joints.silent));
  return joints;
}

// ----------------------------------------------------------------------------------------------- tf and commands

namespace
{
/** Why tf lacks the camera at the stamps of most of the last images; empty: it does not. */
std::string faultAtImages(const MountObservations& mount, const TransformSource& transforms,
                          const CameraListener& camera)
{
  constexpr double PATIENCE = 0.3;  // tf comes later than images, by no more than this [s]
  int asked = 0;
  int lacking = 0;
  std::string fault;
  for (const ros::Time& stamp : camera.stamps())
  {
    if (stamp.isZero() || ageOf(stamp) < PATIENCE)
    {
      continue;
    }
    ++asked;
    const std::string missing = transforms.missing(mount.base_frame, mount.camera_frame, stamp);
    if (!missing.empty())
    {
      ++lacking;
      fault = missing;
    }
  }
  return 2 * lacking > asked ? fault : "";
}

}  // namespace

MountObservations observeMount(const Setup& setup, const TransformSource& transforms, const CameraListener& camera)
{
  MountObservations mount;
  mount.base_frame = setup.fixedFrame();
  mount.camera_frame = camera.frameId();
  if (mount.base_frame.empty() || mount.camera_frame.empty())
  {
    return mount;
  }
  mount.fault = transforms.missing(mount.base_frame, mount.camera_frame, ros::Time(0));
  if (!mount.fault.empty())
  {
    return mount;
  }
  const geometry_msgs::TransformStamped newest =
      transforms.lookUp(mount.base_frame, mount.camera_frame, ros::Time(0), 0.0);
  mount.is_static = newest.header.stamp.isZero();
  mount.age = mount.is_static ? 0.0 : ageOf(newest.header.stamp);
  mount.base_from_camera = toIsometry(newest.transform);
  mount.fault_at_images = mount.is_static ? "" : faultAtImages(mount, transforms, camera);
  try
  {
    const CameraMount usable(mount.base_from_camera);
  }
  catch (const std::invalid_argument& error)
  {
    mount.mount_fault = oneLine(error);
  }
  return mount;
}

CommandObservations observeCommands(const ros::NodeHandle& nh, const Setup& setup, const RosGraph& graph)
{
  CommandObservations commands;
  commands.topic = nh.resolveName(setup.commandTopic());
  commands.wanted_type = setup.commandType();
  commands.type = graph.type(commands.topic);
  commands.dry_run = setup.dry_run;
  commands.listeners = graph.subscribers(commands.topic);
  if (!setup.is_arm)
  {
    commands.stamped_topic = nh.resolveName(STAMPED_COMMANDS);
    commands.stamped_listeners = graph.subscribers(commands.stamped_topic);
  }
  const std::string driver = nh.resolveName(setup.is_arm ? "servo_25d" : "homing");
  const std::string result = nh.resolveName(setup.is_arm ? "servo/result" : "home/result");
  const std::string server = graph.publisher(result);  // the driver by another name, or the manager of its nodelet
  std::set<std::string> nodes;
  for (const std::string& topic : { commands.topic, commands.stamped_topic })
  {
    const std::vector<std::string> there = topic.empty() ? std::vector<std::string>() : graph.publishers(topic);
    nodes.insert(there.begin(), there.end());
  }
  for (const std::string& node : nodes)
  {
    if (node != driver && node != server)
    {
      commands.publishers.push_back(node);
    }
  }
  return commands;
}

}  // namespace view_servo::check
