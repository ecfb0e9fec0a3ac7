// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_segment.h"

#include <opencv2/core/mat.hpp>

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/** @file Image pairs whose line matches are known, in the folder named by VIEW_SERVO_DATA; for benchmarks. */

/** The folder, or empty with a message on stderr when the variable is not set or names none. */
std::optional<std::filesystem::path> dataFolder();

/** Which segments of two images show the same physical line: any of the first with any of the second. */
struct LineGroupTruth
{
  std::vector<int> reference;
  std::vector<int> current;
};

/** Two images, segments in each, and which of these correspond. */
struct LinePair
{
  std::string name;
  cv::Mat reference;
  cv::Mat current;
  Segments reference_segments;
  Segments current_segments;
  std::vector<LineGroupTruth> truth;

  bool areSame(int reference_index, int current_index) const;
};

/**
 * The pairs of the folder line_matching_benchmark with their LSD segments; `only` names some, empty = all.
 * @throws std::runtime_error naming a file that cannot be read.
 */
std::vector<LinePair> readBenchmarkPairs(const std::filesystem::path& data, const std::vector<std::string>& only = {});

/** Two views, 1 to 3, of the folder vgg_merton1, with the lines labelled there. @throws std::runtime_error as above. */
LinePair readMertonPair(const std::filesystem::path& data, int reference_view, int current_view);

}  // namespace view_servo
