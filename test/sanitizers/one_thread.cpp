// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Part of the core in a build with ThreadSanitizer: the threads of OpenCV's TBB hand work on by atomics that it does not see.
#include <opencv2/core/utility.hpp>

namespace
{
const bool g_one_thread = [] {
  cv::setNumThreads(1);
  return true;
}();
}  // namespace
