// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "child_process.h"
#include "commands.h"
#include "node_test.h"
#include "support/temporary_directory.h"

#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/ServoStatus.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/SetView.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/views/view_store.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
using Clock = std::chrono::steady_clock;
using Commands = CommandsOf<geometry_msgs::TwistStamped>;
using ActionClient = actionlib::SimpleActionClient<ServoToViewAction>;

constexpr double STOPS_WITHIN = 0.3 * SLOWDOWN;  // of wall time, whatever fails [s]
const cv::Rect REGION(100, 80, 301, 201);
constexpr char CAMERA_FRAME[] = "camera_optical_frame";

/** An arm that stands still, whatever it is told, with a camera and a tracker, all of which can fail. */
class FakeArm
{
public:
  explicit FakeArm(const std::string& ns) : nh_(ns)
  {
    homographies_ = nh_.advertise<Homography>("homography", 5);
    infos_ = nh_.advertise<sensor_msgs::CameraInfo>("camera_info", 5);
    joints_ = nh_.advertise<sensor_msgs::JointState>("joint_states", 5);
    start_ = nh_.advertiseService("homography_tracker/start", &FakeArm::start, this);
    stop_ = nh_.advertiseService("homography_tracker/stop", &FakeArm::stop, this);
    thread_ = std::thread([this] { run(); });
  }
  ~FakeArm()
  {
    running_ = false;
    thread_.join();
  }
  FakeArm(const FakeArm&) = delete;
  FakeArm& operator=(const FakeArm&) = delete;

  std::atomic<bool> tracker{ true };
  std::atomic<bool> accepts{ true };
  std::atomic<bool> covered{ false };
  std::atomic<bool> nonsense{ false };
  std::atomic<bool> other_view{ false };
  std::atomic<bool> frozen{ false };  // stamps stand still
  std::atomic<bool> calibrated{ true };
  std::atomic<double> offset{ 0.1 };  // of the camera from the view, to its left [m]
  std::atomic<double> delay{ 0.0 };   // of all stamps [s]
  std::atomic<double> joint{ 0.0 };   // where joint5 is [rad]
  std::atomic<int> stops{ 0 };

private:
  bool start(SetView::Request& request, SetView::Response& response)
  {
    response.success = accepts ? 1 : 0;
    response.message = accepts ? "follows " + request.view : "it is too dark";
    return true;
  }
  bool stop(std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response)
  {
    ++stops;
    response.success = 1;
    return true;
  }

  void run()
  {
    ros::WallRate rate(30.0);
    ros::Time stamp = ros::Time::now();
    while (running_ && ros::ok())
    {
      stamp = frozen ? stamp : ros::Time::now() - ros::Duration(delay);
      publish(stamp);
      rate.sleep();
    }
  }

  void publish(const ros::Time& stamp)
  {
    std_msgs::Header header;
    header.stamp = stamp;
    header.frame_id = CAMERA_FRAME;
    Camera camera;
    camera.width = 480;
    camera.height = 360;
    if (calibrated)
    {
      camera.k << 500.0, 0.0, 240.0, 0.0, 500.0, 180.0, 0.0, 0.0, 1.0;
    }
    camera.projection.leftCols<3>() = camera.k;
    infos_.publish(toCameraInfo(camera, header));

    sensor_msgs::JointState joints;
    joints.header.stamp = stamp;
    joints.name = { "joint5" };
    joints.position = { joint };
    joints_.publish(joints);

    if (tracker)
    {
      homographies_.publish(homography(header));
    }
  }

  /** The plane is 0.5 m away, and faces the camera. */
  Homography homography(const std_msgs::Header& header) const
  {
    constexpr double DISTANCE = 0.5;
    PlaneTrack track;
    if (covered)
    {
      track.state = TrackingState::LOST;
    }
    else
    {
      PlaneEstimate plane;
      plane.motion.rotation.setIdentity();
      plane.motion.translation_over_distance = Eigen::Vector3d(offset / DISTANCE, 0.0, 0.0);
      plane.motion.normal = Eigen::Vector3d::UnitZ();
      plane.normal_known = true;
      plane.distance = DISTANCE;
      track.state = TrackingState::TRACKING;
      track.homography.found = true;
      track.homography.supporting = 50;
      track.homography.h.setIdentity();
      track.plane = plane;
    }
    Homography message = toHomography(track, other_view ? "another" : "goal", header, "a hand is in front of it");
    if (nonsense)
    {
      message.rotation.w = std::numeric_limits<double>::quiet_NaN();
    }
    return message;
  }

  ros::NodeHandle nh_;
  ros::Publisher homographies_;
  ros::Publisher infos_;
  ros::Publisher joints_;
  ros::ServiceServer start_;
  ros::ServiceServer stop_;
  std::atomic<bool> running_{ true };
  std::thread thread_;
};

class ArmServoTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    StoredView view;
    view.name = "goal";
    view.image = makePicture(1);
    view.region = REGION;
    ViewStore(viewsDir("driving/servo_25d")).save(view, true);
  }
  static void TearDownTestSuite()
  {
    removeViews("driving/servo_25d");
  }

  ArmServoTest() : ArmServoTest("driving", "cmd_vel")
  {
  }
  ArmServoTest(const std::string& ns, const std::string& topic)
    : ns_(ns),
      arm_(ns),
      commands_(ns + "/" + topic),
      errors_(ns + "/servo_error"),
      status_(ns + "/status"),
      client_(ns + "/servo", false)
  {
  }

  void SetUp() override
  {
    ASSERT_TRUE(waitForService(ns_ + "/servo_25d/enable"));
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
    ASSERT_TRUE(ros::service::call(ns_ + "/servo_25d/enable", service));
    EXPECT_TRUE(service.response.success) << service.response.message;
  }

  void send(const std::string& view, double timeout = 60.0)
  {
    ServoToViewGoal goal;
    goal.view = view;
    goal.timeout = timeout;
    client_.sendGoal(goal);
  }

  /** Sends a goal as soon as the camera is known to the node, and waits until it drives. */
  void drive()
  {
    bool sent = false;
    ASSERT_TRUE(waitUntil([&] {
      if (!sent || client_.getState().isDone())
      {
        send("goal");
        sent = true;
      }
      return commands_.moving();
    })) << reason();
  }

  std::string reason() const
  {
    return status_.last() ? status_.last()->reason : "no status";
  }

  /** After `fault`, the camera must stand in time, with a reason that has these words in it. */
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

  void expectToGoOn()
  {
    EXPECT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  }

  /** The result of the goal sent last. */
  ServoToViewResult result()
  {
    EXPECT_TRUE(waitUntil([this] { return client_.getState().isDone(); })) << reason();
    const auto found = client_.getResult();
    return found ? *found : ServoToViewResult();
  }

  void expectRefusal(const std::string& words)
  {
    const ServoToViewResult final = result();
    EXPECT_FALSE(final.success);
    EXPECT_NE(final.message.find(words), std::string::npos) << final.message;
    EXPECT_TRUE(std::isnan(final.final.translation_error));
    EXPECT_EQ(final.iterations, 0);
    EXPECT_FALSE(commands_.moving());
  }

  std::string ns_;
  FakeArm arm_;
  Commands commands_;
  Recorder<ServoError> errors_;
  Recorder<ServoStatus> status_;
  ActionClient client_;
};

TEST_F(ArmServoTest, DrivesTowardsTheView)
{
  drive();
  const geometry_msgs::TwistStamped command = commands_.last();
  EXPECT_EQ(command.header.frame_id, CAMERA_FRAME);
  EXPECT_GT(command.twist.linear.x, 0.0);
  EXPECT_LT(std::abs(command.twist.linear.y), 1e-6);
  EXPECT_LE(toVector(command.twist.linear).norm(), 0.15 + 1e-9);
  ASSERT_TRUE(waitUntil([this] { return errors_.last() && errors_.last()->twist.linear.x > 0.0; }));
  const ServoError error = *errors_.last();
  EXPECT_EQ(error.header.frame_id, CAMERA_FRAME);
  EXPECT_EQ(error.view, "goal");
  EXPECT_EQ(error.wanted_x, 250.0);
  EXPECT_EQ(error.wanted_y, 180.0);
  EXPECT_NEAR(error.point_x, 350.0, 1e-6);
  EXPECT_NEAR(error.error_x, 0.2, 1e-6);
  EXPECT_NEAR(error.translation_error, 0.1, 1e-6);
  EXPECT_NEAR(error.rotation_error, 0.0, 1e-6);
  EXPECT_TRUE(waitUntil([this] { return status_.last()->state == ServoStatus::SERVOING; }));
  EXPECT_EQ(status_.last()->inliers, 50);
}

TEST_F(ArmServoTest, EndsAtTheView)
{
  drive();
  arm_.offset = 2e-4;
  const ServoToViewResult final = result();
  EXPECT_TRUE(final.success) << final.message;
  EXPECT_EQ(final.final.state, ServoStatus::CONVERGED);
  EXPECT_NEAR(final.final.translation_error, 2e-4, 1e-6);
  EXPECT_GT(final.iterations, 0);
  EXPECT_GE(final.duration, 0.5);
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  EXPECT_TRUE(waitUntil([this] { return arm_.stops > 0; }));
}

TEST_F(ArmServoTest, StopsWhenTheViewIsCoveredAndGoesOnAfterwards)
{
  drive();
  expectToStop([this] { arm_.covered = true; }, ServoStatus::LOST, "a hand is in front of it");
  arm_.covered = false;
  expectToGoOn();
}

TEST_F(ArmServoTest, GivesUpWhenTheViewStaysCovered)
{
  drive();
  arm_.covered = true;
  const ServoToViewResult final = result();
  EXPECT_FALSE(final.success);
  EXPECT_NE(final.message.find("the view is lost: a hand is in front of it"), std::string::npos) << final.message;
  EXPECT_EQ(final.final.state, ServoStatus::ABORTED);
}

TEST_F(ArmServoTest, StopsWhenHomographiesStopAndGoesOnWithThem)
{
  drive();
  expectToStop([this] { arm_.tracker = false; }, ServoStatus::LOST, "no homography");
  arm_.tracker = true;
  expectToGoOn();
}

TEST_F(ArmServoTest, GivesUpWithoutHomographies)
{
  drive();
  arm_.tracker = false;
  const ServoToViewResult final = result();
  EXPECT_FALSE(final.success);
  EXPECT_NE(final.message.find("no homography"), std::string::npos) << final.message;
}

TEST_F(ArmServoTest, StopsForOldHomographies)
{
  drive();
  // Until they are old their news is that the camera has not moved.
  arm_.frozen = true;
  EXPECT_TRUE(waitUntil([this] { return status_.last()->state == ServoStatus::LOST; }));
  EXPECT_NE(reason().find("old"), std::string::npos) << reason();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
}

TEST_F(ArmServoTest, StopsForHomographiesOfAnotherView)
{
  drive();
  expectToStop([this] { arm_.other_view = true; }, ServoStatus::ABORTED, "are of view 'another', not of 'goal'");
  EXPECT_FALSE(result().success);
}

TEST_F(ArmServoTest, StopsForNonsense)
{
  drive();
  expectToStop([this] { arm_.nonsense = true; }, ServoStatus::LOST, "is not used");
}

TEST_F(ArmServoTest, StopsAtAJointLimit)
{
  drive();
  expectToStop([this] { arm_.joint = 1.74; }, ServoStatus::ABORTED, "joint limit reached: 'joint5' is at 1.740");
  EXPECT_FALSE(result().success);
}

TEST_F(ArmServoTest, StopsWithoutACalibration)
{
  drive();
  expectToStop([this] { arm_.calibrated = false; }, ServoStatus::ABORTED, "not calibrated");
  send("goal");
  expectRefusal("not calibrated");
}

TEST_F(ArmServoTest, StopsWhenDisabled)
{
  drive();
  expectToStop([this] { enable(false); }, ServoStatus::DISABLED, "disabled");
  EXPECT_FALSE(result().success);
  EXPECT_EQ(client_.getState().state_, actionlib::SimpleClientGoalState::ABORTED);
}

TEST_F(ArmServoTest, StopsWhenTheGoalIsCancelled)
{
  drive();
  expectToStop([this] { client_.cancelGoal(); }, ServoStatus::ABORTED, "cancelled");
  result();
  EXPECT_EQ(client_.getState().state_, actionlib::SimpleClientGoalState::PREEMPTED);
}

TEST_F(ArmServoTest, StopsWhenTimeGoesBack)
{
  drive();
  expectToStop([this] { arm_.delay = 5.0; }, ServoStatus::ABORTED, "gone back");
  EXPECT_FALSE(result().success);
}

TEST_F(ArmServoTest, GivesUpInTime)
{
  drive();
  send("goal", 1.0);  // replaces the other
  const ServoToViewResult final = result();
  EXPECT_FALSE(final.success);
  EXPECT_NE(final.message.find("not at the view within 1 s"), std::string::npos) << final.message;
  EXPECT_GE(final.duration, 1.0);
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
}

TEST_F(ArmServoTest, RefusesWhatItCannotDo)
{
  drive();
  client_.cancelGoal();
  result();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  send("unknown");
  expectRefusal("unknown");
  send("goal", std::numeric_limits<double>::quiet_NaN());
  expectRefusal("finite");
  send("goal", -1.0);
  expectRefusal("negative");
  arm_.accepts = false;
  send("goal");
  expectRefusal("it is too dark");
  arm_.accepts = true;
  enable(false);
  send("goal");
  expectRefusal("disabled");
}

TEST_F(ArmServoTest, RefusesWhenNobodyFollowsAndStopsWhenNobodyDoesAnyMore)
{
  drive();
  commands_.shutdown();
  const ServoToViewResult final = result();
  EXPECT_FALSE(final.success);
  EXPECT_NE(final.message.find("nobody listens any more"), std::string::npos) << final.message;
  send("goal");
  EXPECT_NE(result().message.find("nobody listens"), std::string::npos);
  EXPECT_FALSE(result().success);
}

TEST_F(ArmServoTest, StopsBeforeItEnds)
{
  const TemporaryDirectory directory;
  FakeArm arm("ending");
  const Commands commands("ending/cmd_vel");
  const Recorder<ServoStatus> status("ending/status");
  ChildProcess node({ SERVO_25D_PATH, "__ns:=ending", "_views_dir:=" + viewsDir("driving/servo_25d").string() },
                    directory.path() / "output");
  ASSERT_TRUE(waitForService("ending/servo_25d/enable")) << node.output();
  std_srvs::SetBool service;
  service.request.data = 1;
  ASSERT_TRUE(ros::service::call("ending/servo_25d/enable", service));
  ActionClient client("ending/servo", false);
  ASSERT_TRUE(waitUntil([&] { return client.isServerConnected(); }));
  ServoToViewGoal goal;
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
  node.terminate();
  EXPECT_EQ(node.exitStatus(), 0) << node.output();
  EXPECT_TRUE(waitUntil([&] { return !commands.moving(); }));
  EXPECT_LT(commands.lastMotionAfter(moment), STOPS_WITHIN);
  EXPECT_EQ(status.last()->reason, "the node is shutting down");
}

class DryArmServoTest : public ArmServoTest
{
protected:
  DryArmServoTest() : ArmServoTest("dry", "cmd_vel_dry"), real_commands_("dry/cmd_vel")
  {
  }

  Commands real_commands_;
};

TEST_F(DryArmServoTest, KeepsCommandsToItself)
{
  enable(false);
  drive();
  EXPECT_FALSE(real_commands_.any());
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "arm_servo_test");
}
