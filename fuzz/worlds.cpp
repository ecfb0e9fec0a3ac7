// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "sim/world_reader.h"

#include <stdexcept>

using namespace view_servo;

/** A world of the simulation. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  static const fuzz::Directory directory;
  fuzz::readOrRefuse<std::invalid_argument>([&] {
    const sim::World world = sim::readWorld(directory.write("world.yaml", fuzz::toString(data, size)));
    fuzz::require(world.camera.width > 0 && world.camera.height > 0, "a world has a camera");
  });
  return 0;
}
