// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"

#include <filesystem>
#include <string>

namespace view_servo::sim
{
/**
 * Reads a world from a YAML file; the README of `config/worlds/` says what such a file may hold. The world's name is
 * that of the file without its ending, and files of textures are looked for in the file's folder.
 * @throws std::invalid_argument with the file's name, the line, and what is wrong there.
 */
World readWorld(const std::string& file);

/**
 * Reads a world that is given as a file, or by its name: then it is the file NAME.yaml of `directory`.
 * @throws std::invalid_argument as readWorld() does, or when there is no such file.
 */
World findWorld(const std::string& file_or_name, const std::filesystem::path& directory);

}  // namespace view_servo::sim
