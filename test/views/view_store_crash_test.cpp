// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// What a store holds when whoever saves is killed, or not alone.
#include "view_store_test.h"

#include <sys/ptrace.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <optional>
#include <thread>

namespace view_servo
{
namespace test
{
namespace
{
/**
 * Runs `action` in a child process that is killed when it enters its system call number `calls`.
 * @return whether the child came so far; false: it had ended before. Empty when this machine allows no tracing.
 */
template <typename Action>
std::optional<bool> killAtSystemCall(int calls, const Action& action)
{
  constexpr int DONE = 0;
  constexpr int NO_TRACING = 77;
  const pid_t child = fork();
  if (child == 0)
  {
    if (ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0)
    {
      _exit(NO_TRACING);
    }
    raise(SIGSTOP);
    action();
    _exit(DONE);
  }
  int status = 0;
  waitpid(child, &status, 0);
  // Each system call stops the child twice, when it enters and when it leaves the kernel.
  for (int stops = 0; WIFSTOPPED(status) && stops < 2 * calls - 1; ++stops)
  {
    ptrace(PTRACE_SYSCALL, child, nullptr, nullptr);
    waitpid(child, &status, 0);
  }
  if (WIFEXITED(status))
  {
    return WEXITSTATUS(status) == NO_TRACING ? std::nullopt : std::optional<bool>(false);
  }
  kill(child, SIGKILL);
  waitpid(child, &status, 0);
  return true;
}

TEST_F(ViewStoreTest, IgnoresAndClearsWhatACrashLeft)
{
  store_.save(plainView("desk", 1), false);
  store_.save(plainView("desk-2", 1), false);
  // A new image in place, the yaml file that names it not yet.
  writeText(store_.directory() / "desk.0123456789abcdef.png", "half an image");
  writeText(store_.directory() / "desk.0123456789abcdef.png.tmp", "half");
  writeText(store_.directory() / "desk.yaml.tmp", "format: 1\n");
  writeText(store_.directory() / "new.yaml.tmp", "format: 1\n");

  EXPECT_EQ(store_.list().names, (std::vector<std::string>{ "desk", "desk-2" }));
  EXPECT_TRUE(store_.list().damaged.empty());
  expectSame(store_.load("desk"), plainView("desk", 1));

  store_.save(plainView("desk", 2), true);
  store_.save(plainView("new", 3), false);
  expectSame(store_.load("desk"), plainView("desk", 2));
  expectSame(store_.load("new"), plainView("new", 3));
  EXPECT_EQ(filesIn(store_.directory()).size(), 6U);
}

TEST_F(ViewStoreTest, HoldsTheOldOrTheNewViewWhereverSavingIsKilled)
{
  const StoredView before = plainView("desk", 1);
  StoredView after = fullView("desk");
  after.image = randomPicture(2, PLAIN_SIZE);

  int seen_before = 0;
  int seen_after = 0;
  bool killed = true;
  for (int calls = 1; killed; ++calls)
  {
    store_.save(before, true);
    const std::optional<bool> result = killAtSystemCall(calls, [&] { store_.save(after, true); });
    if (!result)
    {
      GTEST_SKIP() << "tracing is not permitted here";
    }
    killed = *result;

    EXPECT_TRUE(store_.list().damaged.empty());
    const StoredView view = store_.load("desk");
    const bool is_after = view.stamp == after.stamp;
    (is_after ? seen_after : seen_before) += 1;
    expectSame(view, is_after ? after : before);
  }
  EXPECT_GT(seen_before, 5);
  EXPECT_GT(seen_after, 5);
}

TEST_F(ViewStoreTest, TwoProcessesSaveOneName)
{
  constexpr int TIMES = 60;
  const auto save_often = [this](int seed) {
    for (int i = 0; i < TIMES; ++i)
    {
      store_.save(plainView("dock", seed), true);
    }
  };
  store_.save(plainView("dock", 1), false);
  const pid_t child = fork();
  if (child == 0)
  {
    try
    {
      save_often(2);
      _exit(0);
    }
    catch (const std::exception&)
    {
      _exit(1);
    }
  }
  std::atomic<bool> done{ false };
  std::thread reader([&] {
    while (!done)
    {
      EXPECT_NO_THROW(store_.load("dock"));
    }
  });
  EXPECT_NO_THROW(save_often(3));
  int status = -1;
  waitpid(child, &status, 0);
  done = true;
  reader.join();
  EXPECT_EQ(status, 0);
  EXPECT_EQ(filesIn(store_.directory()).size(), 2U);
}

TEST_F(ViewStoreTest, ReadersSeeTheOldOrTheNewViewWhileItIsSaved)
{
  // Stamp and image tell the same number, so that a mixture would show.
  const auto numbered = [](int number) {
    StoredView view = plainView("desk");
    view.image.setTo(number);
    view.stamp = number;
    return view;
  };
  store_.save(numbered(0), false);

  std::atomic<bool> done{ false };
  std::thread writer([&] {
    for (int number = 1; number <= 100; ++number)
    {
      store_.save(numbered(number), true);
    }
    done = true;
  });
  int last = 0;
  while (!done)
  {
    EXPECT_NO_THROW({
      const StoredView view = store_.load("desk");
      const int number = static_cast<int>(view.stamp);
      EXPECT_GE(number, last);
      last = number;
      EXPECT_EQ(largestDifference(view.image, numbered(number).image), 0.0) << number;
    });
  }
  writer.join();
  EXPECT_EQ(store_.load("desk").stamp, 100.0);
}

}  // namespace
}  // namespace test
}  // namespace view_servo
