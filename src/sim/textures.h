// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <string>

namespace view_servo::sim
{
/** Kinds of drawn pictures, for messages. */
std::string textureKinds();

/**
 * A drawn picture, 8-bit with one channel, the same for the same arguments. `kind` is one of textureKinds(): `checker`
 * (count x count fields), `blotches`, `wood`, `bricks`, `panel` (a cupboard's door), `poster` (patches of all sizes),
 * `print` (a box's front: lettering and shapes), `plain`.
 * @param size of the picture [px].
 * @param grey its mean, about [0, 255].
 * @throws std::invalid_argument for an unknown kind or an empty size.
 */
cv::Mat drawTexture(const std::string& kind, const cv::Size& size, double grey, int count, std::uint64_t seed);

}  // namespace view_servo::sim
