// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/robust/random.h"
#include "view_servo/views/prepared_image.h"

namespace view_servo
{
/** What a matcher says when isMirrored(). */
constexpr const char* MIRRORED =
    "no geometry found: the current image, mirrored, shows the view better than as it is; look whether the camera or "
    "its driver mirrors images";

/**
 * Whether a current image, turned left to right, shows the reference better than as it is. Symmetric things (facades, a
 * chessboard) match in a mirrored image, too; what is around them then shows that it is mirrored.
 *
 * Profiles are the same in a mirrored image and only their cyclic order is reversed, so the corners need not be found
 * anew: they are matched once as they are and once mirrored.
 * @param reference_level, current_level the scales at which the images match.
 * @param significance -log10 of the false alarms of the points' geometry that was found. It is from more profiles than are compared
 * here, which may be too few for an oblique view: the mirrored image has to reach half of it.
 */
bool isMirrored(const PreparedImage& reference, int reference_level, const PreparedImage& current, int current_level,
                double significance, Rng& rng);

}  // namespace view_servo
