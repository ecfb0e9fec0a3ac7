// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "small_yaml_file.h"

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace view_servo
{
YAML::Node loadSmallYamlFile(const std::string& path)
{
  constexpr std::uintmax_t LARGEST = 1000000;  // [bytes]
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error))
  {
    throw std::runtime_error("there is no such file");
  }
  if (std::filesystem::file_size(path) > LARGEST)
  {
    throw std::runtime_error("it is larger than 1 MB, as no such file is");
  }
  std::ifstream file(path);
  return YAML::Load(file);
}

}  // namespace view_servo
