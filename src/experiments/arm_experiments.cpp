// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/arm_experiments.h"

#include "experiments/input_file.h"
#include "experiments/parallel.h"
#include "experiments/shipped_worlds.h"
#include "experiments/statistics.h"
#include "tools/package_folder.h"
#include "trials/arm_trial.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** What is servoed to, and how. */
struct ArmTask
{
  std::array<const char*, 2> worlds;
  Target target;
  double matching_time;    ///< [s]
  double near_enough;      ///< what says converged and is further off is wrong [m]
  double straight_enough;  ///< likewise [rad]
};

const ArmTask PLANES{ { "rice", "mouse" }, Target::PLANE, 0.3, 0.005, 0.5 / DEGREES };
const ArmTask SCENES{ { "parts", "rack" }, Target::SCENE, 0.6, 0.002, 0.2 / DEGREES };
constexpr std::array<const char*, 3> STARTS = { "near", "far", "extreme" };

/** One run of servoing. */
struct ArmRun
{
  std::string world;
  std::string start;
  int index;  ///< of the runs from this start
  bool other_light;
  std::uint64_t seed;
};

/** What a row of the printed table sums up. */
struct Row
{
  int runs = 0;
  int failures = 0;
  int wrong = 0;  ///< servoing says that it has converged, and it has not
  std::vector<double> millimetres;
  std::vector<double> degrees;
};

sim::ArmTrialParams paramsOf(const ArmTask& task, const ArmRun& run, const sim::World& world)
{
  Rng rng(run.seed);
  sim::ArmTrialParams params;
  params.target = task.target;
  params.matching_time = task.matching_time;
  params.seed = run.seed;
  params.conditions.image_noise = 2.0;
  params.conditions.encoder_noise = 1e-4;
  params.conditions.hand_eye_translation_error = 0.002;
  params.conditions.hand_eye_rotation_error = 0.5 / DEGREES;
  params.conditions.focal_length_error = 0.005;
  params.conditions.light = world.light;
  if (run.other_light)
  {
    params.conditions.light.gain = uniform(rng, 0.6, 1.3);
    params.conditions.light.offset = uniform(rng, -20.0, 20.0);
    params.conditions.light.gradient = uniform(rng, -0.5, 0.5);
  }
  if (run.start == STARTS.back())
  {
    params.conditions.groups = { "distractors" };
  }
  return params;
}

/** A few millimetres and degrees beside a world's start, other ones for each run. */
Eigen::Isometry3d startOf(const ArmRun& run, const sim::World& world)
{
  constexpr double LENGTH = 0.01;               // [m]
  constexpr double ANGLE = 1.5 * M_PI / 180.0;  // [rad]
  Rng rng(1000 + run.seed);
  const auto vector = [&rng](double size) {
    const double x = uniform(rng, -size, size);
    const double y = uniform(rng, -size, size);
    return Eigen::Vector3d(x, y, uniform(rng, -size, size));
  };
  const Eigen::Vector3d turn = vector(ANGLE);
  return world.start(run.start) * Eigen::Translation3d(vector(LENGTH)) *
         Eigen::AngleAxisd(turn.norm(), turn.normalized());
}

/** How a run ended. */
struct Result
{
  Eigen::Isometry3d way;  ///< from the goal to the start
  sim::ArmOutcome outcome;
  double least_margin;  ///< of the chosen point from the image's border [px]
};

/** All runs, those from the same start beside each other. */
std::vector<ArmRun> runsOf(const ArmTask& task, const ExperimentContext& context)
{
  const int runs_each = context.runsOf(ARM_RUNS);
  std::vector<ArmRun> runs;
  for (const char* world : task.worlds)
  {
    for (const char* start : STARTS)
    {
      for (int i = 0; i < runs_each; ++i)
      {
        runs.push_back({ world, start, i, i % 2 == 1, context.seedOf(ARM_RUNS, static_cast<std::uint64_t>(i) + 1) });
      }
    }
  }
  return runs;
}

Result servo(const ArmTask& task, const ArmRun& run, const sim::World& world, const std::string& urdf)
{
  const Eigen::Isometry3d start = startOf(run, world);
  sim::ArmTrials trials(world, urdf, paramsOf(task, run, world));
  double least_margin = world.camera.width;
  const sim::ArmOutcome outcome = trials.run(start, [&](const sim::ArmStep& step) {
    const Eigen::Vector2d& point = step.report.point;
    if (point.allFinite())
    {
      least_margin = std::min({ least_margin, point.x(), point.y(), world.camera.width - 1.0 - point.x(),
                                world.camera.height - 1.0 - point.y() });
    }
  });
  return { world.goal.inverse() * start, outcome, least_margin };
}

/** A line of the table, with its end. */
std::string lineOf(const ArmRun& run, const Result& result)
{
  const sim::ArmOutcome& outcome = result.outcome;
  std::string reason = outcome.reason;
  std::replace(reason.begin(), reason.end(), ',', ';');
  std::ostringstream line;
  line << run.world << ',' << run.start << ',' << run.index << ',' << (run.other_light ? "other" : "same") << ','
       << 1e3 * result.way.translation().norm() << ',' << DEGREES * Eigen::AngleAxisd(result.way.linear()).angle()
       << ',' << (outcome.converged ? 1 : 0) << ',' << 1e3 * outcome.translation_error << ','
       << DEGREES * outcome.rotation_error << ',' << outcome.duration << ',' << result.least_margin << ',' << reason
       << '\n';
  return line.str();
}

void add(const ArmTask& task, const sim::ArmOutcome& outcome, Row& row)
{
  ++row.runs;
  if (!outcome.converged)
  {
    ++row.failures;
    return;
  }
  row.wrong += outcome.translation_error > task.near_enough || outcome.rotation_error > task.straight_enough ? 1 : 0;
  row.millimetres.push_back(1e3 * outcome.translation_error);
  row.degrees.push_back(DEGREES * outcome.rotation_error);
}

/** @param table a row for each world and start, named "WORLD START". */
void print(const ArmTask& task, std::map<std::string, Row>& table)
{
  std::printf("%-14s %8s %6s %9s %6s %9s %6s\n", "", "failures", "wrong", "pos [mm]", "std", "ang [deg]", "std");
  for (const char* world : task.worlds)
  {
    for (const char* start : STARTS)
    {
      const Row& row = table[std::string(world) + " " + start];
      if (row.millimetres.empty())
      {
        std::printf("%-6s %-7s %2d of %2d\n", world, start, row.failures, row.runs);
        continue;
      }
      std::printf("%-6s %-7s %2d of %2d %6d %9.2f %6.2f %9.3f %6.3f\n", world, start, row.failures, row.runs, row.wrong,
                  mean(row.millimetres), deviation(row.millimetres), mean(row.degrees), deviation(row.degrees));
    }
  }
}

void runTask(const ArmTask& task, const ExperimentContext& context, std::ostream& csv)
{
  std::ifstream urdf_file = openForReading(packageFolder() / "urdf" / "puma560.urdf");
  const std::string urdf{ std::istreambuf_iterator<char>(urdf_file), std::istreambuf_iterator<char>() };
  const Worlds worlds = readShippedWorlds({ task.worlds.begin(), task.worlds.end() });
  const std::vector<ArmRun> runs = runsOf(task, context);
  std::vector<std::string> lines(runs.size());
  std::map<std::string, Row> table;
  std::mutex mutex;
  std::size_t done = 0;
  inParallel(runs.size(), context.threads, [&](std::size_t i) {
    const ArmRun& run = runs[i];
    const Result result = servo(task, run, worlds.at(run.world), urdf);
    const std::lock_guard<std::mutex> lock(mutex);
    lines[i] = lineOf(run, result);
    std::cerr << ++done << " of " << runs.size() << ": " << lines[i] << std::flush;
    add(task, result.outcome, table[run.world + " " + run.start]);
  });

  csv << "world,start,index,light,start_distance_mm,start_turn_deg,converged,translation_error_mm,rotation_error_deg,"
         "duration_s,least_margin_px,reason\n";
  for (const std::string& line : lines)
  {
    csv << line;
  }
  print(task, table);
}

}  // namespace

void runArmExperiment(const ExperimentContext& context, std::ostream& csv)
{
  runTask(PLANES, context, csv);
}

void runArmSceneExperiment(const ExperimentContext& context, std::ostream& csv)
{
  runTask(SCENES, context, csv);
}

}  // namespace view_servo
