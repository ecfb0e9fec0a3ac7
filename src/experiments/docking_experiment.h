// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/experiment_context.h"

#include <ostream>

namespace view_servo
{
/** Starts at random places in three rooms, of all rooms together. */
constexpr Repetition DOCKING_STARTS{ "random starts", 200, 3, 5 };

/**
 * Laws that bring a base that cannot slide to a pose before which it has to see something: the one that homing uses
 * (ApproachLaw), and the one of Park and Kuipers (ICRA 2011), as it is in use for docking stations, with three further
 * attempts from a place behind the goal; that one also with a turn on the spot in the end. All are given the same
 * measurements of the goal, which become noisier with the distance and are missing where too little of the view is in
 * sight; no pictures are drawn. Hard is odometry that measures distances 5 % and turns 20 % too large, and a base that
 * does not move at less than 1 cm/s and 0.04 rad/s.
 */
void runDockingExperiment(const ExperimentContext& context, std::ostream& csv);

}  // namespace view_servo
