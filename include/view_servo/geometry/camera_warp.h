// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

namespace view_servo
{
/**
 * Turns images of one camera into those that another would have taken at the same place: other focal length, size or
 * lens. The rectified frames of both count as the same. From a camera to its own rectified() this is rectification;
 * from a camera to itself nothing changes. Not for several threads at once.
 */
class CameraWarp
{
public:
  /** @throws std::invalid_argument with the fault of a camera that has one. */
  CameraWarp(const Camera& from, const Camera& to);

  /** Whether images are changed at all. */
  bool active() const
  {
    return active_;
  }
  /** The camera whose images image() returns. */
  const Camera& to() const
  {
    return to_;
  }
  /** Size of the images that image() returns [px]. */
  cv::Size size() const
  {
    return { to_.width, to_.height };
  }

  /**
   * An image of `from` as `to` would have taken it; shares its data when not active(). What `from` did not see is
   * black.
   * @throws std::invalid_argument when it has another size than `from` has.
   */
  cv::Mat image(const cv::Mat& image) const;

  /** A pixel of `from` -> pixel of `to`; NaN where there is none. */
  Eigen::Vector2d point(const Eigen::Vector2d& pixel) const;

  /**
   * A rectangle in images of `from` -> the one around what becomes of it, within the image and without what `from` did
   * not see. An empty one stands for the whole image. The result is empty only when nothing is left, or when nothing
   * changes.
   */
  cv::Rect region(const cv::Rect& region) const;

  /** The linear part: a pixel of `from` -> pixel of `to`, both taken for pinholes. */
  Eigen::Matrix3d homography() const;

private:
  void makeMap() const;

  Camera from_;
  Camera to_;
  Eigen::Matrix3d rotation_;  // frame of `from` -> frame of `to`
  bool active_;
  mutable cv::Mat
      positions_;  // for each pixel of `to`, where it is in `from`; made when needed, in the form of cv::remap
  mutable cv::Mat weights_;  // the second map that cv::remap takes beside positions_
  mutable cv::Mat seen_;     // 255 where `from` saw it
};

}  // namespace view_servo
