// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <system_error>

namespace view_servo
{
YAML::Node parseYaml(const std::string& text)
{
  return YAML::Load(text + '\n');  // the end of a line is what ends it
}

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
  std::ifstream file(path, std::ios::binary);
  const std::string text{ std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>() };
  if (!file)
  {
    throw std::runtime_error("it cannot be read");
  }
  return parseYaml(text);
}

}  // namespace view_servo
