// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "driver_cases.h"
#include "sim/nomad.h"
#include "sim/renderer.h"
#include "sim/world_reader.h"
#include "sim_ros/robot_messages.h"
#include "support/matched_views.h"
#include "support/shipped_files.h"

#include "test_paths.h"
#include "view_servo/Heading.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/geometry/planar_pose.h"

#include <geometry_msgs/Twist.h>
#include <tf2_ros/static_transform_broadcaster.h>

#include <atomic>
#include <chrono>
#include <cmath>

namespace view_servo
{
namespace test
{
namespace
{
/** What there is to see, drawn once: the view, and what a base sees that stands 0.8 m before it. */
struct Scene
{
  sim::World world;
  cv::Mat view;
  cv::Mat image;
  PlanarPose base;
  std::vector<PointMatch> matches;

  Scene() : world(sim::readWorld(worldFile("desk")))
  {
    sim::SimulatedCamera camera(world, {}, 1);
    sim::Nomad nomad(world, sim::NomadParams());
    view = camera.capture(nomad.cameraPose());
    base = { -0.8, 0.2, 0.05 };
    nomad.setPose(sim::planarPose(base.x, base.y, base.yaw));
    image = camera.capture(nomad.cameraPose());
    matches = toPointMatches(matchPoints(PointViewMatcherParams(), view, image).matches);
  }
};

const Scene& scene()
{
  static const Scene made;
  return made;
}

/** A base on a stand, with a camera and a matcher: its wheels turn as they are told, what it sees does not change. */
class FakeBase : public FakeRobot
{
public:
  using Action = HomeToViewAction;
  using Command = geometry_msgs::Twist;
  static constexpr const char* NAMESPACE = "driving";
  static constexpr const char* DRIVER = "homing";
  static constexpr const char* ACTION = "home";
  static constexpr const char* SILENT = "no matches";
  static std::vector<std::string> program()
  {
    return { HOMING_PATH };
  }

  explicit FakeBase(const std::string& ns) : FakeRobot(ns, DRIVER)
  {
    images_ = nh_.advertise<sensor_msgs::Image>("image_raw", 2);
    infos_ = nh_.advertise<sensor_msgs::CameraInfo>("camera_info", 2);
    odometry_ = nh_.advertise<nav_msgs::Odometry>("odom", 10);
    lines_ = nh_.advertise<LineMatches>("line_matches", 2);
    reconnect();
    focal_length = scene().world.camera.k(0, 0);
    broadcaster_.sendTransform(
        sim::toTransform(scene().world.camera_on_base, sim::BASE_FRAME, sim::CAMERA_FRAME, ros::Time::now()));
    start(RATE, [this](int cycle) { publish(cycle); });
  }
  ~FakeBase() override
  {
    stop();
  }

  void obey(const CommandsOf<Command>& commands)
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    commands_ = &commands;
  }

  /** No matches come, nor are the view's points to be seen: one of both would do. */
  void hush(bool silent) override
  {
    FakeRobot::hush(silent);
    elsewhere_ = silent;
  }

  /** The matcher goes, with all its connections, and comes back. */
  void reconnect()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    matches_.shutdown();
    matches_ = nh_.advertise<PointMatches>("point_matches", 2);
  }

  void publishExtremes()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    for (const ros::Time& stamp : extremeStamps())
    {
      sensor_msgs::CameraInfo info = sim::toCameraInfo(scene().world, 0.0, stamp);
      images_.publish(toImage(scene().image, sensor_msgs::image_encodings::MONO8, info.header));
      infos_.publish(info);
      odometry_.publish(odometry(stamp));
      matches_.publish(matches(info.header));
      LineMatches lines;
      lines.header = info.header;
      lines.view = wantedView().view;
      lines_.publish(lines);
    }
    const ros::Time now = ros::Time::now();
    for (const double number : extremeNumbers())
    {
      nav_msgs::Odometry message = odometry(now);
      message.pose.pose.position.x = number;
      message.pose.pose.orientation.w = number;
      odometry_.publish(message);
      PointMatches points = matches(sim::toCameraInfo(scene().world, 0.0, now).header);
      for (PointMatch& match : points.matches)
      {
        match.reference_x = match.current_y = match.score = number;
      }
      matches_.publish(points);
      sensor_msgs::CameraInfo info = sim::toCameraInfo(scene().world, 0.0, now);
      info.K[0] = info.P[0] = number;
      infos_.publish(info);
    }
    sensor_msgs::Image image =
        toImage(scene().image, sensor_msgs::image_encodings::MONO8, sim::toCameraInfo(scene().world, 0.0, now).header);
    infos_.publish(sim::toCameraInfo(scene().world, 0.0, now));
    image.data.resize(image.data.size() / 2);
    images_.publish(image);
    image.width = image.height = 0;
    image.encoding = "no such encoding";
    images_.publish(image);
  }

  /** tf learns where base_link is on another frame. */
  void placeBaseOn(const std::string& frame)
  {
    broadcaster_.sendTransform(
        sim::toTransform(Eigen::Isometry3d::Identity(), frame, sim::BASE_FRAME, ros::Time::now()));
  }

  /** Of odometry, and of images; with slashes as old nodes have them. */
  void setFrames(const std::string& odometry_child, const std::string& camera_frame)
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    odometry_child_ = odometry_child;
    camera_frame_ = camera_frame;
  }

  std::atomic<bool> infos{ true };             // publishes camera_info with each image
  std::atomic<bool> shuffles{ false };         // every third odometry message comes 0.05 s late, every 20th 0.8 s
  std::atomic<bool> moves_odometry{ true };    // publishes it
  std::atomic<double> odometry_offset{ 0.0 };  // of its stamps against the images' [s]
  std::atomic<bool> black{ false };
  std::atomic<bool> blocked{ false };  // its wheels do not turn

private:
  static constexpr double RATE = 50.0;  // of odometry [Hz]

  void publish(int cycle)
  {
    constexpr int IMAGE_EVERY = 5;
    const ros::Time time = stamp();
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    if (commands_ != nullptr && !blocked)
    {
      const Command told = commands_->newest();
      base_ = compose(base_, { told.linear.x / RATE, told.linear.y / RATE, told.angular.z / RATE });
    }
    if (moves_odometry)
    {
      const double late = !shuffles ? 0.0 : cycle % 20 == 0 ? 0.8 : cycle % 3 == 0 ? 0.05 : 0.0;
      nav_msgs::Odometry message = odometry(time.isZero() ? time : time + ros::Duration(odometry_offset - late));
      message.child_frame_id = odometry_child_;
      odometry_.publish(message);
    }
    if (cycle % IMAGE_EVERY != 0)
    {
      return;
    }
    sensor_msgs::CameraInfo info = sim::toCameraInfo(scene().world, 0.0, time);
    info.K[0] = info.K[4] = info.P[0] = info.P[5] = calibrated ? focal_length.load() : 0.0;
    info.header.frame_id = camera_frame_;
    if (camera)
    {
      cv::Mat image = black ? cv::Mat(scene().image.size(), CV_8UC1, cv::Scalar(0)) : scene().image;
      if (elsewhere_)
      {
        image = texturedPicture(7, image.size());
      }
      images_.publish(toImage(image, sensor_msgs::image_encodings::MONO8, info.header));
      if (infos)
      {
        infos_.publish(info);
      }
    }
    if (answers)
    {
      PointMatches message = matches(info.header);
      if (fill(message))
      {
        matches_.publish(message);
      }
      LineMatches lines;
      lines.header = info.header;
      if (refuses && fill(lines))
      {
        lines_.publish(lines);
      }
    }
  }

  PointMatches matches(const std_msgs::Header& header) const
  {
    PointMatches message;
    message.header = header;
    message.view = wantedView().view;
    message.matches = black ? std::vector<PointMatch>() : scene().matches;
    return message;
  }

  nav_msgs::Odometry odometry(const ros::Time& time) const
  {
    nav_msgs::Odometry message;
    message.header.stamp = time;
    message.header.frame_id = sim::ODOM_FRAME;
    message.child_frame_id = sim::BASE_FRAME;
    message.pose.pose = sim::toPose(sim::planarPose(base_.x, base_.y, base_.yaw));
    return message;
  }

  std::mutex publisher_mutex_;
  const CommandsOf<Command>* commands_ = nullptr;
  PlanarPose base_ = scene().base;        // by odometry
  std::atomic<bool> elsewhere_{ false };  // the camera sees something else
  std::string odometry_child_ = sim::BASE_FRAME;
  std::string camera_frame_ = sim::CAMERA_FRAME;
  ros::Publisher images_;
  ros::Publisher infos_;
  ros::Publisher odometry_;
  ros::Publisher matches_;
  ros::Publisher lines_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
};

/** The same base, whose driver takes it for one that cannot slide. */
class FakeDifferentialBase final : public FakeBase
{
public:
  using FakeBase::FakeBase;
  static constexpr const char* NAMESPACE = "differential";
  static std::vector<std::string> program()
  {
    return { HOMING_PATH, "_base:=differential" };
  }
};

INSTANTIATE_TYPED_TEST_SUITE_P(Homing, EveryDriverTest, FakeBase, );
INSTANTIATE_TYPED_TEST_SUITE_P(HomingDifferential, EveryDriverTest, FakeDifferentialBase, );

class HomingNodeTest : public DriverTest<FakeBase>
{
protected:
  using DriverTest<FakeBase>::DriverTest;
  HomingNodeTest() : DriverTest("driving", "cmd_vel")
  {
  }

  Recorder<Heading> headings_{ ns_ + "/heading" };
};

TEST_F(HomingNodeTest, DrivesTowardsTheView)
{
  drive();
  const PlanarPose truth = inverse(scene().base);
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

TEST_F(HomingNodeTest, StopsWhenTheCameraStopsAndGoesOnWithIt)
{
  drive();
  expectToStopWhile(robot_.camera, "no image");
}

TEST_F(HomingNodeTest, SaysThatItIsTheCalibrationThatStopped)
{
  drive();
  expectToStopWhile(robot_.infos, "no camera_info comes on '/driving/camera_info'");
}

TEST_F(HomingNodeTest, StopsWhenOdometryStopsAndGoesOnWithIt)
{
  drive();
  expectToStopWhile(robot_.moves_odometry, "no odometry");
}

TEST_F(HomingNodeTest, WaitsForOdometryThatIsGoneForLongerThanStampsMayBeApart)
{
  constexpr std::chrono::milliseconds LONG(1200);
  drive();
  expectToStop([this] { robot_.moves_odometry = false; }, ServoStatus::LOST, "no odometry");
  const Clock::time_point begin = Clock::now();
  EXPECT_TRUE(waitUntil([&] { return Clock::now() - begin > LONG; }));
  EXPECT_FALSE(client_.getState().isDone()) << reason();
  EXPECT_EQ(reason().find("apart"), std::string::npos) << reason();
  robot_.moves_odometry = true;
  expectToGoOn();
}

TEST_F(HomingNodeTest, DoesNotDriveByOdometryThatComesBackLate)
{
  constexpr std::chrono::milliseconds LONG(1200);
  drive();
  expectToStop([this] { robot_.moves_odometry = false; }, ServoStatus::LOST, "no odometry");
  const Clock::time_point begin = Clock::now();
  EXPECT_TRUE(waitUntil([&] { return Clock::now() - begin > LONG; }));
  robot_.odometry_offset = -0.9;
  const Clock::time_point moment = Clock::now();
  expectToEnd([this] { robot_.moves_odometry = true; }, GoalState::ABORTED, "before the images on");
  EXPECT_LT(commands_.lastMotionAfter(moment), 0.0);
  robot_.odometry_offset = 0.0;
}

TEST_F(HomingNodeTest, RefusesAndStopsForOdometryOfAnotherTime)
{
  drive();
  expectToEnd([this] { robot_.odometry_offset = 2.0; }, GoalState::ABORTED, "after the images on", 2.0 * STOPS_WITHIN);
  const Clock::time_point moment = Clock::now();
  send("goal");
  EXPECT_TRUE(waitUntil([this] { return reason().find("their clocks are apart") != std::string::npos; })) << reason();
  EXPECT_LT(commands_.lastMotionAfter(moment), 0.0);
  expectToEnd([this] { robot_.odometry_offset = 0.0; }, GoalState::ABORTED, "gone back");
}

TEST_F(HomingNodeTest, StopsForImagesThatAreOldAsOdometryIs)
{
  drive();
  expectToStopForOldStamps(1.5, " ago, at most 1 s");
}

TEST_F(HomingNodeTest, DrivesThoughOdometryComesInTheWrongOrder)
{
  robot_.shuffles = true;
  drive();
  const Clock::time_point moment = Clock::now();
  constexpr double LONG = 3.0;  // than any patience with an input [s]
  EXPECT_TRUE(waitUntil([&] { return commands_.lastMotionAfter(moment) > LONG; })) << reason();
  EXPECT_EQ(client_.getState().state_, GoalState::ACTIVE) << reason();
}

TEST_F(HomingNodeTest, StopsForOdometryOfTwoNodes)
{
  drive();
  const TemporaryDirectory directory;
  const std::string topic = ns_ + "/odom";
  std::unique_ptr<ChildProcess> other;
  const auto publish = [&] {
    other = std::make_unique<ChildProcess>(
        std::vector<std::string>{ "rostopic", "pub", "-r", "5", "/" + topic, "nav_msgs/Odometry", "{}" },
        directory.path() / "output");
  };
  publish();
  EXPECT_TRUE(waitUntil([this] { return reason().find("2 nodes publish odometry on") != std::string::npos; }))
      << reason();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  other->interrupt();
  other.reset();
  expectToGoOn();
}

TEST_F(HomingNodeTest, UsesOdometryOfAFrameThatTfKnows)
{
  drive();
  expectToStop([this] { robot_.setFrames("base_footprint", sim::CAMERA_FRAME); }, ServoStatus::LOST,
               "is of 'base_footprint', ~base_frame is 'base_link'");
  robot_.placeBaseOn("base_footprint");
  expectToGoOn();
}

TEST_F(HomingNodeTest, KnowsFramesWithASlash)
{
  robot_.setFrames(std::string("/") + sim::BASE_FRAME, std::string("/") + sim::CAMERA_FRAME);
  drive();
  EXPECT_EQ(client_.getState().state_, GoalState::ACTIVE);
}

TEST_F(HomingNodeTest, SaysThatImagesHaveNoFrame)
{
  robot_.setFrames(sim::BASE_FRAME, "");
  send("goal");
  EXPECT_TRUE(waitUntil([this] { return reason().find("frame_id is empty") != std::string::npos; })) << reason();
  EXPECT_FALSE(commands_.moving());
}

TEST_F(HomingNodeTest, EndsWhenTheBaseDoesNotDoWhatItIsTold)
{
  drive();
  const Clock::time_point moment = Clock::now();
  robot_.blocked = true;
  expectToFail("the base does not do what it is told");
  EXPECT_LT(commands_.lastMotionAfter(moment), 2.0 + STOPS_WITHIN);
}

TEST_F(HomingNodeTest, StopsWhenTheImageTurnsBlackAndGoesOnAfterwards)
{
  drive();
  expectToStopWhile(robot_.black, "shows nothing");
}

TEST_F(HomingNodeTest, NeedsNoMatchesWhileThePointsAreTracked)
{
  drive();
  ASSERT_TRUE(waitUntil([this] { return reason().find("points are") != std::string::npos; })) << reason();
  robot_.answers = false;
  const auto silent = std::chrono::steady_clock::now();
  EXPECT_TRUE(waitUntil([&] { return commands_.lastMotionAfter(silent) > 2.0; })) << reason();
  EXPECT_EQ(status_.last()->state, ServoStatus::SERVOING) << reason();
}

TEST_F(HomingNodeTest, StopsForMatchesOfAnotherView)
{
  drive();
  expectToStop([this] { robot_.other_view = true; }, ServoStatus::LOST, "are of view 'another', not of 'goal'");
}

TEST_F(HomingNodeTest, StopsWithoutACalibration)
{
  drive();
  expectToStop([this] { robot_.calibrated = false; }, ServoStatus::LOST, "not calibrated");
}

TEST_F(HomingNodeTest, RefusesAStepThatIsNone)
{
  HomeToViewGoal goal;
  goal.view = "goal";
  goal.step = -1.0;
  client_.sendGoal(goal);
  const auto final = expectToFail("negative");
  EXPECT_TRUE(std::isnan(final.final.heading));
  send("");
  EXPECT_NE(result().message.find("names no view"), std::string::npos);
}

class DifferentialHomingNodeTest : public DriverTest<FakeDifferentialBase>
{
};

TEST_F(DifferentialHomingNodeTest, NeverSlidesAndSaysWhatItDoes)
{
  const Recorder<HomeToViewActionFeedback> feedback(ns_ + "/home/feedback");
  drive();
  EXPECT_TRUE(waitUntil([&] { return feedback.last() && !feedback.last()->feedback.manoeuvre.empty(); }));
  EXPECT_TRUE(commands_.all([](const geometry_msgs::Twist& twist) { return twist.linear.y == 0.0; }));
}

class DryHomingNodeTest : public DryDriverTest<FakeBase>
{
protected:
  Recorder<Heading> headings_{ "dry/heading" };
};

TEST_F(DryHomingNodeTest, WatchesItsViewAndKeepsCommandsToItself)
{
  // Without any goal.
  EXPECT_TRUE(waitUntil([this] { return headings_.last() && std::isfinite(headings_.last()->heading); }));
  EXPECT_FALSE(commands_.moving());
  enable(false);
  send("");
  EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  EXPECT_FALSE(real_commands_.any());
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  using view_servo::test::scene;
  return view_servo::test::runDriverTests(argc, argv, "homing_test", "driving/homing",
                                          [] { return view_servo::test::viewOf("goal", scene().view); });
}
