// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/hand_eye_session.h"
#include "view_servo/views/hand_eye_file.h"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo
{
/** @file What calibrate_hand_eye and calibrate_mount write. */

/** Numbers with a fixed number of decimals, separated by spaces. */
std::string fixed(const std::vector<double>& values, int decimals);

/** Of now, as "2026-01-31 12:00". */
std::string dateAndTime();

/** What a session has collected, for a file. */
HandEyePosesFile posesOf(const HandEyeSession& session, const HandEyeSources& sources);

/**
 * Writes poses for the option --file of a program, and says so, or why it cannot: what they are for goes on without.
 * @param path of the file; empty: nothing is written.
 */
void keepPoses(HandEyePosesFile poses, const std::string& path, const std::string& program);

/** The numbers of a covariance, by rows. */
std::vector<double> numbersOf(const Eigen::Matrix<double, 6, 6>& covariance);

/** x y z qx qy qz qw, as static_transform_publisher takes them. */
std::string numbersOf(const Eigen::Isometry3d& pose);

}  // namespace view_servo
