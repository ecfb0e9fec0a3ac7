// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/arm_geometry_experiment.h"

#include "support/csv_table.h"
#include "support/temporary_directory.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
using test::number;
using test::readTable;
using test::Row;

constexpr double RADIANS = M_PI / 180.0;
constexpr double SQUARE = 0.0236;  // [m]

Eigen::Isometry3d pose(const Eigen::Vector3d& position, const Eigen::Matrix3d& rotation)
{
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = rotation;
  result.translation() = position;
  return result;
}

Eigen::Matrix3d turn(double x, double y, double z)
{
  return (Eigen::AngleAxisd(x * RADIANS, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(y * RADIANS, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(z * RADIANS, Eigen::Vector3d::UnitZ()))
      .toRotationMatrix();
}

/** A camera over a board on a table, in a folder laid out like the real data; every number is exact. */
class ArmGeometryExperimentTest : public ::testing::Test
{
protected:
  void SetUp() override
  {
    folder_ = data_.path() / "eyeinhand_franka_visp";
    std::filesystem::create_directories(folder_);
    std::ofstream(folder_ / "franka_camera.xml")
        << "<root>\n<camera>\n<image_width>640</image_width>\n<image_height>480</image_height>\n<model>\n"
        << "<px>610</px>\n<py>605</py>\n<u0>322</u0>\n<v0>243</v0>\n<kud>0</kud>\n</model>\n</camera>\n</root>\n";
    const Eigen::Isometry3d camera_in_hand = pose({ 0.05, -0.03, -0.04 }, turn(1.0, -2.0, 90.0));
    std::ofstream(folder_ / "derived_eMc_park.txt") << std::setprecision(17) << camera_in_hand.matrix() << '\n';

    // It looks down on the board's middle from around, at distances from 0.35 to 0.6 m.
    const Eigen::Vector3d middle(4.0 * SQUARE, 2.5 * SQUARE, 0.0);
    const std::vector<Eigen::Matrix3d> turns{ turn(180.0, 5.0, 0.0), turn(150.0, -10.0, 60.0), turn(200.0, 25.0, -80.0),
                                              turn(170.0, -30.0, 20.0), turn(190.0, 15.0, 150.0) };
    for (std::size_t i = 0; i < turns.size(); ++i)
    {
      const Eigen::Vector3d back = (0.35 + 0.06 * static_cast<double>(i)) * turns[i].col(2);
      cameras_.push_back(pose(board_ * middle - back + Eigen::Vector3d(0.01, -0.02, 0.0), turns[i]));
      hands_.push_back(cameras_[i] * camera_in_hand.inverse());
      writePose(i, hands_[i]);
    }
    writeCorners(0.0);
  }

  /** @param distortion radial: positions off the axis are (1 + distortion r²) times as far from it. */
  void writeCorners(double distortion) const
  {
    Eigen::Matrix3d k;
    k << 610.0, 0.0, 322.0, 0.0, 605.0, 243.0, 0.0, 0.0, 1.0;
    std::ofstream stream(folder_ / "derived_chessboard_corners.txt");
    stream << "# image corner u v\n" << std::setprecision(17);
    for (std::size_t i = 0; i < cameras_.size(); ++i)
    {
      for (int row = 0; row < 6; ++row)
      {
        for (int column = 0; column < 9; ++column)
        {
          const Eigen::Vector3d corner = board_ * Eigen::Vector3d(SQUARE * column, SQUARE * row, 0.0);
          Eigen::Vector2d seen = (cameras_[i].inverse() * corner).hnormalized();
          seen *= 1.0 + distortion * seen.squaredNorm();
          stream << i + 1 << ' ' << 9 * row + column << ' ' << (k * seen.homogeneous()).hnormalized().transpose()
                 << '\n';
        }
      }
    }
  }

  void writePose(std::size_t i, const Eigen::Isometry3d& hand) const
  {
    const Eigen::AngleAxisd rotation(hand.linear());
    const Eigen::Vector3d vector = rotation.angle() * rotation.axis();
    std::ofstream stream(folder_ / ("franka_pose_rPe_" + std::to_string(i + 1) + ".yaml"));
    stream << std::setprecision(17) << "rows: 6\ncols: 1\ndata:\n";
    for (int j = 0; j < 6; ++j)
    {
      stream << "  - [" << (j < 3 ? hand.translation()(j) : vector(j - 3)) << "]\n";
    }
  }

  std::vector<Row> run() const
  {
    ExperimentContext context;
    context.data = data_.path();
    std::ostringstream csv;
    runArmGeometryExperiment(context, csv);
    return readTable(csv.str());
  }

  test::TemporaryDirectory data_;
  std::filesystem::path folder_;
  Eigen::Isometry3d board_ = pose({ 0.5, -0.1, 0.02 }, turn(0.0, 0.0, 30.0));
  std::vector<Eigen::Isometry3d> cameras_;
  std::vector<Eigen::Isometry3d> hands_;
};

}  // namespace

TEST_F(ArmGeometryExperimentTest, ExactCornersAgreeWithTheArm)
{
  const std::vector<Row> rows = run();
  // For the lens as it is given and as the board tells of it.
  ASSERT_EQ(rows.size(), 2U * hands_.size() * (hands_.size() - 1));
  int ambiguous = 0;
  for (const Row& row : rows)
  {
    const std::string name = row.at("lens") + " " + row.at("reference") + " -> " + row.at("current");
    EXPECT_NE(row.at("reference"), row.at("current"));
    EXPECT_GT(number(row, "baseline_m"), 0.05) << name;
    EXPECT_LT(number(row, "rotation_error_deg"), 1e-3) << name;
    EXPECT_LT(number(row, "translation_error_deg"), 1e-3) << name;
    EXPECT_LT(number(row, "position_error"), 1e-6) << name;
    EXPECT_LT(number(row, "log_depth_error"), 1e-6) << name;
    EXPECT_LT(number(row, "off_normal_deg"), 1e-3) << name;
    const double vector = std::hypot(number(row, "ux"), number(row, "uy"), number(row, "uz"));
    EXPECT_NEAR(vector, number(row, "rotation_deg") * RADIANS, 1e-5) << name;
    if (row.at("solutions") == "2")
    {
      // The one that was not chosen is another motion.
      ++ambiguous;
      EXPECT_GT(number(row, "other_off_normal_deg"), 1.0) << name;
      EXPECT_GT(number(row, "other_rotation_error_deg"), 1.0) << name;
    }
  }
  EXPECT_GT(ambiguous, 5);
}

TEST_F(ArmGeometryExperimentTest, AWrongJointIsTold)
{
  // The hand is turned by 3 degrees and 2 cm away from where it says.
  writePose(1, hands_[1] * pose({ 0.02, 0.0, 0.0 }, turn(0.0, 3.0, 0.0)));
  for (const Row& row : run())
  {
    const std::string name = row.at("lens") + " " + row.at("reference") + " -> " + row.at("current");
    if (row.at("reference") == "2" || row.at("current") == "2")
    {
      EXPECT_NEAR(number(row, "rotation_error_deg"), 3.0, 1e-3) << name;
      EXPECT_GT(number(row, "translation_error_deg"), 0.5) << name;
      EXPECT_GT(number(row, "log_depth_error"), 1e-4) << name;
    }
    else
    {
      EXPECT_LT(number(row, "rotation_error_deg"), 1e-3) << name;
      EXPECT_LT(number(row, "translation_error_deg"), 1e-3) << name;
    }
  }
}

TEST_F(ArmGeometryExperimentTest, TheBoardTellsOfTheLens)
{
  writeCorners(0.2);
  double given = 0.0;
  for (const Row& row : run())
  {
    if (row.at("lens") == "given")
    {
      given = std::max(given, number(row, "rotation_error_deg"));
    }
    else
    {
      EXPECT_LT(number(row, "rotation_error_deg"), 0.01) << row.at("reference") << " -> " << row.at("current");
      EXPECT_LT(number(row, "translation_error_deg"), 0.01) << row.at("reference") << " -> " << row.at("current");
    }
  }
  EXPECT_GT(given, 0.2);
}

TEST_F(ArmGeometryExperimentTest, WhatIsMissingIsNamed)
{
  std::filesystem::remove(folder_ / "franka_pose_rPe_3.yaml");
  try
  {
    run();
    FAIL() << "a pose is missing";
  }
  catch (const std::runtime_error& error)
  {
    EXPECT_NE(std::string(error.what()).find("franka_pose_rPe_3.yaml"), std::string::npos) << error.what();
  }
}

}  // namespace view_servo
