// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace view_servo
{
/** The 256 bits of an ORB descriptor (Rublee et al. 2011): comparisons of pairs of pixels around a corner. */
using BinaryWord = std::array<std::uint64_t, 4>;

/** Number of bits in which two words differ, 0 to 256. */
inline int hammingDistance(const BinaryWord& a, const BinaryWord& b)
{
  // Counts of bits are summed side by side: first of 2 bits, then of 4, of 8 and of 16. Unlike the compiler's popcount
  // this is fast also where the processor's instruction for it may not be used.
  constexpr std::uint64_t PAIRS = 0x5555555555555555;
  constexpr std::uint64_t NIBBLES = 0x3333333333333333;
  constexpr std::uint64_t BYTES = 0x0f0f0f0f0f0f0f0f;
  constexpr std::uint64_t SHORTS = 0x00ff00ff00ff00ff;
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < a.size(); i += 2)
  {
    std::uint64_t first = a[i] ^ b[i];
    std::uint64_t second = a[i + 1] ^ b[i + 1];
    first -= (first >> 1) & PAIRS;
    second -= (second >> 1) & PAIRS;
    first = (first & NIBBLES) + ((first >> 2) & NIBBLES) + (second & NIBBLES) + ((second >> 2) & NIBBLES);
    sum += (first & BYTES) + ((first >> 4) & BYTES);
  }
  sum = (sum & SHORTS) + ((sum >> 8) & SHORTS);
  return static_cast<int>((sum * 0x0001000100010001) >> 48);
}

/** A corner, described for finding views that show it. */
struct BinaryFeature
{
  BinaryWord word{};       ///< descriptor of the patch around the corner
  std::uint8_t angle = 0;  ///< direction of the patch, to which its word refers: [1/256 turn] from x towards y
};

/** Options of detectBinaryFeatures(). */
struct BinaryFeatureParams
{
  int max_features = 500;     ///< the strongest corners of all scales together
  int scales = 8;             ///< number of scales, each the image of the one before divided by `scale_factor`
  double scale_factor = 1.2;  ///< ratio of the sizes of two neighbouring scales, > 1
  int fast_threshold = 7;     ///< least difference of grey values around a corner; low, for images with little light

  /** Each fault in one line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(BinaryFeatureParams& params);

/**
 * ORB features of an image's corners. Large images are reduced and small ones enlarged first, until the longer side has
 * 480 to 640 pixels, as patches have a fixed size in pixels. The same image gives the same features.
 * @param grey 8-bit, one channel.
 * @param region where corners are looked for [px]; empty = everywhere.
 * @throws std::invalid_argument when the image has the wrong type or the region leaves it.
 */
std::vector<BinaryFeature> detectBinaryFeatures(const cv::Mat& grey, const cv::Rect& region,
                                                const BinaryFeatureParams& params);

}  // namespace view_servo
