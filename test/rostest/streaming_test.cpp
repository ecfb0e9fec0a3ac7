// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file A matcher matches the images of a camera with the view that somebody chose. */
#include "streaming_test.h"
#include "change_parameters.h"
#include "support/text_file.h"

#include "view_servo/DeleteView.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
TEST_F(StreamingTest, MatchesCameraImagesWithTheView)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  left_.sent.clear();
  ASSERT_TRUE(
      waitUntil([&] { return left_.matches.last() && left_.sent.count(left_.matches.last()->header.stamp) > 0; },
                [&] { left_.send(seen_); }));

  const PointMatches message = *left_.matches.last();
  EXPECT_EQ(message.header.frame_id, left_.camera.frame_id);
  EXPECT_EQ(message.view, "wall");
  EXPECT_EQ(message.homography.header.stamp, message.header.stamp);
  EXPECT_EQ(message.homography.header.frame_id, message.header.frame_id);
  EXPECT_EQ(message.homography.view, "wall");
  EXPECT_TRUE(message.homography.valid);
  EXPECT_EQ(message.homography.state, Homography::TRACKING);
  EXPECT_LT(cornerError(toMatrix(message.homography.h), exampleHomography()), 1.5);
  EXPECT_EQ(message.homography.matches, static_cast<int>(message.matches.size()));
  EXPECT_TRUE(right_.matches.messages().empty()) << "a node answered to the other's camera";
}

TEST_F(StreamingTest, SaysSoWhenTheViewIsNotSeen)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  const cv::Mat other = texturedPicture(5);
  ASSERT_TRUE(waitUntil([&] { return left_.matches.last() && !left_.matches.last()->homography.valid; },
                        [&] { left_.send(other); }));
  EXPECT_EQ(left_.matches.last()->homography.state, Homography::SEARCHING);
  EXPECT_EQ(left_.matches.last()->homography.inliers, 0);
}

TEST_F(StreamingTest, DrawsTheOverlayForThoseWhoListen)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  const Recorder<sensor_msgs::Image> overlays("left/point_matcher/overlay");
  ASSERT_TRUE(waitUntil([&] { return overlays.last().has_value(); }, [&] { left_.send(seen_); }));
  EXPECT_EQ(overlays.last()->encoding, sensor_msgs::image_encodings::BGR8);
  EXPECT_EQ(overlays.last()->header.frame_id, left_.camera.frame_id);
  EXPECT_EQ(left_.sent.count(overlays.last()->header.stamp), 1u);
}

TEST_F(StreamingTest, KeepsTwoNamespacesApart)
{
  left_.teach("wall", picture_);
  right_.teach("floor", seen_);
  ASSERT_TRUE(left_.setView("wall").success);
  ASSERT_TRUE(right_.setView("floor").success);
  const auto matched = [](const Robot& robot, const std::string& view, const Eigen::Matrix3d& h) {
    const std::optional<PointMatches> last = robot.matches.last();
    return last && last->view == view && last->homography.valid && cornerError(toMatrix(last->homography.h), h) < 1.5;
  };
  EXPECT_TRUE(waitUntil(
      [&] {
        return matched(left_, "wall", exampleHomography()) && matched(right_, "floor", exampleHomography().inverse());
      },
      [&] {
        left_.send(seen_);
        right_.send(picture_);
      }));
}

TEST_F(StreamingTest, FollowsSetView)
{
  left_.teach("wall", picture_);
  left_.teach("poster", texturedPicture(3));
  ASSERT_TRUE(left_.setView("wall").success);
  EXPECT_FALSE(left_.setView("nobody").success);
  EXPECT_NE(left_.setView("nobody").message.find("nobody"), std::string::npos);
  EXPECT_FALSE(left_.setView("../wall").success);
  EXPECT_TRUE(waitUntil([&] { return left_.matches.last() && left_.matches.last()->view == "wall"; },
                        [&] { left_.send(seen_); }));
  ASSERT_TRUE(left_.setView("poster").success);
  EXPECT_TRUE(waitUntil([&] { return left_.matches.last()->view == "poster"; }, [&] { left_.send(seen_); }));

  // Without a view nothing is matched but the image that may be under way.
  ASSERT_TRUE(left_.setView("").success);
  const ros::Time unset = ros::Time::now();
  right_.teach("floor", picture_);
  ASSERT_TRUE(right_.setView("floor").success);
  std::size_t images = 0;
  ASSERT_TRUE(waitUntil([&] { return right_.matches.messages().size() >= 5; },
                        [&] {
                          left_.send(seen_);
                          right_.send(picture_);
                          ++images;
                        }));
  EXPECT_GE(images, 5u);
  EXPECT_LE(left_.matches.last()->header.stamp, unset);
}

TEST_F(StreamingTest, TakesTheRateAndThresholdsThatPeopleChange)
{
  constexpr double SLOW = 0.5;  // [Hz]
  const auto change = [](const std::map<std::string, double>& wanted) {
    return changeParameters("left/point_matcher", wanted);
  };
  const auto nextMatches = [this] {
    const std::size_t before = left_.matches.messages().size();
    EXPECT_TRUE(waitUntil([&] { return left_.matches.messages().size() > before + 1; }, [&] { left_.send(seen_); }));
    return left_.matches.last()->matches.size();
  };
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  const std::map<std::string, double> started = change({});
  const std::size_t usual = nextMatches();
  EXPECT_EQ(change({ { "patch_correlation", 1.5 } }), started) << "no correlation is as high";
  EXPECT_EQ(change({ { "patch_correlation", 0.999 } })["patch_correlation"], 0.999);
  EXPECT_LT(nextMatches(), usual);
  EXPECT_EQ(change({ { "patch_correlation", started.at("patch_correlation") }, { "rate", SLOW } })["rate"], SLOW);
  nextMatches();
  const std::size_t at = left_.matches.messages().size();
  ASSERT_TRUE(waitUntil([&] { return left_.matches.messages().size() > at; }, [&] { left_.send(seen_); }));
  const auto messages = left_.matches.messages();
  EXPECT_GT((messages[at].header.stamp - messages[at - 1].header.stamp).toSec(), 0.9 / SLOW);
  EXPECT_EQ(messages[at].matches.size(), usual);
  EXPECT_EQ(change({ { "rate", 1e9 } })["rate"], 4.0 * started.at("rate"));
  EXPECT_EQ(change(started), started);
}

TEST_F(StreamingTest, GoesOnWhenTheViewDisappears)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  DeleteView::Request request;
  request.name = "wall";
  ASSERT_TRUE(left_.call<DeleteView>("view_store/delete", request).success);
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  EXPECT_TRUE(
      waitUntil([&] { return reported(diagnostics, "left/point_matcher", { "wall" }); }, [&] { left_.send(seen_); }));

  const ros::Time since = ros::Time::now();
  left_.teach("wall", picture_);
  EXPECT_TRUE(waitUntil([&] { return left_.matches.last() && left_.matches.last()->header.stamp > since; },
                        [&] { left_.send(seen_); }));
}

TEST_F(StreamingTest, MatchesTheViewThatADriverWants)
{
  left_.teach("wall", picture_);
  left_.teach("poster", texturedPicture(3));
  left_.want("wall", "goal 1");
  const auto send = [&] {
    left_.send(seen_);
  };
  ASSERT_TRUE(
      waitUntil([&] { return left_.answersFor("wall", "goal 1") && left_.matches.last()->homography.valid; }, send));
  EXPECT_FALSE(left_.matches.last()->refused);
  EXPECT_EQ(left_.matches.last()->reason, "");
  EXPECT_EQ(left_.matches.last()->homography.goal, "goal 1");
  left_.want("poster", "goal 2");
  ASSERT_TRUE(waitUntil([&] { return left_.answersFor("poster", "goal 2"); }, send));
  EXPECT_FALSE(left_.matches.last()->refused);
  EXPECT_NE(left_.matches.last()->reason, "");
  ASSERT_TRUE(left_.setView("wall").success);
  ASSERT_TRUE(waitUntil([&] { return left_.answersFor("wall", ""); }, send));
  left_.want("wall", "goal 3");
  ASSERT_TRUE(waitUntil([&] { return left_.answersFor("wall", "goal 3"); }, send));

  // None, from a driver, ends what a driver wanted.
  left_.want("", "goal 3");
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  const auto ended = [&] {
    for (const diagnostic_msgs::DiagnosticArray& array : diagnostics.messages())
    {
      for (const diagnostic_msgs::DiagnosticStatus& status : array.status)
      {
        if (status.name.find("left/point_matcher") != std::string::npos && status.message == "no view is set")
        {
          return true;
        }
      }
    }
    return false;
  };
  EXPECT_TRUE(waitUntil(ended, send));
}

TEST_F(StreamingTest, NoneFromADriverLeavesAPersonsViewAlone)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  left_.want("", "an old goal");
  const std::size_t before = left_.matches.messages().size();
  EXPECT_TRUE(waitUntil([&] { return left_.matches.messages().size() >= before + 20; }, [&] { left_.send(seen_); }));
  EXPECT_TRUE(left_.answersFor("wall", ""));
}

TEST_F(StreamingTest, RefusesAViewThatCannotBeMatched)
{
  const std::filesystem::path views = viewsDir("left/point_matcher");
  left_.expectRefusal("nobody", "missing", "nobody");  // without any image
  EXPECT_EQ(left_.matches.last()->header.frame_id, "");
  EXPECT_LT(std::abs((ros::Time::now() - left_.matches.last()->header.stamp).toSec()), 10.0);
  left_.expectRefusal("../wall", "name", "../wall");
  left_.teach("broken", picture_);
  writeText(views / "broken.yaml", "image: [");
  left_.expectRefusal("broken", "damaged", "broken");
  const auto send = [&] {
    left_.send(seen_);
  };

  // Who listens later learns of it, too.
  const Recorder<PointMatches> late("left/point_matcher/point_matches");
  EXPECT_TRUE(waitUntil([&] { return late.last() && late.last()->refused && late.last()->goal == "damaged"; }, send));
  left_.teach("wall", picture_);
  left_.want("wall", "good");
  EXPECT_TRUE(
      waitUntil([&] { return left_.answersFor("wall", "good") && left_.matches.last()->homography.valid; }, send));
}

TEST_F(StreamingTest, MatchesAViewOfAnotherSize)
{
  cv::Mat larger;
  cv::resize(picture_, larger, cv::Size(), 1.3, 1.3, cv::INTER_CUBIC);
  left_.teach("larger", larger);
  left_.want("larger", "size");
  EXPECT_TRUE(waitUntil([&] { return left_.answersFor("larger", "size") && left_.matches.last()->homography.valid; },
                        [&] { left_.send(seen_); }));
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "streaming_test");
}
