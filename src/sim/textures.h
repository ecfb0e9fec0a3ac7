// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <string>

namespace view_servo::sim
{
/** The names of all kinds of drawn pictures, for messages. */
std::string textureKinds();

/**
 * Draws a picture, 8-bit with one channel. The same arguments give the same picture.
 * @param kind `checker` (count x count fields), `blotches`, `wood`, `bricks`, `panel` (a cupboard's door), `poster`
 * (patches of all sizes), `print` (the front of a box: lettering and shapes) or `plain`.
 * @param size of the picture [px].
 * @param grey mean grey level of the picture, roughly, in [0, 255].
 * @param count how many things are drawn, for kinds that have a number of them.
 * @throws std::invalid_argument for an unknown kind or an empty size.
 */
cv::Mat drawTexture(const std::string& kind, const cv::Size& size, double grey, int count, std::uint64_t seed);

}  // namespace view_servo::sim
