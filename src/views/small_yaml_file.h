// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace view_servo
{
/**
 * What a yaml text says. Its aliases may not make more of it than it seems to be: a few lines of them can stand for more
 * values than fit into memory.
 * @throws std::exception when it is no yaml, larger than 4 MB, nested deeper than 100 times, or when it stands for more than a
 * million values.
 */
YAML::Node loadBoundedYaml(const std::string& text);

/**
 * What a yaml file of at most 1 MB holds.
 * @throws std::exception when there is no regular file, when it is larger, or as loadBoundedYaml().
 */
YAML::Node loadSmallYamlFile(const std::string& path);

}  // namespace view_servo
