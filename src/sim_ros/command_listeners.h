// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace view_servo
{
/**
 * Whether somebody else listens to the commands of a simulated robot: a real one at the same master would follow them.
 * Recorders and what shows topics are known by their names. A listener that publishes nothing itself is warned of only.
 * @param topic of the commands, beside those that the server of `action` publishes, whatever they are called.
 * @param robot the simulated robot's node. All are fully resolved.
 * @return who must not be there, and what to do, in one line; empty: nobody.
 */
std::string foreignListener(const std::string& topic, const std::string& action, const std::string& robot);

}  // namespace view_servo
