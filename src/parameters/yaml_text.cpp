// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <system_error>

namespace view_servo
{
namespace
{
/**
 * Counts the values of a node, aliases followed. @throws std::runtime_error as soon as there are too many, or too deep.
 */
void countValues(const YAML::Node& node, std::size_t depth, std::size_t& count)
{
  constexpr std::size_t MOST = 1'000'000;
  constexpr std::size_t DEEPEST = 100;
  if (depth > DEEPEST)
  {
    throw std::runtime_error("it is nested deeper than " + std::to_string(DEEPEST) +
                             " times: write it without aliases");
  }
  if (++count > MOST)
  {
    throw std::runtime_error("it stands for more than a million values: write it without aliases");
  }
  for (const auto& entry : node)
  {
    if (node.IsMap())
    {
      countValues(entry.first, depth + 1, count);
      countValues(entry.second, depth + 1, count);
    }
    else
    {
      countValues(entry, depth + 1, count);
    }
  }
}

}  // namespace

YAML::Node parseYaml(const std::string& text)
{
  constexpr std::size_t LARGEST = 4'000'000;  // [bytes]
  if (text.size() > LARGEST)
  {
    throw std::runtime_error("it is larger than 4 MB, as no such file is");
  }
  YAML::Node root = YAML::Load(text + '\n');  // the end of a line is what ends it
  std::size_t count = 0;
  countValues(root, 0, count);
  return root;
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

std::string exactText(double number)
{
  char text[40];
  std::snprintf(text, sizeof(text), "%.*g", std::numeric_limits<double>::max_digits10, number);
  return text;
}

}  // namespace view_servo
