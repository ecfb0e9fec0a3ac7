// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"

#include <yaml-cpp/yaml.h>
#include <Eigen/Core>

#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/** A matrix from the list of its elements, row by row. @throws std::runtime_error when there are more or fewer. */
template <typename Matrix>
void fromList(const YAML::Node& node, Matrix& matrix)
{
  const auto list = node.as<std::vector<double>>();
  if (static_cast<Eigen::Index>(list.size()) != matrix.size())
  {
    throw std::runtime_error("a list of " + std::to_string(matrix.size()) + " numbers has " +
                             std::to_string(list.size()));
  }
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
  {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
    {
      matrix(row, column) = list[static_cast<std::size_t>(row * matrix.cols() + column)];
    }
  }
}

/**
 * A camera from yaml as stored views and printed sensor_msgs/CameraInfo have it: width, height, K and so on. @throws
 * what yaml-cpp and fromList() throw.
 */
inline Camera cameraFromYaml(const YAML::Node& node)
{
  Camera camera;
  camera.width = node["width"].as<int>();
  camera.height = node["height"].as<int>();
  camera.distortion_model = node["distortion_model"].as<std::string>();
  camera.distortion = node["D"].as<std::vector<double>>();
  fromList(node["K"], camera.k);
  fromList(node["R"], camera.rectification);
  fromList(node["P"], camera.projection);
  return camera;
}

}  // namespace view_servo
