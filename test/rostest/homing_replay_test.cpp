// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "replay.h"
#include "sim/nomad.h"
#include "sim/world_reader.h"
#include "support/recorded_bag.h"
#include "support/shipped_files.h"
#include "support/temporary_directory.h"

#include "view_servo/Heading.h"
#include "view_servo/SetView.h"
#include "view_servo/geometry/planar_pose.h"
#include "view_servo/ros/call_service.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** On the floor, x along the optical axis. */
PlanarPose planarPoseOf(const Eigen::Isometry3d& camera)
{
  const Eigen::Vector3d axis = camera.linear().col(2);
  return { camera.translation().x(), camera.translation().y(), std::atan2(axis.y(), axis.x()) };
}

class HomingReplayTest : public ::testing::TestWithParam<const char*>
{
protected:
  void TearDown() override
  {
    removeViews("homing");
  }
};

TEST_P(HomingReplayTest, HeadingsAndArrivalAgreeWithTheTruth)
{
  constexpr double FAR = 0.3;        // [m]
  constexpr double TOLERANCE = 5.0;  // of headings [degrees]
  // Of those told while far. With sanitizers, fewer images are matched in time.
  constexpr double LEAST_SHARE = SLOWDOWN > 1.0 ? 0.8 : 0.9;
  constexpr double LEAST_ANSWERED = 0.6;  // of the images; a busy machine leaves some out
  constexpr double ARRIVAL = 0.03;        // [m]

  const TemporaryDirectory directory;
  const std::string bag = directory.path() / "approach.bag";
  const std::string file = worldFile(GetParam());
  recordBag(file, "approach", bag);
  ASSERT_FALSE(HasFatalFailure());
  const sim::World world = sim::readWorld(file);
  const sim::Nomad at_goal(world, sim::NomadParams());
  saveGoal("homing", world, at_goal.cameraPose());
  ASSERT_TRUE(waitForService("point_matcher/set_view"));
  SetView set;
  set.request.view = "goal";
  ASSERT_TRUE(callService("point_matcher/set_view", set) && set.response.success) << set.response.message;

  std::map<ros::Time, PlanarPose> truth;  // of the goal as seen from the camera
  for (const Frame& frame : framesOf(bag))
  {
    truth[frame.stamp] = compose(inverse(planarPoseOf(frame.pose)), planarPoseOf(at_goal.cameraPose()));
  }
  const Recorder<Heading> headings("heading");
  playBag(bag, 0.6, { "/camera/image_raw", "/camera/camera_info", "/odom", "/tf", "/tf_static" });
  ASSERT_FALSE(HasFatalFailure());
  std::size_t far_images = 0;
  for (const auto& [stamp, goal] : truth)
  {
    far_images += goal.distance() > FAR ? 1 : 0;
  }
  std::size_t told = 0;
  std::size_t right = 0;
  double arrived_at = -1.0;
  for (const Heading& heading : headings.messages())
  {
    const auto goal = truth.find(heading.header.stamp);
    ASSERT_NE(goal, truth.end()) << heading.header.stamp;
    if (heading.state == Heading::ARRIVED && arrived_at < 0.0)
    {
      arrived_at = goal->second.distance();
    }
    if (goal->second.distance() > FAR)
    {
      ++told;
      right += std::abs(wrapAngle(heading.heading - goal->second.heading())) * 180.0 / M_PI < TOLERANCE ? 1 : 0;
    }
  }
  RecordProperty("far_images", static_cast<int>(far_images));
  RecordProperty("told", static_cast<int>(told));
  RecordProperty("right", static_cast<int>(right));
  EXPECT_GE(static_cast<double>(told), LEAST_ANSWERED * static_cast<double>(far_images));
  EXPECT_GE(static_cast<double>(right), LEAST_SHARE * static_cast<double>(told)) << right << " of " << told;
  EXPECT_GE(arrived_at, 0.0) << "it never arrives";
  EXPECT_LE(arrived_at, ARRIVAL);
}

INSTANTIATE_TEST_SUITE_P(Worlds, HomingReplayTest, ::testing::Values("desk", "cabinet"),
                         [](const ::testing::TestParamInfo<const char*>& world) { return std::string(world.param); });

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "homing_replay_test");
}
