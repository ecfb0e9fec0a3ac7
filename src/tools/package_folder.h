// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace view_servo
{
/** Where the package's files lie: in the source tree, or where they were installed. */
std::filesystem::path packageFolder();

}  // namespace view_servo
