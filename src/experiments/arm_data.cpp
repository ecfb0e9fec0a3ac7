// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/arm_data.h"

#include "experiments/input_file.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>

#include <algorithm>
#include <exception>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

/** Of ViSP's XML; the camera has no distortion. */
Camera readCamera(const fs::path& file)
{
  std::ifstream stream = openForReading(file);
  const std::string text{ std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>() };
  const auto value = [&](const std::string& tag) {
    const std::size_t at = text.find("<" + tag + ">");
    if (at == std::string::npos)
    {
      throw std::runtime_error(file.string() + " has no <" + tag + ">");
    }
    return std::stod(text.substr(at + tag.size() + 2));
  };
  Camera camera;
  camera.width = static_cast<int>(value("image_width"));
  camera.height = static_cast<int>(value("image_height"));
  camera.k << value("px"), 0.0, value("u0"), 0.0, value("py"), value("v0"), 0.0, 0.0, 1.0;
  return camera;
}

/** Position [m] and rotation vector [rad], as ViSP writes them. */
Eigen::Isometry3d readPose(const fs::path& file)
{
  Eigen::Matrix<double, 6, 1> values;
  try
  {
    const YAML::Node data = loadSmallYamlFile(file.string())["data"];
    for (int i = 0; i < 6; ++i)
    {
      values(i) = data[i][0].as<double>();
    }
  }
  catch (const std::exception& error)
  {
    throw std::runtime_error("cannot read " + file.string() + ": " + error.what());
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = values.head<3>();
  pose.linear() = rotationFromVector(values.tail<3>());
  return pose;
}

}  // namespace

std::vector<Eigen::Vector3d> ArmData::board()
{
  std::vector<Eigen::Vector3d> corners;
  for (int row = 0; row < ROWS; ++row)
  {
    for (int column = 0; column < COLUMNS; ++column)
    {
      corners.emplace_back(SQUARE * column, SQUARE * row, 0.0);
    }
  }
  return corners;
}

ArmData readArmData(const fs::path& folder)
{
  ArmData data;
  data.camera = readCamera(folder / "franka_camera.xml");
  std::ifstream hand = openForReading(folder / "derived_eMc_park.txt");
  for (int i = 0; i < 16; ++i)
  {
    hand >> data.camera_in_hand.matrix()(i / 4, i % 4);
  }
  if (!hand)
  {
    throw std::runtime_error("no pose in " + (folder / "derived_eMc_park.txt").string());
  }
  // Images count from 1, corners from 0, in order.
  std::ifstream corners = openForReading(folder / "derived_chessboard_corners.txt");
  for (std::string line; std::getline(corners, line);)
  {
    std::istringstream words(line);
    std::size_t image = 0;
    std::size_t corner = 0;
    Eigen::Vector2d position;
    if (words >> image >> corner >> position.x() >> position.y())
    {
      if (image > data.views.size())
      {
        const std::string name = "franka_pose_rPe_" + std::to_string(data.views.size() + 1) + ".yaml";
        const Eigen::Isometry3d hand_in_base = readPose(folder / name);
        data.views.push_back({ hand_in_base, hand_in_base * data.camera_in_hand, {} });
      }
      if (image != data.views.size() || corner != data.views.back().corners.size())
      {
        throw std::runtime_error("corners are not in order: " + line);
      }
      data.views.back().corners.push_back(position);
    }
  }
  const auto differs = [](const ArmView& view) {
    return view.corners.size() != ArmData::CORNERS;
  };
  if (data.views.size() < 2 || std::any_of(data.views.begin(), data.views.end(), differs))
  {
    throw std::runtime_error("images are missing, or corners of them: " + folder.string());
  }
  return data;
}

double removeDistortion(ArmData& data)
{
  std::vector<cv::Point3f> board;
  for (const Eigen::Vector3d& corner : ArmData::board())
  {
    board.emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()), 0.0F);
  }
  std::vector<std::vector<cv::Point2f>> corners;
  for (const ArmView& view : data.views)
  {
    corners.emplace_back();
    for (const Eigen::Vector2d& corner : view.corners)
    {
      corners.back().emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()));
    }
  }
  cv::Mat k;
  cv::eigen2cv(data.camera.k, k);
  cv::Mat distortion = cv::Mat::zeros(5, 1, CV_64F);
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  const double rms =
      cv::calibrateCamera(std::vector<std::vector<cv::Point3f>>(corners.size(), board), corners,
                          cv::Size(data.camera.width, data.camera.height), k, distortion, rotations, translations,
                          cv::CALIB_USE_INTRINSIC_GUESS | cv::CALIB_FIX_FOCAL_LENGTH | cv::CALIB_FIX_PRINCIPAL_POINT |
                              cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K3);
  Camera distorted = data.camera;
  distorted.distortion_model = "plumb_bob";
  distorted.distortion.assign(distortion.begin<double>(), distortion.end<double>());
  for (ArmView& view : data.views)
  {
    for (Eigen::Vector2d& corner : view.corners)
    {
      corner = (data.camera.k * distorted.normalized(corner).homogeneous()).hnormalized();
    }
  }
  return rms;
}

}  // namespace view_servo
