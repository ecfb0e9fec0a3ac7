// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <filesystem>
#include <string>

namespace view_servo::check
{
/** What is left of this computer's processors from the construction on. Linux. */
class ProcessorMeter
{
public:
  ProcessorMeter();

  /** Cores that were idle, on average; NaN when the system does not tell. */
  double idleCores() const;
  static int cores();

private:
  struct Ticks
  {
    double idle = 0.0;
    double all = 0.0;
  };
  static Ticks read();

  Ticks begin_;
};

/** Space for files in a directory that need not exist yet. */
struct DiskSpace
{
  std::string fault;  ///< why nothing could be written there, in one line; empty: it could
  double free = 0.0;  ///< [bytes]
};
DiskSpace diskSpace(const std::filesystem::path& directory);

}  // namespace view_servo::check
