// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"

#include <map>
#include <string>
#include <vector>

namespace view_servo
{
using Worlds = std::map<std::string, sim::World>;  ///< by their names

/** A world of this package's `config/worlds/`, by its name. @throws as sim::findWorld() and packageFolder() do. */
sim::World readShippedWorld(const std::string& name);

/** Several of them. */
Worlds readShippedWorlds(const std::vector<std::string>& names);

}  // namespace view_servo
