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
/** @file Command-line programs write one line on standard error when they fail, and nothing else there. */

/** Joins the lines of a message. */
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

/** As long as it lives, standard error is discarded: some libraries, as those that decode images, write there. */
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
