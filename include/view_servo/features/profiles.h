// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/corners.h"
#include "view_servo/parameters/parameter.h"

#include <opencv2/core/mat.hpp>

#include <string>
#include <vector>

namespace view_servo
{
/** How corners are paired (thesis 6.1.1). */
enum class PairSelection
{
  NEAREST,  ///< each corner with its K_c nearest corners
  RADIUS    ///< each corner with all corners within D_c
};

/** Options of intensity profiles (thesis ch. 6). */
struct ProfileParams
{
  PairSelection selection = PairSelection::NEAREST;  ///< which corners are paired
  int neighbours = 50;        ///< K_c: each corner is paired with this many of its nearest ones (NEAREST)
  double max_length = 200.0;  ///< D_c: longest profile (RADIUS) [px]
  double min_length = 10.0;   ///< shortest profile [px]
  int coefficients = 8;       ///< N_f: number of Fourier features of a profile: 4, 6 or 8
  double min_contrast = 6.0;  ///< least value of max|p - mean| of a profile p that is kept [grey levels]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(ProfileParams& params);

/**
 * The intensity profiles of an image, each pair of corners once, in the direction `start` -> `end`.
 *
 * A profile's features are ordered sin 1, cos 1, sin 2, cos 2, .. (thesis eq. 6.3), each divided by its standard
 * deviation over the image's profiles. Samples lie at (i + 1/2)/N, so the profile read from `end` to `start` has the
 * same features but for the sign of the sines of even and the cosines of odd order (reversed()). Those two kinds have
 * zero mean over both directions; the mean of the others is subtracted.
 */
struct ProfileSet
{
  struct Pair
  {
    int start;  ///< index of a corner
    int end;    ///< index of another
  };

  int coefficients = 0;         ///< number of features of a profile
  std::vector<Pair> pairs;      ///< the ends of each profile
  std::vector<float> features;  ///< pairs.size() x coefficients, row-major

  /** The `coefficients` features of the profile with index `pair` in `pairs`. */
  const float* feature(std::size_t pair) const
  {
    return features.data() + pair * static_cast<std::size_t>(coefficients);
  }
};

/** +1 where the feature of that index keeps its sign when a profile is read backwards, -1 where it changes. */
constexpr float reversalSign(int feature_index)
{
  // Order m = index / 2 + 1; even indices are sines, which change for even m; odd ones cosines, which change for odd m.
  const int order = feature_index / 2 + 1;
  const bool is_sine = feature_index % 2 == 0;
  return (order % 2 == 0) == is_sine ? -1.0F : 1.0F;
}

/**
 * Extracts and describes the profiles between corners.
 * @param image 8-bit, one channel; the one in which the corners were found.
 * @throws std::invalid_argument when the image has the wrong type.
 */
ProfileSet extractProfiles(const cv::Mat& image, const std::vector<Corner>& corners, const ProfileParams& params);

/**
 * The raw features of one profile before normalisation over the image: `features` is an array of params.coefficients
 * numbers that are set. `start` and `end` are pixels of `image`, which is 8-bit with one channel. Brightness is
 * normalised as (p - mean) / max|p - mean|; eq. 6.1 divides by max(p), which depends on an offset of the light.
 * @return false when its contrast is below `min_contrast` or an end lies outside the image; `features` is then
 * untouched.
 */
bool profileFeatures(const cv::Mat& image, const Eigen::Vector2d& start, const Eigen::Vector2d& end,
                     const ProfileParams& params, float* features);

}  // namespace view_servo
