// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/servo_25d.h"
#include "view_servo/parameters/numbers.h"

#include "support/cameras.h"
#include "support/synthetic_scene.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double WIDTH = 640.0;
constexpr double HEIGHT = 480.0;
constexpr double DISTANCE = 0.5;  // [m]

const Eigen::Matrix3d K = test::cameraMatrix(600.0, 600.0, 319.5, 239.5);

ServoTarget target()
{
  return { K, { WIDTH, HEIGHT }, { 319.5, 239.5 } };
}

/** The camera's frame after it has moved by a twist of its own, by small steps. */
Eigen::Isometry3d moved(Eigen::Isometry3d pose, const Twist& twist, double duration)
{
  constexpr int STEPS = 20;
  for (int i = 0; i < STEPS; ++i)
  {
    const double dt = duration / STEPS;
    pose.translation() += dt * pose.linear() * twist.head<3>();
    const Eigen::Vector3d turn = dt * twist.tail<3>();
    if (turn.norm() > 0.0)
    {
      pose.linear() *= Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
    }
  }
  return pose;
}

/** A camera before a plane, led by a Servo25d, with the time that images and commands take. */
class Plant
{
public:
  static constexpr double CONTROL = 0.02;  // [s]
  static constexpr double IMAGES = 0.04;
  static constexpr double DELAY = 0.06;

  /** @param camera in the frame of the stored view [m]. */
  Plant(const Eigen::Isometry3d& camera, const Eigen::Vector3d& normal, const Servo25dParams& params)
    : servo(target(), params), camera_(camera), normal_(normal)
  {
  }

  EuclideanHomography motion() const
  {
    const Eigen::Isometry3d now = (shown ? shown(camera_) : camera_).inverse();
    return { now.linear(), now.translation() / DISTANCE, normal_ };
  }
  Eigen::Vector2d point() const
  {
    const Eigen::Vector3d chosen = K.inverse() * target().point.homogeneous();
    return (K * motion().matrix() * chosen).hnormalized();
  }
  double rotationLeft() const
  {
    return Eigen::AngleAxisd(camera_.linear()).angle();
  }
  const Eigen::Isometry3d& camera() const
  {
    return camera_;
  }
  double time() const
  {
    return time_;
  }

  /** A cycle of control. @return the twist after limits. */
  Twist step()
  {
    if (visible && time_ >= next_image_ - 1e-9)
    {
      next_image_ += IMAGES;
      images_.push_back({ time_, motion(), tell_distance ? std::optional<double>(DISTANCE) : std::nullopt, 100 });
    }
    while (!images_.empty() && images_.front().stamp + DELAY <= time_ + 1e-9)
    {
      servo.add(images_.front());
      images_.pop_front();
    }
    const Twist wanted = servo.command(time_);
    const Twist twist = limited ? limiter.next(wanted, CONTROL) : wanted;
    if (feed_forward)
    {
      servo.sent(time_, twist);
    }
    commands_.push_back({ time_ + dead_time, twist });
    while (commands_.size() > 1 && commands_[1].first <= time_ + 1e-9)
    {
      commands_.pop_front();
    }
    if (commands_.front().first <= time_ + 1e-9)
    {
      camera_ = moved(camera_, commands_.front().second, CONTROL);
    }
    time_ += CONTROL;
    return twist;
  }

  Servo25d servo;
  VelocityLimits limits;
  TwistLimiter limiter{ limits };
  bool limited = true;
  bool feed_forward = true;
  bool tell_distance = false;
  bool visible = true;
  double dead_time = 0.0;  // after which the arm does what it is told [s]
  std::function<Eigen::Isometry3d(const Eigen::Isometry3d&)>
      shown;  // from where a camera sees the plane; empty: from its pose

private:
  Eigen::Isometry3d camera_;
  Eigen::Vector3d normal_;
  double time_ = 0.0;
  double next_image_ = 0.0;
  std::deque<PlaneView> images_;
  std::deque<std::pair<double, Twist>> commands_;  // from when on the arm follows which
};

/**
 * A camera that sees the chosen point somewhere in its image, turned by up to 60 degrees about its axis and 40 across.
 */
Eigen::Isometry3d randomCamera(Rng& rng, const Eigen::Vector3d& normal)
{
  while (true)
  {
    const double roll = uniform(rng, -60.0, 60.0) * DEGREE;
    const double tilt = uniform(rng, -40.0, 40.0) * DEGREE;
    const double bearing = uniform(rng, 0.0, M_PI);
    const Eigen::Matrix3d rotation =
        (Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(bearing), std::sin(bearing), 0.0)) *
         Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
            .toRotationMatrix();
    const double depth = uniform(rng, 0.6, 1.8) * DISTANCE;
    const double u = uniform(rng, 0.15, 0.85) * WIDTH;
    const double v = uniform(rng, 0.15, 0.85) * HEIGHT;
    const Eigen::Vector3d in_camera = depth * (K.inverse() * Eigen::Vector3d(u, v, 1.0));
    const Eigen::Vector3d in_view = DISTANCE / normal.z() * Eigen::Vector3d::UnitZ();
    Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();
    camera.linear() = rotation;
    camera.translation() = in_view - rotation * in_camera;
    // In front of the plane, and not along it.
    if (normal.dot(rotation * in_camera.normalized()) > 0.3)
    {
      return camera;
    }
  }
}

Eigen::Isometry3d someCamera()
{
  Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();
  camera.linear() = Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.5, -0.4, 0.7).normalized()).toRotationMatrix();
  camera.translation() = Eigen::Vector3d(0.05, -0.08, -0.12);
  return camera;
}

}  // namespace

TEST(Servo25dParams, NameAllFaultsAtOnce)
{
  Servo25dParams params;
  EXPECT_TRUE(params.validate().empty());
  params.gain = 0.0;
  params.near_gain = -1.0;
  params.margin = 0.4;
  params.distance = std::numeric_limits<double>::quiet_NaN();
  params.translation_tolerance = 0.0;
  params.rotation_tolerance = -1.0;
  params.dwell = -0.1;
  params.loss_tolerance = 0.6;
  params.lost_timeout = 0.0;
  EXPECT_EQ(params.validate().size(), 9U);
  EXPECT_THROW(Servo25d(target(), params), std::invalid_argument);
}

TEST(Servo25d, RefusesAChosenPointOutsideTheMargin)
{
  for (const Eigen::Vector2d& point : { Eigen::Vector2d(20.0, 240.0), Eigen::Vector2d(320.0, 470.0),
                                        Eigen::Vector2d(-5.0, 240.0), Eigen::Vector2d(900.0, 240.0) })
  {
    ServoTarget bad = target();
    bad.point = point;
    EXPECT_THROW(Servo25d(bad, Servo25dParams()), std::invalid_argument) << point.transpose();
  }
}

TEST(Servo25dError, IsThatOfPoints)
{
  const Eigen::Vector3d normal = Eigen::Vector3d(0.2, -0.1, 1.0).normalized();
  const Eigen::Vector2d chosen(0.1, -0.05);
  const Eigen::Isometry3d motion = someCamera().inverse();
  const Servo25dError error = servo25dError({ motion.linear(), motion.translation() / DISTANCE, normal }, chosen);
  // The point in space.
  const Eigen::Vector3d before = DISTANCE / normal.dot(chosen.homogeneous()) * chosen.homogeneous();
  const Eigen::Vector3d now = motion * before;
  EXPECT_LT((now.hnormalized() - chosen - error.point).norm(), 1e-12);
  EXPECT_NEAR(std::log(now.z() / before.z()), error.depth, 1e-12);
  const Eigen::Matrix3d turned =
      Eigen::AngleAxisd(error.rotation.norm(), error.rotation.normalized()).toRotationMatrix();
  EXPECT_LT((someCamera().linear() - turned).norm(), 1e-12);
}

TEST(Servo25d, StandsUntilTheViewIsFound)
{
  Servo25d servo(target(), Servo25dParams());
  EXPECT_TRUE(servo.command(0.0).isZero());
  servo.addLoss(0.1, "not there");
  EXPECT_EQ(servo.report().state, ServoState::ACQUIRING);
  EXPECT_EQ(servo.report().reason, "not there");
  EXPECT_TRUE(servo.command(0.1).isZero());
  EXPECT_TRUE(std::isnan(servo.report().translation_error));
  servo.addLoss(5.2, "still not there");
  EXPECT_EQ(servo.report().state, ServoState::FAILED);
  EXPECT_NE(servo.report().reason.find("still not there"), std::string::npos);
}

TEST(Servo25d, StandsWhileTheViewIsLostAndGoesOnAfterwards)
{
  Plant plant(someCamera(), Eigen::Vector3d::UnitZ(), Servo25dParams());
  for (int i = 0; i < 20; ++i)
  {
    plant.step();
  }
  EXPECT_FALSE(plant.servo.command(plant.time()).isZero());
  // An image or two are bridged.
  plant.servo.addLoss(plant.time(), "covered");
  EXPECT_EQ(plant.servo.report().state, ServoState::SERVOING);
  EXPECT_FALSE(plant.servo.command(plant.time()).isZero());
  plant.servo.addLoss(plant.time() + 0.1, "covered");
  EXPECT_EQ(plant.servo.report().state, ServoState::LOST);
  EXPECT_TRUE(plant.servo.command(plant.time() + 0.1).isZero());
  plant.servo.addLoss(plant.time() + 4.0, "covered");
  EXPECT_EQ(plant.servo.report().state, ServoState::LOST);
  plant.servo.add({ plant.time() + 4.1, plant.motion(), std::nullopt, 100 });
  EXPECT_EQ(plant.servo.report().state, ServoState::SERVOING);
  EXPECT_FALSE(plant.servo.command(plant.time() + 4.1).isZero());
  plant.servo.addLoss(plant.time() + 5.0, "covered");
  plant.servo.addLoss(plant.time() + 10.1, "covered");
  EXPECT_EQ(plant.servo.report().state, ServoState::FAILED);
  EXPECT_TRUE(plant.servo.command(plant.time() + 10.1).isZero());
  // For good.
  plant.servo.add({ plant.time() + 10.2, plant.motion(), std::nullopt, 100 });
  EXPECT_EQ(plant.servo.report().state, ServoState::FAILED);
}

TEST(Servo25d, HasConvergedOnceItDwellsWithinTheTolerances)
{
  Servo25dParams params;
  Servo25d servo(target(), params);
  const EuclideanHomography at{ Eigen::Matrix3d::Identity(), { 0.001, 0.0, 0.0 }, Eigen::Vector3d::UnitZ() };
  EuclideanHomography off = at;
  off.translation_over_distance.x() = 0.003;  // 1.5 mm
  EuclideanHomography turned = at;
  turned.rotation = Eigen::AngleAxisd(0.002, Eigen::Vector3d::UnitX()).toRotationMatrix();
  const auto state_after = [&](double stamp, const EuclideanHomography& motion) {
    servo.add({ stamp, motion, 0.5, 100 });
    return servo.report().state;
  };
  EXPECT_EQ(state_after(0.0, at), ServoState::SERVOING);
  EXPECT_EQ(state_after(0.4, at), ServoState::SERVOING);
  EXPECT_EQ(state_after(0.5, off), ServoState::SERVOING);  // the dwell begins anew
  EXPECT_EQ(state_after(0.6, at), ServoState::SERVOING);
  EXPECT_EQ(state_after(1.0, turned), ServoState::SERVOING);
  EXPECT_EQ(state_after(1.1, at), ServoState::SERVOING);
  servo.addLoss(1.2, "covered");
  EXPECT_EQ(state_after(1.3, at), ServoState::SERVOING);
  EXPECT_EQ(state_after(1.79, at), ServoState::SERVOING);
  EXPECT_EQ(state_after(1.81, at), ServoState::CONVERGED);
  EXPECT_NEAR(servo.report().translation_error, 0.0005, 1e-9);
}

TEST(Servo25d, KeepsTheDistanceItWasTold)
{
  Servo25d servo(target(), Servo25dParams());
  const EuclideanHomography motion{ Eigen::Matrix3d::Identity(), { 0.1, 0.0, 0.0 }, Eigen::Vector3d::UnitZ() };
  servo.add({ 0.0, motion, std::nullopt, 100 });
  EXPECT_NEAR(servo.report().translation_error, 0.05, 1e-12);
  EXPECT_NE(servo.report().reason.find("if its plane is 0.50 m away"), std::string::npos);
  servo.add({ 0.1, motion, 0.8, 100 });
  EXPECT_NEAR(servo.report().translation_error, 0.08, 1e-12);
  servo.add({ 0.2, motion, std::nullopt, 100 });
  EXPECT_NEAR(servo.report().translation_error, 0.08, 1e-12);
}

TEST(Servo25d, LeadsThePointStraightWithTheRightDistance)
{
  Servo25dParams params;
  params.margin = 0.02;
  Plant plant(someCamera(), Eigen::Vector3d(0.1, 0.2, 1.0).normalized(), params);
  plant.tell_distance = true;
  const Eigen::Vector2d begin = plant.point();
  const Eigen::Vector2d way = target().point - begin;
  while (plant.time() < 10.0)
  {
    plant.step();
    const Eigen::Vector2d gone = plant.point() - begin;
    const double aside = std::abs(gone.x() * way.y() - gone.y() * way.x()) / way.norm();
    EXPECT_LT(aside, 3.0) << plant.time();
  }
  EXPECT_LT((plant.point() - target().point).norm(), 0.1);
}

/** Feed-forward makes up for the time that images take. */
TEST(Servo25d, ErrorsDecayAsCommanded)
{
  Servo25dParams params;
  params.gain = 3.0;
  params.near_gain = 3.0;
  params.margin = 0.0;
  const auto decay = [&](bool feed_forward) {
    Plant plant(someCamera(), Eigen::Vector3d::UnitZ(), params);
    plant.limited = false;
    plant.tell_distance = true;
    plant.feed_forward = feed_forward;
    while (plant.step().isZero())
    {
    }
    const double begin = plant.time() - Plant::CONTROL;
    const double first = Eigen::AngleAxisd(someCamera().linear()).angle();
    double worst = 0.0;
    while (plant.time() < begin + 1.0)
    {
      plant.step();
      const double expected = first * std::exp(-params.gain * (plant.time() - begin));
      worst = std::max(worst, std::abs(plant.rotationLeft() - expected) / first);
    }
    return worst;
  };
  EXPECT_LT(decay(true), 0.02);
  EXPECT_GT(decay(false), 0.05);
}

/** Wrong distances change speed, not stability; the chosen point stays in sight and the limits are kept. */
RC_GTEST_PROP(Servo25d, ConvergesWithTheDistanceWrongByAFactorOfThree, (std::uint64_t seed))
{
  Rng rng(seed);
  const Eigen::Vector3d normal = test::randomRotation(rng, 0.4) * Eigen::Vector3d::UnitZ();
  const Eigen::Isometry3d start = randomCamera(rng, normal);
  for (const double factor : { 1.0 / 3.0, 1.0, 3.0 })
  {
    Servo25dParams params;
    params.distance = factor * DISTANCE;
    params.translation_tolerance = 0.001 * factor;  // it is measured by the wrong distance
    Plant plant(start, normal, params);
    Twist last = Twist::Zero();
    while (plant.servo.report().state != ServoState::CONVERGED)
    {
      RC_ASSERT(plant.time() < 60.0);
      const Twist twist = plant.step();
      RC_ASSERT(twist.head<3>().norm() <= plant.limits.max_speed * (1.0 + 1e-9));
      RC_ASSERT(twist.tail<3>().norm() <= plant.limits.max_turn_rate * (1.0 + 1e-9));
      const Twist jump = twist - last;
      RC_ASSERT(jump.head<3>().norm() <= plant.limits.max_acceleration * Plant::CONTROL * (1.0 + 1e-9));
      RC_ASSERT(jump.tail<3>().norm() <= plant.limits.max_turn_acceleration * Plant::CONTROL * (1.0 + 1e-9));
      const Eigen::Vector2d point = plant.point();
      RC_ASSERT(point.x() >= 0.0 && point.x() <= WIDTH - 1.0 && point.y() >= 0.0 && point.y() <= HEIGHT - 1.0);
      last = twist;
    }
    RC_ASSERT(plant.camera().translation().norm() < 0.0015);
    RC_ASSERT(plant.rotationLeft() < 0.0016);
  }
}

TEST(Servo25d, TakesOtherGainsWhileItDrives)
{
  Servo25dParams params;
  params.gain = params.near_gain = 1.0;
  const auto twist = [&](double gain) {
    Servo25d servo(target(), params);
    servo.add({ 1.0, { Eigen::Matrix3d::Identity(), { 0.02, 0.01, 0.1 }, Eigen::Vector3d::UnitZ() }, DISTANCE, 50 });
    servo.setGains(gain, gain);
    return servo.command(1.0);
  };
  EXPECT_GT(twist(1.0).norm(), 0.01);
  EXPECT_LT((twist(2.5) - 2.5 * twist(1.0)).norm(), 1e-9);
  Servo25d servo(target(), params);
  EXPECT_THROW(servo.setGains(2.0, 1.0), std::invalid_argument) << "near_gain is the smaller one";
  EXPECT_THROW(servo.setGains(0.0, 1.0), std::invalid_argument);
}

TEST(Servo25d, ConvergesWithArmsThatFollowLate)
{
  const Eigen::Vector3d normal = Eigen::Vector3d(0.1, 0.2, 1.0).normalized();
  for (const double dead_time : { 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4 })
  {
    for (std::uint64_t seed = 1; seed <= 16; ++seed)
    {
      Rng rng(seed);
      Plant plant(randomCamera(rng, normal), normal, Servo25dParams());
      plant.dead_time = dead_time;
      while (plant.servo.report().state != ServoState::CONVERGED && plant.time() < 60.0)
      {
        plant.step();
        ASSERT_NE(plant.servo.report().state, ServoState::FAILED)
            << dead_time << " s, seed " << seed << ", at " << plant.time() << " s: " << plant.servo.report().reason;
      }
      EXPECT_LT(plant.camera().translation().norm(), 0.0015) << dead_time << " s, seed " << seed;
    }
  }
}

// ---- what looks like the view and is not

class Servo25dCopiesTest : public testing::Test
{
protected:
  static Plant start()
  {
    Eigen::Isometry3d camera(Eigen::AngleAxisd(0.2, Eigen::Vector3d(0.3, 0.5, 0.8).normalized()));
    camera.translation() << 0.12, -0.08, -0.1;
    return Plant(camera, Eigen::Vector3d(0.1, 0.2, -1.0).normalized() * -1.0, Servo25dParams());
  }
  static void run(Plant& plant, double duration)
  {
    const double end = plant.time() + duration;
    while (plant.time() < end && plant.servo.report().state != ServoState::CONVERGED &&
           plant.servo.report().state != ServoState::FAILED)
    {
      plant.step();
    }
  }
};

TEST_F(Servo25dCopiesTest, IsNotDeceivedByAPictureOfTheViewHeldBefore)
{
  for (const double begin : { 0.3, 0.8, 1.5 })
  {
    Plant plant = start();
    run(plant, begin);
    const Eigen::Vector3d before = plant.camera().translation();
    plant.shown = [](const Eigen::Isometry3d&) {
      return Eigen::Isometry3d(Eigen::Isometry3d::Identity());
    };
    run(plant, 20.0);
    EXPECT_EQ(plant.servo.report().state, ServoState::FAILED) << begin << ": " << plant.servo.report().reason;
    EXPECT_LT((plant.camera().translation() - before).norm(), 0.02) << begin;
  }
}

TEST_F(Servo25dCopiesTest, IsNotDeceivedByAPictureThatComesWhileItBrakesUnseen)
{
  for (const double begin : { 0.4, 0.8, 1.2 })
  {
    Plant plant = start();
    run(plant, begin);
    plant.visible = false;
    for (double unseen = 0.0; unseen < 0.4; unseen += Plant::CONTROL)
    {
      plant.step();
      plant.servo.addLoss(plant.time() - Plant::DELAY, "covered");
    }
    plant.visible = true;
    plant.shown = [](const Eigen::Isometry3d&) {
      return Eigen::Isometry3d(Eigen::Isometry3d::Identity());
    };
    run(plant, 20.0);
    EXPECT_EQ(plant.servo.report().state, ServoState::FAILED)
        << begin << ": " << plant.camera().translation().norm() << " m off, " << plant.servo.report().reason;
  }
}

TEST_F(Servo25dCopiesTest, ConvergesWhenThePictureIsTakenAway)
{
  for (const double begin : { 0.3, 1.5 })
  {
    Plant plant = start();
    run(plant, begin);
    plant.shown = [](const Eigen::Isometry3d&) {
      return Eigen::Isometry3d(Eigen::Isometry3d::Identity());
    };
    run(plant, 2.0);
    plant.shown = nullptr;
    run(plant, 30.0);
    EXPECT_EQ(plant.servo.report().state, ServoState::CONVERGED) << begin << ": " << plant.servo.report().reason;
    EXPECT_LT(plant.camera().translation().norm(), 0.0012);
  }
}

TEST_F(Servo25dCopiesTest, StandsWhenTheCameraSendsOneImageAgainAndAgain)
{
  constexpr double FARTHEST = 0.18;  // the arm may be one that follows late [m]
  for (const double begin : { 0.0, 0.3, 0.8 })
  {
    Plant plant = start();
    run(plant, begin);
    const Eigen::Isometry3d before = plant.camera();
    plant.shown = [before](const Eigen::Isometry3d&) {
      return before;
    };
    run(plant, 30.0);
    EXPECT_EQ(plant.servo.report().state, ServoState::FAILED) << begin << ": " << plant.servo.report().reason;
    EXPECT_LT((plant.camera().translation() - before.translation()).norm(), FARTHEST) << begin;
  }
}

TEST_F(Servo25dCopiesTest, StandsWhenTheCameraIsMountedTheOtherWayRound)
{
  Plant plant = start();
  plant.shown = [](const Eigen::Isometry3d& camera) {
    return Eigen::Isometry3d(camera * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()));
  };
  const Eigen::Isometry3d before = plant.camera();
  run(plant, 40.0);
  EXPECT_EQ(plant.servo.report().state, ServoState::FAILED) << plant.servo.report().reason;
  EXPECT_LT((plant.camera().translation() - before.translation()).norm(), 0.2);
}

TEST_F(Servo25dCopiesTest, ADryRunDoesNotKnowHowTheCameraMoves)
{
  Plant plant = start();
  plant.feed_forward = false;
  run(plant, 60.0);
  EXPECT_EQ(plant.servo.report().state, ServoState::CONVERGED) << plant.servo.report().reason;
}

TEST(Servo25d, NumbersThatAreNoneDriveNothing)
{
  Servo25d servo(target(), Servo25dParams());
  EuclideanHomography motion{ Eigen::Matrix3d::Identity(), { 0.1, 0.0, 0.0 }, Eigen::Vector3d::UnitZ() };
  motion.translation_over_distance.x() = std::numeric_limits<double>::quiet_NaN();
  servo.add({ 0.0, motion, std::nullopt, 100 });
  EXPECT_TRUE(servo.command(0.0).isZero());
  EXPECT_EQ(servo.report().state, ServoState::ACQUIRING);
  EXPECT_NE(servo.report().reason.find("not finite"), std::string::npos);
}

}  // namespace view_servo
