// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/finding.h"

#include <string>

namespace view_servo::check
{
/** One line a finding in columns, and a line below with what to do where there is something. */
std::string toLines(const Findings& findings);

/** How many there are of each level, in one line. */
std::string summary(const Findings& findings);

}  // namespace view_servo::check
