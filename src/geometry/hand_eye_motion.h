// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hand_eye_problem.h"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo::hand_eye
{
/** @throws std::invalid_argument as calibrateHandEye() does of a view and poses. */
void check(const HandEyeView& view, const std::vector<HandEyePose>& poses);

/** As handEyeMotion(). @param normal of the plane; NaN: not known. */
HandEyeMotion motionOf(const Problem& problem, const std::vector<HandEyePose>& poses, const Eigen::Vector3d& normal);

/** The same with the normal on which most homographies agree. */
HandEyeMotion motionOf(const Problem& problem, const std::vector<HandEyePose>& poses);

/** What to do about too short a way of the camera. @param travel as a part of the plane's distance; NaN: not known. */
std::string lackOfTravel(double travel, double least);

/** A number with this many digits after the point, as people read it. */
std::string rounded(double value, int decimals = 1);

/** The angle of a rotation [rad], [0, pi]. */
double angleOf(const Eigen::Matrix3d& rotation);

}  // namespace view_servo::hand_eye
