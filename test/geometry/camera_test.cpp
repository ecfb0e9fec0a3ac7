// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <stdexcept>

using view_servo::Camera;

namespace
{
Camera pinhole()
{
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.k << 520.0, 0.0, 318.5, 0.0, 510.0, 242.25, 0.0, 0.0, 1.0;
  return camera;
}

Camera plumbBob()
{
  Camera camera = pinhole();
  camera.distortion_model = "plumb_bob";
  camera.distortion = { -0.28, 0.09, 0.0012, -0.0007, -0.011 };
  return camera;
}

Camera rationalPolynomial()
{
  Camera camera = pinhole();
  camera.distortion_model = "rational_polynomial";
  camera.distortion = { 0.9, -0.3, 0.0008, -0.0005, -0.02, 1.2, -0.18, -0.06 };
  return camera;
}

/** The largest distance [px] between pixels of a grid over the image and their way to z = 1 and back. */
double roundTripError(const Camera& camera)
{
  double worst = 0.0;
  for (int v = 0; v < camera.height; v += 16)
  {
    for (int u = 0; u < camera.width; u += 16)
    {
      const Eigen::Vector2d pixel(u, v);
      const double error = (camera.project(camera.normalized(pixel).homogeneous()) - pixel).norm();
      if (!(error <= worst))  // also when it is NaN
      {
        worst = error;
      }
    }
  }
  return worst;
}

}  // namespace

TEST(Camera, ProjectsWithoutDistortion)
{
  const Eigen::Vector2d pixel = pinhole().project({ 0.2, -0.1, 2.0 });
  EXPECT_NEAR(pixel.x(), 318.5 + 520.0 * 0.1, 1e-9);
  EXPECT_NEAR(pixel.y(), 242.25 - 510.0 * 0.05, 1e-9);
}

TEST(Camera, NormalizesWithoutDistortion)
{
  const Eigen::Vector2d point = pinhole().normalized({ 318.5 + 52.0, 242.25 - 51.0 });
  EXPECT_NEAR(point.x(), 0.1, 1e-12);
  EXPECT_NEAR(point.y(), -0.1, 1e-12);
}

TEST(Camera, AppliesPlumbBob)
{
  const Camera camera = plumbBob();
  const double x = 0.3;
  const double y = -0.2;
  const double r2 = x * x + y * y;
  const double k1 = camera.distortion[0];
  const double k2 = camera.distortion[1];
  const double p1 = camera.distortion[2];
  const double p2 = camera.distortion[3];
  const double k3 = camera.distortion[4];
  const double radial = 1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
  const double x_distorted = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
  const double y_distorted = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;

  const Eigen::Vector2d pixel = camera.project(3.0 * Eigen::Vector3d(x, y, 1.0));
  EXPECT_NEAR(pixel.x(), 318.5 + 520.0 * x_distorted, 1e-9);
  EXPECT_NEAR(pixel.y(), 242.25 + 510.0 * y_distorted, 1e-9);
}

TEST(Camera, AppliesRationalPolynomial)
{
  Camera camera = rationalPolynomial();
  camera.distortion[2] = 0.0;  // radial only
  camera.distortion[3] = 0.0;
  const double x = 0.3;
  const double y = -0.2;
  const double r2 = x * x + y * y;
  const std::vector<double>& d = camera.distortion;
  const double radial = (1.0 + d[0] * r2 + d[1] * r2 * r2 + d[4] * r2 * r2 * r2) /
                        (1.0 + d[5] * r2 + d[6] * r2 * r2 + d[7] * r2 * r2 * r2);

  const Eigen::Vector2d pixel = camera.project({ x, y, 1.0 });
  EXPECT_NEAR(pixel.x(), 318.5 + 520.0 * x * radial, 1e-9);
  EXPECT_NEAR(pixel.y(), 242.25 + 510.0 * y * radial, 1e-9);
}

TEST(Camera, NormalizedInvertsProject)
{
  EXPECT_LT(roundTripError(pinhole()), 1e-9);
  EXPECT_LT(roundTripError(plumbBob()), 1e-6);
  EXPECT_LT(roundTripError(rationalPolynomial()), 1e-6);
}

TEST(Camera, ModelWithoutCoefficientsIsNotDistorted)
{
  Camera camera = plumbBob();
  camera.distortion.clear();
  EXPECT_EQ(camera.project({ 0.2, -0.1, 2.0 }), pinhole().project({ 0.2, -0.1, 2.0 }));
}

TEST(Camera, GivesNaNWhereThereIsNoAnswer)
{
  EXPECT_FALSE(Camera().calibrated());
  EXPECT_TRUE(Camera().normalized({ 1.0, 2.0 }).hasNaN());
  EXPECT_TRUE(Camera().project({ 0.0, 0.0, 1.0 }).hasNaN());
  EXPECT_TRUE(pinhole().project({ 0.1, 0.1, 0.0 }).hasNaN());
  EXPECT_TRUE(pinhole().project({ 0.1, 0.1, -1.0 }).hasNaN());
  EXPECT_TRUE(pinhole().normalized({ std::nan(""), 1.0 }).hasNaN());
}

TEST(Camera, GivesNaNBeyondTheLargestImageOfABarrelDistortion)
{
  Camera camera = pinhole();
  camera.distortion_model = "plumb_bob";
  camera.distortion = { -0.4, 0.0, 0.0, 0.0 };
  // r (1 - 0.4 r²) is at most 0.61: no ray meets a pixel farther than 317 px from the centre.
  EXPECT_TRUE(camera.normalized({ 318.5 + 340.0, 242.25 }).hasNaN());
  EXPECT_FALSE(camera.normalized({ 318.5 + 280.0, 242.25 }).hasNaN());
}

TEST(Camera, RefusesOtherModels)
{
  Camera camera = pinhole();
  camera.distortion_model = "equidistant";
  camera.distortion = { 0.1, 0.01, 0.0, 0.0 };
  EXPECT_THROW(camera.normalized({ 1.0, 2.0 }), std::invalid_argument);
  EXPECT_THROW(camera.project({ 0.0, 0.0, 1.0 }), std::invalid_argument);

  camera = plumbBob();
  camera.distortion.resize(3);
  EXPECT_THROW(camera.project({ 0.0, 0.0, 1.0 }), std::invalid_argument);
}
