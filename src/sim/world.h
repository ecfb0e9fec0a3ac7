// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <map>
#include <string>
#include <vector>

namespace view_servo::sim
{
/** @file
 * The world that a simulated robot moves in and its camera sees; world_reader.h reads it from a file. Frames follow REP
 * 103: the world's z axis points up; optical frames have x right, y down, z forward. Lengths are in metres.
 */

/**
 * A flat rectangle with a picture on it. In its own frame it lies in the x-y plane around the origin, and the picture
 * is upright when it is seen from +z.
 */
struct Surface
{
  std::string name;
  std::string group;        ///< is drawn only when this group is asked for; empty: always
  Eigen::Isometry3d pose;   ///< world from surface
  Eigen::Vector2d size;     ///< lengths along its x and y [m]
  int texture;              ///< index into World::textures
  Eigen::Vector2d repeat;   ///< how often the picture is repeated along x and y
  double brightness = 1.0;  ///< factor by which the picture's grey levels are multiplied
};

/** A thing on the floor where the base cannot be: its outline is a convex polygon, counter-clockwise, in the world. */
struct Obstacle
{
  std::string name;
  std::vector<Eigen::Vector2d> outline;  ///< corners [m]
  std::string group = {};                ///< of its surfaces; empty: none
};

/** How good the images of a camera are. */
struct ImageQuality
{
  double noise = 0.0;     ///< standard deviation [grey levels], >= 0
  double exposure = 0.0;  ///< time over which motion blurs [s], >= 0
  int supersampling = 2;  ///< a pixel is the mean of this many rays along each side, 1 to 4
};

/** grey level = gain x (1 + gradient u) x radiance + offset, where u goes from -0.5 at the left to 0.5 at the right. */
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

/** A pose of a trajectory. */
struct Waypoint
{
  double time;             ///< [s]
  Eigen::Isometry3d pose;  ///< of the frame whose poses a World holds
};

/**
 * A room or table, the robot in it, and the poses that experiments use. For the Nomad these are poses of its base on
 * the floor, for the Puma those of its camera's optical frame: each is the world from that frame.
 */
struct World
{
  std::string name;
  RobotKind robot = RobotKind::NOMAD;
  Eigen::Isometry3d robot_base = Eigen::Isometry3d::Identity();  ///< world from the Puma's base_link
  Camera camera;
  Eigen::Isometry3d camera_on_base = Eigen::Isometry3d::Identity();  ///< the Nomad's base_link from optical frame
  double camera_rate = 10.0;                                         ///< of images [Hz]
  ImageQuality quality;
  Light light;
  double background = 128.0;      ///< radiance where no surface is seen [grey levels]
  std::vector<cv::Mat> textures;  ///< 8-bit with one channel
  std::vector<Surface> surfaces;
  std::vector<Obstacle> obstacles;
  Eigen::Isometry3d goal = Eigen::Isometry3d::Identity();  ///< pose at which the view is stored
  cv::Rect region;                                  ///< of interest, in the view at the goal [px]; empty: all of it
  std::map<std::string, Eigen::Isometry3d> starts;  ///< poses to begin at, by name
  std::map<std::string, std::vector<Waypoint>> trajectories;  ///< by name, each by ascending time

  /** @throws std::invalid_argument that lists the names of all starts, when there is none of this name. */
  const Eigen::Isometry3d& start(const std::string& start_name) const;
  /** @throws std::invalid_argument as start() does. */
  const std::vector<Waypoint>& trajectory(const std::string& trajectory_name) const;
};

/** The world with another standard deviation of its images' noise [grey levels]; a negative one leaves it as it is. */
World withImageNoise(World world, double noise);

/** The world with only the obstacles that have no group, or one of these. */
World withObstaclesOf(World world, const std::vector<std::string>& groups);

/** A calibration whose focal lengths are too long by this part of them: 0.01 is one per cent. */
Camera withFocalLengthError(Camera camera, double error);

/** The pose on the floor at (x, y), turned by yaw about z [rad]. */
Eigen::Isometry3d planarPose(double x, double y, double yaw);

/** The angle from the world's x axis to that of a pose, about the world's z axis [rad]. */
double yawOf(const Eigen::Isometry3d& pose);

/**
 * The pose of an optical frame that looks from a point at another, its x axis level, then turned by `roll` about z
 * [rad].
 */
Eigen::Isometry3d lookingAt(const Eigen::Vector3d& position, const Eigen::Vector3d& target, double roll);

/**
 * The name of an obstacle that a disc on the floor touches; "an obstacle" when it has none, empty when it touches none.
 */
std::string touchedObstacle(const World& world, const Eigen::Vector2d& centre, double radius);

/**
 * The pose of a trajectory at a time [s]: between two waypoints on a straight line, turning evenly; before the first
 * and after the last one their own poses. The trajectory has at least one waypoint.
 */
Eigen::Isometry3d poseAt(const std::vector<Waypoint>& trajectory, double time);

}  // namespace view_servo::sim
