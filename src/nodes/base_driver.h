// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/view_homing.h"

#include <optional>
#include <string>

namespace view_servo
{
/**
 * The part of a driver of a mobile base that its ViewHoming answers for it. What each member is for, DriverNode says.
 */
class BaseDriver
{
public:
  using Velocity = BaseVelocity;
  using Limiter = BaseVelocityLimiter;

  void sent(double time, const Velocity& velocity)
  {
    view_homing_.sent(time, velocity);
  }
  static void onMissingInput(double /*time*/, const std::string& /*why*/)
  {
  }
  bool hasListener() const
  {
    return view_homing_.hasListener();
  }
  void publish(const Velocity& velocity) const
  {
    view_homing_.publish(velocity);
  }
  std::optional<double> takeLatency()
  {
    return view_homing_.takeLatency();
  }
  void fill(ServoStatus& status) const
  {
    view_homing_.fill(status);
  }
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status) const
  {
    view_homing_.diagnose(status);
  }

protected:
  /** @param homing a member of the driver, which is made later: only a reference is kept. */
  explicit BaseDriver(ViewHoming& homing) : view_homing_(homing)
  {
  }
  ~BaseDriver() = default;
  BaseDriver(const BaseDriver&) = delete;
  BaseDriver& operator=(const BaseDriver&) = delete;

private:
  ViewHoming& view_homing_;
};

}  // namespace view_servo
