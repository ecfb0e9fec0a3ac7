// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/hand_eye_session.h"
#include "view_servo/views/hand_eye_file.h"

#include <string>

namespace view_servo
{
/**
 * The poses at which an arm stood still before a stored view, from a bag that was recorded meanwhile: /tf, /tf_static,
 * the camera's camera_info and the tracker's homographies. What HandEyeSession would have taken is taken, by the same
 * rules.
 * @throws std::runtime_error naming the bag, and what it lacks or what is wrong with it.
 */
HandEyePosesFile readHandEyeBag(const std::string& path, const HandEyeSources& sources);

}  // namespace view_servo
