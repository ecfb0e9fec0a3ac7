// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"

#include <Eigen/Geometry>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
/** What the folder hololens_indoor holds: images of a walk through rooms, and where the camera was. */
struct IndoorWalk
{
  Camera camera;
  std::map<std::string, Eigen::Isometry3d> poses;  ///< world from camera, by the names of the images
  struct Pair
  {
    std::string reference;
    std::string current;
    double baseline;  ///< distance between the two places of the camera [m]
    double rotation;  ///< angle between its two orientations [degrees]
    double overlap;   ///< share of the one image that the other one shows, too, [0, 1]
  };
  std::vector<Pair> pairs;  ///< each in both directions, one after the other
};

/** @param data the folder that VIEW_SERVO_DATA names. @throws std::runtime_error naming a file that cannot be read. */
IndoorWalk readIndoorWalk(const std::filesystem::path& data);

}  // namespace view_servo
