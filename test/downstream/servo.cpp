// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include <view_servo/control/servo_25d.h>

/** At the view there is no error. */
int main()
{
  const view_servo::Servo25dError error = view_servo::servo25dError({}, Eigen::Vector2d::Zero());
  return error.rotation.norm() < 1e-9 ? 0 : 1;
}
