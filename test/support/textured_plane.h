// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <cstdint>

namespace view_servo
{
namespace test
{
/** A textured plane, another one for each seed: patches of many sizes and greys on a slowly varying ground, 8-bit. */
inline cv::Mat texturedPicture(std::uint64_t seed, const cv::Size& size = cv::Size(480, 360))
{
  cv::RNG rng(seed);
  cv::Mat coarse(6, 8, CV_8UC1);
  rng.fill(coarse, cv::RNG::UNIFORM, 60, 200);
  cv::Mat picture;
  cv::resize(coarse, picture, size, 0.0, 0.0, cv::INTER_CUBIC);
  for (int i = 0; i < 420; ++i)
  {
    const cv::Point centre(rng.uniform(0, size.width), rng.uniform(0, size.height));
    const cv::Size2f side(static_cast<float>(rng.uniform(4, 40)), static_cast<float>(rng.uniform(4, 40)));
    const cv::RotatedRect box(centre, side, static_cast<float>(rng.uniform(0, 180)));
    cv::Point2f corners[4];
    box.points(corners);
    cv::Point polygon[4];
    for (int k = 0; k < 4; ++k)
    {
      polygon[k] = corners[k];
    }
    cv::fillConvexPoly(picture, polygon, 4, cv::Scalar(rng.uniform(20, 236)), cv::LINE_AA);
  }
  cv::Mat blurred;
  cv::GaussianBlur(picture, blurred, cv::Size(), 0.8);
  return blurred;
}

/**
 * Noise blurred by `sigma` px, 8-bit: its corners, unlike those of texturedPicture(), are others in a reduced image.
 */
inline cv::Mat blotchedPicture(std::uint64_t seed, double sigma, const cv::Size& size = cv::Size(480, 360))
{
  cv::Mat noise(size, CV_32F);
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
  cv::GaussianBlur(noise, noise, cv::Size(), sigma);
  cv::Mat picture;
  noise.convertTo(picture, CV_8U, 40.0 * sigma * std::sqrt(4.0 * M_PI), 128.0);  // to a deviation of 40
  return picture;
}

/** Reference -> current: a plane seen from another side: a turn, a change of size and some perspective. */
inline Eigen::Matrix3d exampleHomography()
{
  Eigen::Matrix3d h;
  h << 0.87, -0.12, 50.0, 0.09, 0.93, -5.0, -2e-4, 1e-4, 1.0;
  return h;
}

/**
 * The picture seen through `h` (picture -> result), on grey ground. @param size of the result; without: the picture's.
 */
inline cv::Mat warpedPicture(const cv::Mat& picture, const Eigen::Matrix3d& h, const cv::Size& size)
{
  cv::Mat matrix;
  cv::eigen2cv(h, matrix);
  cv::Mat result;
  cv::warpPerspective(picture, result, matrix, size, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(128));
  return result;
}

inline cv::Mat warpedPicture(const cv::Mat& picture, const Eigen::Matrix3d& h)
{
  return warpedPicture(picture, h, picture.size());
}

/** The picture under another light, with noise. */
inline cv::Mat disturbed(const cv::Mat& picture, double gain, double offset, double sigma, std::uint64_t seed = 7)
{
  cv::Mat values;
  picture.convertTo(values, CV_32F, gain, offset);
  cv::Mat noise(picture.size(), CV_32F);
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0.0, sigma);
  values += noise;
  cv::Mat result;
  values.convertTo(result, CV_8U);
  return result;
}

}  // namespace test
}  // namespace view_servo
