// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/core/version.hpp>

/** @file OpenCV's universal intrinsics with operators such as a + b, which from 4.11 on come in a header of their own. */

#if CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 411
#include <opencv2/core/hal/intrin_legacy_ops.h>
#endif
