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
/** @file Real pairs of images whose true line matches are known, from the folder that VIEW_SERVO_DATA names. */

/** That folder; empty, with a message on standard error, when the variable is not set or names no folder. */
std::optional<std::filesystem::path> dataFolder();

/**
 * Indices of segments that show the same physical line, which may be broken: each of the reference image matches each
 * of the current one.
 */
struct LineGroupTruth
{
  std::vector<int> reference;
  std::vector<int> current;
};

/** Two images, line segments in each, and which of them match. */
struct LinePair
{
  std::string name;
  cv::Mat reference;
  cv::Mat current;
  Segments reference_segments;
  Segments current_segments;
  std::vector<LineGroupTruth> truth;

  /** Whether two segments, by their indices, show the same line. */
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
