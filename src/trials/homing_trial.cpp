// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/homing_trial.h"

#include "sim/renderer.h"
#include "sim/visibility.h"
#include "trials/trial.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <optional>
#include <utility>

namespace view_servo::sim
{
namespace
{
constexpr double STEP = 0.005;            // of the base [s]
constexpr double ODOMETRY_PERIOD = 0.02;  // [s]
constexpr double CONTROL_PERIOD = 0.05;   // [s]
constexpr double IMAGE_DELAY = 0.05;      // from the stamp to what homing makes of it [s]
constexpr double SETTLING = 1.0;          // after homing has ended, until the error is measured [s]

/** Somebody walks by, from left to right in 2 s, 1.2 m in front of the camera. */
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

struct Matches
{
  double stamp;
  double ready;
  Correspondences pairs;
  std::vector<double> weights;
};

Matches toMatches(const ViewMatch& match, double stamp, double ready)
{
  Matches result{ stamp, ready, {}, {} };
  for (const MatchedPoint& point : match.matches)
  {
    result.pairs.push_back(point.position);
    result.weights.push_back(point.score);
  }
  return result;
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

HomingOutcome HomingTrials::run(const PlanarPose& start, const std::function<void(const HomingStep&)>& on_step)
{
  const HomingConditions& conditions = params_.conditions;
  NomadParams nomad_params;
  nomad_params.odometry_drift = conditions.odometry_drift;
  nomad_params.seed = params_.seed;
  Nomad nomad(world_, nomad_params);
  nomad.setPose(planarPose(start.x, start.y, start.yaw));
  Light light = world_.light;
  light.gain *= conditions.light_gain;
  parts_->camera.setLight(light);

  const Camera camera = withFocalLengthError(world_.camera, conditions.focal_length_error);
  const std::unique_ptr<Homing> homing =
      makeHoming(params_.homing, { parts_->reference->grey(), camera, CameraMount(world_.camera_on_base) });
  BaseVelocityLimiter limiter(params_.limits);
  Every odometry_due(ODOMETRY_PERIOD);
  Every control_due(CONTROL_PERIOD);
  Every image_due(1.0 / world_.camera_rate);
  Every points_due(params_.points_period);
  Every lines_due(params_.lines_period);
  std::deque<std::pair<double, cv::Mat>> images;
  std::deque<Matches> matches;
  HomingOutcome outcome;
  PlanarPose last = start;
  std::optional<double> end;
  double time = 0.0;
  for (; time < params_.max_duration && (!end || time < *end + SETTLING); time += STEP)
  {
    if (odometry_due.due(time))
    {
      homing->addOdometry(time, toPlanar(nomad.odometry()));
    }
    if (!end && image_due.due(time))
    {
      cv::Mat image = parts_->camera.capture(nomad.cameraPose());
      if (conditions.occluded_from >= 0.0)
      {
        drawPasserBy(time - conditions.occluded_from, world_.camera, world_.camera_on_base.translation().z(), image);
      }
      images.emplace_back(time, image);
      const bool by_points = params_.use_points && points_due.due(time);
      const bool by_lines = params_.use_lines && lines_due.due(time);
      if (by_points || by_lines)
      {
        const PreparedImage current(image, cv::Rect(), parts_->features);
        if (by_points)
        {
          matches.push_back(toMatches(parts_->points.match(*parts_->reference, current, GeometryModel::HOMOGRAPHY),
                                      time, time + params_.matching_time));
        }
        if (by_lines)
        {
          matches.push_back(
              toMatches(parts_->lines.match(parts_->reference->lines(), current.lines(), GeometryModel::HOMOGRAPHY,
                                            params_.line_pairs ? LineGrouping::PAIRS : LineGrouping::TRIPLETS),
                        time, time + params_.matching_time));
        }
      }
    }
    if (!images.empty() && time >= images.front().first + IMAGE_DELAY)
    {
      homing->addImage(images.front().first, images.front().second);
      images.pop_front();
      if (on_step)
      {
        on_step({ time, toPlanar(nomad.pose()), homing->report(), nomad.velocity() });
      }
    }
    if (!matches.empty() && time >= matches.front().ready)
    {
      homing->addMatches(matches.front().stamp, matches.front().pairs, matches.front().weights);
      matches.pop_front();
    }
    if (control_due.due(time))
    {
      const BaseVelocity wanted = homing->command();
      if (wanted.isZero())
      {
        limiter.stop();
      }
      nomad.command(limiter.next(wanted, CONTROL_PERIOD));
      const HomingState state = homing->report().state;
      if (!end && (state == HomingState::ARRIVED || state == HomingState::FAILED))
      {
        end = time;
      }
    }
    nomad.step(STEP);
    const PlanarPose here = toPlanar(nomad.pose());
    outcome.travelled += std::hypot(here.x - last.x, here.y - last.y);
    last = here;
  }
  const PlanarPose error = compose(inverse(toPlanar(world_.goal)), last);
  outcome.arrived = homing->report().state == HomingState::ARRIVED;
  outcome.reason = end ? homing->report().reason : "not arrived in time: " + homing->report().reason;
  outcome.distance_error = error.distance();
  outcome.ahead_error = error.x;
  outcome.side_error = error.y;
  outcome.yaw_error = error.yaw;
  outcome.duration = end ? *end : time;
  return outcome;
}

PlanarPose randomStart(const World& world, Rng& rng)
{
  constexpr double LEAST_SHARE = 0.3;
  Nomad nomad(world, NomadParams());
  const Eigen::Isometry3d stored = nomad.cameraPose();
  while (true)
  {
    const double distance = uniform(rng, 0.4, 2.0);
    const double direction = uniform(rng, -M_PI / 3.0, M_PI / 3.0);
    const double yaw = uniform(rng, -M_PI / 18.0, M_PI / 18.0);
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
