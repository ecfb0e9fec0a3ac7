// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/planar_pose.h"

#include <opencv2/core.hpp>

#include <deque>
#include <optional>
#include <utility>

namespace view_servo::sim
{
/** @file
 * What the trials of both robots need to keep the times of a real driver in simulated time [s].
 */

constexpr double STEP = 0.005;            ///< of the simulation [s]
constexpr double ODOMETRY_PERIOD = 0.02;  ///< of a base [s]
constexpr double CONTROL_PERIOD = 0.05;   ///< of a base's driver [s]
constexpr double IMAGE_DELAY = 0.05;      ///< from an image's stamp until a base's driver gets it [s]
constexpr double SETTLING = 1.0;          ///< from the end of servoing until the error is measured [s]

/** An image, and when and where it was taken. */
struct StampedImage
{
  double stamp;  ///< [s]
  cv::Mat image;
  PlanarPose base;  ///< true pose of the base in the world [m, rad]
};

/** Something that happens at time 0 and then once a period. */
class Every
{
public:
  /** @param period [s], > 0. */
  explicit Every(double period) : period_(period)
  {
  }

  /** Whether it happens at `time` [s]. To be asked once for each time, with increasing times. */
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
  double period_;      // [s]
  double next_ = 0.0;  // when it happens next [s]
};

/** Values that are ready some time after they were begun, and are taken in the order in which they were begun. */
template <typename Value>
class Delayed
{
public:
  /** Adds a value, begun after all before it. @param ready from which time on it may be taken [s]. */
  void add(double ready, Value value)
  {
    waiting_.emplace_back(ready, std::move(value));
  }

  /** Takes the oldest value out, if it is ready at `time` [s]; else empty. */
  std::optional<Value> take(double time)
  {
    if (waiting_.empty() || time < waiting_.front().first)
    {
      return std::nullopt;
    }
    std::optional<Value> value(std::move(waiting_.front().second));
    waiting_.pop_front();
    return value;
  }

  bool empty() const
  {
    return waiting_.empty();
  }

private:
  std::deque<std::pair<double, Value>> waiting_;
};

}  // namespace view_servo::sim
