// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"

#include <string>

namespace view_servo
{
/**
 * The calibration in a file: one that ROS' camera_calibration writes (image_width, camera_matrix and so on), one in
 * which a sensor_msgs/CameraInfo was printed (width, K and so on), or that of a stored view (the same below `camera`).
 * @throws std::runtime_error naming the file and what is wrong with it, also when the camera cannot be used, see
 * Camera::fault().
 */
Camera readCameraFile(const std::string& path);

}  // namespace view_servo
