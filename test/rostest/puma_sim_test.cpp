// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "simulation_test.h"
#include "test_paths.h"
#include "view_servo/SetPose.h"
#include "view_servo/ros/call_service.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>

namespace view_servo::sim
{
namespace
{
using test::waitUntil;

class PumaSimTest : public SimulationTest<sensor_msgs::JointState, geometry_msgs::TwistStamped>
{
protected:
  PumaSimTest() : SimulationTest("joint_states", BASE_FRAME)
  {
  }

  void SetUp() override
  {
    waitForRobot();
    ASSERT_FALSE(HasFatalFailure());
    ASSERT_TRUE(waitUntil([&] { return tf_.canTransform(BASE_FRAME, CAMERA_FRAME, ros::Time(0)); }));
    ASSERT_TRUE(waitUntil([&] { return speed() == 0.0; }));
    waitForFreshTruth();
  }

  double speed() const
  {
    double sum = 0.0;
    const sensor_msgs::JointState joints = *state_.last();
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

  void moveFor(double duration, const Puma::Twist& twist, const std::string& frame = CAMERA_FRAME)
  {
    const ros::Time end = ros::Time::now() + ros::Duration(duration);
    ASSERT_TRUE(waitUntil([&] { return state_.last()->header.stamp > end; }, [&] { move(twist, frame); }));
  }
};

Puma::Twist twist(double x, double y, double z, double wx, double wy, double wz)
{
  Puma::Twist result;
  result << x, y, z, wx, wy, wz;
  return result;
}

}  // namespace

TEST_F(PumaSimTest, TfAndGroundTruthTellOfOneMotion)
{
  const geometry_msgs::PoseStamped start = *truth_.last();
  const Eigen::Isometry3d tf_start = cameraByTf(start.header.stamp);
  const Eigen::Vector3d from = cameraByTruth().translation();
  ASSERT_TRUE(waitUntil([&] { return (cameraByTruth().translation() - from).norm() > 0.04; },
                        [&] { move(twist(0.02, -0.03, -0.04, 0.03, -0.02, 0.1)); }));
  waitForFreshTruth();
  const geometry_msgs::PoseStamped end = *truth_.last();
  const Eigen::Isometry3d true_motion = toIsometry(start.pose).inverse() * toIsometry(end.pose);
  const Eigen::Isometry3d tf_motion = tf_start.inverse() * cameraByTf(end.header.stamp);
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

TEST_F(PumaSimTest, StandsAQuarterOfASecondAfterTheLastCommand)
{
  ASSERT_TRUE(waitUntil([&] { return speed() > 0.05; }, [&] { move(twist(0.0, 0.0, -0.05, 0.0, 0.0, 0.2)); }));
  move(twist(0.0, 0.0, -0.05, 0.0, 0.0, 0.2));
  const ros::WallTime last = ros::WallTime::now();
  ASSERT_TRUE(waitUntil([&] { return speed() == 0.0; }));
  for (const sensor_msgs::JointState& message : state_.messages())
  {
    const double after = message.header.stamp.toSec() - last.toSec();
    if (after > 0.25)
    {
      EXPECT_TRUE(std::all_of(message.velocity.begin(), message.velocity.end(), [](double v) { return v == 0.0; }))
          << after << " s after the last command";
    }
  }
}

TEST_F(PumaSimTest, RefusesCommandsThatAreNotFiniteOrInAnotherFrame)
{
  const Eigen::Isometry3d before = cameraByTruth();
  moveFor(0.4, twist(std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0, 0.0, 0.0, 0.1));
  moveFor(0.4, twist(0.0, 0.0, -0.05, 0.0, 0.0, 0.0), "base_link");
  waitForFreshTruth();
  EXPECT_TRUE(cameraByTruth().isApprox(before, 1e-9));
}

TEST_F(PumaSimTest, GoesToPosesWithinReachOnly)
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

TEST_F(PumaSimTest, NodesRefuseBadParameters)
{
  const std::string node = PUMA_SIM_PATH;
  for (const std::string arguments :
       { " _world:=desk", " _world:=rice _start:=nowhere", " _world:=rice _encoder_noise:=-1.0" })
  {
    const int status = std::system((node + " __name:=refused" + arguments + " 2> /dev/null").c_str());
    EXPECT_EQ(WEXITSTATUS(status), 1) << arguments;
  }
}

}  // namespace view_servo::sim

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "puma_sim_test");
}
