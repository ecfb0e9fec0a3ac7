// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/line_segments.h"
#include "view_servo/matching/line_features.h"
#include "view_servo/matching/point_matcher.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <array>
#include <memory>
#include <mutex>
#include <string>

namespace view_servo
{
/**
 * Options of the features of an image. For matching by points only, or by lines only, the others can keep their
 * defaults.
 */
struct FeatureParams
{
  FeatureParams() = default;
  FeatureParams(const PointMatcherParams& point_params) : points(point_params)
  {
  }
  FeatureParams(const LineSegmentParams& segment_params, const LineFeatureParams& line_params)
    : segments(segment_params), lines(line_params)
  {
  }

  PointMatcherParams points;   ///< options of corners, profiles and their matching
  LineSegmentParams segments;  ///< options of the detection of line segments
  LineFeatureParams lines;     ///< options of the groups of line segments
};

/**
 * An image with the features for matching, each computed once, when it is first asked for: a stored view that is kept
 * need not be analysed again for the next live image. Safe to use from several threads.
 *
 * Level l < SCALES is the image reduced by 2^(l/2) on each side. The others are the image as it would look from the
 * sides (Morel & Yu 2009): compressed by TILT in one of SIDES directions. Features of a level are in its own pixels;
 * toFull() maps them. Asking for a level outside [0, LEVELS) throws std::out_of_range.
 */
class PreparedImage
{
public:
  static constexpr int SCALES = 5;               ///< number of levels that are the image reduced
  static constexpr int SIDES = 8;                ///< number of levels that are the image from the sides
  static constexpr int LEVELS = SCALES + SIDES;  ///< number of all levels
  static constexpr double TILT = 5.5;            ///< factor by which an image from the side is compressed

  /**
   * @param grey 8-bit, one channel; the data is shared and must not be changed afterwards.
   * @param region where features are looked for [px]; empty = everywhere.
   * @param params must be valid; this is not checked here.
   * @throws std::invalid_argument when the image is empty or has the wrong type, or when the region leaves it.
   */
  PreparedImage(cv::Mat grey, const cv::Rect& region, const FeatureParams& params);

  const cv::Mat& grey() const
  {
    return grey_;
  }
  /** As given to the constructor; the whole image when that was empty. */
  const cv::Rect& region() const
  {
    return region_;
  }
  const FeatureParams& params() const
  {
    return params_;
  }

  /** The image of level `number`; ones that would be too small are empty, and so are their features. */
  const cv::Mat& image(int number) const;
  /** Corners and profiles of level `number`, in its own pixels. */
  const PointFeatures& points(int number) const;
  /** The index over the profiles of level `number`. */
  const ProfileIndex& profileIndex(int number) const;

  /** The line segments of the full image, in its region. @throws what detectLineSegments() and LineFeatures throw. */
  const LineFeatures& lines() const;

  /** Maps pixels of a level to pixels of the full image (homogeneous, affine). */
  Eigen::Matrix3d toFull(int number) const;

private:
  struct Level
  {
    std::once_flag image_once;
    std::once_flag points_once;
    std::once_flag index_once;
    cv::Mat image;
    cv::Mat mask;             ///< of a side: where the image shows the region, without its edge
    Eigen::Matrix3d to_full;  ///< see toFull()
    PointFeatures points;
    std::unique_ptr<ProfileIndex> index;
  };

  Level& level(int number) const;
  void reduce(Level& wanted, int number) const;
  void lookFromSide(Level& wanted, int side) const;

  cv::Mat grey_;
  cv::Rect region_;
  FeatureParams params_;
  mutable std::array<Level, LEVELS> levels_;
  mutable std::once_flag lines_once_;
  mutable std::unique_ptr<LineFeatures> lines_;
};

/**
 * To be appended to the message of a failure: which image's region is nearly black, white or uniform, see
 * lackOfLight(); empty when neither is.
 */
std::string exposureNote(const PreparedImage& reference, const PreparedImage& current);

}  // namespace view_servo
