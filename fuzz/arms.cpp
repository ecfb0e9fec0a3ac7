// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "sim/arm_kinematics.h"

#include <stdexcept>

using namespace view_servo;

/** The URDF of an arm. What is wrong with one is told one fault a line, as of parameters. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  try
  {
    const sim::ArmKinematics arm(fuzz::toString(data, size), sim::ArmKinematicsParams());
    fuzz::require(arm.jointNames().size() == sim::ArmKinematics::JOINTS, "an arm has six joints");
    fuzz::require((arm.lower().array() < arm.upper().array()).all(), "each has a range");
    arm.pose(0.5 * (arm.lower() + arm.upper()));
  }
  catch (const std::invalid_argument& error)
  {
    fuzz::require(std::string(error.what()).find("\n  ") != std::string::npos, "a refusal names a fault");
  }
  return 0;
}
