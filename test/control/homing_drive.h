// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/cameras.h"
#include "support/level_cameras.h"
#include "support/textured_plane.h"
#include "view_servo/control/homing.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/random.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace view_servo
{
/** @file A base that homes on a view before walls whose homographies are known. */

constexpr double CONTROL_PERIOD =
    0.05;  // [s]; odometry comes as often, every fourth time an image, every tenth matches

inline HeadingEvidence equallyTrusted(const Correspondences& matches)
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
    target_.mount = CameraMount(test::levelCamera(camera_on_base));
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
    const Eigen::Isometry3d stored = test::levelCamera(target_.mount.on_base);
    const Eigen::Isometry3d motion = (test::onFloor(base) * stored).inverse() * stored;
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
    COPY,            // a picture of the walls as the view shows them, held before the camera
    FROZEN,          // the walls as they were seen when this began
    BLANK            // black images and no matches
  };

  /** Somebody else drives the base from now on. @param velocity in its frame [m/s, rad/s]. */
  void push(const BaseVelocity& velocity)
  {
    pushed_ = velocity;
  }

  /** Somebody puts the base elsewhere, without odometry noticing. */
  void carryTo(const PlanarPose& base)
  {
    odom_ = compose(compose(odom_, base_), inverse(base));
    base_ = base;
  }

  void step(Sight sight = Sight::WALLS)
  {
    frozen_ = sight == Sight::FROZEN ? frozen_.value_or(base_) : std::optional<PlanarPose>();
    const PlanarPose seen_from = sight == Sight::COPY ? PlanarPose() : frozen_.value_or(base_);
    homing_->addOdometry(time(), compose(odom_, base_));
    if (steps_ % 4 == 0)
    {
      const bool blank = sight == Sight::BLANK;
      const bool elsewhere = sight == Sight::NO_MATCHES || sight == Sight::RANDOM_MATCHES;
      cv::Mat image = blank ? black_ : elsewhere ? something_else_ : walls_.image(seen_from);
      if (sight == Sight::NOISY)
      {
        image = test::disturbed(image, 1.0, 0.0, 20.0, static_cast<std::uint64_t>(steps_ + 1));
      }
      homing_->addImage(time(), image);
    }
    if (steps_ % 10 == 0)
    {
      const bool any = sight == Sight::RANDOM_MATCHES || sight == Sight::WRONG_MATCHES;
      const bool walls =
          sight == Sight::WALLS || sight == Sight::NOISY || sight == Sight::COPY || sight == Sight::FROZEN;
      const Correspondences pairs = walls_.matches(seen_from, walls ? 60 : 0, any ? 60 : 0, rng_);
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
  std::optional<PlanarPose> frozen_;
  PlanarPose odom_;  // of the view's base, in odometry's frame
  PlanarPose base_;  // in the frame of the view's base
  double travelled_ = 0.0;
  int steps_ = 0;
};

/** With fewer points to track, as they are images of a quarter of the usual size. */
inline HomingParams servoParams()
{
  HomingParams params;
  params.tracker.max_landmarks = 80;
  params.docking_displacement = 10.0;
  return params;
}

inline HomingParams thesisParams()
{
  HomingParams params;
  params.mode = HomingMode::THESIS;
  return params;
}

/** Of a base that cannot slide. */
inline HomingParams differentialParams()
{
  HomingParams params = servoParams();
  params.approach.base = BaseKind::DIFFERENTIAL;
  return params;
}

}  // namespace view_servo
