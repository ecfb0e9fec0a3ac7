// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/calibration_files.h"

#include "view_servo/parameters/error_text.h"

#include <Eigen/Geometry>

#include <cstdio>
#include <ctime>
#include <exception>
#include <iostream>

namespace view_servo
{
std::string fixed(const std::vector<double>& values, int decimals)
{
  std::string text;
  for (const double value : values)
  {
    char number[32];
    std::snprintf(number, sizeof number, "%.*f", decimals, value);
    text += (text.empty() ? "" : " ") + std::string(number);
  }
  return text;
}

std::string dateAndTime()
{
  const std::time_t now = std::time(nullptr);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M", std::localtime(&now));
  return text;
}

HandEyePosesFile posesOf(const HandEyeSession& session, const HandEyeSources& sources)
{
  HandEyePosesFile poses;
  poses.base_frame = sources.base_frame;
  poses.flange_frame = sources.flange_frame;
  poses.camera_frame = session.cameraFrame();
  poses.view_name = sources.view;
  poses.view = session.view();
  poses.poses = session.poses();
  return poses;
}

void keepPoses(HandEyePosesFile poses, const std::string& path, const std::string& program)
{
  if (path.empty())
  {
    return;
  }
  try
  {
    poses.comment = program + ", " + dateAndTime() + ": poses for its option --file";
    writeHandEyePosesFile(poses, path);
    std::cout << poses.poses.size() << " poses are kept in " << path << std::endl;
  }
  catch (const std::exception& error)
  {
    std::cerr << program << ": the poses are not kept: " << oneLine(error) << std::endl;
  }
}

std::vector<double> numbersOf(const Eigen::Matrix<double, 6, 6>& covariance)
{
  std::vector<double> numbers;
  for (int row = 0; row < 6; ++row)
  {
    for (int column = 0; column < 6; ++column)
    {
      numbers.push_back(covariance(row, column));
    }
  }
  return numbers;
}

std::string numbersOf(const Eigen::Isometry3d& pose)
{
  const Eigen::Vector3d place = pose.translation();
  const Eigen::Quaterniond turn(pose.linear());
  return fixed({ place.x(), place.y(), place.z() }, 6) + " " + fixed({ turn.x(), turn.y(), turn.z(), turn.w() }, 8);
}

}  // namespace view_servo
