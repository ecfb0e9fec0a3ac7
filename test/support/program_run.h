// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/temporary_directory.h"
#include "support/text_file.h"

#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** How a program ended, and what it printed. */
struct ProgramRun
{
  int status;  ///< of its exit; -1: a signal ended it
  std::string out;
  std::string err;
};

/**
 * Runs a program as a shell does, with nothing to read, until it ends.
 * @param arguments each is one word for the program, whatever is in it but single quotes.
 * @param before commands that the shell carries out first, in the same process.
 */
inline ProgramRun runProgram(const std::string& program, const std::vector<std::string>& arguments,
                             const std::string& before = ":")
{
  const TemporaryDirectory directory;
  const std::filesystem::path out = directory.path() / "out";
  const std::filesystem::path err = directory.path() / "err";
  std::string command = before + "; '" + program + "'";
  for (const std::string& argument : arguments)
  {
    command += " '" + argument + "'";
  }
  command += " > '" + out.string() + "' 2> '" + err.string() + "' < /dev/null";
  const int status = std::system(command.c_str());
  return { WIFEXITED(status) ? WEXITSTATUS(status) : -1, readText(out), readText(err) };
}

/** Expects status 2 and nothing printed but one line, on stderr, which names `culprit`. */
inline void expectBadInput(const ProgramRun& run, const std::string& culprit)
{
  EXPECT_EQ(run.status, 2) << culprit;
  EXPECT_EQ(run.out, "");
  EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
  EXPECT_NE(run.err.find(culprit), std::string::npos) << run.err << " does not name " << culprit;
}

}  // namespace test
}  // namespace view_servo
