// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_segment.h"

#include <cstddef>
#include <stdexcept>
#include <string>

namespace view_servo
{
/** Segments that cannot be used; what() names the file and the line in it and says why, in one line. */
class SegmentError : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

/** Files with more segments are refused, because matching keeps the neighbours of every segment. */
constexpr std::size_t MAX_FILE_SEGMENTS = 100'000;

/** Segments with a coordinate of larger magnitude are refused: no image is that large [px]. */
constexpr double MAX_SEGMENT_COORDINATE = 1e6;

/**
 * Reads line segments from a text file, `x1 y1 x2 y2` on each line [px], separated by blanks or tabs. Blank lines and
 * lines that start with # are skipped; a file may have no segments. Does not depend on the locale.
 * @throws SegmentError when the file is missing, not readable or not a file, when a line is not four finite numbers
 * within MAX_SEGMENT_COORDINATE or a segment has no length, and for more segments than MAX_FILE_SEGMENTS.
 */
Segments readSegments(const std::string& path);

}  // namespace view_servo
