// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/package_folder.h"

#include <ros/package.h>

#include <stdexcept>
#include <string>

namespace view_servo
{
std::filesystem::path packageFolder()
{
  constexpr char PACKAGE[] = "view_servo";
  const std::string found = ros::package::getPath(PACKAGE);
  if (!found.empty())
  {
    return found;
  }
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe");
  std::filesystem::path installed = program.parent_path().parent_path().parent_path() / "share" / PACKAGE;
  if (!std::filesystem::exists(installed))
  {
    throw std::runtime_error("ROS does not find the package view_servo: source the setup.bash of its workspace");
  }
  return installed;
}

}  // namespace view_servo
