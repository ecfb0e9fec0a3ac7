// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "driver_cases.h"
#include "support/cameras.h"

#include "test_paths.h"
#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/tracking/plane_tracker.h"

#include <geometry_msgs/TwistStamped.h>
#include <sensor_msgs/JointState.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
const cv::Rect REGION(100, 80, 301, 201);
constexpr char CAMERA_FRAME[] = "camera_optical_frame";
constexpr char FIRST_VIEW[] = "approach";  // of a list; the other one is "goal"

/** An arm that stands still, whatever it is told, with a camera and a tracker. */
class FakeArm : public FakeRobot
{
public:
  using Action = ServoToViewAction;
  using Command = geometry_msgs::TwistStamped;
  static constexpr const char* NAMESPACE = "driving";
  static constexpr const char* DRIVER = "servo_25d";
  static constexpr const char* ACTION = "servo";
  static constexpr const char* SILENT = "no homograph";
  static std::vector<std::string> program()
  {
    return { SERVO_25D_PATH };
  }

  explicit FakeArm(const std::string& ns) : FakeRobot(ns, DRIVER)
  {
    infos_ = nh_.advertise<sensor_msgs::CameraInfo>("camera_info", 5);
    joints_ = nh_.advertise<sensor_msgs::JointState>("joint_states", 5);
    reconnect();
    start(30.0, [this](int /*cycle*/) { publish(); });
  }
  ~FakeArm() override
  {
    stop();
  }

  /** The tracker goes, with all its connections, and comes back. */
  void reconnect()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    homographies_.shutdown();
    homographies_ = nh_.advertise<Homography>("homography", 5);
  }

  void publishExtremes()
  {
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    for (const ros::Time& time : extremeStamps())
    {
      homographies_.publish(homography(header(time)));
      infos_.publish(info(header(time)));
      joints_.publish(joints(header(time), 0.0));
    }
    const std_msgs::Header now = header(ros::Time::now());
    for (const double number : extremeNumbers())
    {
      for (double Homography::*const field : { &Homography::distance, &Homography::rms_error })
      {
        Homography message = homography(now);
        message.*field = number;
        homographies_.publish(message);
      }
      Homography message = homography(now);
      message.rotation.w = number;
      homographies_.publish(message);
      message = homography(now);
      message.normal.x = message.normal.z = number;
      homographies_.publish(message);
      message = homography(now);
      message.translation_over_distance.z = number;
      message.h.fill(number);
      homographies_.publish(message);
      joints_.publish(joints(now, number));
    }
    Homography message = homography(now);
    message.inliers = -1;
    message.header.frame_id.clear();
    homographies_.publish(message);
    sensor_msgs::JointState uneven = joints(now, 0.0);
    uneven.name.resize(3);
    uneven.velocity.resize(7);
    joints_.publish(uneven);
  }

  std::atomic<bool> covered{ false };
  std::atomic<bool> nonsense{ false };
  std::atomic<bool> joints_come{ true };
  std::atomic<bool> keeps_to_first{ false };  // follows no other view than the first one
  std::atomic<bool> refuses_second{ false };  // any view but the first one
  std::atomic<double> offset{ 0.1 };          // of the camera from the view, to its left [m]
  std::atomic<double> joint{ 0.0 };           // where joint5 is [rad]

private:
  void publish()
  {
    const std_msgs::Header now = header(stamp());
    const std::lock_guard<std::mutex> lock(publisher_mutex_);
    if (camera)
    {
      infos_.publish(info(now));
    }
    if (joints_come)
    {
      joints_.publish(joints(now, joint));
    }
    Homography message = homography(now);
    if (answers && fill(message))
    {
      if (keeps_to_first && message.view != FIRST_VIEW)
      {
        message.view = FIRST_VIEW;
        message.goal.clear();
      }
      if (refuses_second && message.view != FIRST_VIEW)
      {
        message.refused = 1;
        message.reason = "it is gone";
      }
      homographies_.publish(message);
    }
  }

  static std_msgs::Header header(const ros::Time& time)
  {
    std_msgs::Header header;
    header.stamp = time;
    header.frame_id = CAMERA_FRAME;
    return header;
  }

  sensor_msgs::CameraInfo info(const std_msgs::Header& header) const
  {
    Camera model = pinholeCamera({ 480, 360 }, focal_length, focal_length, 240.0, 180.0);
    if (!calibrated)
    {
      model.k.setZero();
    }
    model.projection.leftCols<3>() = model.k;
    return toCameraInfo(model, header);
  }

  static sensor_msgs::JointState joints(const std_msgs::Header& header, double position)
  {
    sensor_msgs::JointState message;
    message.header = header;
    message.name = { "joint5" };
    message.position = { position };
    return message;
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
    Homography message = toHomography(track, wantedView().view, header, "a hand is in front of it");
    if (nonsense)
    {
      message.rotation.w = std::numeric_limits<double>::quiet_NaN();
    }
    return message;
  }

  std::mutex publisher_mutex_;
  ros::Publisher homographies_;
  ros::Publisher infos_;
  ros::Publisher joints_;
};

INSTANTIATE_TYPED_TEST_SUITE_P(Servo25d, EveryDriverTest, FakeArm, );

class Servo25dNodeTest : public DriverTest<FakeArm>
{
protected:
  Recorder<ServoError> errors_{ ns_ + "/servo_error" };
};

TEST_F(Servo25dNodeTest, DrivesTowardsTheView)
{
  drive();
  const geometry_msgs::TwistStamped command = commands_.last();
  EXPECT_EQ(command.header.frame_id, CAMERA_FRAME);
  EXPECT_EQ(commands_.first().header.frame_id, CAMERA_FRAME);  // that of the calibration, before any homography
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

TEST_F(Servo25dNodeTest, EndsAtTheView)
{
  drive();
  robot_.offset = 2e-4;
  const ServoToViewResult final = result();
  EXPECT_TRUE(final.success) << final.message;
  EXPECT_EQ(client_.getState().state_, GoalState::SUCCEEDED);
  EXPECT_EQ(final.final.state, ServoStatus::CONVERGED);
  EXPECT_EQ(final.final.reason, final.message);
  EXPECT_NEAR(final.final.translation_error, 2e-4, 1e-6);
  EXPECT_GT(final.iterations, 0);
  EXPECT_GE(final.duration, 0.5);
  EXPECT_TRUE(waitUntil([this] { return robot_.wantedView().view.empty(); }));
}

TEST_F(Servo25dNodeTest, StopsWhenTheViewIsCoveredAndGoesOnAfterwards)
{
  drive();
  expectToStopWhile(robot_.covered, "a hand is in front of it");
}

TEST_F(Servo25dNodeTest, GivesUpWhenTheViewStaysCovered)
{
  drive();
  robot_.covered = true;
  const auto final = expectToFail("the view is lost: a hand is in front of it");
  EXPECT_EQ(final.final.state, ServoStatus::ABORTED);
}

TEST_F(Servo25dNodeTest, StopsForOldHomographies)
{
  drive();
  expectToStopForOldStamps(0.9, " old");
}

TEST_F(Servo25dNodeTest, StopsForHomographiesOfAnotherView)
{
  drive();
  expectToEnd([this] { robot_.other_view = true; }, GoalState::ABORTED, "are of view 'another', not of 'goal'");
}

TEST_F(Servo25dNodeTest, StopsForNonsense)
{
  drive();
  expectToStop([this] { robot_.nonsense = true; }, ServoStatus::LOST,
               "are not used: its rotation is no unit quaternion");
}

TEST_F(Servo25dNodeTest, StopsAtAJointLimit)
{
  drive();
  expectToEnd([this] { robot_.joint = 1.74; }, GoalState::ABORTED, "joint limit reached: 'joint5' is at 1.740",
              2.0 * STOPS_WITHIN);
}

TEST_F(Servo25dNodeTest, ForgetsAJointThatIsNotHeardOfAnyMore)
{
  drive();
  expectToEnd([this] { robot_.joint = 1.74; }, GoalState::ABORTED, "joint limit reached", 2.0 * STOPS_WITHIN);
  robot_.joints_come = false;
  // As soon as what was said of the joint is old, it hinders nobody.
  EXPECT_TRUE(waitUntil([this] {
    send("goal");
    waitUntil([this] { return commands_.moving() || client_.getState().isDone(); });
    return commands_.moving() && !client_.getState().isDone();
  })) << reason();
}

TEST_F(Servo25dNodeTest, DoesWithoutJointStatesThatNeverCome)
{
  robot_.joints_come = false;
  const Clock::time_point moment = Clock::now();
  const auto drives_on = [&] {
    return commands_.lastMotionAfter(moment) > 4.0;
  };
  // What former tests published is forgotten first.
  EXPECT_TRUE(waitUntil(drives_on, [this] {
    if (!commands_.any() || client_.getState().isDone() || reason().find("no joint states") != std::string::npos)
    {
      send("goal");
      waitUntil([this] { return commands_.moving(); });
    }
  })) << reason();
}

TEST_F(Servo25dNodeTest, StopsWhenJointStatesStopAndGoesOnWithThem)
{
  drive();
  robot_.joints_come = false;
  EXPECT_TRUE(waitUntil([this] { return reason().find("no joint states for") != std::string::npos; })) << reason();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  robot_.joints_come = true;
  expectToGoOn();
}

TEST_F(Servo25dNodeTest, StopsForAJointThatIsNowhere)
{
  drive();
  robot_.joint = 99.0;
  EXPECT_TRUE(waitUntil([this] { return reason().find("'joint5' is said to be at 99") != std::string::npos; }))
      << reason();
  EXPECT_TRUE(waitUntil([this] { return !commands_.moving(); }));
}

TEST_F(Servo25dNodeTest, StopsWithoutACalibration)
{
  drive();
  expectToEnd([this] { robot_.calibrated = false; }, GoalState::ABORTED, "not calibrated");
  send("goal");
  EXPECT_NE(result().message.find("not calibrated"), std::string::npos);
}

/** Goals with two views: a wide approach, which the camera is at, and the goal, which it is not. */
class ServoViewsTest : public Servo25dNodeTest
{
protected:
  void SetUp() override
  {
    Servo25dNodeTest::SetUp();
    StoredView view = viewOf(FIRST_VIEW, texturedPicture(2));
    view.region = REGION;
    saveView(ns_ + "/servo_25d", view);
    robot_.offset = 0.02;
  }

  static ServoView wanted(const std::string& view, double translation_tolerance = 0.0)
  {
    ServoView result;
    result.view = view;
    result.translation_tolerance = translation_tolerance;
    return result;
  }

  void sendViews(const std::vector<ServoView>& views)
  {
    ServoToViewGoal goal;
    goal.views = views;
    goal.timeout = 60.0;
    client_.sendGoal(goal, {}, {}, [this](const ServoToViewFeedbackConstPtr& feedback) {
      const std::lock_guard<std::mutex> lock(feedback_mutex_);
      feedback_.push_back(*feedback);
    });
  }

  void sendBoth()
  {
    sendViews({ wanted(FIRST_VIEW, 0.03), wanted("goal") });
  }

  /** Until the tracker is asked for the second view, and the driver waits for it. */
  void waitBetween()
  {
    ASSERT_TRUE(waitUntil([this] { return robot_.wantedView().view == "goal"; })) << reason();
    ASSERT_TRUE(waitUntil([this] { return reason().find("view 'goal', 2 of 2: ") == 0; })) << reason();
    ASSERT_TRUE(waitUntil([this] { return !commands_.moving(); }));
  }

  void driveToSecond()
  {
    sendBoth();
    ASSERT_TRUE(waitUntil([this] {
      return commands_.moving() && reason() == "view 'goal', 2 of 2: drives to the view";
    })) << reason();
  }

  std::vector<ServoToViewFeedback> feedback()
  {
    const std::lock_guard<std::mutex> lock(feedback_mutex_);
    return feedback_;
  }

  /** The goal that was sent must be refused, by these words, before anything moves or any view is asked for. */
  void expectToBeRefused(const std::string& words)
  {
    EXPECT_EQ(expectToFail(words).reached, 0);
    EXPECT_FALSE(commands_.moving());
    const auto asked = views_.messages();
    EXPECT_TRUE(
        std::all_of(asked.begin(), asked.end(), [](const WantedView& message) { return message.view.empty(); }));
  }

  Recorder<WantedView> views_{ ns_ + "/servo_25d/wanted_view" };

private:
  std::mutex feedback_mutex_;
  std::vector<ServoToViewFeedback> feedback_;
};

TEST_F(ServoViewsTest, DrivesToOneAfterTheOther)
{
  driveToSecond();
  robot_.offset = 2e-4;
  const ServoToViewResult final = result();
  EXPECT_TRUE(final.success) << final.message;
  EXPECT_EQ(final.reached, 2);
  EXPECT_EQ(final.message.find("view 'goal', 2 of 2: "), 0U) << final.message;
  const std::vector<ServoToViewFeedback> told = feedback();
  ASSERT_FALSE(told.empty());
  EXPECT_EQ(told.front().view, FIRST_VIEW);
  EXPECT_EQ(told.front().number, 1);
  EXPECT_EQ(told.back().view, "goal");
  EXPECT_EQ(told.back().number, 2);
  for (const ServoToViewFeedback& feedback : told)
  {
    EXPECT_EQ(feedback.count, 2);
    EXPECT_EQ(feedback.view, feedback.number == 1 ? FIRST_VIEW : "goal");
  }
  // Both were asked for, for one goal, and nothing afterwards.
  std::vector<std::string> asked;
  std::set<std::string> goals;
  for (const WantedView& message : views_.messages())
  {
    if (!message.view.empty())
    {
      asked.push_back(message.view);
      goals.insert(message.goal);
    }
  }
  EXPECT_EQ(goals.size(), 1U);
  EXPECT_EQ(asked, (std::vector<std::string>{ FIRST_VIEW, "goal" }));
}

TEST_F(ServoViewsTest, AsksEachViewForItsOwnTolerance)
{
  sendViews({ wanted("goal"), wanted(FIRST_VIEW, 0.03) });  // the narrow one first
  const Clock::time_point moment = Clock::now();
  ASSERT_TRUE(waitUntil([&] { return commands_.lastMotionAfter(moment) > 1.5; })) << reason();
  EXPECT_EQ(robot_.wantedView().view, "goal");
  EXPECT_EQ(reason().find("view 'goal', 1 of 2: "), 0U) << reason();
  robot_.offset = 2e-4;
  ASSERT_TRUE(waitUntil([this] { return robot_.wantedView().view == FIRST_VIEW; })) << reason();
  robot_.offset = 0.02;
  EXPECT_TRUE(result().success);
}

TEST_F(ServoViewsTest, IsCancelledBetweenViews)
{
  robot_.keeps_to_first = true;
  sendBoth();
  waitBetween();
  EXPECT_TRUE(waitUntil([this] { return reason().find("are of view 'approach', not of 'goal'") != std::string::npos; }))
      << reason();
  expectToEnd([this] { client_.cancelGoal(); }, GoalState::PREEMPTED, "cancelled");
  EXPECT_EQ(client_.getResult()->reached, 1);
}

TEST_F(ServoViewsTest, IsCancelledOnTheWayToEach)
{
  robot_.offset = 0.1;
  sendBoth();
  ASSERT_TRUE(waitUntil([this] { return commands_.moving(); })) << reason();
  expectToEnd([this] { client_.cancelGoal(); }, GoalState::PREEMPTED, "cancelled");
  EXPECT_EQ(client_.getResult()->reached, 0);
  robot_.offset = 0.02;
  driveToSecond();
  expectToEnd([this] { client_.cancelGoal(); }, GoalState::PREEMPTED, "cancelled");
  EXPECT_EQ(client_.getResult()->reached, 1);
}

TEST_F(ServoViewsTest, StandsBetweenViewsUntilTheTrackerAnswers)
{
  robot_.keeps_to_first = true;
  sendBoth();
  waitBetween();
  robot_.keeps_to_first = false;
  expectToGoOn();
}

TEST_F(ServoViewsTest, GivesUpWhenTheTrackerDoesNotTurnToTheNextView)
{
  robot_.keeps_to_first = true;
  sendBoth();
  EXPECT_EQ(expectToFail("view 'goal', 2 of 2: the view is not found within 4 s").reached, 1);
}

TEST_F(ServoViewsTest, EndsWhenTheTrackerRefusesTheNextView)
{
  robot_.refuses_second = true;
  sendBoth();
  EXPECT_EQ(expectToFail("view 'goal', 2 of 2: homographies on").reached, 1);
  EXPECT_NE(client_.getResult()->message.find("it is gone"), std::string::npos);
}

TEST_F(ServoViewsTest, StopsForTheSameFaultsAtEachView)
{
  driveToSecond();
  expectToStopWhile(robot_.covered, "a hand is in front of it");
  expectToStop([this] { robot_.hush(true); }, ServoStatus::LOST, FakeArm::SILENT);
  robot_.hush(false);
  expectToGoOn();
  // That the tracker has gone back to the view before is no answer that comes late.
  expectToEnd([this] { robot_.keeps_to_first = true; }, GoalState::ABORTED, "are of view 'approach', not of 'goal'");
}

TEST_F(ServoViewsTest, RefusesAListWithAViewThatIsNotThere)
{
  sendViews({ wanted(FIRST_VIEW, 0.03), wanted("unknown") });
  expectToBeRefused("unknown");
}

TEST_F(ServoViewsTest, RefusesAListWithAViewThatCannotBeRead)
{
  StoredView view = viewOf("damaged", texturedPicture(3));
  saveView(ns_ + "/servo_25d", view);
  for (const auto& file : std::filesystem::directory_iterator(viewsDir(ns_ + "/servo_25d")))
  {
    if (file.path().filename().string().find("damaged.") == 0 && file.path().extension() == ".png")
    {
      std::filesystem::resize_file(file.path(), 100);
    }
  }
  sendViews({ wanted(FIRST_VIEW, 0.03), wanted("damaged") });
  expectToBeRefused("damaged");
}

TEST_F(ServoViewsTest, RefusesAListThatIsNoOrder)
{
  sendViews({ wanted(FIRST_VIEW, -0.03), wanted("goal") });
  expectToBeRefused("tolerances, dwell and timeout must be finite and not negative");
  sendViews({ wanted(FIRST_VIEW), wanted("") });
  expectToBeRefused("''");
  ServoToViewGoal goal;
  goal.view = "goal";
  goal.views = { wanted(FIRST_VIEW) };
  client_.sendGoal(goal);
  expectToBeRefused("both a view and a list of views");
}

using DryServo25dNodeTest = DryDriverTest<FakeArm>;

TEST_F(DryServo25dNodeTest, KeepsCommandsToItself)
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
  return view_servo::test::runDriverTests(argc, argv, "arm_servo_test", "driving/servo_25d", [] {
    view_servo::StoredView view = view_servo::test::viewOf("goal", view_servo::test::texturedPicture(1));
    view.region = view_servo::test::REGION;
    return view;
  });
}
