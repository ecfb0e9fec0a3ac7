// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/robust/random.h"
#include "view_servo/views/prepared_image.h"

#include <Eigen/Core>

#include <vector>

namespace view_servo
{
/** What a matcher says when isMirrored(). */
constexpr const char* MIRRORED =
    "no geometry found: the current image, mirrored, shows the view better than as it is; look whether the camera or "
    "its driver mirrors images";

/**
 * Whether a current image, turned left to right, shows the reference better than as it is. Symmetric things (facades, a
 * chessboard) match in a mirrored image, too; what is around them, and their details, then show that it is mirrored.
 *
 * Profiles are the same in a mirrored image and only their cyclic order is reversed, so the corners need not be found
 * anew. Where the mirrored ones match, the plane on which they do and those that were found are compared by how many of
 * the reference's corners look alike along them: an oblique view, which few profiles show, is not refused for what
 * little matches mirrored.
 * @param reference_level, current_level the scales at which the images match.
 * @param planes that the geometry that was found agrees with, x_cur ~ H x_ref in pixels of the full images; where it
 * has none, its significance decides.
 * @param significance -log10 of the false alarms of that geometry.
 */
bool isMirrored(const PreparedImage& reference, int reference_level, const PreparedImage& current, int current_level,
                std::vector<Eigen::Matrix3d> planes, double significance, Rng& rng);

}  // namespace view_servo
