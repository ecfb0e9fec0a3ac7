// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace YAML  // NOLINT(readability-identifier-naming): that of yaml-cpp
{
class Node;
}

namespace view_servo
{
/** @file Every text in YAML that may come from elsewhere is read by these. */

/**
 * What a text in YAML holds. It comes to an end with every text, while YAML::Load() of yaml-cpp 0.6 takes all memory
 * for one that ends after a colon within braces. Aliases may not make more of it than it seems to be: a few lines of
 * them can stand for more values than fit into memory.
 * @throws std::exception when it is no YAML, larger than 4 MB, nested deeper than 100 times, or when it stands for more
 * than a million values.
 */
YAML::Node parseYaml(const std::string& text);

/**
 * What a YAML file of at most 1 MB holds.
 * @throws std::exception when there is no regular file, when it is larger or cannot be read, or as parseYaml().
 */
YAML::Node loadSmallYamlFile(const std::string& path);

/**
 * A finite number as a plain scalar that is read as this number, to the last bit. yaml-cpp before 0.6.3 itself writes 16
 * digits at most.
 */
std::string exactText(double number);

}  // namespace view_servo
