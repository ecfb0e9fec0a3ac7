// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <exception>
#include <string>

namespace view_servo
{
/**
 * An exception's text for people: in one line, never empty, and without the assertions of OpenCV, which speak of source
 * files that users do not have. With OPENCV_DUMP_ERRORS=1 in the environment OpenCV itself prints them.
 */
std::string oneLine(const std::exception& error);

}  // namespace view_servo
