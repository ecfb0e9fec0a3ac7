// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/stream_meter.h"

#include "view_servo/geometry/planar_pose.h"
#include "view_servo/robust/quantile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace view_servo::check
{
namespace
{
double mean(const std::vector<double>& values)
{
  double sum = 0.0;
  for (const double value : values)
  {
    sum += value;
  }
  return sum / static_cast<double>(values.size());
}

/** Mean squared distance from the mean. */
double variance(const std::vector<double>& values)
{
  const double middle = mean(values);
  double sum = 0.0;
  for (const double value : values)
  {
    sum += (value - middle) * (value - middle);
  }
  return sum / static_cast<double>(values.size());
}

}  // namespace

void StreamMeter::add(double time, double age, bool late)
{
  times_.push_back(time);
  ages_.push_back(age);
  late_ += late ? 1 : 0;
}

void StreamMeter::fill(StreamObservations& stream) const
{
  stream.count = count();
  if (times_.empty())
  {
    return;
  }
  stream.age = medianOf(ages_);
  stream.late_share = static_cast<double>(late_) / static_cast<double>(times_.size());
  std::vector<double> gaps;
  for (std::size_t i = 1; i < times_.size(); ++i)
  {
    gaps.push_back(times_[i] - times_[i - 1]);
  }
  const double duration = times_.back() - times_.front();
  if (duration > 0.0)
  {
    stream.rate = static_cast<double>(gaps.size()) / duration;
    stream.usual_gap = quantileOf(gaps, 0.95);
  }
}

void RestMeter::add(double x, double y, double yaw)
{
  first_yaw_ = xs_.empty() ? yaw : first_yaw_;
  xs_.push_back(x);
  ys_.push_back(y);
  yaws_.push_back(wrapAngle(yaw - first_yaw_));
}

void RestMeter::fill(OdometryObservations& odometry) const
{
  if (xs_.empty())
  {
    return;
  }
  odometry.moved = odometry.turned = 0.0;
  for (std::size_t i = 0; i < xs_.size(); ++i)
  {
    odometry.moved = std::max(odometry.moved, std::hypot(xs_[i] - xs_[0], ys_[i] - ys_[0]));
    odometry.turned = std::max(odometry.turned, std::abs(yaws_[i]));
  }
  odometry.position_noise = std::sqrt(variance(xs_) + variance(ys_));
  odometry.yaw_noise = std::sqrt(variance(yaws_));
}

}  // namespace view_servo::check
