// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/homing_trial.h"

#include "sim/renderer.h"
#include "sim/visibility.h"
#include "trials/evidence.h"
#include "trials/trial.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <vector>

namespace view_servo::sim
{
namespace
{
constexpr double MOVES = 0.005;  // slower, a base counts as one that stands [m/s]

/**
 * Draws somebody who walks by from left to right in 2 s, 1.2 m in front of the camera.
 * @param seconds since the person entered the image.
 */
void drawPasserBy(double seconds, const Camera& camera, double camera_height, cv::Mat& image)
{
  constexpr double DURATION = 2.0;
  constexpr double DEPTH = 1.2;
  constexpr double WIDTH = 0.5;
  constexpr double HEIGHT = 1.75;
  if (seconds < 0.0 || seconds > DURATION)
  {
    return;
  }
  const double width = camera.k(0, 0) * WIDTH / DEPTH;
  const double top = camera.k(1, 2) - camera.k(1, 1) * (HEIGHT - camera_height) / DEPTH;
  const double left = -width + seconds / DURATION * (camera.width + width);
  const cv::Rect person = cv::Rect(cv::Point(static_cast<int>(left), std::max(0, static_cast<int>(top))),
                                   cv::Point(static_cast<int>(left + width), camera.height)) &
                          cv::Rect(0, 0, camera.width, camera.height);
  if (person.empty())
  {
    return;
  }
  // Clothes with stripes, which move along.
  for (int v = person.y; v < person.br().y; ++v)
  {
    for (int u = person.x; u < person.br().x; ++u)
    {
      const int stripe = (v / 17 + static_cast<int>(u - left) / 23) % 3;
      image.at<unsigned char>(v, u) = static_cast<unsigned char>(60 + 45 * stripe);
    }
  }
}

}  // namespace

struct HomingTrials::Parts
{
  Parts(const World& world, std::uint64_t seed) : camera(world, {}, seed)
  {
  }

  SimulatedCamera camera;
  PointViewMatcher points{ PointViewMatcherParams() };
  LineViewMatcher lines{ LineMatcherParams() };
  FeatureParams features;
  std::unique_ptr<PreparedImage> reference;
};

HomingTrials::HomingTrials(const World& world, const HomingTrialParams& params)
  : world_(withImageNoise(world, params.conditions.image_noise)),
    params_(params),
    parts_(std::make_unique<Parts>(world_, params.seed))
{
  Nomad nomad(world_, NomadParams());
  parts_->features.points = parts_->points.params().points;
  parts_->features.segments = parts_->lines.params().segments;
  parts_->features.lines = parts_->lines.params().features;
  parts_->reference =
      std::make_unique<PreparedImage>(parts_->camera.capture(nomad.cameraPose()), cv::Rect(), parts_->features);
}

HomingTrials::~HomingTrials() = default;

namespace
{
Nomad nomadAt(const World& world, const HomingTrialParams& params, const PlanarPose& start)
{
  NomadParams nomad_params;
  nomad_params.differential = params.homing.approach.base == BaseKind::DIFFERENTIAL;
  nomad_params.odometry_drift = params.conditions.odometry_drift;
  nomad_params.odometry_turn_scale = params.conditions.odometry_turn_scale;
  nomad_params.deadband_speed = params.conditions.deadband_speed;
  nomad_params.deadband_turn_rate = params.conditions.deadband_turn_rate;
  nomad_params.slip_share = params.conditions.slip_share;
  nomad_params.slip_loss = params.conditions.slip_loss;
  nomad_params.seed = params.seed;
  Nomad nomad(world, nomad_params);
  nomad.setPose(planarPose(start.x, start.y, start.yaw));
  return nomad;
}

}  // namespace

/** One run: what moves, what is on its way, and the steps of a cycle. */
class HomingTrials::Run
{
public:
  Run(const World& world, const HomingTrialParams& params, Parts& parts, const PlanarPose& start,
      const std::function<void(const HomingStep&)>& on_step)
    : world_(world),
      params_(params),
      parts_(parts),
      on_step_(on_step),
      nomad_(nomadAt(world, params, start)),
      homing_(makeHoming(params.homing, targetOf(world, params, parts))),
      limiter_(params.limits),
      odometry_due_(ODOMETRY_PERIOD),
      control_due_(CONTROL_PERIOD),
      image_due_(1.0 / world.camera_rate),
      points_due_(params.points_period),
      lines_due_(params.lines_period),
      last_(start)
  {
  }

  static HomingTarget targetOf(const World& world, const HomingTrialParams& params, const Parts& parts)
  {
    HomingTarget target;
    target.image = parts.reference->grey();
    target.camera = target.view_camera = withFocalLengthError(world.camera, params.conditions.focal_length_error);
    target.mount = CameraMount(world.camera_on_base);
    target.structure = params.structure;
    return target;
  }

  HomingOutcome run()
  {
    for (time_ = 0.0; time_ < params_.max_duration && (!end_ || time_ < *end_ + SETTLING); time_ += STEP)
    {
      if (odometry_due_.due(time_))
      {
        homing_->addOdometry(time_ + params_.conditions.odometry_delay, toPlanar(nomad_.odometry()));
      }
      if (!end_ && image_due_.due(time_))
      {
        const cv::Mat image = takeImage();
        images_.add(time_ + IMAGE_DELAY, { time_, image, toPlanar(nomad_.pose()) });
        match(image);
      }
      deliverImage();
      deliverMatches();
      if (control_due_.due(time_))
      {
        control();
      }
      move();
    }
    return outcome();
  }

private:
  cv::Mat takeImage()
  {
    cv::Mat image = parts_.camera.capture(nomad_.cameraPose());
    if (params_.conditions.occluded_from >= 0.0)
    {
      drawPasserBy(time_ - params_.conditions.occluded_from, world_.camera, world_.camera_on_base.translation().z(),
                   image);
    }
    return image;
  }

  /** Begins to match the image by points, by lines, or both, when it is time for that. */
  void match(const cv::Mat& image)
  {
    const bool by_points = params_.use_points && points_due_.due(time_);
    const bool by_lines = params_.use_lines && lines_due_.due(time_);
    if (!by_points && !by_lines)
    {
      return;
    }
    const double ready = time_ + params_.matching_time;
    const PreparedImage current(image, cv::Rect(), parts_.features);
    if (by_points)
    {
      matches_.add(ready,
                   toEvidence(time_, parts_.points.match(*parts_.reference, current, GeometryModel::HOMOGRAPHY)));
    }
    if (by_lines)
    {
      const LineGrouping groups = params_.line_pairs ? LineGrouping::PAIRS : LineGrouping::TRIPLETS;
      matches_.add(
          ready, toEvidence(time_, parts_.lines.match(*parts_.reference, current, GeometryModel::HOMOGRAPHY, groups)));
    }
  }

  void deliverImage()
  {
    if (const std::optional<StampedImage> ready = images_.take(time_))
    {
      homing_->addImage(ready->stamp, ready->image);
      const HomingState state = homing_->report().state;
      found_ = found_ || state != HomingState::ACQUIRING;
      images_since_found_ += found_ ? 1 : 0;
      images_in_sight_ += found_ && state != HomingState::LOST ? 1 : 0;
      if (on_step_)
      {
        on_step_({ time_, ready->base, homing_->report(), nomad_.velocity() });
      }
    }
  }

  void deliverMatches()
  {
    if (const std::optional<StampedEvidence> ready = matches_.take(time_))
    {
      homing_->addMatches(ready->stamp, ready->pixels);
    }
  }

  void control()
  {
    const BaseVelocity wanted = homing_->command();
    nomad_.command(limiter_.next(wanted, CONTROL_PERIOD));
    const HomingState state = homing_->report().state;
    if (!end_ && (state == HomingState::ARRIVED || state == HomingState::FAILED))
    {
      end_ = time_;
    }
    const bool stands = wanted.isZero(0.0);
    stops_ += under_way_ && stands && !end_ ? 1 : 0;
    under_way_ = !stands;
  }

  void move()
  {
    nomad_.step(STEP);
    const PlanarPose here = toPlanar(nomad_.pose());
    travelled_ += std::hypot(here.x - last_.x, here.y - last_.y);
    const double ahead = nomad_.velocity().x();
    if (std::abs(ahead) > MOVES)
    {
      reversals_ += ahead * sense_ < 0.0 ? 1 : 0;
      sense_ = ahead;
    }
    last_ = here;
  }

  HomingOutcome outcome() const
  {
    const PlanarPose error = compose(inverse(toPlanar(world_.goal)), last_);
    HomingOutcome outcome;
    outcome.arrived = homing_->report().state == HomingState::ARRIVED;
    outcome.reason = end_ ? homing_->report().reason : "not arrived in time: " + homing_->report().reason;
    outcome.distance_error = error.distance();
    outcome.ahead_error = error.x;
    outcome.side_error = error.y;
    outcome.yaw_error = error.yaw;
    outcome.duration = end_ ? *end_ : time_;
    outcome.travelled = travelled_;
    outcome.reversals = reversals_;
    outcome.stops = stops_;
    outcome.in_sight = images_since_found_ > 0 ? static_cast<double>(images_in_sight_) / images_since_found_ : 0.0;
    outcome.structure = homing_->structure();
    return outcome;
  }

  const World& world_;
  const HomingTrialParams& params_;
  Parts& parts_;
  const std::function<void(const HomingStep&)>& on_step_;
  Nomad nomad_;
  std::unique_ptr<Homing> homing_;
  BaseVelocityLimiter limiter_;
  Every odometry_due_;
  Every control_due_;
  Every image_due_;
  Every points_due_;
  Every lines_due_;
  Delayed<StampedImage> images_;
  Delayed<StampedEvidence> matches_;
  PlanarPose last_;
  double travelled_ = 0.0;
  double sense_ = 0.0;  // last speed ahead or back that was one [m/s]
  int reversals_ = 0;
  bool under_way_ = false;
  int stops_ = 0;
  bool found_ = false;
  int images_since_found_ = 0;
  int images_in_sight_ = 0;
  std::optional<double> end_;  // when homing ended [s]
  double time_ = 0.0;          // [s]
};

HomingOutcome HomingTrials::run(const PlanarPose& start, const std::function<void(const HomingStep&)>& on_step)
{
  Light light = world_.light;
  light.gain *= params_.conditions.light_gain;
  parts_->camera.setLight(light);
  return Run(world_, params_, *parts_, start, on_step).run();
}

PlanarPose randomStart(const World& world, Rng& rng, double max_yaw)
{
  constexpr double LEAST_SHARE = 0.3;
  Nomad nomad(world, NomadParams());
  const Eigen::Isometry3d stored = nomad.cameraPose();
  while (true)
  {
    const double distance = uniform(rng, 0.4, 2.0);
    const double direction = uniform(rng, -M_PI / 3.0, M_PI / 3.0);
    const double yaw = uniform(rng, -max_yaw, max_yaw);
    const double sense = uniform(rng, 0.0, 1.0) < 0.5 ? 1.0 : -1.0;  // in front of the goal or behind it
    const PlanarPose start =
        compose(toPlanar(world.goal), { sense * distance * std::cos(direction), distance * std::sin(direction), yaw });
    try
    {
      nomad.setPose(planarPose(start.x, start.y, start.yaw));
    }
    catch (const std::invalid_argument&)
    {
      continue;  // an obstacle is there
    }
    if (shareInSight(world, stored, nomad.cameraPose()) >= LEAST_SHARE)
    {
      return start;
    }
  }
}

}  // namespace view_servo::sim
