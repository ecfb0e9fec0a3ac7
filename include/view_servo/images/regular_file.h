// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace view_servo
{
/**
 * All bytes of a file; empty when there is none of that name. Pipes, devices and directories are refused and never
 * waited for. @param max_size larger files are refused [bytes]. @throws std::runtime_error saying why, without the
 * file's name.
 */
std::optional<std::string> readRegularFile(const std::filesystem::path& path, std::uintmax_t max_size);

}  // namespace view_servo
