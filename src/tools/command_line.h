// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <iostream>
#include <sstream>
#include <string>

namespace view_servo
{
/** @file What the command-line programs promise: one line on standard error, and nothing else there. */

/** Messages may have several lines; this joins them. */
inline std::string oneLine(const std::string& text)
{
  std::istringstream lines(text);
  std::string joined;
  for (std::string line; std::getline(lines >> std::ws, line);)
  {
    joined += (joined.empty() ? "" : " ") + line;
  }
  return joined;
}

/** Keeps standard error quiet: libraries, such as decoders of images, write there on their own. */
class QuietStandardError
{
public:
  QuietStandardError() : standard_error_(dup(STDERR_FILENO))
  {
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    dup2(nowhere, STDERR_FILENO);
    close(nowhere);
  }
  ~QuietStandardError()
  {
    std::cerr.flush();
    std::fflush(stderr);
    dup2(standard_error_, STDERR_FILENO);
    close(standard_error_);
  }
  QuietStandardError(const QuietStandardError&) = delete;
  QuietStandardError& operator=(const QuietStandardError&) = delete;

private:
  int standard_error_;
};

}  // namespace view_servo
