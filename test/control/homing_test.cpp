// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/homing.h"

#include "support/synthetic_scene.h"
#include "support/textured_plane.h"
#include "view_servo/control/velocity_limiter.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double DEGREE = M_PI / 180.0;
constexpr double CONTROL_PERIOD =
    0.05;  // [s]; odometry comes as often, every fourth time an image, every tenth matches

Eigen::Isometry3d mounted(const PlanarPose& on_base)
{
  Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();
  Eigen::Matrix3d optical;
  optical << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  camera.linear() = Eigen::AngleAxisd(on_base.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix() * optical;
  camera.translation() << on_base.x, on_base.y, 1.0;
  return camera;
}

HeadingEvidence equallyTrusted(const Correspondences& matches)
{
  return { matches, std::vector<double>(matches.size(), 1.0) };
}

/**
 * What a camera stored when its base was in the origin of odometry's frame: below the horizon a wall 1.8 m away, above
 * it another, 3.5 m away. A single wall would leave open what is turn and what is motion to the side.
 */
class Walls
{
public:
  explicit Walls(const PlanarPose& camera_on_base = {})
  {
    target_.image = test::texturedPicture(1, cv::Size(WIDTH, HEIGHT));
    target_.camera.width = WIDTH;
    target_.camera.height = HEIGHT;
    target_.camera.k << 260.0, 0.0, 159.5, 0.0, 260.0, 119.5, 0.0, 0.0, 1.0;
    target_.view_camera = target_.camera;
    target_.mount = CameraMount(mounted(camera_on_base));
    Rng rng(1);
    for (int i = 0; i < 200; ++i)
    {
      corners_.push_back(randomPixel(rng));
    }
  }

  const HomingTarget& target() const
  {
    return target_;
  }

  cv::Mat image(const PlanarPose& base) const
  {
    // What is as high as the camera stays on the horizon: neither wall hides the other.
    const cv::Size size(WIDTH, HEIGHT);
    cv::Mat result = test::warpedPicture(target_.image, homography(base, FAR), size);
    const cv::Rect below(0, HEIGHT / 2, WIDTH, HEIGHT / 2);
    test::warpedPicture(target_.image, homography(base, NEAR), size)(below).copyTo(result(below));
    return result;
  }

  /** Of some of the view's corners, exact to 0.3 px, and of unrelated places. */
  Correspondences matches(const PlanarPose& base, int good, int random, Rng& rng) const
  {
    Correspondences pairs;
    while (static_cast<int>(pairs.size()) < good)
    {
      const Eigen::Vector2d& reference = corners_[uniformIndex(rng, corners_.size())];
      const Eigen::Matrix3d h = homography(base, reference.y() < 0.5 * HEIGHT ? FAR : NEAR);
      Eigen::Vector2d current = (h * reference.homogeneous()).hnormalized();
      current.x() += 0.3 * gaussian(rng);
      current.y() += 0.3 * gaussian(rng);
      if (current.x() >= 0.0 && current.y() >= 0.0 && current.x() < WIDTH && current.y() < HEIGHT)
      {
        pairs.push_back({ reference, current });
      }
    }
    for (int i = 0; i < random; ++i)
    {
      const Eigen::Vector2d reference = randomPixel(rng);
      pairs.push_back({ reference, randomPixel(rng) });
    }
    return pairs;
  }

  static constexpr int WIDTH = 320;
  static constexpr int HEIGHT = 240;

private:
  static constexpr double NEAR = 1.8;  // [m]
  static constexpr double FAR = 3.5;   // [m]

  static Eigen::Vector2d randomPixel(Rng& rng)
  {
    const double u = uniform(rng, 0.0, WIDTH - 1.0);
    return { u, uniform(rng, 0.0, HEIGHT - 1.0) };
  }

  /** Stored -> seen, of a wall at a distance from the stored camera. */
  Eigen::Matrix3d homography(const PlanarPose& base, double distance) const
  {
    const Eigen::Isometry3d stored = mounted(target_.mount.on_base);
    Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
    moved.linear() = Eigen::AngleAxisd(base.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    moved.translation() << base.x, base.y, 0.0;
    const Eigen::Isometry3d motion = (moved * stored).inverse() * stored;
    const Eigen::Matrix3d& k = target_.camera.k;
    return k * (motion.linear() + motion.translation() * Eigen::RowVector3d::UnitZ() / distance) * k.inverse();
  }

  HomingTarget target_;
  Points corners_;  // pixels of the view
};

/** A base with a camera before the walls, homing on the view, in steps of CONTROL_PERIOD. */
class Drive
{
public:
  Drive(const Walls& walls, const HomingParams& params, const PlanarPose& start)
    : Drive(walls, params, start, walls.target())
  {
  }

  Drive(const Walls& walls, const HomingParams& params, const PlanarPose& start, const HomingTarget& target)
    : walls_(walls), homing_(makeHoming(params, target)), limiter_(VelocityLimits()), base_(start)
  {
  }

  Homing& homing()
  {
    return *homing_;
  }
  const HomingReport& report() const
  {
    return homing_->report();
  }
  const PlanarPose& base() const
  {
    return base_;
  }
  double travelled() const
  {
    return travelled_;
  }
  /** Whether it knows where to go. */
  bool follows() const
  {
    return report().state == HomingState::APPROACHING || report().state == HomingState::NEAR ||
           report().state == HomingState::DOCKING;
  }
  bool ended() const
  {
    return report().state == HomingState::ARRIVED || report().state == HomingState::FAILED;
  }

  /** What the camera and the matcher see instead of the walls. */
  enum class Sight
  {
    WALLS,
    NO_MATCHES,      // images of something else, and a matcher that finds nothing
    RANDOM_MATCHES,  // the same, and one that finds anything
    WRONG_MATCHES,   // images of the walls and any matches
    UNMATCHED,       // images of the walls, but the matcher finds nothing
    NOISY,           // the walls in bad light
    BLANK            // black images and no matches
  };

  /** Somebody else drives the base from now on. @param velocity in its frame [m/s, rad/s]. */
  void push(const BaseVelocity& velocity)
  {
    pushed_ = velocity;
  }

  void step(Sight sight = Sight::WALLS)
  {
    homing_->addOdometry(time(), base_);
    if (steps_ % 4 == 0)
    {
      const bool blank = sight == Sight::BLANK;
      const bool elsewhere = sight == Sight::NO_MATCHES || sight == Sight::RANDOM_MATCHES;
      cv::Mat image = blank ? black_ : elsewhere ? something_else_ : walls_.image(base_);
      if (sight == Sight::NOISY)
      {
        image = test::disturbed(image, 1.0, 0.0, 20.0, static_cast<std::uint64_t>(steps_ + 1));
      }
      homing_->addImage(time(), image);
    }
    if (steps_ % 10 == 0)
    {
      const bool any = sight == Sight::RANDOM_MATCHES || sight == Sight::WRONG_MATCHES;
      const Correspondences pairs =
          walls_.matches(base_, sight == Sight::WALLS || sight == Sight::NOISY ? 60 : 0, any ? 60 : 0, rng_);
      homing_->addMatches(time(), equallyTrusted(pairs));
    }
    const BaseVelocity wanted = homing_->command();
    if (wanted.isZero())
    {
      limiter_.stop();
    }
    const BaseVelocity motion = CONTROL_PERIOD * pushed_.value_or(limiter_.next(wanted, CONTROL_PERIOD));
    base_ = compose(base_, { motion.x(), motion.y(), motion.z() });
    travelled_ += motion.head<2>().norm();
    ++steps_;
  }

  void runFor(double duration, Sight sight = Sight::WALLS)
  {
    const double end = time() + duration;
    while (time() < end && !ended())
    {
      step(sight);
    }
  }

  double time() const
  {
    return 10.0 + CONTROL_PERIOD * steps_;
  }

private:
  const Walls& walls_;
  std::unique_ptr<Homing> homing_;
  BaseVelocityLimiter limiter_;
  cv::Mat black_ = cv::Mat(Walls::HEIGHT, Walls::WIDTH, CV_8UC1, cv::Scalar(0));
  cv::Mat something_else_ = test::texturedPicture(99, cv::Size(Walls::WIDTH, Walls::HEIGHT));
  Rng rng_{ 5 };
  std::optional<BaseVelocity> pushed_;
  PlanarPose base_;
  double travelled_ = 0.0;
  int steps_ = 0;
};

std::string messageOf(const HomingParams& params, const HomingTarget& target)
{
  try
  {
    makeHoming(params, target);
  }
  catch (const std::invalid_argument& error)
  {
    return error.what();
  }
  return "";
}

/** With fewer points to track, as they are images of a quarter of the usual size. */
HomingParams servoParams()
{
  HomingParams params;
  params.tracker.max_landmarks = 80;
  params.docking_displacement = 10.0;
  return params;
}

HomingParams thesisParams()
{
  HomingParams params;
  params.mode = HomingMode::THESIS;
  return params;
}

}  // namespace

// ---- what is refused

TEST(MakeHoming, RefusesBadParametersNamingAllFaults)
{
  const Walls walls;
  HomingParams params;
  params.vote.bins = 0;
  params.hypotheses.memory = 2.0;
  params.arrival.drop = 0.0;
  params.tracker.window = 20;
  params.lost_timeout = 0.0;
  params.approach.gain = -1.0;
  params.approach.turn_gain = 0.0;
  params.blind_speed = 0.0;
  params.approach.distance_tolerance = 0.0;
  params.approach.yaw_tolerance = 0.0;
  params.dwell = -0.1;
  params.arrival_distance = 0.0;
  params.arrival_yaw = 0.0;
  params.docking_displacement = 0.0;
  params.min_similarity = 1.0;
  params.step = 0.0;
  params.near_step = 0.0;
  params.step_speed = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(params.validate().size(), 18U);
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    params.mode = mode;
    const std::string message = messageOf(params, walls.target());
    for (const char* name :
         { "heading_bins", "memory", "arrival_drop", "tracking_window", "lost_timeout", "\n  gain", "turn_gain",
           "blind_speed", "distance_tolerance", "yaw_tolerance", "dwell", "arrival_distance", "arrival_yaw",
           "docking_displacement", "min_similarity", "\n  step ", "near_step", "step_speed" })
    {
      EXPECT_NE(message.find(name), std::string::npos) << name << " in: " << message;
    }
  }
  EXPECT_TRUE(HomingParams().validate().empty());
}

TEST(MakeHoming, RefusesATargetThatLacksSomething)
{
  const Walls walls;
  EXPECT_EQ(messageOf(HomingParams(), walls.target()), "");
  HomingTarget target = walls.target();
  target.camera.k.setZero();
  EXPECT_NE(messageOf(HomingParams(), target).find("calibrated"), std::string::npos);
  target = walls.target();
  target.image = cv::Mat();
  EXPECT_NE(messageOf(HomingParams(), target).find("image"), std::string::npos);
  target.image = cv::Mat(240, 320, CV_8UC3, cv::Scalar(1, 2, 3));
  EXPECT_NE(messageOf(HomingParams(), target).find("grey"), std::string::npos);
}

TEST(Homing, RefusesImagesOfAnotherSize)
{
  const Walls walls;
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    HomingParams params;
    params.mode = mode;
    const auto homing = makeHoming(params, walls.target());
    homing->addOdometry(1.0, {});
    EXPECT_THROW(homing->addImage(1.0, test::texturedPicture(1, cv::Size(Walls::WIDTH, Walls::HEIGHT - 2))),
                 std::invalid_argument);
    EXPECT_NO_THROW(homing->addImage(1.1, test::texturedPicture(1, cv::Size(Walls::WIDTH, Walls::HEIGHT))));
  }
}

// ---- before anything is known

TEST(Homing, StandsStillUntilItKnowsWhereToGo)
{
  const Walls walls;
  const PlanarPose base{ -0.5, 0.2, 0.0 };
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    HomingParams params;
    params.mode = mode;
    const auto homing = makeHoming(params, walls.target());
    EXPECT_TRUE(homing->command().isZero());
    EXPECT_EQ(homing->report().state, HomingState::ACQUIRING);
    EXPECT_TRUE(std::isnan(homing->report().heading));
    EXPECT_TRUE(std::isnan(homing->report().distance));
    homing->addOdometry(1.0, base);
    EXPECT_TRUE(homing->command().isZero());
    for (int i = 0; i < 5; ++i)
    {
      homing->addOdometry(1.1 + 0.1 * i, base);
      homing->addImage(1.1 + 0.1 * i, walls.image(base));
      EXPECT_TRUE(homing->command().isZero());
      EXPECT_EQ(homing->report().state, HomingState::ACQUIRING);
      EXPECT_EQ(homing->report().stamp, 1.1 + 0.1 * i);
    }
  }
}

TEST(Homing, MatchesWithoutOdometryOfTheirTimeSayNothing)
{
  const Walls walls;
  const PlanarPose base{ -0.5, 0.2, 0.0 };
  const auto homing = makeHoming(HomingParams(), walls.target());
  Rng rng(1);
  for (int i = 0; i < 5; ++i)
  {
    homing->addMatches(0.5 + 0.1 * i, equallyTrusted(walls.matches(base, 60, 0, rng)));
  }
  homing->addOdometry(1.0, base);
  for (int i = 0; i < 5; ++i)
  {
    homing->addMatches(0.5 + 0.1 * i, equallyTrusted(walls.matches(base, 60, 0, rng)));
  }
  EXPECT_TRUE(homing->command().isZero());
  EXPECT_TRUE(homing->report().histogram.empty());
}

TEST(Homing, RandomMatchesAreNotFollowed)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.5, 0.2, 0.0 });
  run.runFor(8.0, Drive::Sight::RANDOM_MATCHES);
  EXPECT_EQ(run.report().state, HomingState::ACQUIRING);
  EXPECT_EQ(run.travelled(), 0.0);
  EXPECT_FALSE(run.report().at_view);
  run.runFor(4.0, Drive::Sight::RANDOM_MATCHES);
  EXPECT_EQ(run.report().state, HomingState::FAILED);
  EXPECT_EQ(run.report().reason, "the view was not found");
  EXPECT_EQ(run.travelled(), 0.0);
}

TEST(Homing, GivesUpWhenTheViewIsNotFound)
{
  const Walls walls;
  for (const HomingMode mode : { HomingMode::SERVO, HomingMode::THESIS })
  {
    HomingParams params;
    params.mode = mode;
    params.lost_timeout = 3.0;
    Drive run(walls, params, { -0.5, 0.2, 0.0 });
    run.runFor(2.5, Drive::Sight::NO_MATCHES);
    EXPECT_EQ(run.report().state, HomingState::ACQUIRING);
    run.runFor(2.0, Drive::Sight::NO_MATCHES);
    EXPECT_EQ(run.report().state, HomingState::FAILED) << (mode == HomingMode::THESIS ? "thesis" : "servo");
    EXPECT_NE(run.report().reason, "");
    EXPECT_EQ(run.travelled(), 0.0);
  }
}

// ---- by matches alone

TEST(Homing, OneSetOfMatchesIsNotFollowed)
{
  const Walls walls;
  const PlanarPose base{ -0.5, 0.2, 0.1 };
  const auto homing = makeHoming(HomingParams(), walls.target());
  Rng rng(2);
  homing->addOdometry(1.0, base);
  homing->addImage(1.0, walls.image(base));
  homing->addMatches(1.0, equallyTrusted(walls.matches(base, 60, 20, rng)));
  EXPECT_TRUE(homing->command().isZero());
  homing->addMatches(1.0, equallyTrusted(walls.matches(base, 60, 20, rng)));
  homing->addImage(1.0, walls.image(base));
  EXPECT_FALSE(homing->command().isZero());
}

TEST(Homing, MatchesGiveTheDirectionInBaseLink)
{
  // Also of a camera that looks to the left and is not in the middle of the base.
  for (const PlanarPose& on_base : { PlanarPose{}, PlanarPose{ 0.2, -0.1, 0.6 } })
  {
    const Walls walls(on_base);
    const PlanarPose base{ -0.5, -0.3, 0.15 };
    const PlanarPose goal = inverse(base);  // seen from the base
    HomingParams params;
    params.hypotheses.assumed_distance = walls.target().mount.ofCamera(goal).distance();
    const auto homing = makeHoming(params, walls.target());
    Rng rng(3);
    homing->addOdometry(1.0, base);
    for (int i = 0; i < 2; ++i)
    {
      homing->addMatches(1.0, equallyTrusted(walls.matches(base, 60, 20, rng)));
    }
    // In this image the view's points are not found.
    homing->addImage(1.0, test::texturedPicture(99, cv::Size(Walls::WIDTH, Walls::HEIGHT)));
    EXPECT_EQ(homing->report().state, HomingState::APPROACHING);
    const BaseVelocity command = homing->command();
    EXPECT_NEAR(std::atan2(command.y(), command.x()), goal.heading(), 2.0 * DEGREE);
    EXPECT_NEAR(command.head<2>().norm(), params.blind_speed, 1e-9);
    EXPECT_NEAR(command.z(), params.approach.turn_gain * goal.yaw, 0.5 * DEGREE);
    const std::vector<double>& votes = homing->report().histogram;
    ASSERT_EQ(votes.size(), static_cast<std::size_t>(params.vote.bins));
    // They are cast by the camera, which need not move as the base does where both turn.
    const double voted =
        M_PI * (std::max_element(votes.begin(), votes.end()) - votes.begin()) / static_cast<double>(votes.size() - 1) -
        0.5 * M_PI;
    const double expected = on_base.yaw + walls.target().mount.ofCamera(goal).heading();
    EXPECT_NEAR(std::remainder(voted - expected, M_PI), 0.0, 2.0 * DEGREE);
    EXPECT_NEAR(homing->report().heading, goal.heading(), 2.0 * DEGREE);
    EXPECT_NEAR(homing->report().yaw_error, goal.yaw, 0.5 * DEGREE);
    EXPECT_GT(homing->report().confidence, 0.7);
    EXPECT_LE(homing->report().confidence, 1.0);
  }
}

// ---- the whole way

TEST(Homing, Arrives)
{
  const std::vector<std::pair<PlanarPose, PlanarPose>> cases{ { {}, { -0.5, -0.3, 0.12 } },
                                                              { { 0.2, -0.1, 0.3 }, { 0.3, 0.1, -0.1 } } };
  for (const auto& [on_base, start] : cases)
  {
    const Walls walls(on_base);
    Drive run(walls, servoParams(), start);
    run.runFor(40.0);
    ASSERT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
    EXPECT_TRUE(run.report().at_view);
    EXPECT_LE(run.report().distance, servoParams().approach.distance_tolerance);
    EXPECT_LE(std::abs(run.report().yaw_error), servoParams().approach.yaw_tolerance);
    EXPECT_LT(run.base().distance(), 0.008);
    EXPECT_LT(std::abs(run.base().yaw), 0.4 * DEGREE);
    EXPECT_LT(run.travelled(), 1.5 * start.distance());
    EXPECT_GT(run.report().similarity, 0.9);
    // It has ended: whatever comes.
    EXPECT_TRUE(run.homing().command().isZero());
    for (int i = 0; i < 10; ++i)
    {
      run.step(Drive::Sight::BLANK);
    }
    EXPECT_EQ(run.report().state, HomingState::ARRIVED);
    EXPECT_TRUE(run.homing().command().isZero());
  }
}

TEST(Homing, ReportsTheWayThatIsLeft)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.6, -0.3, 0.1 });
  run.runFor(1.2);
  int compared = 0;
  while (run.base().distance() > 0.1 && run.time() < 30.0)
  {
    const PlanarPose goal = inverse(run.base());  // which the next image is taken from
    run.step();
    EXPECT_NEAR(run.report().heading, goal.heading(), 4.0 * DEGREE);
    EXPECT_NEAR(run.report().yaw_error, goal.yaw, 1.0 * DEGREE);
    EXPECT_LE(run.report().roi_min, run.report().heading);
    EXPECT_GE(run.report().roi_max, run.report().heading);
    EXPECT_FALSE(run.report().at_view);
    EXPECT_TRUE(run.follows());
    if (run.travelled() > 0.3)
    {
      EXPECT_NEAR(run.report().distance, goal.distance(), 0.4 * goal.distance());  // odometry has told the scale
      ++compared;
    }
    run.runFor(0.15);
  }
  EXPECT_GT(compared, 3);
}

TEST(Homing, StatesFollowTheDisplacement)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.6, -0.1, 0.1 });
  std::vector<HomingState> states{ HomingState::ACQUIRING };
  while (states.back() != HomingState::DOCKING && run.time() < 40.0)
  {
    run.step();
    if (run.report().state != states.back())
    {
      states.push_back(run.report().state);
    }
  }
  EXPECT_LE(run.report().displacement, servoParams().docking_displacement);
  EXPECT_GT(run.report().displacement, 0.7 * servoParams().docking_displacement);
  EXPECT_EQ(states, (std::vector<HomingState>{ HomingState::ACQUIRING, HomingState::APPROACHING, HomingState::NEAR,
                                               HomingState::DOCKING }));
}

TEST(Homing, EndsOnlyWhereTheViewsAreSimilar)
{
  // Noise makes the images less alike than the place is: whether that will do is a question of the parameter.
  const Walls walls;
  for (const double least : { 0.3, 0.97 })
  {
    HomingParams params = servoParams();
    params.min_similarity = least;
    params.approach.distance_tolerance = 0.01;
    params.approach.yaw_tolerance = 0.01;
    Drive run(walls, params, { -0.2, 0.05, 0.0 });
    run.runFor(6.0, Drive::Sight::NOISY);
    EXPECT_GT(run.report().similarity, 0.3);
    EXPECT_LT(run.report().similarity, 0.97) << run.report().distance;
    EXPECT_LT(run.base().distance(), 0.02);
    EXPECT_EQ(run.report().state == HomingState::ARRIVED, least == 0.3) << run.report().reason;
    EXPECT_EQ(run.report().at_view, least == 0.3);
  }
}

TEST(Homing, StaysAtTheViewUntilItMayEnd)
{
  const Walls walls;
  HomingParams params = servoParams();
  params.dwell = 4.0;
  Drive run(walls, params, { -0.2, 0.05, 0.0 });
  while (run.base().distance() > 0.008 && run.time() < 30.0)
  {
    run.step();
  }
  ASSERT_TRUE(run.follows());
  double furthest = 0.0;
  const double since = run.time();
  while (!run.ended() && run.time() < since + 8.0)
  {
    run.step();
    furthest = std::max(furthest, run.base().distance());
  }
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  EXPECT_GT(run.time() - since, params.dwell - 0.3);  // it cannot have been within the tolerances for long before
  EXPECT_LT(furthest, 0.015);
}

TEST(Homing, StaysWhereItIsWhenItStartsAtTheView)
{
  const Walls walls;
  for (const PlanarPose& start : { PlanarPose{}, PlanarPose{ -0.03, 0.01, 0.0 } })
  {
    Drive run(walls, servoParams(), start);
    run.runFor(12.0);
    EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
    EXPECT_LT(run.travelled(), 0.03 + 2.0 * start.distance());
  }
}

// ---- when the view is lost

TEST(Homing, WaitsWhileTheImageIsBlankAndGoesOn)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.5, 0.1, 0.0 });
  run.runFor(2.0);
  ASSERT_TRUE(run.follows());
  run.runFor(0.5, Drive::Sight::BLANK);
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_NE(run.report().reason, "");
  const double travelled = run.travelled();
  run.runFor(2.0, Drive::Sight::BLANK);
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_EQ(run.travelled(), travelled);
  run.runFor(40.0);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
}

std::string nameOf(Drive::Sight sight)
{
  switch (sight)
  {
    case Drive::Sight::WALLS:
      return "Walls";
    case Drive::Sight::NO_MATCHES:
      return "NoMatches";
    case Drive::Sight::RANDOM_MATCHES:
      return "RandomMatches";
    case Drive::Sight::WRONG_MATCHES:
      return "WrongMatches";
    case Drive::Sight::UNMATCHED:
      return "Unmatched";
    case Drive::Sight::NOISY:
      return "Noisy";
    case Drive::Sight::BLANK:
      return "Blank";
  }
  return "";
}

class LostView : public ::testing::TestWithParam<Drive::Sight>
{
};

TEST_P(LostView, StopsTheBaseAndEndsHoming)
{
  const Walls walls;
  HomingParams params = servoParams();
  params.lost_timeout = 2.0;
  Drive run(walls, params, { -0.6, 0.2, 0.0 });
  run.runFor(1.5);
  ASSERT_TRUE(run.follows());
  ASSERT_FALSE(run.homing().command().isZero());
  run.runFor(1.2, GetParam());
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_TRUE(run.homing().command().isZero());
  EXPECT_GE(run.report().confidence, 0.0);
  EXPECT_LE(run.report().confidence, 1.0);
  run.runFor(2.5, GetParam());
  EXPECT_EQ(run.report().state, HomingState::FAILED);
  EXPECT_EQ(run.report().reason, "the view was lost");
  EXPECT_TRUE(run.homing().command().isZero());
}

INSTANTIATE_TEST_SUITE_P(Homing, LostView,
                         ::testing::Values(Drive::Sight::BLANK, Drive::Sight::NO_MATCHES, Drive::Sight::RANDOM_MATCHES),
                         [](const auto& sight) { return nameOf(sight.param); });

TEST(Homing, NeedsNoMatchesWhileTheViewIsTracked)
{
  const Walls walls;
  for (const Drive::Sight sight : { Drive::Sight::WRONG_MATCHES, Drive::Sight::UNMATCHED })
  {
    Drive run(walls, servoParams(), { -0.7, 0.1, 0.0 });
    run.runFor(2.0);
    ASSERT_TRUE(run.follows());
    ASSERT_GT(run.base().distance(), 0.25);
    run.runFor(15.0, sight);
    EXPECT_EQ(run.report().state, HomingState::ARRIVED) << nameOf(sight) << ": " << run.report().reason;
    EXPECT_LT(run.base().distance(), 0.01) << nameOf(sight);
  }
}

// ---- as the thesis has it

TEST(ThesisHoming, DrivesStepsWithoutTurning)
{
  const Walls walls;
  const PlanarPose start{ -0.4, 0.1, 0.0 };
  Drive run(walls, thesisParams(), start);
  // The first heading comes when the base is seen at rest.
  bool moved = false;
  while (!moved && run.time() < 13.0)
  {
    run.step();
    moved = run.travelled() > 0.0;
  }
  ASSERT_TRUE(moved);
  EXPECT_EQ(run.report().state, HomingState::APPROACHING);
  const double heading = std::atan2(-0.1, 0.4);
  EXPECT_NEAR(run.report().heading, heading, 3.0 * DEGREE);
  // To the end of the step, where it waits for the next heading.
  double speed = 1.0;
  while (speed > 0.0 && run.time() < 16.0)
  {
    const PlanarPose before = run.base();
    run.step();
    speed = compose(inverse(before), run.base()).distance() / CONTROL_PERIOD;
    EXPECT_LE(speed, thesisParams().step_speed + 1e-9);
  }
  const PlanarPose step = compose(inverse(start), run.base());
  EXPECT_NEAR(step.distance(), thesisParams().step, 0.005);
  EXPECT_NEAR(step.heading(), heading, 4.0 * DEGREE);
  EXPECT_EQ(step.yaw, 0.0);
}

TEST(ThesisHoming, StopsNearTheView)
{
  const Walls walls;
  Drive run(walls, thesisParams(), { -0.15, 0.02, 0.0 });
  run.runFor(40.0);
  ASSERT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  EXPECT_TRUE(run.report().at_view);
  EXPECT_LT(run.base().distance(), 0.03);
  EXPECT_EQ(run.base().yaw, 0.0);
  EXPECT_TRUE(run.homing().command().isZero());
}

TEST(ThesisHoming, KeepsTheDirectionOfTheStepThoughTheBaseTurns)
{
  const Walls walls;
  const PlanarPose start{ -0.4, 0.1, 0.0 };
  const auto homing = makeHoming(thesisParams(), walls.target());
  Rng rng(4);
  for (int i = 0; i < 3; ++i)
  {
    homing->addOdometry(1.0 + 0.1 * i, start);
    homing->addImage(1.0 + 0.1 * i, walls.image(start));
    homing->addMatches(1.0 + 0.1 * i, equallyTrusted(walls.matches(start, 60, 20, rng)));
  }
  const BaseVelocity before = homing->command();
  ASSERT_GT(before.norm(), 0.0);
  homing->addOdometry(1.3, { start.x, start.y, 0.3 });
  const BaseVelocity after = homing->command();
  EXPECT_NEAR(std::atan2(after.y(), after.x()), std::atan2(before.y(), before.x()) - 0.3, 1e-9);
  EXPECT_EQ(after.z(), 0.0);
}

// ---- a base that cannot slide

namespace
{
HomingParams differentialParams()
{
  HomingParams params = servoParams();
  params.approach.base = BaseKind::DIFFERENTIAL;
  return params;
}

}  // namespace

TEST(DifferentialHoming, ArrivesWithoutSliding)
{
  const Walls walls({ 0.1, 0.05, 0.0 });
  for (const PlanarPose& start : { PlanarPose{ -0.6, 0.2, 0.1 }, { -0.5, -0.3, -0.2 }, { 0.3, -0.1, 0.15 } })
  {
    Drive run(walls, differentialParams(), start);
    bool told = false;
    while (run.time() < 130.0 && !run.ended())
    {
      run.step();
      ASSERT_EQ(run.homing().command().y(), 0.0);
      told = told || !run.report().manoeuvre.empty();
    }
    EXPECT_EQ(run.report().state, HomingState::ARRIVED)
        << run.report().reason << ", from " << start.x << ' ' << start.y;
    EXPECT_LT(run.base().distance(), 0.01);
    EXPECT_LT(std::abs(run.base().yaw), 0.5 * DEGREE);
    EXPECT_TRUE(told);
  }
}

/** Something walks between, where the view should be in sight: the base stands, and goes on when it has passed. */
TEST(DifferentialHoming, StandsWhileTheViewIsHidden)
{
  const Walls walls;
  Drive run(walls, differentialParams(), { -0.6, 0.1, 0.0 });
  run.runFor(4.0);
  ASSERT_TRUE(run.follows()) << run.report().reason;
  ASSERT_FALSE(run.homing().command().isZero());
  const PlanarPose seen_from = run.base();
  run.runFor(3.0, Drive::Sight::NO_MATCHES);
  EXPECT_EQ(run.report().state, HomingState::LOST);
  EXPECT_LT(compose(inverse(seen_from), run.base()).distance(), 0.06);
  run.runFor(100.0);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED) << run.report().reason;
  EXPECT_LT(run.base().distance(), 0.01);
}

/** For a navigation stack: the truth is odometry's origin. */
TEST(ServoHoming, TellsWhereTheViewIsInMetres)
{
  const Walls walls;
  Drive run(walls, servoParams(), { -0.7, 0.2, 0.05 });
  run.step();
  EXPECT_FALSE(run.report().goal_in_odom);
  double normalized = 0.0;
  int count = 0;
  while (run.time() < 60.0 && !run.ended())
  {
    run.step();
    if (const std::optional<PlanarPose>& goal = run.report().goal_in_odom)
    {
      ++count;
      EXPECT_LT(goal->distance(), 0.15);
      const Eigen::Vector2d error(goal->x, goal->y);
      normalized += error.dot(run.report().goal_covariance.topLeftCorner<2, 2>().inverse() * error);
    }
  }
  EXPECT_GT(count, 20);
  EXPECT_LT(normalized / count, 20.0);
  EXPECT_GT(normalized / count, 0.02);
  ASSERT_TRUE(run.report().goal_in_odom);
  EXPECT_LT(run.report().goal_in_odom->distance(), 0.003);
}

TEST(ServoHoming, LearnsWhereTheViewIsWhenItIsDrivenAwayFromThere)
{
  const Walls walls;
  HomingParams params = servoParams();
  params.dwell = 1e3;  // nobody wants it to arrive
  Drive run(walls, params, {});
  run.push(BaseVelocity::Zero());
  run.runFor(2.0);
  EXPECT_FALSE(run.report().goal_in_odom);
  run.push({ -0.15, 0.03, 0.0 });
  run.runFor(4.0);
  EXPECT_NEAR(run.base().x, -0.6, 0.02);
  ASSERT_TRUE(run.report().goal_in_odom) << run.report().reason;
  EXPECT_LT(run.report().goal_in_odom->distance(), 0.03);
  EXPECT_GE(run.homing().structure().points.size(), 30U);
}

TEST(ServoHoming, KnowsTheDistanceFromTheFirstMatchesOnOnceTheViewIsLearnt)
{
  const Walls walls;
  Drive lesson(walls, servoParams(), { -0.7, 0.2, 0.05 });
  EXPECT_TRUE(lesson.homing().structure().points.empty());
  lesson.runFor(60.0);
  ASSERT_EQ(lesson.report().state, HomingState::ARRIVED);
  HomingTarget target = walls.target();
  target.structure = lesson.homing().structure();
  EXPECT_GE(target.structure.points.size(), 30U);

  Drive run(walls, servoParams(), { -0.5, -0.3, -0.1 }, target);
  run.runFor(0.6);  // two images after the first matches
  ASSERT_TRUE(run.report().goal_in_odom) << run.report().reason;
  EXPECT_LT(run.report().goal_in_odom->distance(), 0.03);
  EXPECT_LT(std::abs(run.report().goal_in_odom->yaw), 0.5 * DEGREE);
  run.runFor(60.0);
  EXPECT_EQ(run.report().state, HomingState::ARRIVED);
  EXPECT_LT(run.base().distance(), 0.005);

  // What is wrong now is not used for long: the view's points are nowhere near where it has them.
  for (StructurePoint& point : target.structure.points)
  {
    point.inverse_depth = point.pixel.x() < 160.0 ? 0.1 : 5.0;
  }
  Drive misled(walls, servoParams(), { -0.5, -0.3, -0.1 }, target);
  misled.runFor(60.0);
  EXPECT_EQ(misled.report().state, HomingState::ARRIVED) << misled.report().reason;
  EXPECT_LT(misled.base().distance(), 0.01);  // as much as moves the view's points by 1.5 px
}

TEST(ServoHoming, ForgetsPointsThatAreNotSeenAtTheView)
{
  const Walls walls;
  Drive lesson(walls, servoParams(), { -0.7, 0.2, 0.05 });
  lesson.runFor(60.0);
  HomingTarget target = walls.target();
  target.structure = lesson.homing().structure();
  // Two things that have gone since the view was stored.
  target.image = target.image.clone();
  const std::vector<Eigen::Vector2d> gone = { { 101.0, 121.0 }, { 201.0, 61.0 } };
  for (const Eigen::Vector2d& at : gone)
  {
    const cv::Rect place(cv::Point2d(at.x() - 20.0, at.y() - 20.0), cv::Size(41, 41));
    test::texturedPicture(33, place.size()).copyTo(target.image(place));
    target.structure.points.push_back({ at, 1.0 / 1.8, 0.003 });
  }
  const auto moved = [&gone](const StructurePoint& point) {
    return std::any_of(gone.begin(), gone.end(),
                       [&](const Eigen::Vector2d& at) { return (point.pixel - at).norm() < 1.0; });
  };
  Drive run(walls, servoParams(), { -0.5, -0.3, -0.1 }, target);
  run.runFor(60.0);
  ASSERT_EQ(run.report().state, HomingState::ARRIVED);
  const ViewStructure learnt = run.homing().structure();
  EXPECT_GE(learnt.points.size(), 30U);
  EXPECT_EQ(std::count_if(learnt.points.begin(), learnt.points.end(), moved), 0);
}

TEST(MakeHoming, RefusesTheThesisWayForABaseThatCannotSlide)
{
  const Walls walls;
  HomingParams params = differentialParams();
  params.mode = HomingMode::THESIS;
  EXPECT_NE(messageOf(params, walls.target()).find("it needs base: holonomic"), std::string::npos);
}

}  // namespace view_servo
