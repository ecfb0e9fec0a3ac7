// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/text_file.h"
#include "test_paths.h"

#include <string>

namespace view_servo
{
namespace test
{
/** @file Files that the package ships. */

inline const std::string WORLDS_DIRECTORY = PACKAGE_DIR "/config/worlds";

/** The file of a world, by its name. */
inline std::string worldFile(const std::string& name)
{
  return WORLDS_DIRECTORY + "/" + name + ".yaml";
}

inline const std::string PUMA_URDF_FILE = PACKAGE_DIR "/urdf/puma560.urdf";

/** The description of the simulated arm, as text. */
inline std::string pumaUrdf()
{
  return readText(PUMA_URDF_FILE);
}

}  // namespace test
}  // namespace view_servo
