// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/match_options.h"

namespace view_servo
{
/**
 * `match_images find`: says which of many views an image shows, and prints it. @return whether a view was found and
 * verified. @throws std::runtime_error when the folder or the image cannot be read, or a parameter is wrong.
 */
bool findView(const FindOptions& options);

}  // namespace view_servo
