// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/machine.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <system_error>
#include <thread>

namespace view_servo::check
{
ProcessorMeter::ProcessorMeter() : begin_(read())
{
}

int ProcessorMeter::cores()
{
  return static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

ProcessorMeter::Ticks ProcessorMeter::read()
{
  constexpr int FIELDS = 8;  // user nice system idle iowait irq softirq steal: what follows is counted there, too
  constexpr int IDLE = 3;
  constexpr int WAITING = 4;
  std::ifstream file("/proc/stat");
  std::string cpu;
  file >> cpu;
  Ticks ticks;
  for (int i = 0; i < FIELDS; ++i)
  {
    double value = 0.0;
    file >> value;
    ticks.all += value;
    ticks.idle += i == IDLE || i == WAITING ? value : 0.0;
  }
  return file ? ticks : Ticks();
}

double ProcessorMeter::idleCores() const
{
  const Ticks end = read();
  const double all = end.all - begin_.all;
  return all > 0.0 ? cores() * (end.idle - begin_.idle) / all : std::numeric_limits<double>::quiet_NaN();
}

DiskSpace diskSpace(const std::filesystem::path& directory)
{
  std::filesystem::path existing = std::filesystem::absolute(directory);
  std::error_code ignored;
  while (!std::filesystem::exists(existing, ignored) && existing.has_parent_path() &&
         existing != existing.parent_path())
  {
    existing = existing.parent_path();
  }
  DiskSpace space;
  if (access(existing.c_str(), W_OK | X_OK) != 0)
  {
    space.fault =
        "views cannot be written to '" + directory.string() + "': '" + existing.string() + "': " + std::strerror(errno);
    return space;
  }
  std::error_code failure;
  const std::filesystem::space_info info = std::filesystem::space(existing, failure);
  if (failure)
  {
    space.fault = "nothing is known of the disk of '" + existing.string() + "': " + failure.message();
    return space;
  }
  space.free = static_cast<double>(info.available);
  return space;
}

}  // namespace view_servo::check
