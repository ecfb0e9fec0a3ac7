// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** @file
 * What a simulated robot lives in, read from YAML (`config/worlds/`, whose README says what a file may hold). Frames
 * follow REP 103: the world's z axis points up; optical frames have x right, y down, z forward. Lengths in metres.
 */

/** A flat rectangle in the x-y plane of its own frame, its middle in the origin; the picture is upright seen from +z. */
struct Surface
{
  std::string name;
  std::string group;        ///< shown only when asked for; empty: always
  Eigen::Isometry3d pose;   ///< world from surface
  Eigen::Vector2d size;     ///< along its x and y
  int texture;              ///< index in World::textures
  Eigen::Vector2d repeat;   ///< how often the picture fits along x and y
  double brightness = 1.0;  ///< of the picture
};

/** Where the base cannot be: the outline of a thing on the floor, a convex polygon, counter-clockwise. */
struct Obstacle
{
  std::string name;
  std::vector<Eigen::Vector2d> outline;
};

/** How a camera turns what it sees into numbers, besides its calibration. */
struct ImageQuality
{
  double noise = 0.0;     ///< standard deviation [grey levels], >= 0
  double exposure = 0.0;  ///< time over which motion blurs [s], >= 0
  int supersampling = 2;  ///< rays a pixel has along each side, 1 to 4
};

/** grey = gain x (1 + gradient u) x radiance + offset, u from -0.5 to 0.5 across the image. */
struct Light
{
  double gain = 1.0;      ///< > 0
  double offset = 0.0;    ///< [grey levels]
  double gradient = 0.0;  ///< (-2, 2)
};

enum class RobotKind
{
  NOMAD,
  PUMA
};

/** A pose on the way, and when. */
struct Waypoint
{
  double time;  ///< [s]
  Eigen::Isometry3d pose;
};

/**
 * Poses are those of the base for the Nomad (on the floor), and of the camera's optical frame for the Puma.
 */
struct World
{
  std::string name;
  RobotKind robot = RobotKind::NOMAD;
  Eigen::Isometry3d robot_base = Eigen::Isometry3d::Identity();  ///< world from the Puma's base_link
  Camera camera;
  Eigen::Isometry3d camera_on_base = Eigen::Isometry3d::Identity();  ///< the Nomad's base_link from optical frame
  double camera_rate = 10.0;                                         ///< images a second
  ImageQuality quality;
  Light light;
  double background = 128.0;      ///< where nothing is [grey levels]
  std::vector<cv::Mat> textures;  ///< 8-bit, one channel
  std::vector<Surface> surfaces;
  std::vector<Obstacle> obstacles;
  Eigen::Isometry3d goal = Eigen::Isometry3d::Identity();
  cv::Rect region;  ///< of interest, in the view at the goal [px]; empty: all of it
  std::map<std::string, Eigen::Isometry3d> starts;
  std::map<std::string, std::vector<Waypoint>> trajectories;

  /** The start of a name. @throws std::invalid_argument that lists the names there are. */
  const Eigen::Isometry3d& start(const std::string& start_name) const;
  /** As start(). */
  const std::vector<Waypoint>& trajectory(const std::string& trajectory_name) const;
};

/**
 * Reads a world.
 * @throws std::invalid_argument with the file's name, the line and what is wrong there.
 */
World readWorld(const std::string& file);

/** Reads a world by its file, or by the name that a file has in a directory. @throws std::invalid_argument as
 * readWorld(), or when there is none. */
World findWorld(const std::string& file_or_name, const std::filesystem::path& directory);

/** Pose on the floor: position (x, y), turned by yaw about z [rad]. */
Eigen::Isometry3d planarPose(double x, double y, double yaw);

/** Yaw of a pose [rad]: of its x axis about the world's z. */
double yawOf(const Eigen::Isometry3d& pose);

/** Pose of an optical frame at a point that looks at another, its x axis level, then turned by `roll` about z [rad]. */
Eigen::Isometry3d lookingAt(const Eigen::Vector3d& position, const Eigen::Vector3d& target, double roll);

/** Whether a disc on the floor touches an obstacle. Which one, or an empty string. */
std::string touchedObstacle(const World& world, const Eigen::Vector2d& centre, double radius);

/** The pose at a time: held before the first and after the last waypoint, straight and evenly turning between two. */
Eigen::Isometry3d poseAt(const std::vector<Waypoint>& trajectory, double time);

}  // namespace view_servo::sim
