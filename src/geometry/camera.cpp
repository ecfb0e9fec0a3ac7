// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera.h"

#include "view_servo/images/image_io.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/parameters/shown_text.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr std::size_t FISHEYE_COEFFICIENTS = 4;

/** A pixel whose undistorted point comes back this far off lies where the distortion has no inverse [px]. */
constexpr double MAX_INVERSION_ERROR = 0.1;

/** As OpenCV wants them; its functions refuse empty lists. */
using CvPoints = std::vector<cv::Point2d>;

bool isFisheye(const Camera& camera)
{
  return camera.distortion_model == "equidistant";
}

bool isZero(const std::vector<double>& numbers)
{
  return std::all_of(numbers.begin(), numbers.end(), [](double number) { return number == 0.0; });
}

bool isOneOf(std::size_t count, std::initializer_list<std::size_t> counts)
{
  return std::find(counts.begin(), counts.end(), count) != counts.end();
}

/** What is wrong with model and coefficients; empty: nothing. */
std::string faultOfDistortion(const Camera& camera)
{
  const std::string& model = camera.distortion_model;
  const std::size_t count = camera.distortion.size();
  const auto wrong = [&](const std::string& right) {
    return "D has " + std::to_string(count) + " coefficients, distortion_model '" + shown(model) + "' has " + right;
  };
  if (!std::all_of(camera.distortion.begin(), camera.distortion.end(),
                   [](double number) { return std::isfinite(number); }))
  {
    return "a number in D is not finite";
  }
  if (model == "plumb_bob")
  {
    return isOneOf(count, { 0, 4, 5 }) ? "" : wrong("4 or 5");
  }
  if (model == "rational_polynomial")
  {
    return isOneOf(count, { 0, 5, 8, 12, 14 }) ? "" : wrong("5, 8, 12 or 14");
  }
  if (isFisheye(camera))
  {
    // Some drivers write five numbers for every model.
    const bool fits = isOneOf(count, { 0, FISHEYE_COEFFICIENTS }) ||
                      (count == FISHEYE_COEFFICIENTS + 1 && camera.distortion.back() == 0.0);
    return fits ? "" : wrong("4");
  }
  if (model.empty() || model == "none" || model == "None" || model == "NONE")
  {
    return isZero(camera.distortion) ? "" : "D is not zero, but distortion_model is '" + model + "'";
  }
  return "distortion_model '" + shown(model) + "' is not known: plumb_bob, rational_polynomial and equidistant are";
}

void requireDistortion(const Camera& camera)
{
  const std::string fault = faultOfDistortion(camera);
  if (!fault.empty())
  {
    throw std::invalid_argument(fault);
  }
}

cv::Vec4d fisheyeCoefficients(const Camera& camera)
{
  cv::Vec4d coefficients = cv::Vec4d::all(0.0);
  std::copy_n(camera.distortion.begin(), std::min(camera.distortion.size(), FISHEYE_COEFFICIENTS), coefficients.val);
  return coefficients;
}

/**
 * How far from the optical axis a ray may be, on the plane z = 1, before the image of what is farther out would lie farther
 * in: no camera does so, only the polynomial does. Infinite where it never does. Tangential coefficients are left out.
 */
double findFarthestRay(const Camera& camera)
{
  constexpr double STEP = 0.25 * DEGREE;
  constexpr double SIDEWAYS = 89.0 * DEGREE;
  std::vector<double> d = camera.distortion;
  d.resize(8, 0.0);
  const cv::Vec4d fisheye = fisheyeCoefficients(camera);
  const bool is_fisheye = isFisheye(camera);
  const auto radius = [&](double angle) {
    if (is_fisheye)
    {
      const double s = angle * angle;
      return angle * (1.0 + s * (fisheye[0] + s * (fisheye[1] + s * (fisheye[2] + s * fisheye[3]))));
    }
    const double r = std::tan(angle);
    const double s = r * r;
    return r * (1.0 + s * (d[0] + s * (d[1] + s * d[4]))) / (1.0 + s * (d[5] + s * (d[6] + s * d[7])));
  };
  double last = 0.0;
  for (double angle = STEP; angle < SIDEWAYS; angle += STEP)
  {
    const double next = radius(angle);
    if (!(next > last))
    {
      return std::tan(angle - STEP);
    }
    last = next;
  }
  return std::numeric_limits<double>::infinity();
}

/** As findFarthestRay(), of which each thread keeps the last answer: points are distorted one by one, too. */
double farthestRay(const Camera& camera)
{
  struct Answer
  {
    bool is_fisheye = false;
    std::vector<double> distortion;
    double farthest = std::numeric_limits<double>::infinity();
  };
  thread_local Answer last;
  if (last.is_fisheye != isFisheye(camera) || last.distortion != camera.distortion)
  {
    last = { isFisheye(camera), camera.distortion, findFarthestRay(camera) };
  }
  return last.farthest;
}

cv::Matx33d intrinsics(const Camera& camera)
{
  cv::Matx33d k;
  cv::eigen2cv(camera.k, k);
  return k;
}

CvPoints toCv(const Points& points)
{
  CvPoints result(points.size());
  std::transform(points.begin(), points.end(), result.begin(),
                 [](const Eigen::Vector2d& point) { return cv::Point2d(point.x(), point.y()); });
  return result;
}

Points fromCv(const CvPoints& points)
{
  Points result(points.size());
  std::transform(points.begin(), points.end(), result.begin(),
                 [](const cv::Point2d& point) { return Eigen::Vector2d(point.x, point.y); });
  return result;
}

}  // namespace

std::string Camera::fault() const
{
  if (!k.allFinite() || !rectification.allFinite() || !projection.allFinite())
  {
    return "a number in K, R or P is not finite";
  }
  if (k(0, 0) == 0.0 && k(1, 1) == 0.0)
  {
    return "the camera is not calibrated: K has no focal lengths";
  }
  if (!calibrated())
  {
    return "the focal lengths in K have to be positive";
  }
  if (k.row(2) != Eigen::RowVector3d(0.0, 0.0, 1.0))
  {
    return "the last row of K has to be 0, 0, 1";
  }
  if (width <= 0 || height <= 0)
  {
    return "width and height have to be positive";
  }
  if (width > MAX_IMAGE_PIXELS / height)  // maps that remove distortion have as many points
  {
    return "images of " + std::to_string(width) + " x " + std::to_string(height) + " pixels are too large: over " +
           std::to_string(MAX_IMAGE_PIXELS / 1'000'000) + " million";
  }
  if (!projection.leftCols<3>().isZero(0.0) && !(projection(0, 0) > 0.0 && projection(1, 1) > 0.0))
  {
    return "the focal lengths in P have to be positive";
  }
  if (!projection.leftCols<3>().isZero(0.0) && projection.row(2).head<3>() != Eigen::RowVector3d(0.0, 0.0, 1.0))
  {
    return "the last row of P has to be 0, 0, 1, 0";
  }
  constexpr double ROUNDING = 1e-3;
  const Eigen::Matrix3d rotation = rectifyingRotation();
  if (!(rotation * rotation.transpose()).isIdentity(ROUNDING) || rotation.determinant() < 0.0)
  {
    return "R is no rotation";
  }
  return faultOfDistortion(*this);
}

bool Camera::isPinhole() const
{
  return !isFisheye(*this) && isZero(distortion);
}

Camera Camera::rectified() const
{
  if (isPinhole())
  {
    return *this;
  }
  Camera pinhole;
  pinhole.width = width;
  pinhole.height = height;
  pinhole.k = projection.leftCols<3>().isZero(0.0) ? k : Eigen::Matrix3d(projection.leftCols<3>());
  pinhole.projection.leftCols<3>() = pinhole.k;
  return pinhole;
}

Points Camera::normalized(const Points& pixels) const
{
  requireDistortion(*this);
  Points points(pixels.size(), Eigen::Vector2d::Constant(NOT_A_NUMBER));
  if (!calibrated() || pixels.empty())
  {
    return points;
  }
  if (isPinhole())
  {
    const Eigen::Matrix3d inverse = k.inverse();
    std::transform(pixels.begin(), pixels.end(), points.begin(),
                   [&](const Eigen::Vector2d& pixel) { return (inverse * pixel.homogeneous()).hnormalized(); });
    return points;
  }
  CvPoints undistorted;
  if (isFisheye(*this))
  {
    cv::fisheye::undistortPoints(toCv(pixels), undistorted, intrinsics(*this), fisheyeCoefficients(*this));
  }
  else
  {
    // OpenCV's own default stops after five iterations, which is pixels off at the edge of a wide-angle lens.
    const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-9);
    cv::undistortPoints(toCv(pixels), undistorted, intrinsics(*this), distortion, cv::noArray(), cv::noArray(), until);
  }
  const Points found = fromCv(undistorted);
  const Points back = distorted(found);
  for (std::size_t i = 0; i < pixels.size(); ++i)
  {
    if ((back[i] - pixels[i]).norm() <= MAX_INVERSION_ERROR)
    {
      points[i] = found[i];
    }
  }
  return points;
}

Eigen::Vector2d Camera::normalized(const Eigen::Vector2d& pixel) const
{
  return normalized(Points{ pixel }).front();
}

Points Camera::distorted(const Points& points) const
{
  requireDistortion(*this);
  if (!calibrated() || points.empty())
  {
    return Points(points.size(), Eigen::Vector2d::Constant(NOT_A_NUMBER));
  }
  CvPoints pixels;
  if (isFisheye(*this))
  {
    cv::fisheye::distortPoints(toCv(points), pixels, intrinsics(*this), fisheyeCoefficients(*this));
  }
  else
  {
    std::vector<cv::Point3d> rays(points.size());
    std::transform(points.begin(), points.end(), rays.begin(),
                   [](const Eigen::Vector2d& point) { return cv::Point3d(point.x(), point.y(), 1.0); });
    // As many zeros as a driver likes are no distortion, but OpenCV takes certain numbers of coefficients only.
    cv::projectPoints(rays, cv::Vec3d(), cv::Vec3d(), intrinsics(*this),
                      isPinhole() ? std::vector<double>() : distortion, pixels);
  }
  Points result = fromCv(pixels);
  const double farthest = isPinhole() ? std::numeric_limits<double>::infinity() : farthestRay(*this);
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    if (!(points[i].norm() <= farthest))
    {
      result[i] = Eigen::Vector2d::Constant(NOT_A_NUMBER);
    }
  }
  return result;
}

Eigen::Vector2d Camera::project(const Eigen::Vector3d& point) const
{
  const bool in_front = point.allFinite() && point.z() > 0.0;
  const Eigen::Vector2d on_plane =
      in_front ? Eigen::Vector2d(point.hnormalized()) : Eigen::Vector2d(Eigen::Vector2d::Constant(NOT_A_NUMBER));
  const Eigen::Vector2d pixel = distorted(Points{ on_plane }).front();
  return in_front ? pixel : on_plane;
}

}  // namespace view_servo
