// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "node_test.h"

#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SetView.h"

#include <gtest/gtest.h>
#include <rosgraph_msgs/Clock.h>

#include <string>

namespace view_servo
{
namespace test
{
namespace
{
/** Plays a bag's clock and camera. */
class SimTimeTest : public ::testing::Test
{
protected:
  static void TearDownTestSuite()
  {
    removeViews("point_matcher");
  }

  void SetUp() override
  {
    clock_ = ros::NodeHandle().advertise<rosgraph_msgs::Clock>("/clock", 1);
    ASSERT_TRUE(waitForService("point_matcher/match"));
    ASSERT_TRUE(camera_.waitForSubscribers(1));
    saveView("point_matcher", viewOf("wall", picture_));
  }

  void play(double seconds, bool image)
  {
    rosgraph_msgs::Clock clock;
    clock.clock = ros::Time(seconds);
    clock_.publish(clock);
    if (image)
    {
      camera_.publish(seen_, clock.clock);
    }
  }

  /** Matches the view with the camera's latest image. */
  static MatchPoints::Response match()
  {
    MatchPoints::Request request;
    request.reference.view = "wall";
    return answerOf<MatchPoints>("point_matcher/match", request);
  }

  /** Lets the camera take images from a time on [s], until one is matched. */
  void playUntilMatched(double& now)
  {
    MatchPoints::Response response;
    EXPECT_TRUE(waitUntil(
        [&] {
          response = match();
          return response.success != 0;
        },
        [&] { play(now += 0.1, true); }))
        << response.message;
  }

  ros::Publisher clock_;
  FakeCamera camera_{ "camera" };
  const cv::Mat picture_ = texturedPicture(1);
  const cv::Mat seen_ = warped(picture_, exampleHomography());
};

TEST_F(SimTimeTest, ServesBeforeTheClockStarts)
{
  EXPECT_FALSE(match().success);
  MatchPoints::Request request;
  request.reference.view = "wall";
  request.query.image = toMono8(seen_);
  const MatchPoints::Response response = answerOf<MatchPoints>("point_matcher/match", request);
  EXPECT_TRUE(response.success) << response.message;
}

TEST_F(SimTimeTest, ForgetsTheFutureWhenTimeJumpsBack)
{
  double now = 1000.0;
  playUntilMatched(now);

  // The bag starts again: the last image is one of the future until the camera has sent another.
  now = 10.0;
  MatchPoints::Response response;
  EXPECT_TRUE(waitUntil(
      [&] {
        response = match();
        return !response.success;
      },
      [&] { play(now += 0.001, false); }));
  EXPECT_NE(response.message.find("future"), std::string::npos) << response.message;
  playUntilMatched(now);
}

TEST_F(SimTimeTest, StreamsOnAfterTimeJumpsBack)
{
  SetView::Request request;
  request.view = "wall";
  ASSERT_TRUE(answerOf<SetView>("point_matcher/set_view", request).success);
  const Recorder<PointMatches> matches("point_matcher/point_matches");
  double now = 2000.0;
  EXPECT_TRUE(waitUntil([&] { return matches.last() && matches.last()->header.stamp > ros::Time(2000.0); },
                        [&] { play(now += 0.1, true); }));
  now = 20.0;
  EXPECT_TRUE(
      waitUntil([&] { return matches.last()->header.stamp < ros::Time(1000.0); }, [&] { play(now += 0.1, true); }));
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "sim_time_test");
}
