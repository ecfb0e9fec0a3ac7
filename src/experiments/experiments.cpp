// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * Re-runs the thesis' experiments on this implementation: `experiments NAME [--out DIR]` writes NAME.csv, and NAME.png
 * beside it, drawn by plot_experiment; `--list` names them. Those that need real images read them from VIEW_SERVO_DATA.
 */
#include "arm_experiments.h"
#include "arm_geometry_experiment.h"
#include "cyclic_order_experiment.h"
#include "homing_experiments.h"
#include "hypothesis_experiments.h"
#include "line_ground_truth.h"
#include "profile_experiments.h"
#include "view_servo/features/line_segments.h"
#include "view_servo/geometry/line_homography.h"
#include "view_servo/matching/assignment.h"
#include "view_servo/matching/line_groups.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
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
  bool needs_data;  ///< real images, from VIEW_SERVO_DATA
  std::function<void(const ExperimentContext& context, std::ostream& csv)> run;
};

/** The labelled lines of an image that a detected segment lies on: across within 2 px, 3 degrees, half side by side. */
std::vector<int> labelsOf(const Segment& segment, const Segments& labelled)
{
  constexpr double TOLERANCE = 2.0;      // [px]
  constexpr double MIN_COSINE = 0.9986;  // 3 degrees
  constexpr double MIN_OVERLAP = 0.5;
  std::vector<int> labels;
  for (std::size_t i = 0; i < labelled.size(); ++i)
  {
    const SegmentAgreement found = compare(segment, labelled[i]);
    if (std::abs(found.cosine) >= MIN_COSINE && found.overlap >= MIN_OVERLAP && found.distance <= TOLERANCE)
    {
      labels.push_back(static_cast<int>(i));
    }
  }
  return labels;
}

/** What the ground truth says of a match of detected segments. */
enum class Verdict
{
  CORRECT,
  WRONG,
  UNKNOWN  ///< the reference segment is none of the labelled lines
};

Verdict judge(const LinePair& pair, const std::vector<int>& reference_labels, const std::vector<int>& current_labels)
{
  bool known = false;
  for (const LineGroupTruth& group : pair.truth)
  {
    const auto has_any = [](const std::vector<int>& labels, const std::vector<int>& members) {
      return std::any_of(labels.begin(), labels.end(),
                         [&](int label) { return std::find(members.begin(), members.end(), label) != members.end(); });
    };
    if (has_any(reference_labels, group.reference))
    {
      known = true;
      if (has_any(current_labels, group.current))
      {
        return Verdict::CORRECT;
      }
    }
  }
  return known ? Verdict::WRONG : Verdict::UNKNOWN;
}

/**
 * Tables 4.1 and 4.2: how many of the 25 and 50 candidates with most votes are correct, for pairs and triplets,
 * distances of 25, 75 and 125 px, at a fine and a coarse scale; with the thesis' order of end points and by contrast.
 * The thesis judged by eye; here only candidates count whose reference segment is a labelled line.
 */
void linesTable(const ExperimentContext& context, std::ostream& csv)
{
  const fs::path& data = context.data;
  constexpr double FINE = 1.0;    // [px]
  constexpr double COARSE = 2.0;  // [px]
  std::vector<LinePair> pairs = readBenchmarkPairs(data, { "dunster", "building_viewpoint" });
  if (context.brief)
  {
    pairs.resize(1);
  }
  else
  {
    pairs.push_back(readMertonPair(data, 1, 2));
    pairs.push_back(readMertonPair(data, 1, 3));
  }
  csv << "pair,order,scale,groups,max_distance,segments_reference,segments_current,top25,top50\n";
  for (const LinePair& pair : pairs)
  {
    for (const double sigma : { FINE, COARSE })
    {
      LineSegmentParams detection;
      detection.sigma = sigma;
      detection.max_segments = 300;  // about as many as the thesis has
      const Segments reference = detectLineSegments(pair.reference, detection);
      const Segments current = detectLineSegments(pair.current, detection);
      std::vector<std::vector<int>> reference_labels;
      std::vector<std::vector<int>> current_labels;
      for (const Segment& segment : reference)
      {
        reference_labels.push_back(labelsOf(segment, pair.reference_segments));
      }
      for (const Segment& segment : current)
      {
        current_labels.push_back(labelsOf(segment, pair.current_segments));
      }
      for (const LineOrder order : { LineOrder::UPRIGHT, LineOrder::CONTRAST })
      {
        for (const LineGrouping groups : { LineGrouping::PAIRS, LineGrouping::TRIPLETS })
        {
          for (const double distance : { 25.0, 75.0, 125.0 })
          {
            LineGroupParams params;
            params.order = order;
            params.groups = groups;
            params.max_distance = distance;
            const std::vector<Association> candidates =
                maximumWeightMatching(associateLines(LineIndex(reference, params), LineIndex(current, params)));
            int judged = 0;
            int correct = 0;
            int top25 = 0;
            for (const Association& candidate : candidates)
            {
              const Verdict verdict = judge(pair, reference_labels[static_cast<std::size_t>(candidate.row)],
                                            current_labels[static_cast<std::size_t>(candidate.column)]);
              judged += verdict == Verdict::UNKNOWN ? 0 : 1;
              correct += verdict == Verdict::CORRECT ? 1 : 0;
              if (judged <= 25)
              {
                top25 = correct;
              }
              if (judged == 50)
              {
                break;
              }
            }
            csv << pair.name << ',' << (order == LineOrder::UPRIGHT ? "upright" : "contrast") << ','
                << (sigma == FINE ? "fine" : "coarse") << ',' << (groups == LineGrouping::PAIRS ? "pairs" : "triplets")
                << ',' << distance << ',' << reference.size() << ',' << current.size() << ',' << top25 << ',' << correct
                << '\n';
          }
        }
      }
      std::cerr << pair.name << (sigma == FINE ? ", fine" : ", coarse") << ": done" << std::endl;
    }
  }
}

const std::vector<Experiment>& experiments()
{
  static const std::vector<Experiment> all{
    { "lines_table", "tables 4.1 and 4.2: line matching by pairs and triplets", true, linesTable },
    { "homing", "chapter 5: homing in simulated rooms, from many starts", false, runHomingExperiment },
    { "arm", "table 8.1: servoing of a simulated arm, from many starts", false, runArmExperiment },
    { "homing_directions", "the heading between real views of a room", true, runDirectionsExperiment },
    { "multi_hypothesis", "table 9.1, figures 9.1 to 9.6: several hypotheses a point, simulated", false,
      runMultiHypothesisExperiment },
    { "real_pairs", "figures 9.7 to 9.10: several hypotheses a point, real images", true, runRealPairsExperiment },
    { "profiles_parameters", "figures 6.8 to 6.10: parameters of intensity profiles", true,
      runProfileParametersExperiment },
    { "view_consistency", "tables 6.2 and 6.3: the view constraint before and within RANSAC", true,
      runViewConsistencyExperiment },
    { "arm_geometry", "chapter 8: motions from homographies beside a real arm's", true, runArmGeometryExperiment },
    { "cyclic_order", "figures 7.5 to 7.11: cyclic order against plain votes", false, runCyclicOrderExperiment },
  };
  return all;
}

/** Draws a table with plot_experiment, which lies beside this program; false when that fails. */
bool plot(const fs::path& csv, const fs::path& png)
{
  const fs::path script = fs::read_symlink("/proc/self/exe").parent_path() / "plot_experiment";
  const std::string command = "'" + script.string() + "' '" + csv.string() + "' '" + png.string() + "'";
  return std::system(command.c_str()) == 0;  // NOLINT(cert-env33-c): of our own package, paths quoted
}

}  // namespace

int main(int argc, char** argv)
{
  CLI::App app("Re-runs the thesis' experiments and writes tables and plots.");
  std::string name;
  std::string out = ".";
  bool list = false;
  ExperimentContext context;
  app.add_option("name", name, "experiment; see --list");
  app.add_option("--out", out, "folder for NAME.csv and NAME.png, made when it does not exist");
  app.add_flag("--short", context.brief, "a small part of it, to see that it works");
  app.add_option("--threads", context.threads, "at most so many; 0: as many as there are processors")
      ->check(CLI::NonNegativeNumber);
  app.add_flag("--list", list, "names the experiments");
  CLI11_PARSE(app, argc, argv);
  if (list)
  {
    for (const Experiment& experiment : experiments())
    {
      std::cout << experiment.name << ": " << experiment.description << std::endl;
    }
    return 0;
  }
  const auto found = std::find_if(experiments().begin(), experiments().end(),
                                  [&](const Experiment& experiment) { return experiment.name == name; });
  if (found == experiments().end())
  {
    std::cerr << (name.empty() ? "name an experiment" : "there is no experiment '" + name + "'") << "; see --list"
              << std::endl;
    return 2;
  }
  if (found->needs_data)
  {
    const auto data = dataFolder();
    if (!data)
    {
      return 2;
    }
    context.data = *data;
  }
  try
  {
    fs::create_directories(out);
    const fs::path csv = fs::path(out) / (name + ".csv");
    const fs::path png = fs::path(out) / (name + ".png");
    std::ofstream stream(csv);
    if (!stream)
    {
      throw std::runtime_error("cannot write " + csv.string());
    }
    found->run(context, stream);
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
  catch (const std::exception& error)
  {
    std::cerr << error.what() << std::endl;
    return 2;
  }
}
