// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "node_test.h"
#include "support/temporary_directory.h"

#include "view_servo/LineMatches.h"
#include "view_servo/ListViews.h"
#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SaveView.h"
#include "view_servo/SetView.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

extern char** environ;

namespace view_servo
{
namespace test
{
namespace
{
const std::string LINE_MATCHER = LINE_MATCHER_PATH;
const std::string POINT_MATCHER = POINT_MATCHER_PATH;
const std::string VIEW_STORE = VIEW_STORE_PATH;

/** A node that the test starts and stops. */
class NodeProcess
{
public:
  /** @param output file that takes what the node prints. */
  NodeProcess(const std::string& program, std::vector<std::string> arguments, std::filesystem::path output)
    : output_(std::move(output))
  {
    arguments.insert(arguments.begin(), program);
    std::vector<char*> argv;
    for (std::string& argument : arguments)
    {
      argv.push_back(argument.data());
    }
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 1, output_.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
    const int error = posix_spawn(&pid_, program.c_str(), &actions, nullptr, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    EXPECT_EQ(error, 0) << program;
  }

  ~NodeProcess()
  {
    if (!exited())
    {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  NodeProcess(const NodeProcess&) = delete;
  NodeProcess& operator=(const NodeProcess&) = delete;

  void interrupt() const
  {
    kill(pid_, SIGINT);
  }

  bool exited()
  {
    if (!exit_status_)
    {
      int status = 0;
      if (waitpid(pid_, &status, WNOHANG) == pid_)
      {
        exit_status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
      }
    }
    return exit_status_.has_value();
  }

  /** Waits for the end; 128 + the signal when one ended it. */
  std::optional<int> exitStatus()
  {
    waitUntil([&] { return exited(); });
    return exit_status_;
  }

  std::string output() const
  {
    return { std::istreambuf_iterator<char>(std::ifstream(output_).rdbuf()), {} };
  }

private:
  std::filesystem::path output_;
  pid_t pid_ = 0;
  std::optional<int> exit_status_;
};

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
    const cv::Mat picture = makePicture(1);
    NodeProcess node(program,
                     { "__name:=" + name, views(), "_rate:=100.0", "image_raw:=camera/image_raw",
                       "camera_info:=camera/camera_info", topic + ":=" + name + "/" + topic },
                     output());
    ASSERT_TRUE(waitForService(name + "/match")) << node.output();
    StoredView view;
    view.name = "wall";
    view.image = picture;
    ViewStore(directory_.path() / "views").save(view, true);
    SetView::Request request;
    request.view = "wall";
    SetView::Response response;
    ASSERT_TRUE(ros::service::call(name + "/set_view", request, response));
    ASSERT_TRUE(response.success) << response.message;

    const FakeCamera camera("camera");
    const Recorder<Message> matches(name + "/" + topic);
    const cv::Mat seen = warped(picture, exampleHomography());
    ASSERT_TRUE(waitUntil([&] { return matches.last().has_value(); }, [&] { camera.publish(seen, ros::Time::now()); }));
    const ros::WallTime start = ros::WallTime::now();
    node.interrupt();
    EXPECT_EQ(node.exitStatus(), 0) << node.output();
    EXPECT_LT((ros::WallTime::now() - start).toSec(), 5.0);
  }

  static bool contains(const std::string& text, const std::string& part)
  {
    return text.find(part) != std::string::npos;
  }

  TemporaryDirectory directory_;
};

TEST_F(LifecycleTest, ViewsSurviveARestart)
{
  const cv::Mat picture = makePicture(1);
  {
    NodeProcess node(VIEW_STORE, { "__name:=view_store_one", views() }, output());
    ASSERT_TRUE(waitForService("view_store_one/save")) << node.output();
    SaveView::Request request;
    request.name = "wall";
    request.source.image = toMono8(picture);
    SaveView::Response response;
    ASSERT_TRUE(ros::service::call("view_store_one/save", request, response));
    EXPECT_TRUE(response.success) << response.message;
    node.interrupt();
    EXPECT_EQ(node.exitStatus(), 0) << node.output();
  }

  NodeProcess node(VIEW_STORE, { "__name:=view_store_two", views() }, output());
  ASSERT_TRUE(waitForService("view_store_two/list")) << node.output();
  ListViews::Request list_request;
  ListViews::Response listing;
  ASSERT_TRUE(ros::service::call("view_store_two/list", list_request, listing));
  EXPECT_EQ(listing.names, std::vector<std::string>{ "wall" });

  NodeProcess matcher(POINT_MATCHER, { "__name:=matcher", views() }, directory_.path() / "matcher_output");
  ASSERT_TRUE(waitForService("matcher/match")) << matcher.output();
  MatchPoints::Request request;
  request.reference.view = "wall";
  request.query.image = toMono8(warped(picture, exampleHomography()));
  MatchPoints::Response response;
  ASSERT_TRUE(ros::service::call("matcher/match", request, response));
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_LT(cornerError(toMatrix(response.model_matrix), exampleHomography()), 1.5);
}

TEST_F(LifecycleTest, KeepsViewsInRosHomeByDefault)
{
  const std::string home = directory_.path().string();
  const char* before = std::getenv("ROS_HOME");
  const std::optional<std::string> saved = before != nullptr ? std::optional<std::string>(before) : std::nullopt;
  setenv("ROS_HOME", home.c_str(), 1);
  NodeProcess node(VIEW_STORE, { "__name:=view_store_home" }, output());
  saved ? setenv("ROS_HOME", saved->c_str(), 1) : unsetenv("ROS_HOME");
  ASSERT_TRUE(waitForService("view_store_home/save")) << node.output();
  SaveView::Request request;
  request.name = "wall";
  request.source.image = toMono8(makePicture(1));
  SaveView::Response response;
  ASSERT_TRUE(ros::service::call("view_store_home/save", request, response));
  EXPECT_TRUE(response.success) << response.message;
  EXPECT_TRUE(std::filesystem::exists(directory_.path() / "view_servo" / "views" / "wall.yaml"));
}

TEST_F(LifecycleTest, RefusesToStartAndListsAllFaults)
{
  NodeProcess node(POINT_MATCHER,
                   { "__name:=faulty", views(), "_rate:=0", "_queue_size:=none", "_max_image_age:=-1",
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
  NodeProcess node(LINE_MATCHER,
                   { "__name:=faulty_lines", views(), "_rate:=0", "_queue_size:=none", "_max_image_age:=-1",
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
  NodeProcess node(POINT_MATCHER, { "__name:=misspelt", views(), "_max_cornes:=300", "_rte:=3.0" }, output());
  ASSERT_TRUE(waitForService("misspelt/match")) << node.output();
  EXPECT_TRUE(contains(node.output(), "~max_cornes")) << node.output();
  EXPECT_TRUE(contains(node.output(), "~max_corners?")) << node.output();
  EXPECT_TRUE(contains(node.output(), "~rate?")) << node.output();
}

TEST_F(LifecycleTest, ReadsItsParameters)
{
  NodeProcess node(POINT_MATCHER,
                   { "__name:=tuned", views(), "_max_corners:=300", "_seed:=7", "_cyclic_order:=false",
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
  NodeProcess node(LINE_MATCHER,
                   { "__name:=tuned_lines", views(), "_max_segments:=300", "_seed:=7", "_line_order:=upright",
                     "_min_quality:=0.25", "_max_segmens:=3" },
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
