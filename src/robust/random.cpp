// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/random.h"

#include <cmath>

namespace view_servo
{
std::size_t uniformIndex(Rng& rng, std::size_t count)
{
  // The lowest 2^64 mod count values are refused: what remains is a whole number of times [0, count).
  const std::uint64_t n = count;
  const std::uint64_t refused = (std::uint64_t{ 0 } - n) % n;
  std::uint64_t value = rng();
  while (value < refused)
  {
    value = rng();
  }
  return static_cast<std::size_t>(value % n);
}

double uniform(Rng& rng, double low, double high)
{
  return low + (high - low) * std::ldexp(static_cast<double>(rng() >> 11U), -53);
}

double gaussian(Rng& rng)
{
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(rng, 0.0, 1.0)));
  return radius * std::cos(uniform(rng, 0.0, 2.0 * M_PI));
}

}  // namespace view_servo
