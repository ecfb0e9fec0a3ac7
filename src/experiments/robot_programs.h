// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

namespace view_servo
{
/** @file Programs in Python that run simulated robots with their nodes, and that `experiments` starts by name. */

inline constexpr Repetition CAMPAIGN_RUNS{ "runs of each fault with each driver", 1, 1, 1 };
inline constexpr Repetition SOAK_DRAWS{ "", 0, 0, 1 };

/** What such a program is told. */
struct RobotProgramOptions
{
  std::filesystem::path out;          ///< folder of its table
  bool brief = false;                 ///< a small part only
  std::optional<int> runs;            ///< empty: as many as the program does by itself
  std::optional<std::uint64_t> seed;  ///< empty: the program's own
  std::optional<double> hours;        ///< empty: the program's own [h]
};

/**
 * Becomes the program, whose exit status is this process' then: 0 all was good, 1 not, 2 bad input.
 * @param script of the source tree of this package, relative to it.
 * @throws std::runtime_error when it cannot be started, as where this package is installed without its source tree.
 */
[[noreturn]] void becomeRobotProgram(const std::string& script, const RobotProgramOptions& options);

}  // namespace view_servo
