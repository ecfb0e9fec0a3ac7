// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/cameras.h"
#include "support/textured_plane.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>

namespace view_servo
{
namespace test
{
/** Of RoomCorner's pictures [px]. */
inline const cv::Size PICTURE_SIZE(640, 480);

/** The camera that took them. */
inline Camera roomCamera()
{
  Camera camera = pinholeCamera(PICTURE_SIZE, 500.0, 500.0, 319.5, 239.5);
  camera.distortion_model = "plumb_bob";
  return camera;
}

/** Two walls that meet in the upright line u = 320 of the reference, each with its texture: a corner of a room. */
struct RoomCorner
{
  cv::Mat reference;
  cv::Mat current;
  Eigen::Matrix3d left;   ///< homography of the left wall, reference -> current
  Eigen::Matrix3d right;  ///< and of the right one
  Eigen::Matrix3d f;

  RoomCorner()
  {
    const Eigen::Matrix3d k = roomCamera().k;
    // Walls at 45 degrees to the optical axis that meet 4 m ahead.
    const Eigen::Vector3d n_left(-std::sqrt(0.5), 0.0, std::sqrt(0.5));
    const Eigen::Vector3d n_right(std::sqrt(0.5), 0.0, std::sqrt(0.5));
    const double d = 4.0 * std::sqrt(0.5);
    const Eigen::Matrix3d r = Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Vector3d t(-0.6, 0.1, 0.2);
    left = k * (r + t * n_left.transpose() / d) * k.inverse();
    right = k * (r + t * n_right.transpose() / d) * k.inverse();
    f = fundamentalOf(k, k, r, t);

    const cv::Mat texture_left = texturedPicture(21, PICTURE_SIZE);
    const cv::Mat texture_right = texturedPicture(22, PICTURE_SIZE);
    reference = texture_left.clone();
    const cv::Rect half(PICTURE_SIZE.width / 2, 0, PICTURE_SIZE.width / 2, PICTURE_SIZE.height);
    texture_right(half).copyTo(reference(half));
    cv::Mat mask(PICTURE_SIZE, CV_8UC1, cv::Scalar(0));
    mask(half).setTo(255);
    cv::Mat seen_mask;
    cv::Mat matrix;
    cv::eigen2cv(right, matrix);
    cv::warpPerspective(mask, seen_mask, matrix, PICTURE_SIZE, cv::INTER_NEAREST);
    current = warpedPicture(texture_left, left);
    warpedPicture(texture_right, right).copyTo(current, seen_mask);
  }
};

}  // namespace test
}  // namespace view_servo
