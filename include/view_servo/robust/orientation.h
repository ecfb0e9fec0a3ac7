// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

namespace view_servo
{
/**
 * Whether, for most points, the triangle of the point and two of its neighbours turns the same way in both images,
 * clockwise or counter-clockwise. In a mirrored image (a plane seen from behind) it turns the other way, which a
 * fundamental matrix alone cannot tell; where matches are scattered along epipolar lines, it turns either way.
 * The neighbours are the nearest that are not at the point itself, nor on one line with it and each other.
 * @param part of the points for which this has to hold, more than that. True views of surfaces have had 0.87 at least,
 * rows of windows matched at random along epipolar lines 0.62 at most.
 * @return false where no three pairs tell anything.
 */
bool keepsOrientation(const Correspondences& pairs, double part = 0.5);

}  // namespace view_servo
