// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/structure_experiment.h"

#include "experiments/parallel.h"
#include "experiments/shipped_worlds.h"
#include "sim/visibility.h"
#include "trials/homing_trial.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** A room, and what was learnt of its view. */
struct Lesson
{
  sim::World world;
  BaseKind base = BaseKind::HOLONOMIC;
  ViewStructure structure;
};

struct StructureRun
{
  const Lesson* lesson;
  bool learnt;  ///< the structure is used
  PlanarPose start;
  std::uint64_t seed;
};

/** Where the view is by the first report of its distance in metres, beside where it is. */
struct FirstPose
{
  double time = 0.0;            ///< since the start [s]
  double distance = 0.0;        ///< the true one [m]
  double position_error = 0.0;  ///< [m]
  double yaw_error = 0.0;       ///< [rad]
};

struct Outcome
{
  sim::HomingOutcome homing;
  std::optional<FirstPose> first;
};

Outcome home(const Lesson& lesson, bool learnt, const PlanarPose& start, std::uint64_t seed)
{
  sim::HomingTrialParams params;
  params.seed = seed;
  params.homing.approach.base = lesson.base;
  if (learnt)
  {
    params.structure = lesson.structure;
  }
  Outcome outcome;
  outcome.homing = sim::HomingTrials(lesson.world, params).run(start, [&](const sim::HomingStep& step) {
    if (!outcome.first && step.report.goal_in_odom)
    {
      const PlanarPose truth = compose(inverse(step.base), toPlanar(lesson.world.goal));
      const double heading = step.report.heading;
      const PlanarPose found{ step.report.distance * std::cos(heading), step.report.distance * std::sin(heading),
                              step.report.yaw_error };
      outcome.first = FirstPose{ step.time, truth.distance(), std::hypot(found.x - truth.x, found.y - truth.y),
                                 std::abs(wrapAngle(found.yaw - truth.yaw)) };
    }
  });
  return outcome;
}

/**
 * Parts by which depths are wrong, of points that would move by 10 px and more if the camera moved as in the lesson.
 */
std::vector<double> depthErrors(const Lesson& lesson)
{
  constexpr double LEAST_PARALLAX = 10.0;  // [px]
  const sim::World& world = lesson.world;
  const Eigen::Isometry3d camera = world.goal * world.camera_on_base;
  const CameraMount mount(world.camera_on_base);
  std::vector<double> errors;
  for (const StructurePoint& point : lesson.structure.points)
  {
    const double parallax = std::sqrt(point.information) * point.inverse_depth * world.camera.k(0, 0);
    const Eigen::Vector2d normalized = world.camera.normalized(point.pixel);
    const Eigen::Vector3d ray = normalized.homogeneous().normalized();
    const std::optional<double> distance = sim::firstHit(world, camera.translation(), camera.linear() * ray);
    if (parallax < LEAST_PARALLAX || !distance)
    {
      continue;
    }
    // In the level camera a point lies as far ahead as its distance along the floor and its bearing say.
    const double along_floor = std::hypot((camera.linear() * ray).x(), (camera.linear() * ray).y()) * *distance;
    const double depth = along_floor / std::hypot(1.0, mount.level(normalized).x());
    errors.push_back(std::abs(1.0 / point.inverse_depth - depth) / depth);
  }
  return errors;
}

/** A room's view, learnt in a run from a start of its own. */
Lesson learn(const std::string& name, BaseKind base, std::uint64_t seed)
{
  constexpr int MOST_STARTS = 10;
  Lesson lesson{ readShippedWorld(name), base, {} };
  Rng rng(seed);
  for (int i = 0; i < MOST_STARTS && lesson.structure.points.empty(); ++i)
  {
    const Outcome outcome = home(lesson, false, sim::randomStart(lesson.world, rng), seed);
    lesson.structure = outcome.homing.arrived ? outcome.homing.structure : ViewStructure();
  }
  return lesson;
}

/** What becomes of runs with a structure, or without. */
struct StructureSummary
{
  int arrived = 0;
  std::vector<double> seconds;
  std::vector<double> first_seconds;
  std::vector<double> first_millimetres;
  std::vector<double> first_percents;
  std::vector<double> first_degrees;

  void add(const Outcome& outcome)
  {
    arrived += outcome.homing.arrived ? 1 : 0;
    seconds.push_back(outcome.homing.duration);
    if (outcome.first)
    {
      first_seconds.push_back(outcome.first->time);
      first_millimetres.push_back(1e3 * outcome.first->position_error);
      first_percents.push_back(100.0 * outcome.first->position_error / outcome.first->distance);
      first_degrees.push_back(outcome.first->yaw_error * DEGREES);
    }
  }

  void print(std::ostream& stream) const
  {
    stream << arrived << " of " << seconds.size() << " arrive, after " << medianOf(seconds) << " s in the median";
    if (!first_seconds.empty())
    {
      stream << "; " << first_seconds.size() << " know the distance in metres, after " << medianOf(first_seconds)
             << " s, by " << medianOf(first_millimetres) << " mm, " << medianOf(first_percents) << " % and "
             << medianOf(first_degrees) << " degrees wrong (95 %: " << quantileOf(first_millimetres, 0.95) << " mm, "
             << quantileOf(first_percents, 0.95) << " %, " << quantileOf(first_degrees, 0.95) << " degrees)";
    }
    stream << std::endl;
  }
};

}  // namespace

void runStructureExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const std::array<const char*, 3> names{ "desk", "cabinet", "corridor" };
  const std::array<BaseKind, 2> bases{ BaseKind::HOLONOMIC, BaseKind::DIFFERENTIAL };
  std::vector<Lesson> lessons(names.size() * bases.size());
  inParallel(lessons.size(), context.threads, [&](std::size_t i) {
    lessons[i] = learn(names[i / bases.size()], bases[i % bases.size()], context.seedOf(STRUCTURE_STARTS, 1));
  });
  std::vector<StructureRun> runs;
  Rng rng(context.seedOf(STRUCTURE_STARTS, STRUCTURE_STARTS.seed));
  for (int i = 0; i < context.runsOf(STRUCTURE_STARTS); ++i)
  {
    const std::size_t first = static_cast<std::size_t>(i) % names.size() * bases.size();
    const PlanarPose start = sim::randomStart(lessons[first].world, rng);
    const std::uint64_t seed = context.seedOf(STRUCTURE_STARTS, static_cast<std::uint64_t>(i) + 2);
    for (std::size_t base = 0; base < bases.size(); ++base)
    {
      runs.push_back({ &lessons[first + base], false, start, seed });
      runs.push_back({ &lessons[first + base], true, start, seed });
    }
  }
  std::vector<Outcome> outcomes(runs.size());
  std::mutex mutex;
  std::size_t done = 0;
  inParallel(runs.size(), context.threads, [&](std::size_t i) {
    outcomes[i] = home(*runs[i].lesson, runs[i].learnt, runs[i].start, runs[i].seed);
    const std::lock_guard<std::mutex> lock(mutex);
    std::cerr << ++done << " of " << runs.size() << std::endl;
  });
  csv << "world,base,learnt,start_x,start_y,start_yaw_deg,arrived,distance_error_mm,yaw_error_deg,duration_s,"
         "first_s,first_distance_m,first_error_mm,first_yaw_error_deg\n";
  std::array<StructureSummary, 4> summaries;
  for (std::size_t i = 0; i < runs.size(); ++i)
  {
    const StructureRun& run = runs[i];
    const sim::HomingOutcome& homing = outcomes[i].homing;
    const FirstPose first = outcomes[i].first.value_or(FirstPose());
    const bool slides = run.lesson->base == BaseKind::HOLONOMIC;
    csv << run.lesson->world.name << ',' << (slides ? "holonomic" : "differential") << ',' << run.learnt << ','
        << run.start.x << ',' << run.start.y << ',' << run.start.yaw * DEGREES << ',' << homing.arrived << ','
        << 1e3 * homing.distance_error << ',' << homing.yaw_error * DEGREES << ',' << homing.duration << ','
        << first.time << ',' << first.distance << ',' << 1e3 * first.position_error << ',' << first.yaw_error * DEGREES
        << '\n';
    summaries[(slides ? 0 : 2) + (run.learnt ? 1 : 0)].add(outcomes[i]);
  }
  for (const Lesson& lesson : lessons)
  {
    const std::vector<double> errors = depthErrors(lesson);
    std::cout << lesson.world.name << ", " << (lesson.base == BaseKind::HOLONOMIC ? "holonomic" : "differential")
              << ": " << lesson.structure.points.size() << " points learnt";
    if (!errors.empty())
    {
      std::cout << ", depths of " << errors.size() << " with 10 px of parallax " << 100.0 * medianOf(errors)
                << " % wrong in the median";
    }
    std::cout << '\n';
  }
  const std::array<const char*, 4> titles{ "holonomic, nothing learnt", "holonomic, learnt",
                                           "differential, nothing learnt", "differential, learnt" };
  for (std::size_t i = 0; i < titles.size(); ++i)
  {
    std::cout << titles[i] << ": ";
    summaries[i].print(std::cout);
  }
}

}  // namespace view_servo
