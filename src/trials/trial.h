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

/** @param error by which the calibration has the focal lengths too long, as a part of them. */
inline Camera withFocalLengthError(Camera camera, double error)
{
  camera.k(0, 0) *= 1.0 + error;
  camera.k(1, 1) *= 1.0 + error;
  camera.projection(0, 0) *= 1.0 + error;
  camera.projection(1, 1) *= 1.0 + error;
  return camera;
}

/** @param noise sd [grey levels]; negative: the world's. */
inline World withImageNoise(World world, double noise)
{
  if (noise >= 0.0)
  {
    world.quality.noise = noise;
  }
  return world;
}

}  // namespace view_servo::sim
