// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/shipped_worlds.h"

#include "sim/world_reader.h"
#include "tools/package_folder.h"

namespace view_servo
{
sim::World readShippedWorld(const std::string& name)
{
  return sim::findWorld(name, packageFolder() / "config" / "worlds");
}

Worlds readShippedWorlds(const std::vector<std::string>& names)
{
  Worlds worlds;
  for (const std::string& name : names)
  {
    worlds.emplace(name, readShippedWorld(name));
  }
  return worlds;
}

}  // namespace view_servo
