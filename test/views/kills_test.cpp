// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Two processes write views, structure and routes in one folder and are killed at random moments, while a third one
// reads.
#include "view_store_test.h"

#include "view_servo/views/route_store.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <functional>
#include <iostream>
#include <random>

namespace view_servo
{
namespace test
{
namespace
{
constexpr int WRITERS = 2;

/** What a writer says when a call has returned: a letter and a number. */
struct Word
{
  char what = 0;  // see Said
  int number = 0;
};

/** What a writer has said last of each kind: the number of what was saved; 0: nothing. */
struct Said
{
  int begun = 0;      // 'B': everything of a lower number has been done, or never will be
  int view = 0;       // 'V'
  int structure = 0;  // 'S'
  int route = 0;      // 'R'
};

/** A process with a pipe from it. */
class Process
{
public:
  Process() = default;
  explicit Process(const std::function<void(int pipe)>& body)
  {
    std::array<int, 2> ends{};
    if (pipe(ends.data()) != 0)
    {
      throw std::runtime_error("there is no pipe");
    }
    child_ = fork();
    if (child_ == 0)
    {
      close(ends[0]);
      body(ends[1]);
      _exit(0);
    }
    close(ends[1]);
    fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    pipe_ = ends[0];
  }

  /** Waits until the process says something, or a time has passed. @return whether it says something or has ended. */
  bool waitForWords(std::chrono::microseconds time) const
  {
    pollfd wanted = { pipe_, POLLIN, 0 };
    const timespec longest = { time.count() / 1'000'000, static_cast<long>(time.count() % 1'000'000) * 1000 };
    return ppoll(&wanted, 1, &longest, nullptr) > 0;
  }

  /** Kills the process. @return all that it has said. */
  std::string kill() const
  {
    ::kill(child_, SIGKILL);
    std::string words;
    std::array<char, 4096> part{};
    ssize_t count = 0;
    while ((count = read(pipe_, part.data(), part.size())) > 0 || (count < 0 && errno == EINTR))
    {
      words.append(part.data(), static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    }
    close(pipe_);
    waitpid(child_, nullptr, 0);
    return words;
  }

private:
  pid_t child_ = -1;
  int pipe_ = -1;
};

class KillsTest : public ViewStoreTest
{
protected:
  KillsTest() : routes_(store_.directory())
  {
    for (const char* name : { "w0", "w1", "both" })
    {
      store_.save(numbered(name, 1), false);
    }
    routes_.save(route("anchor", 1));
  }

  /** Its picture tells the number of its stamp, so that a mixture would show. */
  static StoredView numbered(const std::string& name, int number)
  {
    StoredView view = plainView(name, number);
    view.stamp = number;
    return view;
  }
  static ViewStructure structure(int number)
  {
    ViewStructure result;
    for (int i = 0; i < 50; ++i)
    {
      result.points.push_back({ { 1.0 + i % 8, 2.0 + i % 16 }, 1.0 / number, 1.0 + number });
    }
    return result;
  }
  static Route route(const std::string& name, int number)
  {
    return { name, "odom", { { "w0", { 0.0, 0.0, 0.0 }, 1.0 * number }, { "w1", { 1.0, 0.0, 0.5 }, 2.0 * number } } };
  }
  static std::string nameOf(int writer)
  {
    return "w" + std::to_string(writer);
  }
  static std::string routeOf(int writer, int number)
  {
    return "r" + std::to_string(writer) + "_" + std::to_string(number);
  }

  /**
   * Saves without end, from a number on, and says so. The route of the number before goes when the new one is there.
   */
  void write(int writer, int first, int pipe) const
  {
    const auto say = [&](char what, int number) {
      const Word word{ what, number };
      if (::write(pipe, &word, sizeof(word)) != static_cast<ssize_t>(sizeof(word)))
      {
        _exit(1);
      }
    };
    try
    {
      for (int number = first;; ++number)
      {
        say('B', number);
        store_.save(numbered(nameOf(writer), number), true);
        say('V', number);
        if (store_.saveStructure(nameOf(writer), store_.revision(nameOf(writer)), structure(number)))
        {
          say('S', number);
        }
        store_.save(numbered("both", number), true);
        routes_.save(route(routeOf(writer, number), number));
        say('R', number);
        if (routes_.has(routeOf(writer, number - 1)))
        {
          routes_.remove(routeOf(writer, number - 1));
        }
      }
    }
    catch (const std::exception& error)
    {
      say('E', 0);
      std::cerr << "a writer fails: " << error.what() << std::endl;
      _exit(1);
    }
  }

  /** What is wrong with a view; empty: nothing. */
  std::string faultOf(const std::string& name) const
  {
    const StoredView view = store_.load(name);
    const int number = static_cast<int>(view.stamp);
    const bool whole = largestDifference(view.image, numbered(name, number).image) == 0.0;
    return whole ? "" : "view '" + name + "' is mixed of two; ";
  }

  /** Reads all without end, and says what is wrong. */
  void readAll(int pipe) const
  {
    while (true)
    {
      std::string faults;
      try
      {
        for (const char* name : { "w0", "w1", "both" })
        {
          faults += faultOf(name);
          const std::vector<StructurePoint> points = store_.loadStructure(name).points;
          const bool one =
              points.empty() || (points.size() == 50U && points.front().information == points.back().information);
          faults += one ? "" : "what was learnt is cut short; ";
        }
        for (const ViewStore::Damaged& damaged : store_.list().damaged)
        {
          faults += "view '" + damaged.name + "': " + damaged.reason + "; ";
        }
        for (const RouteStore::Damaged& damaged : routes_.list().damaged)
        {
          faults += "route '" + damaged.name + "': " + damaged.reason + "; ";
        }
        faults += routes_.load("anchor").stops.size() == 2U ? "" : "a route is cut short; ";
      }
      catch (const std::exception& error)
      {
        faults += error.what();
      }
      faults.resize(std::min<std::size_t>(faults.size(), 1000));
      if (!faults.empty() && ::write(pipe, faults.data(), faults.size()) < 0)
      {
        _exit(1);
      }
    }
  }

  /** What a writer has said to be saved has to be there, or what it was about to put in its place. */
  void expectKept(int writer, Said& said) const
  {
    const std::string name = nameOf(writer);
    const int number = static_cast<int>(store_.load(name).stamp);
    EXPECT_TRUE(number == said.view || number == said.begun) << number << " of " << said.view << ", " << said.begun;
    EXPECT_EQ(faultOf(name), "");
    const std::vector<StructurePoint> points = store_.loadStructure(name).points;
    if (number == said.structure)
    {
      ASSERT_EQ(points.size(), 50U);
      EXPECT_EQ(points.front().information, 1.0 + number);
    }
    else
    {
      EXPECT_TRUE(points.empty() || points.front().information == 1.0 + number);
    }
    // The next one begins with what is there, said or not.
    said.view = number;
    said.structure = points.empty() ? 0 : number;
    if (said.route > 0)
    {
      EXPECT_EQ(routes_.load(routeOf(writer, said.route)).stops[1].stamp, 2.0 * said.route);
    }
  }

  RouteStore routes_;
};

TEST_F(KillsTest, LoseNothingThatWasSaved)
{
  const char* wanted = std::getenv("VIEW_SERVO_KILLS");
  const int kills = wanted != nullptr ? std::atoi(wanted) : 20;
  constexpr int LONGEST = 150'000;  // life of a writer without an answer [us]
  std::mt19937 random(5);
  std::array<Said, WRITERS> said;
  for (Said& one : said)
  {
    one.begun = one.view = 1;
  }
  const auto start = [&](int writer) {
    const int first = said[static_cast<std::size_t>(writer)].begun + 1;
    return Process([this, writer, first](int pipe) { write(writer, first, pipe); });
  };
  const Process reader([this](int pipe) { readAll(pipe); });
  std::array<Process, WRITERS> writers = { start(0), start(1) };
  int saved = 0;
  for (int kill = 0; kill < kills && !HasFailure(); ++kill)
  {
    SCOPED_TRACE("kill " + std::to_string(kill));
    const std::size_t writer = random() % WRITERS;
    const std::chrono::microseconds life(random() % LONGEST);
    // The first words come when it has begun; then it is killed at any moment.
    writers[writer].waitForWords(std::chrono::seconds(20));
    EXPECT_FALSE(reader.waitForWords(life));
    const std::string words = writers[writer].kill();
    Said& last = said[writer];
    for (std::size_t at = 0; at + sizeof(Word) <= words.size(); at += sizeof(Word))
    {
      Word word;
      std::copy_n(words.data() + at, sizeof(word), reinterpret_cast<char*>(&word));
      EXPECT_NE(word.what, 'E');
      (word.what == 'V'   ? last.view
       : word.what == 'S' ? last.structure
       : word.what == 'R' ? last.route
                          : last.begun) = word.number;
      saved += word.what == 'B' ? 0 : 1;
    }
    expectKept(static_cast<int>(writer), last);
    writers[writer] = start(static_cast<int>(writer));
  }
  for (const Process& writer : writers)
  {
    writer.kill();
  }
  EXPECT_EQ(reader.kill(), "");
  EXPECT_TRUE(store_.list().damaged.empty());
  EXPECT_TRUE(routes_.list().damaged.empty());
  EXPECT_GT(saved, 0);
  std::cout << kills << " kills, " << saved << " views, structures and routes saved" << std::endl;
}

}  // namespace
}  // namespace test
}  // namespace view_servo
