// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * Runs the thesis' experiments on this implementation: `experiments NAME [--out DIR]` writes NAME.csv, and NAME.png
 * beside it, drawn by plot_experiment. `--list` names the experiments, what each of them repeats, how often, and from
 * which seed. Those that need real images read them from VIEW_SERVO_DATA. Exit status: 0 table and plot are there, 1
 * only the table is, 2 neither. `campaign` and `soak` are programs of their own, which run simulated robots with their
 * nodes and say themselves how that ended.
 */
#include "experiments/arm_experiments.h"
#include "experiments/arm_geometry_experiment.h"
#include "experiments/cyclic_order_experiment.h"
#include "experiments/docking_experiment.h"
#include "experiments/experiment_context.h"
#include "experiments/false_answers_experiment.h"
#include "experiments/hand_eye_experiments.h"
#include "experiments/homing_experiments.h"
#include "experiments/hypothesis_experiments.h"
#include "experiments/line_ground_truth.h"
#include "experiments/lines_table.h"
#include "experiments/mount_experiment.h"
#include "experiments/profile_experiments.h"
#include "experiments/recognition_experiment.h"
#include "experiments/robot_programs.h"
#include "experiments/rooms_experiment.h"
#include "experiments/routes_experiment.h"
#include "experiments/structure_experiment.h"
#include "tools/command_line.h"
#include "view_servo/parameters/error_text.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace
{
using namespace view_servo;  // NOLINT(google-build-using-namespace): a program of its own
namespace fs = std::filesystem;

struct Experiment
{
  std::string name;
  std::string description;
  bool needs_data;                       ///< real images, from VIEW_SERVO_DATA
  std::optional<Repetition> repetition;  ///< empty: there are no random numbers
  std::function<void(const ExperimentContext& context, std::ostream& csv)> run;
  std::string program = {};  ///< of the source tree, which is started instead; empty: none
  bool takes_hours = false;

  bool takesSeed() const
  {
    return repetition.has_value();
  }
  bool takesRuns() const
  {
    return repetition && repetition->runs > 0;
  }
};

const std::vector<Experiment>& experiments()
{
  static const std::vector<Experiment> all{
    { "lines_table", "tables 4.1 and 4.2: line matching by pairs and triplets", true, std::nullopt,
      runLinesTableExperiment },
    { "homing", "chapter 5: homing in simulated rooms, from many starts", false, HOMING_STARTS, runHomingExperiment },
    { "homing_differential", "the same for a base that cannot slide", false, HOMING_STARTS,
      runHomingDifferentialExperiment },
    { "homing_structure", "homing with what was learnt of the view in an earlier run, and without", false,
      STRUCTURE_STARTS, runStructureExperiment },
    { "docking", "laws for a base that cannot slide, beside Park and Kuipers', without pictures", false, DOCKING_STARTS,
      runDockingExperiment },
    { "routes", "routes through simulated rooms, recorded and followed", false, ROUTES, runRoutesExperiment },
    { "arm", "table 8.1: servoing of a simulated arm, from many starts", false, ARM_RUNS, runArmExperiment },
    { "arm_scene", "the same with views of scenes that have depth", false, ARM_RUNS, runArmSceneExperiment },
    { "homing_directions", "the heading between real views of a room", true, DIRECTION_DRAWS, runDirectionsExperiment },
    { "multi_hypothesis", "table 9.1, figures 9.1 to 9.6: several hypotheses a point, simulated", false,
      HYPOTHESIS_SCENES, runMultiHypothesisExperiment },
    { "real_pairs", "figures 9.7 to 9.10: several hypotheses a point, real images", true, REAL_PAIR_RUNS,
      runRealPairsExperiment },
    { "profiles_parameters", "figures 6.8 to 6.10: parameters of intensity profiles", true, PROFILE_RUNS,
      runProfileParametersExperiment },
    { "view_consistency", "tables 6.2 and 6.3: the view constraint before and within RANSAC", true,
      VIEW_CONSISTENCY_RUNS, runViewConsistencyExperiment },
    { "rooms", "fundamental matrices between real views of rooms and buildings, beside SIFT and AKAZE", true,
      DRAWN_WALK_PAIRS, runRoomsExperiment },
    { "false_answers", "answers for pictures of different scenes, mirrored ones and walls that repeat", true,
      UNRELATED_PAIRS, runFalseAnswersExperiment },
    { "recognition", "which of many stored views an image shows, beside ORB words", true, UNKNOWN_PICTURES,
      runRecognitionExperiment },
    { "arm_geometry", "chapter 8: motions from homographies beside a real arm's", true, std::nullopt,
      runArmGeometryExperiment },
    { "hand_eye", "hand-eye calibration of a simulated arm by a stored view", false, HAND_EYE_RUNS,
      runHandEyeExperiment },
    { "hand_eye_real", "the same of a real arm, beside a calibration with a board of known size", true, std::nullopt,
      runHandEyeRealExperiment },
    { "mount", "where the camera is on a simulated base, by a stored view", false, MOUNT_RUNS, runMountExperiment },
    { "cyclic_order", "figures 7.5 to 7.11: cyclic order against plain votes", false, DRAWN_PICTURES,
      runCyclicOrderExperiment },
    { "campaign", "faults at random moments of simulated runs, by nodes", false, CAMPAIGN_RUNS, nullptr,
      "test/campaign/campaign.py" },
    { "soak", "goals without end in both simulators, with memory, threads and latencies; --hours 1", false, SOAK_DRAWS,
      nullptr, "test/campaign/soak.py", true },
  };
  return all;
}

/** One line: what it is, and the options that it takes with their defaults. */
std::string describe(const Experiment& experiment)
{
  std::string line = experiment.name + ": " + experiment.description;
  if (experiment.takesRuns())
  {
    line += "; --runs " + std::to_string(experiment.repetition->runs) + " (" + experiment.repetition->what + ")";
  }
  if (experiment.takesSeed())
  {
    line += "; --seed " + std::to_string(experiment.repetition->seed);
  }
  return line;
}

/** The names of the experiments for which something holds, separated by commas. */
std::string namesOf(bool (Experiment::*holds)() const)
{
  std::string names;
  for (const Experiment& experiment : experiments())
  {
    if ((experiment.*holds)())
    {
      names += (names.empty() ? "" : ", ") + experiment.name;
    }
  }
  return names;
}

/** What the command line asks for. */
struct Request
{
  std::string name;  ///< of the experiment; empty: none is named
  std::string out = ".";
  bool list = false;
  ExperimentContext context;
  std::optional<double> hours;
};

/** @throws std::invalid_argument when the experiment has no use for --runs, --seed or --hours, and they are given. */
void refuseUselessOptions(const Experiment& experiment, const Request& request)
{
  if (request.context.seed && !experiment.takesSeed())
  {
    throw std::invalid_argument("--seed: " + experiment.name + " draws no random numbers; " +
                                namesOf(&Experiment::takesSeed) + " do");
  }
  if (request.context.runs > 0 && !experiment.takesRuns())
  {
    throw std::invalid_argument("--runs: " + experiment.name + " repeats nothing; " + namesOf(&Experiment::takesRuns) +
                                " do");
  }
  if (request.hours && !experiment.takes_hours)
  {
    throw std::invalid_argument("--hours: " + experiment.name + " ends by itself; the soak does not");
  }
}

/** Says from which seed and how often the experiment runs, when there are random numbers. */
void printRepetition(const Experiment& experiment, const ExperimentContext& context)
{
  if (experiment.takesSeed())
  {
    std::cout << experiment.name << ": seed " << context.seed.value_or(experiment.repetition->seed);
    if (experiment.takesRuns())
    {
      std::cout << ", " << context.runsOf(*experiment.repetition) << ' ' << experiment.repetition->what;
    }
    std::cout << std::endl;
  }
}

/** Draws a table with plot_experiment, which lies beside this program; false when that fails. */
bool plot(const fs::path& csv, const fs::path& png)
{
  const fs::path script = fs::read_symlink("/proc/self/exe").parent_path() / "plot_experiment";
  const std::string command = "'" + script.string() + "' '" + csv.string() + "' '" + png.string() + "'";
  return std::system(command.c_str()) == 0;  // NOLINT(cert-env33-c): of our own package, paths quoted
}

/** Empty when only help was asked for, which is printed then. @throws std::exception when an option is wrong. */
std::optional<Request> readRequest(int argc, char** argv)
{
  Request request;
  std::optional<int> runs;
  CommandLine line("Runs the thesis' experiments and writes tables and plots: experiments NAME [OPTIONS]",
                   "Exit status: 0 the table and its plot were written, 1 the table alone, 2 bad input.");
  line.text("out", request.out, "Folder for NAME.csv and NAME.png, made when it does not exist; default: here");
  line.flag("short", request.context.brief, "A small part of it, to see that it works");
  line.number("runs", runs, { 1.0, 1e6 }, "How often to repeat what --list says is repeated");
  line.number("seed", request.context.seed, {}, "From which all random numbers are drawn");
  line.number("hours", request.hours, { 1e-3, 1e4 }, "How long the soak lasts");
  line.number("threads", request.context.threads, { 0.0, 1024.0 },
              "At most so many; 0: as many as there are processors");
  line.flag("list", request.list, "Names the experiments, with their runs and seeds");
  const std::optional<std::vector<std::string>> words = line.parse(argc, argv);
  if (!words)
  {
    return std::nullopt;
  }
  if (words->size() > 1)
  {
    throw std::runtime_error("'" + (*words)[1] + "' is one word too many; see --help");
  }
  request.context.runs = runs.value_or(0);
  request.name = words->empty() ? "" : words->front();
  return request;
}

/** @throws std::invalid_argument when there is none of this name. */
const Experiment& findExperiment(const std::string& name)
{
  const auto found = std::find_if(experiments().begin(), experiments().end(),
                                  [&](const Experiment& experiment) { return experiment.name == name; });
  if (found == experiments().end())
  {
    throw std::invalid_argument((name.empty() ? "name an experiment" : "there is no experiment '" + name + "'") +
                                "; see --list");
  }
  return *found;
}

/** Writes the table and its plot. @returns the exit status. @throws std::exception when there is no table. */
int run(const Experiment& experiment, ExperimentContext context, const fs::path& out)
{
  if (experiment.needs_data)
  {
    const auto data = dataFolder();
    if (!data)
    {
      return 2;
    }
    context.data = *data;
  }
  fs::create_directories(out);
  const fs::path csv = out / (experiment.name + ".csv");
  const fs::path png = out / (experiment.name + ".png");
  std::ofstream stream(csv);
  if (!stream)
  {
    throw std::runtime_error("cannot write " + csv.string());
  }
  printRepetition(experiment, context);
  experiment.run(context, stream);
  stream.close();
  std::cout << csv.string() << std::endl;
  if (!plot(csv, png))
  {
    std::cerr << "the table is there, but could not be drawn" << std::endl;
    return 1;
  }
  std::cout << png.string() << std::endl;
  return 0;
}

}  // namespace

int main(int argc, char** argv)
{
  try
  {
    const std::optional<Request> request = readRequest(argc, argv);
    if (!request)
    {
      return 0;  // --help
    }
    if (request->list)
    {
      for (const Experiment& experiment : experiments())
      {
        std::cout << describe(experiment) << std::endl;
      }
      return 0;
    }
    const Experiment& experiment = findExperiment(request->name);
    refuseUselessOptions(experiment, *request);
    if (!experiment.program.empty())
    {
      const int runs = request->context.runs;
      becomeRobotProgram(experiment.program,
                         { request->out, request->context.brief, runs > 0 ? std::optional<int>(runs) : std::nullopt,
                           request->context.seed, request->hours });
    }
    return run(experiment, request->context, request->out);
  }
  catch (const std::exception& error)
  {
    std::cerr << oneLine(error) << std::endl;
    return 2;
  }
}
