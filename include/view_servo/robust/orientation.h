// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

namespace view_servo
{
/**
 * Whether most matches keep the sense of rotation of neighbouring points. In a mirrored image (a plane seen from behind)
 * they reverse it, which a fundamental matrix alone can not tell.
 */
bool keepsOrientation(const Correspondences& pairs);

}  // namespace view_servo
