// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "simulation_test.h"
#include "test_paths.h"
#include "view_servo/SetLight.h"
#include "view_servo/SetPose.h"
#include "view_servo/ros/call_service.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Twist.h>
#include <nav_msgs/Odometry.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace view_servo::sim
{
namespace
{
using test::waitUntil;

class NomadSimNodeTest : public SimulationTest<nav_msgs::Odometry, geometry_msgs::Twist>
{
protected:
  NomadSimNodeTest() : SimulationTest("odom", ODOM_FRAME)
  {
  }

  void prepare() override
  {
    SetPose place;
    place.request.pose = toPose(planarPose(-0.906, 0.423, 0.0));
    ASSERT_TRUE(callService("nomad_sim/set_pose", place) && place.response.success) << place.response.message;
  }

  double speedOf(const nav_msgs::Odometry& state) const override
  {
    const geometry_msgs::Twist& twist = state.twist.twist;
    return std::hypot(twist.linear.x, twist.linear.y) + std::abs(twist.angular.z);
  }

  void drive(double x, double y, double turn)
  {
    geometry_msgs::Twist twist;
    twist.linear.x = x;
    twist.linear.y = y;
    twist.angular.z = turn;
    command_.publish(twist);
  }
};

}  // namespace

TEST_F(NomadSimNodeTest, OdometryTfAndGroundTruthTellOfOneMotion)
{
  const auto [true_motion, tf_motion] = motionsWhile([&] { drive(0.2, -0.1, 0.15); }, 0.25);
  EXPECT_GT(true_motion.translation().norm(), 0.2);
  EXPECT_LT((true_motion.translation() - tf_motion.translation()).norm(), 0.005);
  EXPECT_LT(Eigen::AngleAxisd(true_motion.linear().transpose() * tf_motion.linear()).angle(), 0.003);
  // Forward is along the optical axis, left is against the image's u axis; a turn to the left moves things to the
  // right.
  EXPECT_GT(true_motion.translation().z(), 0.15);
  EXPECT_GT(true_motion.translation().x(), 0.05);
  EXPECT_NEAR(true_motion.translation().y(), 0.0, 1e-9);
  const Eigen::Vector3d ahead = true_motion.inverse() * Eigen::Vector3d(0.0, 0.0, 10.0);
  EXPECT_GT(ahead.x(), 0.3);

  const nav_msgs::Odometry odometry = *state_.last();
  EXPECT_EQ(odometry.header.frame_id, "odom");
  EXPECT_EQ(odometry.child_frame_id, "base_link");
  EXPECT_EQ(images_.last()->header.frame_id, "camera_optical_frame");
}

TEST_F(NomadSimNodeTest, StandsAQuarterOfASecondAfterTheLastCommand)
{
  expectToStandAfter([&] { drive(0.4, 0.0, 0.0); }, 0.3);
}

TEST_F(NomadSimNodeTest, RefusesCommandsThatAreNotFinite)
{
  const Eigen::Isometry3d before = cameraByTruth();
  moveFor(0.5, [&] { drive(std::numeric_limits<double>::quiet_NaN(), 0.1, 0.0); });
  waitForFreshTruth();
  EXPECT_TRUE(cameraByTruth().isApprox(before, 1e-9));
  EXPECT_TRUE(waitUntil([&] { return (cameraByTruth().translation() - before.translation()).norm() > 0.01; },
                        [&] { drive(0.1, 0.0, 0.0); }));
}

TEST_F(NomadSimNodeTest, RefusesPosesInsideFurniture)
{
  const Eigen::Isometry3d before = cameraByTruth();
  SetPose place;
  place.request.pose = toPose(planarPose(2.2, 0.0, 0.0));
  ASSERT_TRUE(callService("nomad_sim/set_pose", place));
  EXPECT_FALSE(place.response.success);
  EXPECT_NE(place.response.message.find("table"), std::string::npos) << place.response.message;
  place.request.pose.orientation.w = 0.0;
  ASSERT_TRUE(callService("nomad_sim/set_pose", place));
  EXPECT_FALSE(place.response.success);
  place.request.pose = toPose(planarPose(std::numeric_limits<double>::infinity(), 0.0, 0.0));
  ASSERT_TRUE(callService("nomad_sim/set_pose", place));
  EXPECT_FALSE(place.response.success);
  waitForFreshTruth();
  EXPECT_TRUE(cameraByTruth().isApprox(before, 1e-12));
}

TEST_F(NomadSimNodeTest, SetsTheLightAsTold)
{
  const auto mean = [&] {
    return cv::mean(toGrey(*images_.last(), "image"))[0];
  };
  const double before = mean();
  SetLight light;
  light.request.gain = 0.6;
  light.request.offset = 5.0;
  ASSERT_TRUE(callService("nomad_sim/set_light", light) && light.response.success) << light.response.message;
  EXPECT_TRUE(waitUntil([&] { return std::abs(mean() - (0.6 * before + 5.0)) < 1.0; })) << before << " " << mean();
  for (const double gain : { 0.0, -1.0, std::numeric_limits<double>::quiet_NaN() })
  {
    light.request.gain = gain;
    ASSERT_TRUE(callService("nomad_sim/set_light", light));
    EXPECT_FALSE(light.response.success);
  }
  light.request.gain = 1.0;
  light.request.offset = 0.0;
  ASSERT_TRUE(callService("nomad_sim/set_light", light) && light.response.success);
  EXPECT_TRUE(waitUntil([&] { return std::abs(mean() - before) < 1.0; }));
}

TEST_F(NomadSimNodeTest, RefusesToStartInBadWorlds)
{
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{ { "_world:=nowhere" },
                                              { "_world:=desk", "_start:=nowhere" },
                                              { "_groups:=nothing" },
                                              { "_world:=desk", "_max_speed:=-1.0" },
                                              { "_seed:=-1" } })
  {
    expectRefusedStart(NOMAD_SIM_PATH, arguments);
  }
}

}  // namespace view_servo::sim

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "nomad_sim_test");
}
