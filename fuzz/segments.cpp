// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/views/segment_io.h"

#include <cmath>

using namespace view_servo;

/** A file of line segments. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  static const fuzz::Directory directory;
  fuzz::readOrRefuse<SegmentError>([&] {
    const Segments segments = readSegments(directory.write("segments.txt", fuzz::toString(data, size)));
    fuzz::require(segments.size() <= MAX_FILE_SEGMENTS, "no more segments than the limit");
    for (const Segment& segment : segments)
    {
      fuzz::require((segment.end - segment.start).norm() > 0.0, "segments have a length");
      fuzz::require(segment.start.cwiseAbs().maxCoeff() <= MAX_SEGMENT_COORDINATE &&
                        segment.end.cwiseAbs().maxCoeff() <= MAX_SEGMENT_COORDINATE,
                    "coordinates are within their limit");
    }
  });
  return 0;
}
