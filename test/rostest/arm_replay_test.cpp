// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "replay.h"
#include "sim/visibility.h"
#include "sim/world_reader.h"
#include "support/recorded_bag.h"
#include "support/shipped_files.h"
#include "support/temporary_directory.h"

#include "view_servo/Homography.h"
#include "view_servo/ServoError.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/control/velocity_limiter.h"

#include <actionlib/client/simple_action_client.h>
#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <deque>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** What the ground truth says of the view and the plane that its region shows. */
class TrueView
{
public:
  explicit TrueView(const sim::World& world) : world_(world)
  {
    const cv::Rect& region = world.region;
    const double right = region.x + region.width - 1.0;
    const double bottom = region.y + region.height - 1.0;
    corners_ = { Eigen::Vector2d(region.x, region.y), Eigen::Vector2d(right, region.y), Eigen::Vector2d(right, bottom),
                 Eigen::Vector2d(region.x, bottom) };
    std::vector<Eigen::Vector3d> on_plane;  // in the view's camera frame
    for (const Eigen::Vector2d& corner : corners_)
    {
      const Eigen::Vector3d ray = (world.camera.k.inverse() * corner.homogeneous()).normalized();
      const auto hit = sim::firstHit(world, world.goal.translation(), world.goal.linear() * ray);
      EXPECT_TRUE(hit);
      on_plane.push_back(hit.value_or(1.0) * ray);
    }
    normal_ = (on_plane[1] - on_plane[0]).cross(on_plane[3] - on_plane[0]).normalized();
    distance_ = normal_.dot(on_plane[0]);
    EXPECT_GT(distance_, 0.0);
  }

  PlaneView view(double stamp, const Eigen::Isometry3d& camera) const
  {
    const Eigen::Isometry3d motion = camera.inverse() * world_.goal;
    return { stamp, { motion.linear(), motion.translation() / distance_, normal_ }, distance_, 100 };
  }

  /** Of the region's corners, the largest [px]. */
  double cornerError(const Eigen::Matrix3d& h, const Eigen::Isometry3d& camera) const
  {
    const Eigen::Matrix3d& k = world_.camera.k;
    const Eigen::Matrix3d truth = k * view(0.0, camera).motion.matrix() * k.inverse();
    double largest = 0.0;
    for (const Eigen::Vector2d& corner : corners_)
    {
      const Eigen::Vector2d expected = (truth * corner.homogeneous()).hnormalized();
      largest = std::max(largest, ((h * corner.homogeneous()).hnormalized() - expected).norm());
    }
    return largest;
  }

  ServoTarget target() const
  {
    return { world_.camera.k,
             { world_.camera.width, world_.camera.height },
             { 0.5 * (corners_[0].x() + corners_[2].x()), 0.5 * (corners_[0].y() + corners_[2].y()) } };
  }

private:
  const sim::World& world_;
  std::array<Eigen::Vector2d, 4> corners_;
  Eigen::Vector3d normal_;
  double distance_;
};

/** Speeds as parts of what the arm may do, so that turns and translations count alike. */
Twist relative(Twist twist)
{
  twist.head<3>() /= ARM_LIMITS.max_speed;
  twist.tail<3>() /= ARM_LIMITS.max_turn_rate;
  return twist;
}

using Poses = std::map<ros::Time, Eigen::Isometry3d>;  // of the camera in the world, by the stamps of images

Poses posesOf(const std::string& bag)
{
  Poses poses;
  for (const Frame& frame : framesOf(bag))
  {
    poses[frame.stamp] = frame.pose;
  }
  return poses;
}

/** Sends the goal as soon as the camera is known. */
class GoalSender
{
public:
  /** Sends it unless it has been accepted; to be called again and again. */
  void sendOnce()
  {
    if (!client_ && ros::Time::isValid())  // a client waits for that without end
    {
      client_ = std::make_unique<actionlib::SimpleActionClient<ServoToViewAction>>("servo", false);
    }
    if (!client_ || !client_->isServerConnected())
    {
      return;
    }
    if (!sent_ || (hasEnded() && client_->getResult() && client_->getResult()->iterations == 0))
    {
      ServoToViewGoal goal;
      goal.view = "goal";
      client_->sendGoal(goal);
      sent_ = true;
    }
  }

  bool hasEnded() const
  {
    return client_ && client_->getState().isDone();
  }
  /** Of a goal that has ended. */
  ServoToViewResult result() const
  {
    return *client_->getResult();
  }

private:
  std::unique_ptr<actionlib::SimpleActionClient<ServoToViewAction>> client_;
  bool sent_ = false;
};

constexpr double LEAST_SHARE = 0.95;  // of the homographies, and of the commands, that agree with the truth

/** How many homographies agree with the truth. */
struct JudgedHomographies
{
  std::optional<ros::Time> first;  // stamp of the first valid one
  std::size_t answered = 0;        // all of images, from that one on
  std::size_t right = 0;           // of these
};

JudgedHomographies judgeHomographies(const std::deque<Homography>& homographies, const Poses& poses,
                                     const TrueView& truth)
{
  constexpr double TOLERANCE = 2.0;  // of the region's corners [px]
  JudgedHomographies judged;
  for (const Homography& message : homographies)
  {
    if (message.header.frame_id.empty())
    {
      continue;  // said without an image
    }
    const auto pose = poses.find(message.header.stamp);
    if (pose == poses.end())
    {
      ADD_FAILURE() << "no image has the stamp " << message.header.stamp;
      continue;
    }
    if (!judged.first && message.valid != 0)
    {
      judged.first = message.header.stamp;
    }
    if (judged.first)
    {
      ++judged.answered;
      judged.right += message.valid != 0 && truth.cornerError(toMatrix(message.h), pose->second) < TOLERANCE ? 1 : 0;
    }
  }
  return judged;
}

/** How many commands agree with those that the truth asks for. */
struct JudgedCommands
{
  std::size_t far = 0;       // from the view
  std::size_t agreeing = 0;  // of these
  double largest = 0.0;      // angle between one of these and that of the truth [degrees]
};

/** @param begin commands before it are left out. */
JudgedCommands judgeCommands(const std::deque<geometry_msgs::TwistStamped>& twists, const Poses& poses,
                             const TrueView& truth, const Eigen::Isometry3d& goal, const ros::Time& begin)
{
  constexpr double FAR = 0.02;            // [m]
  constexpr double LARGEST_ANGLE = 15.0;  // [degrees]
  JudgedCommands judged;
  for (const geometry_msgs::TwistStamped& message : twists)
  {
    Twist twist;
    twist << toVector(message.twist.linear), toVector(message.twist.angular);
    const auto pose = poses.lower_bound(message.header.stamp);
    if (twist.isZero() || message.header.stamp < begin || pose == poses.end() ||
        (pose->second.translation() - goal.translation()).norm() < FAR)
    {
      continue;
    }
    Servo25d servo(truth.target(), Servo25dParams());
    const double stamp = pose->first.toSec();
    servo.add(truth.view(stamp, pose->second));
    const Twist expected = relative(servo.command(stamp));
    const double cosine = relative(twist).normalized().dot(expected.normalized());
    const double angle = std::acos(std::clamp(cosine, -1.0, 1.0)) * 180.0 / M_PI;
    judged.largest = std::max(judged.largest, angle);
    ++judged.far;
    judged.agreeing += angle < LARGEST_ANGLE ? 1 : 0;
  }
  return judged;
}

class ArmReplay : public ::testing::Test
{
protected:
  void TearDown() override
  {
    removeViews("servo_25d");
  }
};

TEST_F(ArmReplay, HomographiesAndTwistsAgreeWithTheTruth)
{
  constexpr double LEAST_ANSWERED = 0.6;  // of the images; a busy machine leaves some out
  constexpr double RAMP = 0.6;            // until a limited command has the direction of the one wanted [s]

  const TemporaryDirectory directory;
  const std::string bag = directory.path() / "approach.bag";
  const std::string file = worldFile("rice");
  recordBag(file, "approach", bag, { "--rate", "30", "--urdf", PUMA_URDF_FILE });
  ASSERT_FALSE(HasFatalFailure());
  const sim::World world = sim::readWorld(file);
  saveGoal("homography_tracker", world, world.goal, world.region);
  const Poses poses = posesOf(bag);

  const Recorder<Homography> homographies("homography_tracker/homography");
  const Recorder<geometry_msgs::TwistStamped> twists("cmd_vel_dry");
  const Recorder<ServoError> errors("servo_error");
  ASSERT_TRUE(waitForService("homography_tracker/start"));
  GoalSender goal;
  playBag(bag, 0.5, { "/camera/image_raw", "/camera/camera_info", "/tf", "/joint_states" }, [&] { goal.sendOnce(); });
  ASSERT_FALSE(HasFatalFailure());
  // The bag ends at the view.
  ASSERT_TRUE(goal.hasEnded()) << errors.messages().size() << " errors";
  EXPECT_TRUE(goal.result().success) << goal.result().message;

  const TrueView truth(world);
  const JudgedHomographies seen = judgeHomographies(homographies.messages(), poses, truth);
  ASSERT_TRUE(seen.first);
  // At the view the goal ends, and the tracker with it.
  const ros::Time last = homographies.last()->header.stamp;
  const auto images = static_cast<double>(std::distance(poses.lower_bound(*seen.first), poses.upper_bound(last)));
  RecordProperty("homographies", static_cast<int>(seen.answered));
  RecordProperty("right", static_cast<int>(seen.right));
  EXPECT_GE(static_cast<double>(seen.answered), LEAST_ANSWERED * images);
  EXPECT_GE(static_cast<double>(seen.right), LEAST_SHARE * static_cast<double>(seen.answered))
      << seen.right << " of " << seen.answered;

  const JudgedCommands commands =
      judgeCommands(twists.messages(), poses, truth, world.goal, *seen.first + ros::Duration(RAMP));
  RecordProperty("far_commands", static_cast<int>(commands.far));
  RecordProperty("largest_angle", static_cast<int>(commands.largest));
  EXPECT_GT(commands.far, 50u);
  EXPECT_GE(static_cast<double>(commands.agreeing), LEAST_SHARE * static_cast<double>(commands.far))
      << commands.agreeing << " of " << commands.far << ", the largest angle is " << commands.largest;
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "arm_replay_test");
}
