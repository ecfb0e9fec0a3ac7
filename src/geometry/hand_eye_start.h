// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hand_eye_problem.h"

#include <cstddef>

namespace view_servo::hand_eye
{
/**
 * The state that suits a part of the poses best (least trimmed squares: Rousseeuw 1984), from closed forms of triples.
 * @param count number of poses that the part has. @param start is set when there is such a state.
 * @return whether there is one.
 */
bool robustStart(const Problem& problem, std::size_t count, State& start);

}  // namespace view_servo::hand_eye
