// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/hand_eye_file.h"

#include "small_yaml_file.h"
#include "view_servo/parameters/error_text.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <stdexcept>

namespace view_servo
{
namespace
{
/** @throws std::runtime_error when it is not there. */
YAML::Node entry(const YAML::Node& map, const std::string& section, const std::string& name)
{
  const YAML::Node value = map.IsMap() ? map[name] : YAML::Node(YAML::NodeType::Undefined);
  if (!value)
  {
    throw std::runtime_error("it has no " + section + "/" + name);
  }
  return value;
}

std::string frame(const YAML::Node& parameters, const std::string& name)
{
  auto text = entry(parameters, "parameters", name).as<std::string>();
  if (text.empty())
  {
    throw std::runtime_error("parameters/" + name + " is empty");
  }
  return text;
}

HandEyeFile fromYaml(const YAML::Node& root)
{
  constexpr double NO_ROTATION = 1e-3;
  HandEyeFile hand_eye;
  const YAML::Node parameters = root.IsMap() ? root["parameters"] : YAML::Node();
  const YAML::Node transformation = root.IsMap() ? root["transformation"] : YAML::Node();
  if (!parameters || !parameters.IsMap() || !transformation || !transformation.IsMap())
  {
    throw std::runtime_error("it has not both parameters and transformation");
  }
  if (!entry(parameters, "parameters", "eye_on_hand").as<bool>())
  {
    throw std::runtime_error("it is of a camera beside the arm (eye_on_hand: false), not on its hand");
  }
  hand_eye.base_frame = frame(parameters, "robot_base_frame");
  hand_eye.flange_frame = frame(parameters, "robot_effector_frame");
  hand_eye.camera_frame = frame(parameters, "tracking_base_frame");
  const auto number = [&](const std::string& name) {
    return entry(transformation, "transformation", name).as<double>();
  };
  const Eigen::Vector3d place(number("x"), number("y"), number("z"));
  const Eigen::Quaterniond rotation(number("qw"), number("qx"), number("qy"), number("qz"));
  if (!place.allFinite() || !(std::abs(rotation.norm() - 1.0) < NO_ROTATION))
  {
    throw std::runtime_error("its transformation is none: numbers are not finite, or the quaternion's norm is not 1");
  }
  hand_eye.camera_in_flange = Eigen::Translation3d(place) * rotation.normalized();
  if (const YAML::Node covariance = root["covariance"])
  {
    hand_eye.covariance = covariance.as<std::vector<double>>();
    constexpr std::size_t NUMBERS = 36;
    if (hand_eye.covariance.size() != NUMBERS)
    {
      throw std::runtime_error("its covariance has not 36 numbers");
    }
  }
  return hand_eye;
}

}  // namespace

HandEyeFile readHandEyeFile(const std::string& path)
{
  try
  {
    return fromYaml(loadSmallYamlFile(path));
  }
  catch (const std::exception& error)
  {
    throw std::runtime_error("no hand-eye calibration can be read from '" + path + "': " + oneLine(error));
  }
}

void writeHandEyeFile(const HandEyeFile& hand_eye, const std::string& path)
{
  constexpr int DIGITS = 12;
  const Eigen::Vector3d place = hand_eye.camera_in_flange.translation();
  Eigen::Quaterniond rotation(hand_eye.camera_in_flange.linear());
  rotation.coeffs() *= rotation.w() < 0.0 ? -1.0 : 1.0;
  YAML::Emitter out;
  out.SetDoublePrecision(DIGITS);
  out << YAML::Comment(hand_eye.comment) << YAML::BeginMap << YAML::Key << "parameters" << YAML::Value << YAML::BeginMap
      << YAML::Key << "eye_on_hand" << YAML::Value << true << YAML::Key << "robot_base_frame" << YAML::Value
      << hand_eye.base_frame << YAML::Key << "robot_effector_frame" << YAML::Value << hand_eye.flange_frame << YAML::Key
      << "tracking_base_frame" << YAML::Value << hand_eye.camera_frame << YAML::EndMap;
  out << YAML::Key << "transformation" << YAML::Value << YAML::BeginMap << YAML::Key << "x" << YAML::Value << place.x()
      << YAML::Key << "y" << YAML::Value << place.y() << YAML::Key << "z" << YAML::Value << place.z() << YAML::Key
      << "qx" << YAML::Value << rotation.x() << YAML::Key << "qy" << YAML::Value << rotation.y() << YAML::Key << "qz"
      << YAML::Value << rotation.z() << YAML::Key << "qw" << YAML::Value << rotation.w() << YAML::EndMap;
  if (!hand_eye.covariance.empty())
  {
    out << YAML::Key << "covariance" << YAML::Value << YAML::Flow << hand_eye.covariance;
  }
  out << YAML::EndMap;
  const std::string unfinished = path + ".unfinished";
  std::ofstream file(unfinished);
  file << out.c_str() << '\n';
  file.close();
  if (!file || std::rename(unfinished.c_str(), path.c_str()) != 0)
  {
    std::remove(unfinished.c_str());
    throw std::runtime_error("'" + path + "' cannot be written: choose a file in a directory of yours");
  }
}

}  // namespace view_servo
