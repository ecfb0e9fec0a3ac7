// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/package_folder.h"

#include <ros/package.h>

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
  return program.parent_path().parent_path().parent_path() / "share" / PACKAGE;
}

}  // namespace view_servo
