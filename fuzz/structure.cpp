// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/views/view_structure.h"

#include <stdexcept>

using namespace view_servo;

/** What has been learnt of a view. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  fuzz::readOrRefuse<std::runtime_error>([&] {
    const ViewStructure structure = structureFromText(fuzz::toString(data, size));
    for (const StructurePoint& point : structure.points)
    {
      fuzz::require(point.pixel.allFinite() && point.inverse_depth > 0.0 && point.information > 0.0,
                    "points are as the header says");
    }
    const std::string text = toText(structure);
    fuzz::require(toText(structureFromText(text)) == text, "what is written is read as it was");
  });
  return 0;
}
