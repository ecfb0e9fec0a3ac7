// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

extern char** environ;

namespace view_servo
{
namespace test
{
/** A program that a test starts, with all that it starts itself: a process group that ends with this object. */
class ChildProcess
{
public:
  /**
   * @param command the program, looked for in PATH, and its arguments.
   * @param output file that takes what it prints; empty: that goes where the test's goes.
   */
  explicit ChildProcess(std::vector<std::string> command, std::filesystem::path output = {})
    : output_(std::move(output))
  {
    std::vector<char*> argv;
    for (std::string& word : command)
    {
      argv.push_back(word.data());
    }
    argv.push_back(nullptr);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);  // some take what is typed as commands
    if (!output_.empty())
    {
      posix_spawn_file_actions_addopen(&actions, 1, output_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
      posix_spawn_file_actions_adddup2(&actions, 1, 2);
    }
    EXPECT_EQ(posix_spawnp(&pid_, argv[0], &actions, &attributes, argv.data(), environ), 0) << command[0];
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
  }

  ~ChildProcess()
  {
    if (pid_ > 0 && !exited())
    {
      interrupt();
      if (!exitStatus())
      {
        ADD_FAILURE() << "process " << pid_ << " did not end";
        kill(-pid_, SIGKILL);
        waitpid(pid_, nullptr, 0);
      }
    }
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void interrupt() const
  {
    kill(-pid_, SIGINT);
  }
  void terminate() const
  {
    kill(-pid_, SIGTERM);
  }

  bool exited()
  {
    if (!exit_status_)
    {
      int status = 0;
      if (waitpid(pid_, &status, WNOHANG) == pid_)
      {
        exit_status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      }
    }
    return exit_status_.has_value();
  }

  /** Waits for the end; 128 + the signal when one ended it. */
  std::optional<int> exitStatus()
  {
    waitUntil([&] { return exited(); });
    return exit_status_;
  }

  std::string output() const
  {
    return { std::istreambuf_iterator<char>(std::ifstream(output_).rdbuf()), {} };
  }

private:
  std::filesystem::path output_;
  pid_t pid_ = 0;
  std::optional<int> exit_status_;
};

}  // namespace test
}  // namespace view_servo
