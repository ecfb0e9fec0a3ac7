// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "child_process.h"
#include "commands.h"
#include "node_test.h"
#include "nodes/robot_messages.h"
#include "sim/nomad.h"
#include "sim/renderer.h"
#include "sim/world.h"
#include "support/temporary_directory.h"

#include "view_servo/Heading.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/PointMatches.h"
#include "view_servo/ServoStatus.h"
#include "view_servo/geometry/planar_motion.h"
#include "view_servo/views/view_matcher.h"
#include "view_servo/views/view_store.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/Twist.h>
#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
using Clock = std::chrono::steady_clock;
using Commands = CommandsOf<geometry_msgs::Twist>;
using ActionClient = actionlib::SimpleActionClient<HomeToViewAction>;

constexpr double STOPS_WITHIN = 0.3 * SLOWDOWN;  // of wall time, whatever fails [s]

/** What there is to see, drawn once: the view, and what a base sees that stands 0.8 m before it. */
struct Scene
{
  sim::World world;
  cv::Mat view;
  cv::Mat image;
  PlanarPose base;
  std::vector<PointMatch> matches;

  Scene() : world(sim::findWorld("desk", PACKAGE_DIR "/config/worlds"))
  {
    sim::SimulatedCamera camera(world, {}, 1);
    sim::Nomad nomad(world, sim::NomadParams());
    view = camera.capture(nomad.cameraPose());
    base = { -0.8, 0.2, 0.05 };
    nomad.setPose(sim::planarPose(base.x, base.y, base.yaw));
    image = camera.capture(nomad.cameraPose());
    const ViewMatcher matcher{ ViewMatcherParams() };
    matches =
        toPointMatches(matcher
                           .match(PreparedImage(view, cv::Rect(), matcher.params().points),
                                  PreparedImage(image, cv::Rect(), matcher.params().points), GeometryModel::HOMOGRAPHY)
                           .matches);
  }
};

/** A base that stands still, whatever it is told, and whose inputs can fail. */
class FakeBase
{
public:
  FakeBase(const Scene& scene, const std::string& ns) : scene_(scene), nh_(ns)
  {
    images_ = nh_.advertise<sensor_msgs::Image>("image_raw", 2);
    infos_ = nh_.advertise<sensor_msgs::CameraInfo>("camera_info", 2);
    odometry_ = nh_.advertise<nav_msgs::Odometry>("odom", 10);
    matches_ = nh_.advertise<PointMatches>("point_matches", 2);
    broadcaster_.sendTransform(
        sim::toTransform(scene.world.camera_on_base, sim::BASE_FRAME, sim::CAMERA_FRAME, ros::Time::now()));
    thread_ = std::thread([this] { run(); });
  }
  ~FakeBase()
  {
    running_ = false;
    thread_.join();
  }
  FakeBase(const FakeBase&) = delete;
  FakeBase& operator=(const FakeBase&) = delete;

  std::atomic<bool> camera{ true };
  std::atomic<bool> odometry{ true };
  std::atomic<bool> matcher{ true };
  std::atomic<bool> black{ false };
  std::atomic<bool> other_view{ false };
  std::atomic<double> delay{ 0.0 };  // of all stamps [s]

private:
  void run()
  {
    constexpr int IMAGE_EVERY = 5;
    ros::WallRate rate(50.0);
    for (int cycle = 0; running_ && ros::ok(); ++cycle)
    {
      const ros::Time stamp = ros::Time::now() - ros::Duration(delay);
      if (odometry)
      {
        nav_msgs::Odometry message;
        message.header.stamp = stamp;
        message.header.frame_id = sim::ODOM_FRAME;
        message.child_frame_id = sim::BASE_FRAME;
        message.pose.pose = sim::toPose(sim::planarPose(scene_.base.x, scene_.base.y, scene_.base.yaw));
        odometry_.publish(message);
      }
      if (cycle % IMAGE_EVERY == 0)
      {
        publishImage(stamp);
      }
      rate.sleep();
    }
  }

  void publishImage(const ros::Time& stamp)
  {
    const sensor_msgs::CameraInfo info = sim::toCameraInfo(scene_.world, 0.0, stamp);
    if (camera)
    {
      const cv::Mat image = black ? cv::Mat(scene_.image.size(), CV_8UC1, cv::Scalar(0)) : scene_.image;
      images_.publish(toImage(image, sensor_msgs::image_encodings::MONO8, info.header));
      infos_.publish(info);
    }
    if (matcher)
    {
      PointMatches message;
      message.header = info.header;
      message.view = other_view ? "another" : "goal";
      message.matches = black ? std::vector<PointMatch>() : scene_.matches;
      matches_.publish(message);
    }
  }

  const Scene& scene_;
  ros::NodeHandle nh_;
  ros::Publisher images_;
  ros::Publisher infos_;
  ros::Publisher odometry_;
  ros::Publisher matches_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  std::atomic<bool> running_{ true };
  std::thread thread_;
};

class HomingTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    scene_ = std::make_unique<Scene>();
    StoredView view;
    view.name = "goal";
    view.image = scene_->view;
    ViewStore(viewsDir("driving/homing")).save(view, true);
  }
  static void TearDownTestSuite()
  {
    removeViews("driving/homing");
    scene_.reset();
  }

  HomingTest() : HomingTest("driving")
  {
  }
  explicit HomingTest(const std::string& ns)
    : ns_(ns),
      base_(*scene_, ns),
      commands_(ns + "/cmd_vel"),
      headings_(ns + "/heading"),
      status_(ns + "/status"),
      client_(ns + "/home", false)
  {
  }

  void SetUp() override
  {
    ASSERT_TRUE(waitForService(ns_ + "/homing/enable"));
    ASSERT_TRUE(waitUntil([this] { return client_.isServerConnected(); }));
    enable(true);
  }
  void TearDown() override
  {
    client_.cancelAllGoals();
    enable(false);
    EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  }

  void enable(bool on) const
  {
    std_srvs::SetBool service;
    service.request.data = on ? 1 : 0;
    ASSERT_TRUE(ros::service::call(ns_ + "/homing/enable", service));
    EXPECT_TRUE(service.response.success) << service.response.message;
  }

  void send(const std::string& view, double timeout = 60.0, double step = 0.0)
  {
    HomeToViewGoal goal;
    goal.view = view;
    goal.timeout = timeout;
    goal.step = step;
    client_.sendGoal(goal);
  }

  /** Sends a goal as soon as its camera is known to the node, and waits until it drives. */
  void drive()
  {
    ASSERT_TRUE(waitUntil([this] {
      if (client_.getState().isDone() || !sent_)
      {
        send("goal");
        sent_ = true;
      }
      return commands_.moving();
    })) << reason();
  }

  std::string reason() const
  {
    return status_.last() ? status_.last()->reason : "no status";
  }

  /** After `fault`, the base must stand in time, with a reason that has these words in it. */
  void expectToStop(const std::function<void()>& fault, std::uint8_t state, const std::string& words)
  {
    const Clock::time_point moment = Clock::now();
    fault();
    EXPECT_TRUE(waitUntil([&] {
      return status_.last() && status_.last()->state == state && reason().find(words) != std::string::npos;
    })) << "it says '"
        << reason() << "', not '" << words << "'";
    EXPECT_TRUE(waitUntil([&] { return !commands_.moving(); }));
    EXPECT_LT(commands_.lastMotionAfter(moment), STOPS_WITHIN);
  }

  /** The result of the goal sent last. */
  HomeToViewResult result()
  {
    EXPECT_TRUE(waitUntil([this] { return client_.getState().isDone(); })) << reason();
    const auto found = client_.getResult();
    return found ? *found : HomeToViewResult();
  }

  static std::unique_ptr<Scene> scene_;
  std::string ns_;
  FakeBase base_;
  Commands commands_;
  Recorder<Heading> headings_;
  Recorder<ServoStatus> status_;
  ActionClient client_;
  bool sent_ = false;
};

std::unique_ptr<Scene> HomingTest::scene_;

TEST_F(HomingTest, DrivesTowardsTheView)
{
  drive();
  const PlanarPose truth = inverse(scene_->base);
  ASSERT_TRUE(waitUntil([this] { return headings_.last() && std::isfinite(headings_.last()->heading); }));
  const Heading heading = *headings_.last();
  EXPECT_EQ(heading.header.frame_id, sim::BASE_FRAME);
  EXPECT_NEAR(heading.heading, truth.heading(), 0.05);
  EXPECT_NEAR(heading.yaw_error, truth.yaw, 0.02);
  EXPECT_EQ(heading.histogram.size(), 181u);
  EXPECT_NE(heading.state, Heading::ARRIVED);
  const geometry_msgs::Twist twist = commands_.last();
  EXPECT_NEAR(std::atan2(twist.linear.y, twist.linear.x), truth.heading(), 0.05);
  EXPECT_LT(twist.angular.z, 0.0);
  EXPECT_LE(std::hypot(twist.linear.x, twist.linear.y), 0.25 + 1e-9);
  EXPECT_TRUE(waitUntil([this] { return status_.last()->state == ServoStatus::SERVOING; }));
}

TEST_F(HomingTest, StopsWhenTheCameraStopsAndGoesOnWithIt)
{
  drive();
  expectToStop([this] { base_.camera = false; }, ServoStatus::LOST, "no image");
  base_.camera = true;
  EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
}

TEST_F(HomingTest, StopsWhenOdometryStopsAndGoesOnWithIt)
{
  drive();
  expectToStop([this] { base_.odometry = false; }, ServoStatus::LOST, "no odometry");
  base_.odometry = true;
  EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
}

TEST_F(HomingTest, StopsWhenTheMatcherDiesAndGivesUp)
{
  drive();
  expectToStop([this] { base_.matcher = false; }, ServoStatus::LOST, "no matches");
  const HomeToViewResult final = result();
  EXPECT_FALSE(final.success);
  EXPECT_NE(final.message.find("no matches"), std::string::npos) << final.message;
  EXPECT_FALSE(commands_.moving());
}

TEST_F(HomingTest, StopsWhenTheImageTurnsBlackAndGoesOnAfterwards)
{
  drive();
  expectToStop([this] { base_.black = true; }, ServoStatus::LOST, "shows nothing");
  base_.black = false;
  EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
}

TEST_F(HomingTest, StopsWhenDisabled)
{
  drive();
  expectToStop([this] { enable(false); }, ServoStatus::DISABLED, "disabled");
  EXPECT_FALSE(result().success);
  EXPECT_EQ(client_.getState().state_, actionlib::SimpleClientGoalState::ABORTED);
}

TEST_F(HomingTest, StopsWhenTheGoalIsCancelled)
{
  drive();
  expectToStop([this] { client_.cancelGoal(); }, ServoStatus::ABORTED, "cancelled");
  result();
  EXPECT_EQ(client_.getState().state_, actionlib::SimpleClientGoalState::PREEMPTED);
}

TEST_F(HomingTest, StopsWhenTimeGoesBack)
{
  drive();
  expectToStop([this] { base_.delay = 5.0; }, ServoStatus::ABORTED, "gone back");
  EXPECT_FALSE(result().success);
}

TEST_F(HomingTest, StopsForMatchesOfAnotherView)
{
  drive();
  expectToStop([this] { base_.other_view = true; }, ServoStatus::LOST, "no matches");
}

TEST_F(HomingTest, StopsBeforeItEnds)
{
  const TemporaryDirectory directory;
  FakeBase base(*scene_, "ending");
  const Commands commands("ending/cmd_vel");
  const Recorder<ServoStatus> status("ending/status");
  ChildProcess node({ HOMING_PATH, "__ns:=ending", "_views_dir:=" + viewsDir("driving/homing").string() },
                    directory.path() / "output");
  ASSERT_TRUE(waitForService("ending/homing/enable")) << node.output();
  std_srvs::SetBool service;
  service.request.data = 1;
  ASSERT_TRUE(ros::service::call("ending/homing/enable", service));
  ActionClient client("ending/home", false);
  ASSERT_TRUE(waitUntil([&] { return client.isServerConnected(); }));
  HomeToViewGoal goal;
  goal.view = "goal";
  bool sent = false;
  ASSERT_TRUE(waitUntil([&] {
    if (!sent || client.getState().isDone())
    {
      client.sendGoal(goal);
      sent = true;
    }
    return commands.moving();
  })) << node.output();
  const Clock::time_point moment = Clock::now();
  node.interrupt();
  EXPECT_EQ(node.exitStatus(), 0) << node.output();
  EXPECT_TRUE(waitUntil([&] { return !commands.moving(); }));
  EXPECT_LT(commands.lastMotionAfter(moment), STOPS_WITHIN);
  EXPECT_EQ(status.last()->reason, "the node is shutting down");
}

TEST_F(HomingTest, RefusesWhatItCannotDo)
{
  drive();
  client_.cancelGoal();
  result();
  const auto refused = [this](const std::string& words) {
    const HomeToViewResult final = result();
    EXPECT_FALSE(final.success);
    EXPECT_NE(final.message.find(words), std::string::npos) << final.message;
    EXPECT_TRUE(std::isnan(final.final.heading));
    EXPECT_FALSE(commands_.moving());
  };
  send("unknown");
  refused("unknown");
  send("");
  refused("names no view");
  send("goal", std::numeric_limits<double>::quiet_NaN());
  refused("finite");
  send("goal", 60.0, -1.0);
  refused("negative");
  enable(false);
  send("goal");
  refused("disabled");
}

TEST_F(HomingTest, GivesUpInTime)
{
  drive();
  send("goal", 1.0);  // replaces the other
  const HomeToViewResult final = result();
  EXPECT_FALSE(final.success);
  EXPECT_NE(final.message.find("not arrived within 1 s"), std::string::npos) << final.message;
  EXPECT_GE(final.duration, 1.0);
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
}

class DryHomingTest : public HomingTest
{
protected:
  DryHomingTest() : HomingTest("dry"), dry_commands_("dry/cmd_vel_dry")
  {
  }

  Commands dry_commands_;
};

TEST_F(DryHomingTest, WatchesItsViewAndKeepsCommandsToItself)
{
  // Without any goal.
  EXPECT_TRUE(waitUntil([this] { return headings_.last() && std::isfinite(headings_.last()->heading); }));
  EXPECT_FALSE(dry_commands_.moving());
  enable(false);
  send("");
  EXPECT_TRUE(waitUntil([this] { return dry_commands_.moving(); })) << reason();
  EXPECT_FALSE(commands_.any());
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "homing_test");
}
