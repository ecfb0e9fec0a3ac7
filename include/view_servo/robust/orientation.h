// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

namespace view_servo
{
/**
 * Whether, for most points, the triangle of the point and its two nearest neighbours turns the same way in both images,
 * clockwise or counter-clockwise. In a mirrored image (a plane seen from behind) it turns the other way, which a
 * fundamental matrix alone cannot tell. False on a tie, and for fewer than three pairs.
 */
bool keepsOrientation(const Correspondences& pairs);

}  // namespace view_servo
