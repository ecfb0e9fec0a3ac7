// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/camera_file.h"

#include "camera_yaml.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>

#include <exception>
#include <stdexcept>
#include <vector>

namespace view_servo
{
namespace
{
/** As camera_calibration writes it; it leaves out no field, but others' files do. */
Camera calibrationFromYaml(const YAML::Node& node)
{
  Camera camera;
  camera.width = node["image_width"].as<int>();
  camera.height = node["image_height"].as<int>();
  fromList(node["camera_matrix"]["data"], camera.k);
  if (const YAML::Node distortion = node["distortion_coefficients"])
  {
    camera.distortion_model = node["distortion_model"].as<std::string>();
    camera.distortion = distortion["data"].as<std::vector<double>>();
  }
  if (const YAML::Node rectification = node["rectification_matrix"])
  {
    fromList(rectification["data"], camera.rectification);
  }
  if (const YAML::Node projection = node["projection_matrix"])
  {
    fromList(projection["data"], camera.projection);
  }
  return camera;
}

Camera anyCameraFromYaml(const YAML::Node& node)
{
  if (node.IsMap() && node["camera_matrix"])
  {
    return calibrationFromYaml(node);
  }
  if (node.IsMap() && node["camera"])
  {
    return cameraFromYaml(node["camera"]);
  }
  if (node.IsMap() && node["K"])
  {
    return cameraFromYaml(node);
  }
  throw std::runtime_error("it has none of camera_matrix, camera and K");
}

}  // namespace

Camera readCameraFile(const std::string& path)
{
  try
  {
    Camera camera = anyCameraFromYaml(loadSmallYamlFile(path));
    const std::string fault = camera.fault();
    if (!fault.empty())
    {
      throw std::runtime_error(fault);
    }
    return camera;
  }
  catch (const std::exception& error)
  {
    throw std::runtime_error("no calibration can be read from '" + path + "': " + oneLine(error));
  }
}

}  // namespace view_servo
