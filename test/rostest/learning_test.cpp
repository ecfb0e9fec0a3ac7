// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/**
 * @file A view that is saved with learn: true is learnt while the base is driven away from it, and used by the next
 * goal.
 */
#include "simulated_base_test.h"

#include "view_servo/Heading.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>

#include <cmath>
#include <cstddef>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
class LearningTest : public SimulatedBaseTest
{
protected:
  std::size_t pointsLearnt() const
  {
    return ViewStore(viewsDir("homing")).loadStructure("learnt").points.size();
  }

  Recorder<Heading> headings_{ "heading" };
  Recorder<geometry_msgs::PoseWithCovarianceStamped> view_pose_{ "view_pose" };
  Recorder<geometry_msgs::PoseWithCovarianceStamped> base_pose_{ "base_pose" };
};

TEST_F(LearningTest, LearnsAViewWhileTheBaseIsDrivenAway)
{
  const geometry_msgs::Point at_view = position();
  const std::string saved = save("learnt", true);
  EXPECT_NE(saved.find("it is learnt while the base moves"), std::string::npos) << saved;
  ASSERT_TRUE(waitUntil([this] { return wanted_.last() && wanted_.last()->view == "learnt"; }));
  EXPECT_TRUE(wanted_.last()->goal.empty());
  EXPECT_EQ(pointsLearnt(), 0U);
  ASSERT_TRUE(waitUntil([this] { return headings_.last() && std::isfinite(headings_.last()->heading); }));

  ASSERT_TRUE(driveBack(0.4));
  EXPECT_TRUE(waitUntil([this] { return pointsLearnt() >= 30; })) << pointsLearnt();
  ASSERT_TRUE(view_pose_.last());
  EXPECT_LT(distance(view_pose_.last()->pose.pose.position, at_view), 0.05);
  ASSERT_TRUE(base_pose_.last());
  EXPECT_EQ(base_pose_.last()->header.frame_id, "view_learnt");
  EXPECT_LT(distance(base_pose_.last()->pose.pose.position, geometry_msgs::Point()), 0.45);
  EXPECT_LT(base_pose_.last()->pose.pose.position.x, -0.25) << "it was driven back";
  EXPECT_TRUE(waitUntil([this] { return wanted_.last()->view.empty(); })) << "the lesson is over";
}

TEST_F(LearningTest, SaysNothingOfLearningUnlessAsked)
{
  const std::string saved = save("plain");
  EXPECT_EQ(saved.find("learnt"), std::string::npos) << saved;
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "learning_test");
}
