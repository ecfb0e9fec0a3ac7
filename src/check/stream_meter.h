// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "check/observations.h"

#include <vector>

namespace view_servo::check
{
/** Takes the times of messages on a topic. Times are seconds of a steady clock. */
class StreamMeter
{
public:
  /**
   * @param age time from the message's stamp to now, by this computer's clock [s]. @param late a newer stamp has come
   * before.
   */
  void add(double time, double age, bool late);

  /** Sets count, rate, usual_gap, age and late_share. */
  void fill(StreamObservations& stream) const;

  /** Number of messages. */
  int count() const
  {
    return static_cast<int>(times_.size());
  }

private:
  std::vector<double> times_;  // when messages came [s]
  std::vector<double> ages_;   // of the messages [s]
  int late_ = 0;               // number of late messages
};

/** Where a base is while it should stand still: how far it went, and how much single readings differ from the mean. */
class RestMeter
{
public:
  /** @param x, y [m]. @param yaw [rad]. */
  void add(double x, double y, double yaw);

  /** Fills in moved, turned and both kinds of noise; they stay UNKNOWN without readings. */
  void fill(OdometryObservations& odometry) const;

private:
  std::vector<double> xs_;    // [m]
  std::vector<double> ys_;    // [m]
  std::vector<double> yaws_;  // less the first one [rad]
  double first_yaw_ = 0.0;
};

}  // namespace view_servo::check
