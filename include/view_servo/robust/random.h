// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>

namespace view_servo
{
/** @file Random numbers that are the same on every machine, which the standard library's distributions are not. */

/** Portable generator: its output is fixed by the standard. */
using Rng = std::mt19937_64;

/** Uniform integer in [0, count), count > 0. */
std::size_t uniformIndex(Rng& rng, std::size_t count);

/** Uniform real number in [low, high). */
double uniform(Rng& rng, double low, double high);

/** Normally distributed, mean 0, variance 1 (Box & Muller 1958). */
double gaussian(Rng& rng);

}  // namespace view_servo
