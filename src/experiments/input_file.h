// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace view_servo
{
/** @throws std::runtime_error naming the file when it cannot be read. */
inline std::ifstream openForReading(const std::filesystem::path& file)
{
  std::ifstream stream(file);
  if (!stream)
  {
    throw std::runtime_error("cannot read " + file.string());
  }
  return stream;
}

}  // namespace view_servo
