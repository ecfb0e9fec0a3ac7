// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tracking/shift_fit.h"

#include "view_servo/geometry/homography.h"

#include <gtest/gtest.h>
#include <Eigen/Core>

#include <optional>

namespace view_servo
{
namespace
{
constexpr double FIT_WIDTH = 4.0;  // [px]

/** Near the identity: it shifts the places below by less than 3 px. */
Eigen::Matrix3d smallChange()
{
  Eigen::Matrix3d h;
  h << 1.003, -0.002, 0.7, 0.001, 0.998, -0.5, 3e-6, -4e-6, 1.0;
  return h;
}

Points places()
{
  Points points;
  for (double u = 40.0; u <= 440.0; u += 80.0)
  {
    for (double v = 30.0; v <= 330.0; v += 60.0)
    {
      points.emplace_back(u, v);
    }
  }
  return points;
}

ShiftFit fitOf(const Eigen::Matrix3d& h)
{
  ShiftFit fit(FIT_WIDTH);
  for (const Eigen::Vector2d& place : places())
  {
    fit.add(place, transfer(h, place) - place, Eigen::Matrix2d::Identity());
  }
  return fit;
}

}  // namespace

TEST(ShiftFit, FindsTheHomographyOfExactShifts)
{
  const ShiftFit fit = fitOf(smallChange());
  const std::optional<Eigen::Matrix3d> found = fit.solve();
  ASSERT_TRUE(found.has_value());
  for (const Eigen::Vector2d& place : places())
  {
    EXPECT_LT((transfer(*found, place) - transfer(smallChange(), place)).norm(), 1e-3);
  }
  double rms = -1.0;
  EXPECT_EQ(fit.supporting(*found, 1.0, rms).size(), places().size());
  EXPECT_LT(rms, 1e-3);
}

TEST(ShiftFit, ShiftsThatDisagreeDoNotCount)
{
  ShiftFit fit = fitOf(smallChange());
  for (const double u : { 100.0, 150.0, 200.0 })
  {
    fit.add({ u, 200.0 }, { 30.0, 0.0 }, 100.0 * Eigen::Matrix2d::Identity());
  }
  const std::optional<Eigen::Matrix3d> found = fit.solve();
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((transfer(*found, { 150.0, 200.0 }) - transfer(smallChange(), { 150.0, 200.0 })).norm(), 1e-3);
  double rms = -1.0;
  EXPECT_EQ(fit.supporting(*found, 1.0, rms).size(), places().size());
}

/** As on an edge, along which a patch may lie anywhere. */
TEST(ShiftFit, OnlyTheDirectionThatIsKnownCounts)
{
  Eigen::Matrix2d across = Eigen::Matrix2d::Zero();
  across(1, 1) = 50.0;
  ShiftFit fit = fitOf(smallChange());
  for (const double u : { 100.0, 150.0, 200.0 })
  {
    const Eigen::Vector2d place(u, 200.0);
    fit.add(place, transfer(smallChange(), place) - place + Eigen::Vector2d(1.5, 0.0), across);
  }
  const std::optional<Eigen::Matrix3d> found = fit.solve();
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((transfer(*found, { 150.0, 200.0 }) - transfer(smallChange(), { 150.0, 200.0 })).norm(), 1e-3);
}

TEST(ShiftFit, IsEmptyWhenTheShiftsLeaveItOpen)
{
  EXPECT_FALSE(ShiftFit(FIT_WIDTH).solve().has_value());
  ShiftFit one_place(FIT_WIDTH);
  ShiftFit far(FIT_WIDTH);
  for (int i = 0; i < 6; ++i)
  {
    one_place.add({ 100.0, 100.0 }, { 0.5, 0.0 }, Eigen::Matrix2d::Identity());
  }
  for (const Eigen::Vector2d& place : places())
  {
    far.add(place, { 2.0 * FIT_WIDTH, 0.0 }, Eigen::Matrix2d::Identity());
  }
  EXPECT_FALSE(one_place.solve().has_value());
  EXPECT_FALSE(far.solve().has_value());
  double rms = -1.0;
  EXPECT_TRUE(far.supporting(Eigen::Matrix3d::Identity(), FIT_WIDTH, rms).empty());
  EXPECT_EQ(rms, 0.0);
}

TEST(SolveChange, ActsOnPixelsAboutTheMiddle)
{
  const Centring centring{ { 100.0, 50.0 }, 40.0 };
  Vector8 right = Vector8::Zero();
  right(2) = 0.05;  // along u, in spreads
  right(0) = 0.01;  // stretches u
  const std::optional<Eigen::Matrix3d> change = solveChange(Matrix8::Identity(), right, centring);
  ASSERT_TRUE(change.has_value());
  EXPECT_LT((transfer(*change, centring.middle) - Eigen::Vector2d(102.0, 50.0)).norm(), 1e-9);
  EXPECT_LT((transfer(*change, { 140.0, 50.0 }) - Eigen::Vector2d(142.4, 50.0)).norm(), 1e-9);
  EXPECT_FALSE(solveChange(Matrix8::Zero(), right, centring).has_value());
}

}  // namespace view_servo
