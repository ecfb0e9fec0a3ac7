// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "node_test.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"

#include "view_servo/DeleteView.h"
#include "view_servo/GetView.h"
#include "view_servo/ListViews.h"
#include "view_servo/SaveView.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/route_store.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <future>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
class ViewStoreNodeTest : public ::testing::Test
{
protected:
  static void TearDownTestSuite()
  {
    removeViews("view_store");
  }

  void SetUp() override
  {
    for (const char* service : { "save", "list", "get", "delete" })
    {
      ASSERT_TRUE(waitForService(std::string("view_store/") + service));
    }
    ASSERT_TRUE(camera_.waitForSubscribers(1));
  }

  template <typename Service>
  static typename Service::Response call(const std::string& service, typename Service::Request request)
  {
    return answerOf<Service>("view_store/" + service, request);
  }

  static GetView::Response get(const std::string& name)
  {
    GetView::Request request;
    request.name = name;
    return call<GetView>("get", request);
  }

  SaveView::Request imageRequest(const std::string& name) const
  {
    SaveView::Request request;
    request.name = name;
    request.overwrite = true;
    request.source.image = toMono8(picture_);
    return request;
  }

  FakeCamera camera_{ "camera" };
  const cv::Mat picture_ = texturedPicture(1);
};

TEST_F(ViewStoreNodeTest, StoresTheCameraImageWithAllThatIsKnown)
{
  // The pose, as tf knows it.
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = ros::Time::now();
  transform.header.frame_id = "odom";
  transform.child_frame_id = camera_.frame_id;
  transform.transform.translation.x = 1.5;
  transform.transform.translation.z = 0.4;
  transform.transform.rotation.x = -0.5;
  transform.transform.rotation.y = 0.5;
  transform.transform.rotation.z = -0.5;
  transform.transform.rotation.w = 0.5;
  tf2_ros::StaticTransformBroadcaster broadcaster;
  broadcaster.sendTransform(transform);

  SaveView::Request request;
  request.name = "desk";
  request.overwrite = true;
  request.roi.x_offset = 40;
  request.roi.y_offset = 30;
  request.roi.width = 300;
  request.roi.height = 200;
  GetView::Response view;
  ros::Time sent;
  ASSERT_TRUE(waitUntil(
      [&] {
        const SaveView::Response response = call<SaveView>("save", request);
        view = get("desk");
        return response.success && view.has_pose;
      },
      [&] {
        sent = ros::Time::now();
        camera_.publish(picture_, sent);
      }))
      << view.message;

  EXPECT_TRUE(view.success);
  EXPECT_EQ(view.image.header.frame_id, camera_.frame_id);
  EXPECT_LT(std::abs((sent - view.image.header.stamp).toSec()), 5.0);
  EXPECT_EQ(view.image.encoding, sensor_msgs::image_encodings::MONO8);
  EXPECT_EQ(view.image.data, toMono8(picture_).data);
  EXPECT_EQ(view.camera_info.header, view.image.header);
  EXPECT_EQ(view.camera_info.width, 480u);
  EXPECT_DOUBLE_EQ(view.camera_info.K[0], 500.0);
  EXPECT_EQ(view.camera_info.distortion_model, "plumb_bob");
  EXPECT_EQ(view.roi, request.roi);
  EXPECT_EQ(view.pose.header.frame_id, "odom");
  EXPECT_EQ(view.pose.header.stamp, view.image.header.stamp);
  EXPECT_DOUBLE_EQ(view.pose.pose.position.x, 1.5);
  EXPECT_DOUBLE_EQ(view.pose.pose.position.z, 0.4);
  EXPECT_NEAR(view.pose.pose.orientation.x, -0.5, 1e-9);
  EXPECT_NEAR(view.pose.pose.orientation.w, 0.5, 1e-9);

  // A copy under another name keeps all of it.
  SaveView::Request copy;
  copy.name = "desk_copy";
  copy.source.view = "desk";
  copy.overwrite = true;
  ASSERT_TRUE(call<SaveView>("save", copy).success);
  const GetView::Response copied = get("desk_copy");
  EXPECT_EQ(copied.image, view.image);
  EXPECT_EQ(copied.camera_info, view.camera_info);
  EXPECT_EQ(copied.roi, view.roi);
  EXPECT_EQ(copied.pose, view.pose);
}

TEST_F(ViewStoreNodeTest, StoresFilesAndImages)
{
  const TemporaryDirectory directory;
  const std::string path = (directory.path() / "picture.png").string();
  ASSERT_TRUE(cv::imwrite(path, picture_));
  SaveView::Request request;
  request.name = "from_file";
  request.source.path = path;
  ASSERT_TRUE(call<SaveView>("save", request).success);
  ASSERT_TRUE(call<SaveView>("save", imageRequest("from_image")).success);
  for (const char* name : { "from_file", "from_image" })
  {
    const GetView::Response view = get(name);
    ASSERT_TRUE(view.success) << view.message;
    EXPECT_EQ(view.image.data, toMono8(picture_).data);
    EXPECT_FALSE(toCamera(view.camera_info).calibrated());
    EXPECT_FALSE(view.has_pose);
  }
}

TEST_F(ViewStoreNodeTest, ListsAndDeletes)
{
  ASSERT_TRUE(call<SaveView>("save", imageRequest("b")).success);
  ASSERT_TRUE(call<SaveView>("save", imageRequest("a")).success);
  std::vector<std::string> names = call<ListViews>("list", {}).names;
  EXPECT_TRUE(std::is_sorted(names.begin(), names.end()));
  EXPECT_EQ(std::count(names.begin(), names.end(), "a"), 1);
  EXPECT_EQ(std::count(names.begin(), names.end(), "b"), 1);

  DeleteView::Request request;
  request.name = "a";
  EXPECT_TRUE(call<DeleteView>("delete", request).success);
  const DeleteView::Response again = call<DeleteView>("delete", request);
  EXPECT_FALSE(again.success);
  EXPECT_NE(again.message.find("'a'"), std::string::npos) << again.message;
  names = call<ListViews>("list", {}).names;
  EXPECT_EQ(std::count(names.begin(), names.end(), "a"), 0);
  EXPECT_EQ(std::count(names.begin(), names.end(), "b"), 1);
}

TEST_F(ViewStoreNodeTest, OverwritesOnlyWhenAsked)
{
  ASSERT_TRUE(call<SaveView>("save", imageRequest("once")).success);
  SaveView::Request request = imageRequest("once");
  request.source.image = toMono8(texturedPicture(2));
  request.overwrite = false;
  expectFailure(call<SaveView>("save", request), "once");
  EXPECT_EQ(get("once").image.data, toMono8(picture_).data);
  request.overwrite = true;
  ASSERT_TRUE(call<SaveView>("save", request).success);
  EXPECT_EQ(get("once").image.data, request.source.image.data);
}

TEST_F(ViewStoreNodeTest, KeepsAViewThatARouteNeeds)
{
  for (const char* name : { "hall_001", "hall_002" })
  {
    ASSERT_TRUE(call<SaveView>("save", imageRequest(name)).success);
  }
  const RouteStore routes(viewsDir("view_store"));
  routes.save({ "hall", "odom", { { "hall_001", {}, 1.0 }, { "hall_002", { 1.0, 0.0, 0.0 }, 2.0 } } });
  const std::string revision = routes.views().revision("hall_002");

  DeleteView::Request request;
  request.name = "hall_002";
  const DeleteView::Response deleted = call<DeleteView>("delete", request);
  EXPECT_FALSE(deleted.success);
  EXPECT_NE(deleted.message.find("route 'hall' needs it"), std::string::npos) << deleted.message;
  const SaveView::Response replaced = call<SaveView>("save", imageRequest("hall_002"));
  EXPECT_FALSE(replaced.success);
  EXPECT_NE(replaced.message.find("route 'hall' needs it"), std::string::npos) << replaced.message;
  EXPECT_EQ(routes.views().revision("hall_002"), revision);

  // What the route does not name, and what is not there, is not the route's.
  ASSERT_TRUE(call<SaveView>("save", imageRequest("hall_003")).success);
  std::filesystem::remove(viewsDir("view_store") / "hall_002.yaml");
  EXPECT_TRUE(call<SaveView>("save", imageRequest("hall_002")).success);
  EXPECT_EQ(routes.remove("hall"), "");
}

TEST_F(ViewStoreNodeTest, ReportsADamagedViewByNameAndKeepsTheOthers)
{
  ASSERT_TRUE(call<SaveView>("save", imageRequest("sound")).success);
  ASSERT_TRUE(call<SaveView>("save", imageRequest("broken")).success);
  writeText(viewsDir("view_store") / "broken.yaml", "image: [");

  const ListViews::Response listing = call<ListViews>("list", {});
  EXPECT_TRUE(listing.success);
  EXPECT_EQ(std::count(listing.names.begin(), listing.names.end(), "sound"), 1);
  EXPECT_EQ(std::count(listing.names.begin(), listing.names.end(), "broken"), 0);
  ASSERT_EQ(listing.damaged.size(), 1u);
  EXPECT_EQ(listing.damaged[0].name, "broken");
  EXPECT_FALSE(listing.damaged[0].reason.empty());

  const GetView::Response view = get("broken");
  EXPECT_FALSE(view.success);
  EXPECT_NE(view.message.find("broken"), std::string::npos) << view.message;
  EXPECT_TRUE(get("sound").success);

  DeleteView::Request request;
  request.name = "broken";
  EXPECT_TRUE(call<DeleteView>("delete", request).success);
  EXPECT_TRUE(call<ListViews>("list", {}).damaged.empty());
}

TEST_F(ViewStoreNodeTest, RefusesBadRequestsAndGoesOn)
{
  for (const char* name : { "", "../up", "a/b", ".hidden", "with space", "-dash" })
  {
    SCOPED_TRACE(name);
    expectFailure(call<SaveView>("save", imageRequest(name)), name);
    EXPECT_FALSE(get(name).success);
    DeleteView::Request request;
    request.name = name;
    EXPECT_FALSE(call<DeleteView>("delete", request).success);
  }
  expectFailure(call<SaveView>("save", imageRequest(std::string(65, 'a'))), "64");

  SaveView::Request request = imageRequest("never");
  request.source.path = "/nowhere/picture.png";
  expectFailure(call<SaveView>("save", request), "path and image");

  request = imageRequest("never");
  request.source = ImageSource();
  request.source.path = "/nowhere/picture.png";
  expectFailure(call<SaveView>("save", request), "/nowhere/picture.png");

  request = imageRequest("never");
  request.roi.x_offset = 400;
  request.roi.width = 100;
  request.roi.height = 100;
  expectFailure(call<SaveView>("save", request), "roi");

  request = imageRequest("never");
  request.source.image.encoding = "h264";
  expectFailure(call<SaveView>("save", request), "h264");

  EXPECT_FALSE(get("never").success);
  EXPECT_NE(get("never").message.find("never"), std::string::npos);
  EXPECT_TRUE(call<SaveView>("save", imageRequest("fine")).success);
}

/** Images cost time on their way, whether somebody wants them or not. */
TEST(IdleViewStoreTest, LetsGoOfItsCameraUntilItIsAskedForAnImage)
{
  const FakeCamera camera("idle_camera");
  ASSERT_TRUE(waitForService("idle_store/save"));
  const cv::Mat picture = texturedPicture(1);
  for (const char* name : { "first", "second" })
  {
    ASSERT_TRUE(waitUntil([&] { return !camera.hasSubscribers(); })) << name;
    SaveView::Request request;
    request.name = name;
    std::future<SaveView::Response> answer =
        std::async(std::launch::async, [&] { return answerOf<SaveView>("idle_store/save", request); });
    EXPECT_TRUE(waitUntil([&] {
      camera.publish(picture, ros::Time::now());
      return answer.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    }));
    const SaveView::Response saved = answer.get();
    EXPECT_TRUE(saved.success) << saved.message;
  }
  removeViews("idle_store");
}

TEST_F(ViewStoreNodeTest, RefusesToStoreAnUncalibratedCamera)
{
  camera_.calibrated = false;
  SaveView::Request request;
  request.name = "never";
  SaveView::Response response;
  EXPECT_TRUE(waitUntil(
      [&] {
        response = call<SaveView>("save", request);
        return response.message.find("not calibrated") != std::string::npos;
      },
      [&] { camera_.publish(picture_, ros::Time::now()); }))
      << response.message;
  expectFailure(response, "/camera/camera_info");
  EXPECT_FALSE(get("never").success);
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "view_store_test");
}
