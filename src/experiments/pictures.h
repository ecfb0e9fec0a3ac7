// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
/** The picture files (jpg, pgm, png, ppm) below a folder, sorted, by the names of the scenes that they show. */
std::map<std::string, std::vector<std::filesystem::path>> findPictures(const std::filesystem::path& data);

}  // namespace view_servo
