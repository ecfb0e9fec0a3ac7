// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace YAML
{
class Node;
}

namespace view_servo
{
/** @file Every text in YAML that may come from elsewhere is read by these. */

/**
 * What a text in YAML holds. It comes to an end with every text, while YAML::Load() of yaml-cpp 0.6 takes all memory for
 * one that ends after a colon within braces.
 * @throws YAML::Exception when it is no YAML.
 */
YAML::Node parseYaml(const std::string& text);

/**
 * What a YAML file of at most 1 MB holds.
 * @throws std::exception when there is no regular file, when it cannot be read, is larger, or is no YAML.
 */
YAML::Node loadSmallYamlFile(const std::string& path);

}  // namespace view_servo
