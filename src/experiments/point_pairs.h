// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/views/point_view_matcher.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file Pairs of images whose true point matches are known: rendered ones, and real ones from VIEW_SERVO_DATA. */

/** Two images of a scene, and the ground truth of how they are related. */
struct PointPair
{
  std::string name;
  cv::Mat reference;                                   ///< 8-bit grey
  cv::Mat current;                                     ///< likewise
  GeometryModel model;                                 ///< what relates the two images
  std::function<double(const Correspondence&)> error;  ///< of a match [px]; NaN where the point can have no match
  Correspondences points;                              ///< true matches, at which an estimated geometry is measured

  /** Whether the error of a match is at most 4 px. */
  bool isCorrect(const Correspondence& match) const;
  /** Number of matches that are correct. */
  int countCorrect(const Correspondences& matches) const;
  /** Mean error of a homography (transfer) or fundamental matrix (Sampson) at `points` [px]; NaN for a NaN matrix. */
  double geometryError(GeometryModel kind, const Eigen::Matrix3d& matrix) const;
};

/** Names of what the folders oxford_affine, kusvod2 and adelaidermf hold; of the last with planes or with motions. */
const std::vector<std::string>& oxfordSequences();
const std::vector<std::string>& kusvodPairs();
const std::vector<std::string>& adelaidePairs(GeometryModel model);

/**
 * Image 1 and another one of a sequence of the folder oxford_affine, related by a homography. `points` are the corners
 * of image 1. @throws std::runtime_error naming a file that cannot be read.
 */
PointPair readOxfordPair(const std::filesystem::path& data, const std::string& sequence, int number);

/**
 * A pair of the folder kusvod2, with depth. `points` are made by hand, 9 to 13 of them; a match's error is its Sampson
 * distance from the fundamental matrix fitted to them: so a wrong match along its epipolar line counts as correct.
 * @throws std::runtime_error as above.
 */
PointPair readKusvodPair(const std::filesystem::path& data, const std::string& name);

/**
 * A pair of the folder adelaidermf, which shows several planes (HOMOGRAPHY) or motions (FUNDAMENTAL): one for each of
 * those that have enough labelled points, which are its `points` and determine what is correct.
 * @throws std::runtime_error as above.
 */
std::vector<PointPair> readAdelaidePairs(const std::filesystem::path& data, GeometryModel model,
                                         const std::string& name);

/**
 * Two views, 1 to 3, of a building, of the folder vgg_merton1. `points` are the corners labelled there; a match's error
 * is that of readKusvodPair(). @throws std::runtime_error as above.
 */
PointPair readMertonPoints(const std::filesystem::path& data, int reference_view, int current_view);

/** What renderPair() draws a picture on. */
enum class Surface
{
  PLANE,    ///< fills the reference image; `points` are the reference image's corners
  CYLINDER  ///< upright, as high as the image, the picture all around it; `points` are spread over what both views see
};

/**
 * A textured surface seen from the front and after it was turned by `angle` [rad] about its vertical axis and the
 * camera rolled by 10 degrees. 768x576, f = 800 px; noise of 2 grey levels, in the second image gain 0.8 and offset 10.
 */
PointPair renderPair(Surface surface, const cv::Mat& picture, double angle, std::uint64_t seed);

}  // namespace view_servo
