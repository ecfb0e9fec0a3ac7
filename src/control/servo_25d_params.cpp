// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/servo_25d.h"

namespace view_servo
{
std::vector<Parameter> parameters(Servo25dParams& params)
{
  return {
    real("gain", params.gain, "1/s", "> 0", "rate at which a large error decays"),
    real("near_gain", params.near_gain, "1/s", ">= gain", "rate at which a small error decays"),
    real("margin", params.margin, "", "[0, 0.3]", "part of the image's sides that the chosen point stays out of"),
    real("distance", params.distance, "m", "> 0", "distance of the plane from the view until it is known"),
    real("translation_tolerance", params.translation_tolerance, "m", "> 0",
         "distance from the view at which it has converged"),
    real("rotation_tolerance", params.rotation_tolerance, "rad", "> 0",
         "rotation from the view at which it has converged"),
    real("dwell", params.dwell, "s", ">= 0", "time that it has to stay within the tolerances"),
    real("loss_tolerance", params.loss_tolerance, "s", "[0, 0.5]",
         "time without the view that is bridged; then it stands"),
    real("lost_timeout", params.lost_timeout, "s", "> 0", "time without the view, after which it gives up"),
  };
}

std::vector<std::string> Servo25dParams::validate() const
{
  return faultsOf(*this);
}

}  // namespace view_servo
