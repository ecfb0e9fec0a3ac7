// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "change_parameters.h"
#include "node_test.h"

#include "support/room_structure.h"
#include "view_servo/RecognizeView.h"
#include "view_servo/RecognizedViews.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/image_encodings.h>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <string>
#include <utility>

namespace view_servo
{
namespace test
{
namespace
{
const std::string NODE = "view_recognizer";

class ViewRecognizerNodeTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    ASSERT_TRUE(waitForService(NODE + "/recognize"));
    for (int i = 0; i < 6; ++i)
    {
      saveView(nameOf(i), texturedPicture(pictureOf(i)));
    }
  }

  static void TearDownTestSuite()
  {
    removeViews(NODE);
  }

  static std::string nameOf(int i)
  {
    return "place_" + std::to_string(i);
  }

  static unsigned pictureOf(int i)
  {
    return 20U + static_cast<unsigned>(i);
  }

  static ViewStore store()
  {
    return ViewStore(viewsDir(NODE));
  }

  static void saveView(const std::string& name, const cv::Mat& image)
  {
    test::saveView(NODE, viewOf(name, image));
  }

  static RecognizeView::Request requestOf(const cv::Mat& image)
  {
    RecognizeView::Request request;
    request.image.image = toMono8(image);
    request.verify = true;
    return request;
  }

  static RecognizeView::Response call(RecognizeView::Request request)
  {
    return answerOf<RecognizeView>(NODE + "/recognize", request);
  }

  /** What a camera elsewhere sees of the picture of a view. */
  static cv::Mat seen(int i)
  {
    return warpedPicture(texturedPicture(pictureOf(i)), exampleHomography());
  }
};

TEST_F(ViewRecognizerNodeTest, NamesTheViewThatAnImageShows)
{
  for (const int i : { 0, 3, 5 })
  {
    SCOPED_TRACE(i);
    const RecognizeView::Response response = call(requestOf(seen(i)));
    EXPECT_TRUE(response.success) << response.message;
    ASSERT_EQ(response.views.size(), 1U);
    EXPECT_EQ(response.views[0].view, nameOf(i));
    EXPECT_TRUE(response.views[0].verified);
    EXPECT_GT(response.views[0].inliers, 20);
    EXPECT_NE(response.message.find(nameOf(i)), std::string::npos) << response.message;
    EXPECT_GT(response.elapsed_ms, 0.0);
  }
}

TEST_F(ViewRecognizerNodeTest, TellsWhereTheCameraOfAnImageIsInAViewThatHasStructure)
{
  const RoomCorner room;
  const StoredView view = roomView(room);
  StoredView other = view;
  other.name = "room_from_aside";
  other.image = room.current;
  test::saveView(NODE, view);
  test::saveView(NODE, other);
  ASSERT_TRUE(store().saveStructure(view.name, store().revision(view.name), roomStructure(4)));
  RecognizeView::Request request;
  request.image.view = other.name;
  request.verify = true;
  request.max_results = 2;
  const RecognizeView::Response response = call(request);
  store().remove(view.name);
  store().remove(other.name);
  ASSERT_EQ(response.views.size(), 2U) << response.message;
  for (const RecognizedView& seen : response.views)
  {
    EXPECT_TRUE(seen.verified) << seen.view;
    EXPECT_EQ(seen.has_pose != 0, seen.view == view.name) << seen.view;
    if (seen.view == view.name)
    {
      const Eigen::Vector3d truth = roomViewFromCurrent().translation();
      EXPECT_NEAR(seen.pose.pose.position.x, truth.x(), 0.02);
      EXPECT_NEAR(seen.pose.pose.position.y, truth.y(), 0.02);
      EXPECT_NEAR(seen.pose.pose.position.z, truth.z(), 0.02);
      EXPECT_NEAR(seen.pose.pose.orientation.w, Eigen::Quaterniond(roomViewFromCurrent().linear()).w(), 0.001);
      EXPECT_GT(seen.pose.covariance[0], 0.0);
    }
  }
}

TEST_F(ViewRecognizerNodeTest, RanksViewsWithoutVerification)
{
  RecognizeView::Request request = requestOf(seen(2));
  request.verify = false;
  request.max_results = 3;
  const RecognizeView::Response response = call(request);
  EXPECT_TRUE(response.success) << response.message;
  ASSERT_FALSE(response.views.empty());
  EXPECT_LE(response.views.size(), 3U);
  EXPECT_EQ(response.views[0].view, nameOf(2));
  for (const RecognizedView& view : response.views)
  {
    EXPECT_FALSE(view.verified);
    EXPECT_EQ(view.inliers, 0);
    EXPECT_LE(view.score, response.views[0].score);
  }
}

TEST_F(ViewRecognizerNodeTest, SaysThatAnImageShowsNoView)
{
  for (const cv::Mat& image : { texturedPicture(99), cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)) })
  {
    const RecognizeView::Response response = call(requestOf(image));
    EXPECT_FALSE(response.success);
    EXPECT_NE(response.message, "");
    for (const RecognizedView& view : response.views)
    {
      EXPECT_FALSE(view.verified);
    }
  }
}

TEST_F(ViewRecognizerNodeTest, RefusesBadRequestsAndGoesOn)
{
  RecognizeView::Request negative = requestOf(seen(1));
  negative.max_results = -1;
  RecognizeView::Request missing;
  missing.image.path = "/nowhere/picture.png";
  RecognizeView::Request twofold = requestOf(seen(1));
  twofold.image.view = nameOf(1);
  for (const auto& [request, naming] :
       { std::make_pair(negative, "max_results"), std::make_pair(missing, "/nowhere/picture.png"),
         std::make_pair(twofold, "image") })
  {
    const RecognizeView::Response response = call(request);
    EXPECT_FALSE(response.success);
    EXPECT_NE(response.message.find(naming), std::string::npos) << response.message;
    EXPECT_EQ(response.message.find('\n'), std::string::npos) << response.message;
  }
  EXPECT_TRUE(call(requestOf(seen(1))).success);
}

TEST_F(ViewRecognizerNodeTest, KnowsWhatWasSavedChangedAndDeletedAMomentAgo)
{
  const cv::Mat image = warpedPicture(texturedPicture(50), exampleHomography());
  EXPECT_FALSE(call(requestOf(image)).success);
  saveView("guest", texturedPicture(50));
  EXPECT_EQ(call(requestOf(image)).views.at(0).view, "guest");
  saveView("guest", texturedPicture(51));
  EXPECT_FALSE(call(requestOf(image)).success);
  store().remove("guest");
  EXPECT_FALSE(call(requestOf(warpedPicture(texturedPicture(51), exampleHomography()))).success);
  // Beside the views, for the node's next start.
  EXPECT_TRUE(waitUntil([] { return std::filesystem::exists(store().directory() / "views.index"); }));
}

TEST_F(ViewRecognizerNodeTest, RecognizesWhatTheCameraSees)
{
  FakeCamera camera("camera");
  ASSERT_TRUE(camera.waitForSubscribers(1));
  const Recorder<RecognizedViews> recognized(NODE + "/recognized");
  const cv::Mat image = seen(4);
  const auto send = [&](const cv::Mat& picture) {
    const sensor_msgs::CameraInfo info = camera.infoOf(picture, ros::Time::now());
    camera.publish(toImage(picture, sensor_msgs::image_encodings::MONO8, info.header), info);
  };
  ASSERT_TRUE(waitUntil([&] { return recognized.last().has_value(); }, [&] { send(image); }));
  EXPECT_EQ(recognized.last()->header.frame_id, camera.frame_id);
  EXPECT_EQ(recognized.last()->reason, "");
  ASSERT_FALSE(recognized.last()->views.empty());
  EXPECT_EQ(recognized.last()->views[0].view, nameOf(4));
  EXPECT_TRUE(recognized.last()->views[0].verified);

  const cv::Mat blank(image.size(), CV_8UC1, cv::Scalar(100));
  EXPECT_TRUE(waitUntil([&] { return !recognized.last()->reason.empty(); }, [&] { send(blank); }));

  // Its rate is changed while it runs: by 4 times at most, and at once, also where the next image was long to wait.
  EXPECT_NEAR(changeParameters(NODE, { { "rate", 1000.0 } }).at("rate"), 200.0, 1e-9);
  EXPECT_NEAR(changeParameters(NODE, { { "rate", 0.0 } }).at("rate"), 0.5, 1e-9);
  const auto shortest = [&] {  // between two of those to come that follow each other, by the stamps of their images [s]
    const std::size_t before = recognized.messages().size();
    EXPECT_TRUE(waitUntil([&] { return recognized.messages().size() > before + 3; }, [&] { send(image); }));
    const std::deque<RecognizedViews> all = recognized.messages();
    double least = 1e3;
    for (std::size_t i = before + 2; i < all.size(); ++i)  // the first may have been under way already
    {
      least = std::min(least, (all[i].header.stamp - all[i - 1].header.stamp).toSec());
    }
    return least;
  };
  EXPECT_GT(shortest(), 1.5);
  changeParameters(NODE, { { "rate", 50.0 } });
  EXPECT_LT(shortest(), 1.5);

  RecognizeView::Request latest;
  latest.verify = true;
  send(image);
  EXPECT_TRUE(waitUntil([&] { return call(latest).success; }, [&] { send(image); }));
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "view_recognizer_test");
}
