// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "simulation_test.h"
#include "test_paths.h"
#include "view_servo/SetPose.h"
#include "view_servo/ros/call_service.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/JointState.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace view_servo::sim
{
namespace
{
using test::waitUntil;

class PumaSimNodeTest : public SimulationTest<sensor_msgs::JointState, geometry_msgs::TwistStamped>
{
protected:
  PumaSimNodeTest() : SimulationTest("joint_states", BASE_FRAME)
  {
  }

  void prepare() override
  {
    ASSERT_TRUE(waitUntil([&] { return tf_.canTransform(BASE_FRAME, CAMERA_FRAME, ros::Time(0)); }));
  }

  double speedOf(const sensor_msgs::JointState& joints) const override
  {
    double sum = 0.0;
    for (const double velocity : joints.velocity)
    {
      sum += std::abs(velocity);
    }
    return sum;
  }

  void move(const Puma::Twist& twist, const std::string& frame = CAMERA_FRAME)
  {
    geometry_msgs::TwistStamped message;
    message.header.stamp = ros::Time::now();
    message.header.frame_id = frame;
    message.twist.linear.x = twist(0);
    message.twist.linear.y = twist(1);
    message.twist.linear.z = twist(2);
    message.twist.angular.x = twist(3);
    message.twist.angular.y = twist(4);
    message.twist.angular.z = twist(5);
    command_.publish(message);
  }
};

Puma::Twist twist(double x, double y, double z, double wx, double wy, double wz)
{
  Puma::Twist result;
  result << x, y, z, wx, wy, wz;
  return result;
}

}  // namespace

TEST_F(PumaSimNodeTest, TfAndGroundTruthTellOfOneMotion)
{
  const auto [true_motion, tf_motion] = motionsWhile([&] { move(twist(0.02, -0.03, -0.04, 0.03, -0.02, 0.1)); }, 0.04);
  EXPECT_LT((true_motion.translation() - tf_motion.translation()).norm(), 0.002);
  EXPECT_LT(Eigen::AngleAxisd(true_motion.linear().transpose() * tf_motion.linear()).angle(), 0.005);
  // As commanded, in the optical frame.
  EXPECT_GT(true_motion.translation().x(), 0.01);
  EXPECT_LT(true_motion.translation().y(), -0.015);
  EXPECT_LT(true_motion.translation().z(), -0.02);
  const Eigen::AngleAxisd turn(true_motion.linear());
  EXPECT_GT(turn.angle() * turn.axis().z(), 0.05);
  EXPECT_EQ(images_.last()->header.frame_id, "camera_optical_frame");
  EXPECT_EQ(state_.last()->name.size(), 6U);
}

TEST_F(PumaSimNodeTest, StandsAQuarterOfASecondAfterTheLastCommand)
{
  expectToStandAfter([&] { move(twist(0.0, 0.0, -0.05, 0.0, 0.0, 0.2)); }, 0.05);
}

TEST_F(PumaSimNodeTest, RefusesCommandsThatAreNotFiniteOrInAnotherFrame)
{
  const Eigen::Isometry3d before = cameraByTruth();
  moveFor(0.4, [&] { move(twist(std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0, 0.0, 0.0, 0.1)); });
  moveFor(0.4, [&] { move(twist(0.0, 0.0, -0.05, 0.0, 0.0, 0.0), "base_link"); });
  waitForFreshTruth();
  EXPECT_TRUE(cameraByTruth().isApprox(before, 1e-9));
}

TEST_F(PumaSimNodeTest, GoesToPosesWithinReachOnly)
{
  const Eigen::Isometry3d before = cameraByTruth();
  Eigen::Isometry3d near = before;
  near.translation().z() += 0.02;
  SetPose place;
  place.request.pose = toPose(near);
  ASSERT_TRUE(callService("puma_sim/set_pose", place) && place.response.success) << place.response.message;
  waitForFreshTruth();
  EXPECT_TRUE(cameraByTruth().isApprox(near, 1e-5));
  Eigen::Isometry3d far = before;
  far.translation().x() += 5.0;
  place.request.pose = toPose(far);
  ASSERT_TRUE(callService("puma_sim/set_pose", place));
  EXPECT_FALSE(place.response.success);
  waitForFreshTruth();
  EXPECT_TRUE(cameraByTruth().isApprox(near, 1e-5));
}

TEST_F(PumaSimNodeTest, RefusesToStartWithBadParameters)
{
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           { "_world:=desk" }, { "_world:=rice", "_start:=nowhere" }, { "_world:=rice", "_encoder_noise:=-1.0" } })
  {
    expectRefusedStart(PUMA_SIM_PATH, arguments);
  }
}

}  // namespace view_servo::sim

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "puma_sim_test");
}
