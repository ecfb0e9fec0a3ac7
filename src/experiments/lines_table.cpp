// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/lines_table.h"

#include "experiments/line_ground_truth.h"
#include "view_servo/features/line_segments.h"
#include "view_servo/geometry/line_homography.h"
#include "view_servo/matching/assignment.h"
#include "view_servo/matching/line_groups.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <iostream>
#include <vector>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

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

}  // namespace

void runLinesTableExperiment(const ExperimentContext& context, std::ostream& csv)
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

}  // namespace view_servo
