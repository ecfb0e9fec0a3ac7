// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"

namespace view_servo::sim
{
/** @file
 * What trials of several robots share.
 */

/** True at each multiple of a period. */
class Every
{
public:
  /** @param period [s]. */
  explicit Every(double period) : period_(period)
  {
  }

  bool due(double time)
  {
    if (time < next_ - 1e-9)
    {
      return false;
    }
    next_ += period_;
    return true;
  }

private:
  double period_;
  double next_ = 0.0;
};

}  // namespace view_servo::sim
