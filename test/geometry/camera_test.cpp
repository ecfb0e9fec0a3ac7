// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/camera.h"

#include "support/cameras.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <stdexcept>

using view_servo::Camera;

namespace
{
Camera pinhole()
{
  return view_servo::test::pinholeCamera({ 640, 480 }, 520.0, 510.0, 318.5, 242.25);
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

Camera fisheye(const std::vector<double>& coefficients)
{
  Camera camera = pinhole();
  camera.k(0, 0) = camera.k(1, 1) = 300.0;
  camera.distortion_model = "equidistant";
  camera.distortion = coefficients;
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
  EXPECT_LT(roundTripError(fisheye({})), 1e-6);
  EXPECT_LT(roundTripError(fisheye({ 0.05, -0.01, 0.002, -0.0003 })), 1e-6);
}

TEST(Camera, AppliesEquidistantAlsoWithZeros)
{
  const double angle = 0.6;
  const Eigen::Vector3d ray(std::sin(angle), 0.0, std::cos(angle));
  for (const std::vector<double>& zeros :
       { std::vector<double>(), std::vector<double>(4, 0.0), std::vector<double>(5, 0.0) })
  {
    const Camera camera = fisheye(zeros);
    EXPECT_EQ(camera.fault(), "");
    EXPECT_FALSE(camera.isPinhole());
    EXPECT_NEAR(camera.project(ray).x(), 318.5 + 300.0 * angle, 1e-6);
    EXPECT_NEAR(camera.normalized({ 318.5 + 300.0 * angle, 242.25 }).x(), std::tan(angle), 1e-6);
  }
  const double bent = angle * (1.0 + 0.05 * angle * angle);
  EXPECT_NEAR(fisheye({ 0.05, 0.0, 0.0, 0.0 }).project(ray).x(), 318.5 + 300.0 * bent, 1e-6);
}

TEST(Camera, IsAPinholeWithoutCoefficientsUnlessItIsAFisheye)
{
  for (const char* model : { "", "none", "None", "plumb_bob", "rational_polynomial" })
  {
    Camera camera = pinhole();
    camera.distortion_model = model;
    EXPECT_EQ(camera.fault(), "") << model;
    EXPECT_TRUE(camera.isPinhole()) << model;
    camera.distortion.assign(5, 0.0);
    EXPECT_EQ(camera.fault(), "") << model;
    EXPECT_TRUE(camera.isPinhole()) << model;
    camera.distortion[0] = 1e-9;
    EXPECT_FALSE(camera.isPinhole()) << model;
  }
}

TEST(Camera, RectifiesToThePinholeOfPOrK)
{
  Camera camera = plumbBob();
  EXPECT_EQ(camera.rectified().k, camera.k);
  camera.projection.leftCols<3>() = 0.9 * camera.k;
  camera.projection(2, 2) = 1.0;
  EXPECT_DOUBLE_EQ(camera.rectified().k(0, 0), 468.0);
  EXPECT_TRUE(camera.rectified().isPinhole());
  EXPECT_EQ(camera.rectified().width, camera.width);
  EXPECT_EQ(camera.rectified().fault(), "");
  camera.distortion.clear();
  EXPECT_EQ(camera.rectified().k, camera.k);  // raw images are of a pinhole already
  camera.rectification.setZero();
  EXPECT_EQ(camera.rectifyingRotation(), Eigen::Matrix3d::Identity());
}

TEST(Camera, SaysWhichFieldCannotBeUsed)
{
  const auto fault_of = [](const auto& change) {
    Camera camera = plumbBob();
    change(camera);
    return camera.fault();
  };
  EXPECT_EQ(fault_of([](Camera&) {}), "");
  EXPECT_EQ(fault_of([](Camera& c) { c.rectification.setZero(); }), "");
  const double nan = std::nan("");
  EXPECT_EQ(fault_of([](Camera& c) { c.k.setZero(); }), "the camera is not calibrated: K has no focal lengths");
  EXPECT_EQ(fault_of([](Camera& c) { c.k(0, 0) = -520.0; }), "the focal lengths in K have to be positive");
  EXPECT_EQ(fault_of([&](Camera& c) { c.k(0, 2) = nan; }), "a number in K, R or P is not finite");
  EXPECT_EQ(fault_of([&](Camera& c) { c.projection(0, 3) = nan; }), "a number in K, R or P is not finite");
  EXPECT_EQ(fault_of([&](Camera& c) { c.distortion[2] = nan; }), "a number in D is not finite");
  EXPECT_EQ(fault_of([](Camera& c) { c.rectification(0, 0) = 2.0; }), "R is no rotation");
  EXPECT_EQ(fault_of([](Camera& c) { c.projection(1, 1) = -3.0; }), "the focal lengths in P have to be positive");
  EXPECT_EQ(fault_of([](Camera& c) { c.k(2, 2) = 0.0; }), "the last row of K has to be 0, 0, 1");
  EXPECT_EQ(fault_of([](Camera& c) {
              c.projection.leftCols<3>() = c.k;
              c.projection(2, 2) = 0.0;
            }),
            "the last row of P has to be 0, 0, 1, 0");
  EXPECT_EQ(fault_of([](Camera& c) { c.height = 0; }), "width and height have to be positive");
  EXPECT_EQ(fault_of([](Camera& c) { c.distortion_model = "plumb\nbob"; }),
            "distortion_model 'plumb?bob' is not known: plumb_bob, rational_polynomial and equidistant are");
  EXPECT_EQ(fault_of([](Camera& c) { c.width = 2147483647; }),
            "images of 2147483647 x 480 pixels are too large: over 50 million");
  EXPECT_EQ(fault_of([](Camera& c) { c.width = c.height = 7000; }), "");
  EXPECT_EQ(fault_of([](Camera& c) { c.distortion.resize(3); }),
            "D has 3 coefficients, distortion_model 'plumb_bob' has 4 or 5");
  EXPECT_EQ(fault_of([](Camera& c) { c.distortion_model = "equidistant"; }),
            "D has 5 coefficients, distortion_model 'equidistant' has 4");
  EXPECT_EQ(fault_of([](Camera& c) { c.distortion_model = "none"; }), "D is not zero, but distortion_model is 'none'");
  EXPECT_EQ(fault_of([](Camera& c) { c.distortion_model = "bent"; }),
            "distortion_model 'bent' is not known: plumb_bob, rational_polynomial and equidistant are");
}

TEST(Camera, ModelWithoutCoefficientsIsNotDistorted)
{
  Camera camera = plumbBob();
  camera.distortion.clear();
  EXPECT_EQ(camera.project({ 0.2, -0.1, 2.0 }), pinhole().project({ 0.2, -0.1, 2.0 }));
  for (const std::string model : { "", "none" })
  {
    camera.distortion_model = model;
    for (std::size_t zeros = 0; zeros <= 15; ++zeros)
    {
      camera.distortion.assign(zeros, 0.0);
      EXPECT_EQ(camera.fault(), "") << zeros;
      EXPECT_EQ(camera.project({ 0.2, -0.1, 2.0 }), pinhole().project({ 0.2, -0.1, 2.0 })) << zeros;
    }
  }
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

TEST(Camera, DoesNotFoldBackWhatIsFartherOut)
{
  for (const bool fisheye : { false, true })
  {
    Camera camera = pinhole();
    camera.distortion_model = fisheye ? "equidistant" : "plumb_bob";
    camera.distortion = { -0.4, 0.0, 0.0, 0.0 };
    // r (1 - 0.4 r²) is largest at r = 0.913, where r is the tangent of the ray's angle, or the angle of a fisheye.
    const double farthest = fisheye ? std::tan(0.913) : 0.913;
    for (const double part : { 0.3, 0.9, 0.98 })
    {
      EXPECT_FALSE(camera.project({ 0.0, part * farthest, 1.0 }).hasNaN()) << part;
    }
    for (const double part : { 1.02, 1.4, 1.8, 5.0 })
    {
      EXPECT_TRUE(camera.project({ -part * farthest, 0.0, 1.0 }).hasNaN()) << part;
    }
  }
}

TEST(Camera, RefusesOtherModels)
{
  Camera camera = pinhole();
  camera.distortion_model = "bent";
  camera.distortion = { 0.1, 0.01, 0.0, 0.0 };
  EXPECT_THROW(camera.normalized({ 1.0, 2.0 }), std::invalid_argument);
  EXPECT_THROW(camera.project({ 0.0, 0.0, 1.0 }), std::invalid_argument);

  camera = plumbBob();
  camera.distortion.resize(3);
  EXPECT_THROW(camera.project({ 0.0, 0.0, 1.0 }), std::invalid_argument);
}
