// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/hand_eye_file.h"

#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <exception>
#include <fstream>
#include <stdexcept>
#include <vector>

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

/** The map `parameters`, of a camera on the hand. */
template <typename File>
void readFrames(const YAML::Node& parameters, File& file)
{
  if (!entry(parameters, "parameters", "eye_on_hand").as<bool>())
  {
    throw std::runtime_error("it is of a camera beside the arm (eye_on_hand: false), not on its hand");
  }
  file.base_frame = frame(parameters, "robot_base_frame");
  file.flange_frame = frame(parameters, "robot_effector_frame");
  file.camera_frame = frame(parameters, "tracking_base_frame");
}

template <typename File>
void writeFrames(YAML::Emitter& out, const File& file)
{
  out << YAML::Key << "parameters" << YAML::Value << YAML::BeginMap << YAML::Key << "eye_on_hand" << YAML::Value << true
      << YAML::Key << "robot_base_frame" << YAML::Value << file.base_frame << YAML::Key << "robot_effector_frame"
      << YAML::Value << file.flange_frame << YAML::Key << "tracking_base_frame" << YAML::Value << file.camera_frame
      << YAML::EndMap;
}

/** x, y, z, qx, qy, qz, qw. */
Eigen::Isometry3d readMotion(const YAML::Node& map, const std::string& section)
{
  constexpr double NO_ROTATION = 1e-3;
  const auto number = [&](const std::string& name) {
    return entry(map, section, name).as<double>();
  };
  const Eigen::Vector3d place(number("x"), number("y"), number("z"));
  const Eigen::Quaterniond rotation(number("qw"), number("qx"), number("qy"), number("qz"));
  if (!place.allFinite() || !(std::abs(rotation.norm() - 1.0) < NO_ROTATION))
  {
    throw std::runtime_error("its " + section + " is none: numbers are not finite, or the quaternion's norm is not 1");
  }
  return Eigen::Translation3d(place) * rotation.normalized();
}

void writeMotion(YAML::Emitter& out, const Eigen::Isometry3d& motion)
{
  const Eigen::Vector3d place = motion.translation();
  Eigen::Quaterniond rotation(motion.linear());
  rotation.coeffs() *= rotation.w() < 0.0 ? -1.0 : 1.0;
  out << YAML::BeginMap << YAML::Key << "x" << YAML::Value << place.x() << YAML::Key << "y" << YAML::Value << place.y()
      << YAML::Key << "z" << YAML::Value << place.z() << YAML::Key << "qx" << YAML::Value << rotation.x() << YAML::Key
      << "qy" << YAML::Value << rotation.y() << YAML::Key << "qz" << YAML::Value << rotation.z() << YAML::Key << "qw"
      << YAML::Value << rotation.w() << YAML::EndMap;
}

using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Eigen::Matrix3d readMatrix(const YAML::Node& map, const std::string& section, const std::string& name)
{
  const auto numbers = entry(map, section, name).as<std::vector<double>>();
  if (numbers.size() != RowMajor3d::SizeAtCompileTime)
  {
    throw std::runtime_error(section + "/" + name + " has not 9 numbers");
  }
  return Eigen::Map<const RowMajor3d>(numbers.data());
}

void writeMatrix(YAML::Emitter& out, const Eigen::Matrix3d& matrix)
{
  const RowMajor3d rows = matrix;
  out << YAML::Flow << std::vector<double>(rows.data(), rows.data() + rows.size());
}

HandEyeFile fromYaml(const YAML::Node& root)
{
  HandEyeFile hand_eye;
  const YAML::Node parameters = root.IsMap() ? root["parameters"] : YAML::Node();
  const YAML::Node transformation = root.IsMap() ? root["transformation"] : YAML::Node();
  if (!parameters || !parameters.IsMap() || !transformation || !transformation.IsMap())
  {
    throw std::runtime_error("it has not both parameters and transformation");
  }
  readFrames(parameters, hand_eye);
  hand_eye.camera_in_flange = readMotion(transformation, "transformation");
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

HandEyePosesFile posesFromYaml(const YAML::Node& root)
{
  HandEyePosesFile file;
  const YAML::Node parameters = root.IsMap() ? root["parameters"] : YAML::Node();
  const YAML::Node view = root.IsMap() ? root["view"] : YAML::Node();
  const YAML::Node poses = root.IsMap() ? root["poses"] : YAML::Node();
  if (!parameters || !parameters.IsMap() || !view || !view.IsMap() || !poses || !poses.IsSequence())
  {
    throw std::runtime_error("it has not all of parameters, view and poses");
  }
  readFrames(parameters, file);
  if (const YAML::Node height = root["camera_height"])
  {
    file.camera_height = height.as<double>();
  }
  file.view_name = entry(view, "view", "name").as<std::string>();
  file.view.k = readMatrix(view, "view", "camera_matrix");
  for (const std::vector<double>& corner : entry(view, "view", "corners").as<std::vector<std::vector<double>>>())
  {
    if (corner.size() != 2)
    {
      throw std::runtime_error("a corner of view/corners has not 2 numbers");
    }
    file.view.corners.emplace_back(corner[0], corner[1]);
  }
  for (const YAML::Node& pose : poses)
  {
    const std::string name = "poses/" + std::to_string(file.poses.size());
    file.poses.push_back(
        { readMotion(entry(pose, name, "flange"), name + "/flange"), readMatrix(pose, name, "homography") });
  }
  return file;
}

/** Writes a file in one step. */
void write(const YAML::Emitter& out, const std::string& path)
{
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
  YAML::Emitter out;
  out.SetDoublePrecision(DIGITS);
  out << YAML::Comment(hand_eye.comment) << YAML::BeginMap;
  writeFrames(out, hand_eye);
  out << YAML::Key << "transformation" << YAML::Value;
  writeMotion(out, hand_eye.camera_in_flange);
  if (!hand_eye.covariance.empty())
  {
    out << YAML::Key << "covariance" << YAML::Value << YAML::Flow << hand_eye.covariance;
  }
  out << YAML::EndMap;
  write(out, path);
}

HandEyePosesFile readHandEyePosesFile(const std::string& path)
{
  try
  {
    return posesFromYaml(loadSmallYamlFile(path));
  }
  catch (const std::exception& error)
  {
    throw std::runtime_error("no poses for a hand-eye calibration can be read from '" + path + "': " + oneLine(error));
  }
}

void writeHandEyePosesFile(const HandEyePosesFile& poses, const std::string& path)
{
  constexpr int DIGITS = 16;  // so that the calibration comes out the same
  YAML::Emitter out;
  out.SetDoublePrecision(DIGITS);
  out << YAML::Comment(poses.comment) << YAML::BeginMap;
  writeFrames(out, poses);
  if (!std::isnan(poses.camera_height))
  {
    out << YAML::Key << "camera_height" << YAML::Value << poses.camera_height;
  }
  out << YAML::Key << "view" << YAML::Value << YAML::BeginMap << YAML::Key << "name" << YAML::Value << poses.view_name
      << YAML::Key << "camera_matrix" << YAML::Value;
  writeMatrix(out, poses.view.k);
  out << YAML::Key << "corners" << YAML::Value << YAML::Flow << YAML::BeginSeq;
  for (const Eigen::Vector2d& corner : poses.view.corners)
  {
    out << std::vector<double>{ corner.x(), corner.y() };
  }
  out << YAML::EndSeq << YAML::EndMap << YAML::Key << "poses" << YAML::Value << YAML::BeginSeq;
  for (const HandEyePose& pose : poses.poses)
  {
    out << YAML::BeginMap << YAML::Key << "flange" << YAML::Value << YAML::Flow;
    writeMotion(out, pose.flange_in_base);
    out << YAML::Key << "homography" << YAML::Value;
    writeMatrix(out, pose.h);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  write(out, path);
}

}  // namespace view_servo
