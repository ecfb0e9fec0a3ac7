// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera.h"

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include <limits>
#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

/** A pixel whose undistorted point comes back this far off lies where the distortion has no inverse [px]. */
constexpr double MAX_INVERSION_ERROR = 0.1;

/** The coefficients in OpenCV's order, which is ROS' for both models; empty when there is no distortion. */
std::vector<double> openCvDistortion(const Camera& camera)
{
  const std::size_t count = camera.distortion.size();
  // Simulated cameras often name a model and give no coefficients.
  const bool usable = count == 0 || (camera.distortion_model == "plumb_bob" && (count == 4 || count == 5)) ||
                      (camera.distortion_model == "rational_polynomial" && count == 8);
  if (!usable)
  {
    throw std::invalid_argument("distortion model '" + camera.distortion_model + "' with " + std::to_string(count) +
                                " coefficients is not supported");
  }
  return camera.distortion;
}

cv::Matx33d intrinsics(const Camera& camera)
{
  cv::Matx33d k;
  cv::eigen2cv(camera.k, k);
  return k;
}

}  // namespace

Eigen::Vector2d Camera::normalized(const Eigen::Vector2d& pixel) const
{
  const std::vector<double> coefficients = openCvDistortion(*this);
  if (!calibrated() || !pixel.allFinite())
  {
    return Eigen::Vector2d::Constant(NOT_A_NUMBER);
  }
  const std::vector<cv::Point2d> in{ { pixel.x(), pixel.y() } };
  std::vector<cv::Point2d> out;
  // OpenCV's own default stops after five iterations, which is pixels off at the edge of a wide-angle lens.
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-9);
  cv::undistortPoints(in, out, intrinsics(*this), coefficients, cv::noArray(), cv::noArray(), until);
  const Eigen::Vector2d point(out[0].x, out[0].y);
  const double error = (project(point.homogeneous()) - pixel).norm();
  return error <= MAX_INVERSION_ERROR ? point : Eigen::Vector2d::Constant(NOT_A_NUMBER);
}

Eigen::Vector2d Camera::project(const Eigen::Vector3d& point) const
{
  const std::vector<double> coefficients = openCvDistortion(*this);
  if (!calibrated() || !point.allFinite() || point.z() <= 0.0)
  {
    return Eigen::Vector2d::Constant(NOT_A_NUMBER);
  }
  const std::vector<cv::Point3d> in{ { point.x(), point.y(), point.z() } };
  std::vector<cv::Point2d> out;
  cv::projectPoints(in, cv::Vec3d(), cv::Vec3d(), intrinsics(*this), coefficients, out);
  return { out[0].x, out[0].y };
}

}  // namespace view_servo
