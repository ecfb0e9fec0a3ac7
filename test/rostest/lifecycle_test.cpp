// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "child_process.h"
#include "node_test.h"
#include "support/temporary_directory.h"

#include "test_paths.h"
#include "view_servo/LineMatches.h"
#include "view_servo/ListViews.h"
#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SaveView.h"
#include "view_servo/SetView.h"
#include "view_servo/ros/call_service.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
const std::string LINE_MATCHER = LINE_MATCHER_PATH;
const std::string POINT_MATCHER = POINT_MATCHER_PATH;
const std::string VIEW_STORE = VIEW_STORE_PATH;

class LifecycleTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    setenv("ROSCONSOLE_STDOUT_LINE_BUFFERED", "1", 1);
  }

  std::string views() const
  {
    return "_views_dir:=" + (directory_.path() / "views").string();
  }

  std::filesystem::path output() const
  {
    return directory_.path() / "output";
  }

  /** @param topic where the node publishes what it found in each image. */
  template <typename Message>
  void expectToStopAtOnceWhileMatching(const std::string& program, const std::string& topic) const
  {
    const std::string name = "stopped_" + topic;
    const cv::Mat picture = texturedPicture(1);
    ChildProcess node({ program, "__name:=" + name, views(), "_rate:=100.0", "image_raw:=camera/image_raw",
                        "camera_info:=camera/camera_info" },
                      output());
    ASSERT_TRUE(waitForService(name + "/match")) << node.output();
    StoredView view;
    view.name = "wall";
    view.image = picture;
    ViewStore(directory_.path() / "views").save(view, true);
    SetView::Request request;
    request.view = "wall";
    SetView::Response response;
    ASSERT_TRUE(callService(name + "/set_view", request, response));
    ASSERT_TRUE(response.success) << response.message;

    const FakeCamera camera("camera");
    const Recorder<Message> matches(name + "/" + topic);
    const cv::Mat seen = warped(picture, exampleHomography());
    ASSERT_TRUE(waitUntil([&] { return matches.last().has_value(); }, [&] { camera.publish(seen, ros::Time::now()); }));
    const ros::WallTime start = ros::WallTime::now();
    node.interrupt();
    EXPECT_EQ(node.exitStatus(), 0) << node.output();
    EXPECT_LT((ros::WallTime::now() - start).toSec(), 2.0 * SLOWDOWN);
  }

  static bool contains(const std::string& text, const std::string& part)
  {
    return text.find(part) != std::string::npos;
  }

  TemporaryDirectory directory_;
};

TEST_F(LifecycleTest, ViewsSurviveARestart)
{
  const cv::Mat picture = texturedPicture(1);
  {
    ChildProcess node({ VIEW_STORE, "__name:=view_store_one", views() }, output());
    ASSERT_TRUE(waitForService("view_store_one/save")) << node.output();
    SaveView::Request request;
    request.name = "wall";
    request.source.image = toMono8(picture);
    SaveView::Response response;
    ASSERT_TRUE(callService("view_store_one/save", request, response));
    EXPECT_TRUE(response.success) << response.message;
    node.interrupt();
    EXPECT_EQ(node.exitStatus(), 0) << node.output();
  }

  ChildProcess node({ VIEW_STORE, "__name:=view_store_two", views() }, output());
  ASSERT_TRUE(waitForService("view_store_two/list")) << node.output();
  ListViews::Request list_request;
  ListViews::Response listing;
  ASSERT_TRUE(callService("view_store_two/list", list_request, listing));
  EXPECT_EQ(listing.names, std::vector<std::string>{ "wall" });

  ChildProcess matcher({ POINT_MATCHER, "__name:=matcher", views() }, directory_.path() / "matcher_output");
  ASSERT_TRUE(waitForService("matcher/match")) << matcher.output();
  MatchPoints::Request request;
  request.reference.view = "wall";
  request.query.image = toMono8(warped(picture, exampleHomography()));
  MatchPoints::Response response;
  ASSERT_TRUE(callService("matcher/match", request, response));
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_LT(cornerError(toMatrix(response.model_matrix), exampleHomography()), 1.5);
}

TEST_F(LifecycleTest, KeepsViewsInRosHomeByDefault)
{
  const std::string home = directory_.path().string();
  const char* before = std::getenv("ROS_HOME");
  const std::optional<std::string> saved = before != nullptr ? std::optional<std::string>(before) : std::nullopt;
  setenv("ROS_HOME", home.c_str(), 1);
  ChildProcess node({ VIEW_STORE, "__name:=view_store_home" }, output());
  saved ? setenv("ROS_HOME", saved->c_str(), 1) : unsetenv("ROS_HOME");
  ASSERT_TRUE(waitForService("view_store_home/save")) << node.output();
  SaveView::Request request;
  request.name = "wall";
  request.source.image = toMono8(texturedPicture(1));
  SaveView::Response response;
  ASSERT_TRUE(callService("view_store_home/save", request, response));
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_TRUE(std::filesystem::exists(directory_.path() / "view_servo" / "views" / "wall.yaml"));
}

TEST_F(LifecycleTest, RefusesToStartAndListsAllFaults)
{
  ChildProcess node({ POINT_MATCHER, "__name:=faulty", views(), "_rate:=0", "_queue_size:=none", "_max_image_age:=-1",
                      "_coefficients:=7", "_assignment:=lucky", "_view:=../x" },
                    output());
  EXPECT_EQ(node.exitStatus(), 1);
  for (const char* name : { "~rate", "~queue_size", "~max_image_age", "coefficients", "~assignment", "~view" })
  {
    EXPECT_TRUE(contains(node.output(), name)) << name << " is missing in\n" << node.output();
  }
}

TEST_F(LifecycleTest, LineMatcherRefusesToStartAndListsAllFaults)
{
  ChildProcess node(
      { LINE_MATCHER, "__name:=faulty_lines", views(), "_rate:=0", "_queue_size:=none", "_max_image_age:=-1",
        "_segment_min_length:=0", "_detector:=lucky", "_min_plane_lines:=2", "_view:=../x" },
      output());
  EXPECT_EQ(node.exitStatus(), 1);
  for (const char* name :
       { "~rate", "~queue_size", "~max_image_age", "segment_min_length", "~detector", "min_plane_lines", "~view" })
  {
    EXPECT_TRUE(contains(node.output(), name)) << name << " is missing in\n" << node.output();
  }
}

TEST_F(LifecycleTest, WarnsOfMisspeltParameters)
{
  ChildProcess node({ POINT_MATCHER, "__name:=misspelt", views(), "_max_cornes:=300", "_rte:=3.0" }, output());
  ASSERT_TRUE(waitForService("misspelt/match")) << node.output();
  EXPECT_TRUE(contains(node.output(), "~max_cornes")) << node.output();
  EXPECT_TRUE(contains(node.output(), "~max_corners?")) << node.output();
  EXPECT_TRUE(contains(node.output(), "~rate?")) << node.output();
}

TEST_F(LifecycleTest, ReadsItsParameters)
{
  ChildProcess node({ POINT_MATCHER, "__name:=tuned", views(), "_max_corners:=300", "_seed:=7", "_cyclic_order:=false",
                      "_view_consistency:=off", "_min_significance:=8" },
                    output());
  ASSERT_TRUE(waitForService("tuned/match")) << node.output();
  for (const char* value : { "max_corners=300", "seed=7", "cyclic_order=false", "view_consistency=off",
                             "min_significance=8", "rate=5", "coefficients=8" })
  {
    EXPECT_TRUE(contains(node.output(), value)) << value << " is missing in\n" << node.output();
  }
  EXPECT_FALSE(contains(node.output(), "did you mean")) << node.output();
}

TEST_F(LifecycleTest, LineMatcherReadsItsParameters)
{
  ChildProcess node({ LINE_MATCHER, "__name:=tuned_lines", views(), "_max_segments:=300", "_seed:=7",
                      "_line_order:=upright", "_min_quality:=0.25", "_max_segmens:=3" },
                    output());
  ASSERT_TRUE(waitForService("tuned_lines/match")) << node.output();
  for (const char* value :
       { "max_segments=300", "seed=7", "line_order=upright", "min_quality=0.25", "rate=10", "max_planes=4" })
  {
    EXPECT_TRUE(contains(node.output(), value)) << value << " is missing in\n" << node.output();
  }
  EXPECT_TRUE(contains(node.output(), "~max_segments?")) << node.output();
}

TEST_F(LifecycleTest, StopsAtOnceWhileMatching)
{
  expectToStopAtOnceWhileMatching<PointMatches>(POINT_MATCHER, "point_matches");
}

TEST_F(LifecycleTest, LineMatcherStopsAtOnceWhileMatching)
{
  expectToStopAtOnceWhileMatching<LineMatches>(LINE_MATCHER, "line_matches");
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "lifecycle_test");
}
