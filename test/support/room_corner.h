// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
/** What another camera sees of a plane; grey beside it. @param h image -> result [px]. */
inline cv::Mat viewThrough(const cv::Mat& image, const Eigen::Matrix3d& h)
{
  cv::Mat matrix;
  cv::eigen2cv(h, matrix);
  cv::Mat result;
  cv::warpPerspective(image, result, matrix, image.size(), cv::INTER_CUBIC, cv::BORDER_CONSTANT, cv::Scalar(110));
  return result;
}

/** Of RoomCorner's pictures [px]. */
inline const cv::Size PICTURE_SIZE(640, 480);

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
    Eigen::Matrix3d k;
    k << 500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0;
    // Walls at 45 degrees to the optical axis that meet 4 m ahead.
    const Eigen::Vector3d n_left(-std::sqrt(0.5), 0.0, std::sqrt(0.5));
    const Eigen::Vector3d n_right(std::sqrt(0.5), 0.0, std::sqrt(0.5));
    const double d = 4.0 * std::sqrt(0.5);
    const Eigen::Matrix3d r = Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Vector3d t(-0.6, 0.1, 0.2);
    left = k * (r + t * n_left.transpose() / d) * k.inverse();
    right = k * (r + t * n_right.transpose() / d) * k.inverse();
    Eigen::Matrix3d cross;
    cross << 0.0, -t.z(), t.y(), t.z(), 0.0, -t.x(), -t.y(), t.x(), 0.0;
    f = k.inverse().transpose() * cross * r * k.inverse();

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
    current = viewThrough(texture_left, left);
    viewThrough(texture_right, right).copyTo(current, seen_mask);
  }
};

}  // namespace test
}  // namespace view_servo
