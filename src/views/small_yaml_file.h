// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace view_servo
{
/**
 * What a yaml file of at most 1 MB holds. @param none what a larger file is not, for the message: "no calibration", say.
 * @throws std::exception when there is no regular file, when it is larger, or when it is no yaml.
 */
YAML::Node loadSmallYamlFile(const std::string& path, const std::string& none);

}  // namespace view_servo
