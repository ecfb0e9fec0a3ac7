// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

namespace view_servo::check
{
/** Measures how much of this computer's processors is idle, from the object's construction on. Linux only. */
class ProcessorMeter
{
public:
  ProcessorMeter();

  /** Cores that were idle, on average; NaN when the system does not tell. */
  double idleCores() const;
  /** Number of cores. */
  static int cores();

private:
  struct Ticks
  {
    double idle = 0.0;  // idle time of all cores since the computer started, in the system's units
    double all = 0.0;   // all time of all cores, likewise
  };
  static Ticks read();

  Ticks begin_;
};

/** Space for files in a directory that need not exist yet. */
struct DiskSpace
{
  std::string fault;  ///< why nothing could be written there, in one line; empty: it could
  double free = 0.0;  ///< space that is free [bytes]
};
DiskSpace diskSpace(const std::filesystem::path& directory);

}  // namespace view_servo::check
