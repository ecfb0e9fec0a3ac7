// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "node_test.h"

#include "view_servo/DeleteView.h"
#include "view_servo/GetView.h"
#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SaveView.h"
#include "view_servo/SetView.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** Two robots, each with the nodes of matching.launch in its namespace. */
class StreamingTest : public ::testing::Test
{
protected:
  struct Robot
  {
    explicit Robot(const std::string& ns) : name(ns), camera(ns + "/camera"), matches(ns + "/point_matches")
    {
    }

    /** A frame of the picture now; its stamp is remembered. */
    void send(const cv::Mat& image)
    {
      const ros::Time stamp = ros::Time::now();
      camera.publish(image, stamp);
      sent.insert(stamp);
    }

    template <typename Service>
    typename Service::Response call(const std::string& service, typename Service::Request request) const
    {
      typename Service::Response response;
      EXPECT_TRUE(ros::service::call(name + "/" + service, request, response)) << service << " did not answer";
      return response;
    }

    SetView::Response setView(const std::string& view) const
    {
      SetView::Request request;
      request.view = view;
      return call<SetView>("point_matcher/set_view", request);
    }

    /** Stores `image` from the camera, as a user does; not one that the camera took before. */
    void teach(const std::string& view, const cv::Mat& image)
    {
      SaveView::Request request;
      request.name = view;
      request.overwrite = true;
      GetView::Request stored;
      stored.name = view;
      SaveView::Response response;
      const ros::Time start = ros::Time::now();
      EXPECT_TRUE(waitUntil(
          [&] {
            response = call<SaveView>("view_store/save", request);
            return response.success && call<GetView>("view_store/get", stored).image.header.stamp > start;
          },
          [&] { send(image); }))
          << response.message;
    }

    std::string name;
    FakeCamera camera;
    Recorder<PointMatches> matches;
    std::set<ros::Time> sent;
  };

  static void TearDownTestSuite()
  {
    removeViews("left/point_matcher");
    removeViews("right/point_matcher");
  }

  void SetUp() override
  {
    for (const Robot* robot : { &left_, &right_ })
    {
      ASSERT_TRUE(waitForService(robot->name + "/point_matcher/set_view"));
      ASSERT_TRUE(waitForService(robot->name + "/view_store/save"));
      ASSERT_TRUE(robot->camera.waitForSubscribers(2));
      ASSERT_TRUE(robot->setView("").success);
    }
  }

  /** Whether a status came whose name and message contain all these. */
  static bool reported(const Recorder<diagnostic_msgs::DiagnosticArray>& diagnostics, const std::string& node,
                       const std::vector<std::string>& words)
  {
    for (const diagnostic_msgs::DiagnosticArray& array : diagnostics.messages())
    {
      for (const diagnostic_msgs::DiagnosticStatus& status : array.status)
      {
        if (status.level == diagnostic_msgs::DiagnosticStatus::ERROR && status.name.find(node) != std::string::npos &&
            std::all_of(words.begin(), words.end(),
                        [&](const std::string& word) { return status.message.find(word) != std::string::npos; }))
        {
          return true;
        }
      }
    }
    return false;
  }

  Robot left_{ "left" };
  Robot right_{ "right" };
  const cv::Mat picture_ = makePicture(1);
  const cv::Mat seen_ = warped(picture_, exampleHomography());
};

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
  const cv::Mat other = makePicture(5);
  ASSERT_TRUE(waitUntil([&] { return left_.matches.last() && !left_.matches.last()->homography.valid; },
                        [&] { left_.send(other); }));
  EXPECT_EQ(left_.matches.last()->homography.state, Homography::SEARCHING);
  EXPECT_EQ(left_.matches.last()->homography.inliers, 0);
}

TEST_F(StreamingTest, DrawsTheOverlayForThoseWhoListen)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  const Recorder<sensor_msgs::Image> overlays("left/overlay");
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
  left_.teach("poster", makePicture(3));
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

TEST_F(StreamingTest, PublishesNothingForAnUncalibratedCamera)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  ASSERT_TRUE(waitUntil([&] { return left_.matches.last().has_value(); }, [&] { left_.send(seen_); }));

  left_.camera.calibrated = false;
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  const ros::Time since = ros::Time::now();
  EXPECT_TRUE(waitUntil(
      [&] {
        return reported(diagnostics, "left/point_matcher",
                        { "not calibrated", "/left/camera/image_raw", "/left/camera/camera_info" });
      },
      [&] { left_.send(seen_); }));
  EXPECT_LE(left_.matches.last()->header.stamp, since);

  MatchPoints::Request request;
  request.reference.view = "wall";
  const MatchPoints::Response response = left_.call<MatchPoints>("point_matcher/match", request);
  EXPECT_FALSE(response.success);
  EXPECT_NE(response.message.find("/left/camera/camera_info"), std::string::npos) << response.message;

  SaveView::Request save;
  save.name = "never";
  EXPECT_FALSE(left_.call<SaveView>("view_store/save", save).success);
}

TEST_F(StreamingTest, MatchesTheLatestImageOnRequestUnlessItIsStale)
{
  left_.teach("wall", picture_);
  MatchPoints::Request request;
  request.reference.view = "wall";
  MatchPoints::Response response;
  EXPECT_TRUE(waitUntil(
      [&] {
        response = left_.call<MatchPoints>("point_matcher/match", request);
        return response.success && cornerError(toMatrix(response.model_matrix), exampleHomography()) < 1.5;
      },
      [&] { left_.send(seen_); }))
      << response.message;

  EXPECT_TRUE(waitUntil(
      [&] {
        response = left_.call<MatchPoints>("point_matcher/match", request);
        return !response.success && response.message.find("old") != std::string::npos;
      },
      [&] { left_.camera.publish(seen_, ros::Time::now() - ros::Duration(10.0)); }))
      << response.message;
  EXPECT_NE(response.message.find("max_image_age"), std::string::npos) << response.message;
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

TEST_F(StreamingTest, NamesBothTopicsWhenTheirStampsDiffer)
{
  ros::NodeHandle nh;
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  ros::Publisher image_only = nh.advertise<sensor_msgs::Image>("right/camera/image_raw", 1);
  const auto told = [&] {
    return reported(diagnostics, "right/point_matcher",
                    { "same stamp", "/right/camera/image_raw", "/right/camera/camera_info" });
  };
  EXPECT_TRUE(waitUntil(told, [&] {
    sensor_msgs::Image image = toMono8(picture_);
    image.header.stamp = ros::Time::now();
    image_only.publish(image);
  }));
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "streaming_test");
}
