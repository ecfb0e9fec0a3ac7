// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "child_process.h"
#include "node_test.h"
#include "store_from_camera.h"
#include "support/compressed_image.h"
#include "support/temporary_directory.h"
#include "test_paths.h"

#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SetView.h"
#include "view_servo/ros/call_service.h"

#include <gtest/gtest.h>
#include <image_transport/image_transport.h>
#include <rosgraph_msgs/Log.h>
#include <sensor_msgs/CompressedImage.h>

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
const std::string IMAGES = "camera/image_raw/compressed";

/** Whether image_transport decodes these images itself, and says in its own words what is wrong with them. */
bool hasPlugin(const std::string& transport)
{
  const std::vector<std::string> names = image_transport::ImageTransport(ros::NodeHandle()).getLoadableTransports();
  return std::find(names.begin(), names.end(), "image_transport/" + transport) != names.end();
}

class CompressedTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    ASSERT_TRUE(waitForService("point_matcher/match"));
    ASSERT_TRUE(waitForService("view_store/save"));
  }

  static void TearDownTestSuite()
  {
    removeViews("point_matcher");
  }

  void SetUp() override
  {
    ASSERT_TRUE(waitUntil([&] { return images_.getNumSubscribers() >= 2 && infos_.getNumSubscribers() >= 2; }));
  }

  /** Publishes an image now, with its calibration; its stamp is remembered. */
  void send(sensor_msgs::CompressedImage image)
  {
    const sensor_msgs::CameraInfo info = camera_.infoOf(picture_, ros::Time::now());
    image.header = info.header;
    infos_.publish(info);
    images_.publish(image);
    sent_.insert(image.header.stamp);
  }
  void send(const cv::Mat& picture)
  {
    send(compressed(picture, ".jpg", "mono8; jpeg compressed "));
  }

  /** Stores the picture from the camera, not what it sent before. */
  void teach(const std::string& name)
  {
    storeFromCamera("view_store", name, [&] { send(picture_); });
  }

  /** Waits until an image that is sent from now on is matched with the view, and looks at the homography. */
  void expectMatches()
  {
    sent_.clear();
    ASSERT_TRUE(waitUntil(
        [&] {
          const std::optional<PointMatches> last = matches_.last();
          return last && last->homography.valid != 0 && sent_.count(last->header.stamp) > 0;
        },
        [&] { send(seen_); }));
    EXPECT_LT(cornerError(toMatrix(matches_.last()->homography.h), exampleHomography()), 1.5);
  }

  const cv::Mat picture_ = texturedPicture(1);
  const cv::Mat seen_ = warped(picture_, exampleHomography());
  const FakeCamera camera_{ "unused" };
  ros::NodeHandle nh_;
  ros::Publisher images_ = nh_.advertise<sensor_msgs::CompressedImage>(IMAGES, 10);
  ros::Publisher infos_ = nh_.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 10);
  Recorder<PointMatches> matches_{ "point_matcher/point_matches" };
  Recorder<rosgraph_msgs::Log> log_{ "/rosout" };  // what it misses at first is told again only after 10 s
  std::set<ros::Time> sent_;
};

TEST_F(CompressedTest, ImagesAreStoredAndMatchedAndDamagedOnesLeftOut)
{
  teach("wall");
  SetView::Request view;
  view.view = "wall";
  ASSERT_TRUE(answerOf<SetView>("point_matcher/set_view", view).success);
  expectMatches();

  // What comes between good images ends nothing.
  const auto told = [&](const std::string& words) {
    const auto messages = log_.messages();
    return std::any_of(messages.begin(), messages.end(), [&](const rosgraph_msgs::Log& message) {
      return message.msg.find(words) != std::string::npos && message.msg.find("/" + IMAGES) != std::string::npos;
    });
  };
  if (!hasPlugin("compressed"))
  {
    EXPECT_TRUE(waitUntil([&] { return told("megapixels"); }, [&] { send(pngOfSize(60000, 60000)); }));
  }
  sensor_msgs::CompressedImage cut = compressed(seen_, ".jpg", "mono8; jpeg compressed ");
  cut.data.resize(cut.data.size() / 2);
  if (!hasPlugin("compressed"))
  {
    EXPECT_TRUE(waitUntil([&] { return told("is damaged"); }, [&] { send(cut); }));
  }
  sensor_msgs::CompressedImage none = cut;
  none.data.clear();
  send(none);
  expectMatches();
}

TEST_F(CompressedTest, ServicesUseTheLatestImage)
{
  teach("wall");
  MatchPoints::Request request;
  request.reference.view = "wall";
  MatchPoints::Response response;
  EXPECT_TRUE(waitUntil(
      [&] {
        response = answerOf<MatchPoints>("point_matcher/match", request);
        return response.success && cornerError(toMatrix(response.model_matrix), exampleHomography()) < 1.5;
      },
      [&] { send(seen_); }))
      << response.message;
}

TEST_F(CompressedTest, CheckRobotListensToThem)
{
  const TemporaryDirectory directory;
  ChildProcess check(
      { CHECK_ROBOT_PATH, "homing", "--seconds", "2", "--no-picture", "camera:=camera", "image_transport:=compressed" },
      directory.path() / "output");
  EXPECT_TRUE(waitUntil([&] { return check.exited(); }, [&] { send(picture_); }));
  const std::string said =
      " Hz on '/" + IMAGES + "', " + std::to_string(picture_.cols) + " x " + std::to_string(picture_.rows) + ", ";
  EXPECT_NE(check.output().find(said), std::string::npos) << check.output();
  EXPECT_NE(check.output().find(" corners, "), std::string::npos) << check.output();
}

TEST_F(CompressedTest, OtherTransportsAreRefusedAtTheStartWithTheNamesThereAre)
{
  const TemporaryDirectory directory;
  for (const std::string transport : { "compressedDepth", "theora", "no_such" })
  {
    if (hasPlugin(transport))
    {
      continue;
    }
    const std::filesystem::path output = directory.path() / transport;
    ChildProcess node({ POINT_MATCHER_PATH, "__name:=refused", "_image_transport:=" + transport }, output);
    ASSERT_TRUE(node.exitStatus());
    EXPECT_NE(*node.exitStatus(), 0);
    EXPECT_NE(node.output().find("image_transport: '" + transport + "' is not installed; there are: "),
              std::string::npos)
        << node.output();
    EXPECT_NE(node.output().find("compressed, "), std::string::npos) << node.output();
  }
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "compressed_test");
}
