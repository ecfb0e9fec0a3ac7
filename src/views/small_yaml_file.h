// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace view_servo
{
/**
 * What a yaml file of at most 1 MB holds.
 * @throws std::exception when there is no regular file, when it is larger, or when it is no yaml.
 */
YAML::Node loadSmallYamlFile(const std::string& path);

}  // namespace view_servo
