// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Options of the program, and what they do to the experiments.
#include "experiments/experiment_context.h"
#include "experiments/hypothesis_experiments.h"
#include "support/csv_table.h"
#include "support/program_run.h"
#include "support/temporary_directory.h"
#include "test_paths.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
using test::ProgramRun;

/** @param arguments words with blanks between them. */
ProgramRun run(const std::string& arguments)
{
  const test::TemporaryDirectory directory;  // the program writes into the one where it runs
  std::istringstream words(arguments);
  const std::vector<std::string> each{ std::istream_iterator<std::string>(words), {} };
  return test::runProgram(EXPERIMENTS_PATH, each, "cd '" + directory.path().string() + "'");
}

void expectContains(const std::string& text, const std::string& part)
{
  EXPECT_NE(text.find(part), std::string::npos) << text << "has no " << part;
}

}  // namespace

TEST(Experiments, ListSaysWhatIsRepeatedAndFromWhichSeed)
{
  const ProgramRun outcome = run("--list");
  EXPECT_EQ(outcome.status, 0);
  expectContains(outcome.out,
                 "homing: chapter 5: homing in simulated rooms, from many starts; --runs 100 (random starts); "
                 "--seed 5\n");
  expectContains(outcome.out, "homing_directions: the heading between real views of a room; --seed 1\n");
  expectContains(outcome.out, "lines_table: tables 4.1 and 4.2: line matching by pairs and triplets\n");
}

TEST(Experiments, RefusesRunsWhereNothingIsRepeated)
{
  for (const std::string name : { "lines_table", "arm_geometry", "homing_directions" })
  {
    const ProgramRun outcome = run(name + " --runs 3");
    EXPECT_EQ(outcome.status, 2);
    expectContains(outcome.err, "--runs: " + name + " repeats nothing");
    expectContains(
        outcome.err,
        "homing, homing_differential, homing_structure, docking, routes, arm, arm_scene, multi_hypothesis, real_pairs, "
        "profiles_parameters, "
        "view_consistency, rooms, false_answers, recognition, hand_eye, mount, cyclic_order, campaign do");
  }
}

TEST(Experiments, RefusesASeedWhereNothingIsDrawn)
{
  for (const std::string name : { "lines_table", "arm_geometry" })
  {
    const ProgramRun outcome = run(name + " --seed 3");
    EXPECT_EQ(outcome.status, 2);
    expectContains(outcome.err, "--seed: " + name + " draws no random numbers");
    expectContains(outcome.err, "homing_directions");
  }
}

TEST(Experiments, RefusesNumbersOutOfRange)
{
  for (const std::string value : { "0", "-1", "1.5", "x", "" })
  {
    const ProgramRun outcome = run("homing --runs " + value);
    EXPECT_NE(outcome.status, 0) << value;
    expectContains(outcome.err, "--runs");
  }
  for (const std::string value : { "-1", "1.5", "x", "" })
  {
    const ProgramRun outcome = run("homing --seed " + value);
    EXPECT_NE(outcome.status, 0) << value;
    expectContains(outcome.err, "--seed");
  }
}

TEST(Experiments, RefusesATimeWhereNoneIsTaken)
{
  const ProgramRun outcome = run("campaign --hours 1");
  EXPECT_EQ(outcome.status, 2);
  expectContains(outcome.err, "--hours: campaign ends by itself");
  expectContains(run("soak --runs 1").err, "--runs: soak repeats nothing");
}

TEST(Experiments, TellsAProgramItsOptionsAndEndsAsItDoes)
{
  const test::TemporaryDirectory package;
  std::filesystem::create_directories(package.path() / "test" / "campaign");
  std::ofstream(package.path() / "package.xml") << "<package><name>view_servo</name></package>\n";
  const std::string elsewhere = "export ROS_PACKAGE_PATH='" + package.path().string() + "'";
  const ProgramRun missing = test::runProgram(EXPERIMENTS_PATH, { "soak" }, elsewhere);
  EXPECT_EQ(missing.status, 2);
  expectContains(missing.err, "soak.py is not there: this runs from the package's source tree only");

  const std::filesystem::path script = package.path() / "test" / "campaign" / "soak.py";
  std::ofstream(script) << "#!/bin/sh\necho \"$@\"\nexit 7\n";
  std::filesystem::permissions(script, std::filesystem::perms::owner_all);
  const ProgramRun started =
      test::runProgram(EXPERIMENTS_PATH, { "soak", "--hours", "0.5", "--seed", "3", "--out", "there" }, elsewhere);
  EXPECT_EQ(started.status, 7);
  EXPECT_EQ(started.out, "--out there --seed 3 --hours 0.5\n");
}

TEST(Experiments, SaysSeedAndRuns)
{
  const ProgramRun outcome = run("multi_hypothesis --short --runs 1 --seed 7");
  expectContains(outcome.out, "multi_hypothesis: seed 7, 1 scenes\n");
  expectContains(run("multi_hypothesis --short --runs 1").out, "multi_hypothesis: seed 1, 1 scenes\n");
}

TEST(ExperimentContext, ItsOwnSeedAndRunsAreTheDefault)
{
  constexpr Repetition REPETITION{ "runs", 20, 3, 5 };
  ExperimentContext context;
  EXPECT_EQ(context.runsOf(REPETITION), 20);
  EXPECT_EQ(context.seedOf(REPETITION, 1000), 1000U);
  context.seed = 5;
  EXPECT_EQ(context.seedOf(REPETITION, 1000), 1000U);
  context.seed = 6;
  EXPECT_NE(context.seedOf(REPETITION, 1000), 1000U);
  EXPECT_NE(context.seedOf(REPETITION, 1000), context.seedOf(REPETITION, 1001));
  context.brief = true;
  EXPECT_EQ(context.runsOf(REPETITION), 3);
  context.runs = 7;
  EXPECT_EQ(context.runsOf(REPETITION), 7);
}

TEST(ExperimentContext, AnotherSeedDrawsAnotherScene)
{
  const auto correct = [](std::optional<std::uint64_t> seed) {
    ExperimentContext context;
    context.brief = true;
    context.runs = 1;
    context.seed = seed;
    std::ostringstream csv;
    runMultiHypothesisExperiment(context, csv);
    std::vector<std::string> column;
    for (const test::Row& row : test::readTable(csv.str()))
    {
      EXPECT_EQ(row.at("runs"), "1");
      column.push_back(row.at("entries_over_half"));
      column.push_back(row.at("correct"));
    }
    return column;
  };
  const std::vector<std::string> usual = correct({});
  EXPECT_EQ(correct(HYPOTHESIS_SCENES.seed), usual);
  EXPECT_NE(correct(2), usual);
}

}  // namespace view_servo
