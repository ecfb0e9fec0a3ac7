// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace view_servo
{
/**
 * The folder with `config/` and `urdf/` of this package: its source tree, or where it was installed.
 * @throws std::runtime_error when ROS does not find the package, and this program is not installed.
 */
std::filesystem::path packageFolder();

}  // namespace view_servo
