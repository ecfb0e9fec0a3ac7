// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/scene_motion.h"

#include "support/matched_views.h"
#include "support/room_corner.h"
#include "view_servo/views/prepared_image.h"

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <cmath>
#include <stdexcept>
#include <string>

namespace view_servo
{
TEST(SceneMotion, IsThatOfTheCameraInARoom)
{
  const test::RoomCorner room;
  const auto motion =
      sceneMotion(test::matchScene(room.reference, room.current), test::roomCamera(), test::roomCamera());
  ASSERT_TRUE(motion);
  // As RoomCorner moves it.
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const Eigen::Vector3d direction = Eigen::Vector3d(-0.6, 0.1, 0.2).normalized();
  EXPECT_LT(Eigen::AngleAxisd(turn.transpose() * motion->pose.rotation).angle(), 0.005);
  EXPECT_LT(std::acos(std::min(1.0, direction.dot(motion->pose.translation))), 0.03);
  EXPECT_GE(motion->inliers, 100U);
}

TEST(SceneMotion, HasACovarianceThatIsOne)
{
  const test::RoomCorner room;
  const auto motion =
      sceneMotion(test::matchScene(room.reference, room.current), test::roomCamera(), test::roomCamera());
  ASSERT_TRUE(motion);
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  const Matrix6d& covariance = motion->covariance;
  EXPECT_TRUE(covariance.isApprox(covariance.transpose(), 1e-9));
  const Matrix6d more = covariance + 1e-12 * Matrix6d::Identity();
  EXPECT_EQ(Eigen::LLT<Matrix6d>(more).info(), Eigen::Success);  // else an eigenvalue is less than -1e-12
  EXPECT_LT((covariance.bottomRightCorner<3, 3>() * motion->pose.translation).norm(), 1e-9)
      << "a unit vector does not vary along itself";
  const double turn = std::sqrt(covariance.topLeftCorner<3, 3>().trace());
  EXPECT_GT(turn, 1e-4);
  EXPECT_LT(turn, 0.05);
}

TEST(SceneMotion, IsNotToldOfAPlane)
{
  const cv::Mat picture = test::texturedPicture(4, test::PICTURE_SIZE);
  const ViewMatch match = test::matchScene(picture, test::warpedPicture(picture, test::exampleHomography()));
  ASSERT_EQ(match.model, GeometryModel::HOMOGRAPHY);
  EXPECT_FALSE(sceneMotion(match, test::roomCamera(), test::roomCamera()));
  EXPECT_FALSE(sceneMotion(ViewMatch(), test::roomCamera(), test::roomCamera()));
}

TEST(SceneMotion, NeedsCalibratedCameras)
{
  try
  {
    sceneMotion(ViewMatch(), test::roomCamera(), Camera());
    FAIL() << "a camera without calibration is refused";
  }
  catch (const std::invalid_argument& error)
  {
    EXPECT_NE(std::string(error.what()).find("the current camera: "), std::string::npos) << error.what();
  }
}

}  // namespace view_servo
