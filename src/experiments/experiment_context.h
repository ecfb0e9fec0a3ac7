// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>

namespace view_servo
{
/** What an experiment is given. */
struct ExperimentContext
{
  std::filesystem::path data;  ///< real images, for those that need them
  bool brief = false;          ///< do a small part only
  int threads = 0;             ///< at most so many; 0: as many as there are processors
};

}  // namespace view_servo
