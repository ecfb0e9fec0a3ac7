// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/picture.h"

#include <Eigen/Geometry>

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace view_servo::check
{
/** @file
 * What was measured at a robot, without ROS. Texts named `fault` are those of the nodes' own checks, in one line;
 * empty: there is none. Topics are named as other nodes see them.
 */

/** What a number is that was not measured. */
constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

constexpr double INPUT_TIMEOUT = 0.25;  ///< a base stands when an input pauses for longer: the nodes' default [s]

/** Messages on one topic. */
struct StreamObservations
{
  std::string topic;
  std::string publisher;       ///< a node that publishes it, by the master; empty: there is none
  int count = 0;               ///< messages that came
  double rate = 0.0;           ///< [Hz]; 0 when fewer than two came
  double usual_gap = UNKNOWN;  ///< time from one message to the next that 19 of 20 keep within [s]
  double age = UNKNOWN;        ///< median time from stamp to arrival, by this computer's clock [s]
  double late_share = 0.0;     ///< part of the messages that came after one with a newer stamp
  std::string stamp_fault;     ///< of the last message's stamp
};

struct CameraObservations
{
  StreamObservations images;
  StreamObservations infos;
  int pairs = 0;                           ///< images that a camera_info with the same stamp came with
  int width = 0;                           ///< of the images [px]
  int height = 0;                          ///< likewise
  std::string encoding;                    ///< of the images
  std::string frame;                       ///< frame_id of the images; may be empty
  std::string image_fault;                 ///< why an image cannot be read
  std::string pairing_fault;               ///< why images and camera_info do not come together
  std::string calibration_fault;           ///< what is wrong with the newest camera_info
  std::string age_fault;                   ///< of the newest image
  std::string model;                       ///< of the lens
  double focal_length = UNKNOWN;           ///< [px]
  bool has_distortion = false;             ///< whether the lens is no pinhole
  std::optional<PictureMeasures> picture;  ///< of the newest image; empty: none can be read
};

/** Where tf has the camera on the robot. */
struct MountObservations
{
  std::string base_frame;  ///< a base's frame, or the frame that an arm stands in; empty: none is wanted
  std::string camera_frame;
  std::string fault;            ///< why tf does not know the camera at all
  std::string fault_at_images;  ///< why tf does not know it at the stamps of most images
  bool is_static = false;       ///< all transforms between the two frames are static
  double age = UNKNOWN;         ///< of the newest transform [s]
  std::string mount_fault;      ///< why a base's camera cannot be used as it is mounted
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();  ///< points of the camera's frame -> base
};

struct OdometryObservations
{
  StreamObservations stream;
  std::string frame;        ///< header.frame_id
  std::string child_frame;  ///< child_frame_id
  std::string fault;
  std::string apart_fault;          ///< why its stamps do not go with those of the images
  double moved = UNKNOWN;           ///< largest distance from the first pose [m]
  double turned = UNKNOWN;          ///< largest angle from the first yaw [rad]
  double position_noise = UNKNOWN;  ///< standard deviation of the position at rest [m]
  double yaw_noise = UNKNOWN;       ///< standard deviation of the yaw at rest [rad]
};

struct CommandObservations
{
  std::string topic;
  std::string wanted_type;                     ///< type of the messages that drivers publish
  std::string type;                            ///< type of the topic's messages, by the master; empty: it knows none
  std::vector<std::string> listeners;          ///< nodes that subscribe
  std::string stamped_topic;                   ///< of a base, where its driver publishes the same with a stamp
  std::vector<std::string> stamped_listeners;  ///< nodes that subscribe that
  std::vector<std::string> publishers;         ///< nodes that publish there, other than the driver
  bool dry_run = false;                        ///< the driver is to run dry, so that nobody need listen
};

struct JointObservations
{
  StreamObservations stream;
  bool described = false;            ///< there is a robot_description with joints that move
  bool is_other = false;             ///< the URDF has none of the messages' joints
  std::vector<std::string> unknown;  ///< joints of the messages that the URDF does not have
  std::vector<std::string> silent;   ///< joints of the URDF that no message has
  std::string fault;                 ///< which position lies beyond the URDF's limits
};

struct MachineObservations
{
  bool sim_time = false;         ///< use_sim_time is set
  bool clock_published = false;  ///< somebody publishes /clock
  double clock_rate = 1.0;       ///< seconds by which ROS' clock goes on in a second
  std::string views_dir;         ///< directory of the stored views
  std::string disk_fault;        ///< why no view could be written
  double disk_free = UNKNOWN;    ///< [bytes]
  int cores = 0;                 ///< number of cores
  double cores_idle = UNKNOWN;   ///< how many of them were idle, on average
};

}  // namespace view_servo::check
