// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcntl.h>
#include <unistd.h>
#include <boost/program_options/options_description.hpp>
#include <boost/program_options/variables_map.hpp>

#include <cstdint>
#include <cstdio>
#include <iostream>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/** @file Command-line programs write one line on standard error when they fail, and nothing else there. */

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

/** @throws std::runtime_error when what was printed there is not written, as on a full disk. */
void requireWritten(std::ostream& standard_output);

/** Words of a command line that a program does not understand: what() names the option, and what it takes. */
class CommandLineError : public std::runtime_error
{
  using std::runtime_error::runtime_error;
};

/** A range of numbers, its ends included. */
struct NumberRange
{
  double low = 0.0;
  double high = std::numeric_limits<double>::infinity();
};

/**
 * What a program takes on its command line: options by their long names ("--rate 5" or "--rate=5"), each once but
 * lists, and words without a name. All that is bound has to outlive parse().
 */
class CommandLine
{
public:
  /** @param introduction what the program does and how it is called. @param ending for the end of --help. */
  CommandLine(std::string introduction, std::string ending);

  /** An option without a value; `value` becomes true when it is given. */
  void flag(const std::string& name, bool& value, const std::string& description);
  /** An option whose value is any text. Without it `value` stays as it is, here and below. */
  void text(const std::string& name, std::string& value, const std::string& description);
  /** An option whose value is one of `words`. */
  void choice(const std::string& name, std::string& value, const std::vector<std::string>& words,
              const std::string& description);
  /** An option that may be given more than once. @param separator between several values in one word; 0: none. */
  void list(const std::string& name, std::vector<std::string>& values, const std::string& description,
            char separator = '\0');

  /**
   * An option whose value is a number within `range`. @tparam Number double, int, std::uint64_t, or std::optional of
   * one, which has no default.
   */
  template <typename Number>
  void number(const std::string& name, Number& value, const NumberRange& range, const std::string& description);

  /** @return the words without a name, in their order; nothing when --help was asked for, and has been printed. */
  std::optional<std::vector<std::string>> parse(int argc, const char* const* argv);

  /** Whether the command line had an option. */
  bool has(const std::string& name) const
  {
    return given_.count(name) > 0 && !given_[name].defaulted();
  }

private:
  /** @param take gets the word after the option's name. */
  template <typename Take>
  void addWord(const std::string& name, const std::string& kind, const std::string& description, const Take& take);

  std::string introduction_;
  std::string ending_;
  boost::program_options::options_description options_{ "Options" };
  boost::program_options::variables_map given_;
};

}  // namespace view_servo
