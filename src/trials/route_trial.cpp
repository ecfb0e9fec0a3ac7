// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/route_trial.h"

#include "sim/nomad.h"
#include "sim/renderer.h"
#include "trials/evidence.h"
#include "trials/trial.h"
#include "view_servo/tracking/pair_structure.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

namespace view_servo::sim
{
namespace
{
/** A view of the route, as it is stored. */
struct RecordedView
{
  cv::Mat image;
  ViewStructure structure;
};

/** Matches with the view of this number. */
struct RouteEvidence
{
  std::size_t number;
  StampedEvidence evidence;
};

NomadParams nomadParams(const RouteTrialParams& params)
{
  NomadParams nomad;
  nomad.differential = params.homing.approach.base == BaseKind::DIFFERENTIAL;
  nomad.odometry_drift = params.conditions.odometry_drift;
  nomad.odometry_turn_scale = params.conditions.odometry_turn_scale;
  nomad.seed = params.seed;
  return nomad;
}

double distanceFrom(const std::vector<PlanarPose>& way, const PlanarPose& base)
{
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < way.size(); ++i)
  {
    const Eigen::Vector2d a(way[i - 1].x, way[i - 1].y);
    const Eigen::Vector2d along = Eigen::Vector2d(way[i].x, way[i].y) - a;
    const Eigen::Vector2d to = Eigen::Vector2d(base.x, base.y) - a;
    const double part = std::clamp(along.dot(to) / std::max(along.squaredNorm(), 1e-12), 0.0, 1.0);
    nearest = std::min(nearest, (to - part * along).norm());
  }
  return nearest;
}

class RouteRun
{
public:
  RouteRun(const World& world, const RouteTrialParams& params)
    : world_(withImageNoise(world, params.conditions.image_noise)),
      params_(params),
      camera_(world_, {}, params.seed),
      nomad_(world_, nomadParams(params)),
      mount_(world.camera_on_base),
      limiter_(params.limits)
  {
    features_.points = matcher_.params().points;
  }

  RouteOutcome run(const std::vector<PlanarPose>& waypoints, const PlanarPose& start)
  {
    record(waypoints);
    Light light = world_.light;
    light.gain *= params_.conditions.light_gain;
    camera_.setLight(light);
    nomad_.setPose(planarPose(start.x, start.y, start.yaw));
    followed_ = start;
    return follow();
  }

private:
  // ----------------------------------------------------------------------------------------------------- recording

  void record(const std::vector<PlanarPose>& waypoints)
  {
    nomad_.setPose(planarPose(waypoints.front().x, waypoints.front().y, waypoints.front().yaw));
    store();
    for (std::size_t i = 1; i < waypoints.size(); ++i)
    {
      driveTo(waypoints[i]);
    }
    store();
    const std::size_t count = views_.size();
    for (std::size_t i = 0; i < count; ++i)
    {
      const std::size_t other = i + 1 < count ? i + 1 : i - 1;
      views_[i].structure = structureOfPair(views_[i].image, views_[other].image, world_.camera, mount_,
                                            compose(inverse(stops_[i].base), stops_[other].base));
    }
  }

  /** Straight, as somebody with a joystick who sees where the base is. */
  void driveTo(const PlanarPose& waypoint)
  {
    constexpr double SPEED = 0.2;       // [m/s]
    constexpr double TOLERANCE = 0.02;  // [m]
    constexpr double LONGEST = 120.0;   // [s]
    Every control_due(CONTROL_PERIOD);
    Every image_due(1.0 / world_.camera_rate);
    for (double time = 0.0; time < LONGEST; time += STEP)
    {
      const PlanarPose left = compose(inverse(toPlanar(nomad_.pose())), waypoint);
      if (left.distance() < TOLERANCE)
      {
        break;
      }
      if (control_due.due(time))
      {
        const double speed = std::min(SPEED, std::max(0.05, left.distance()));
        nomad_.command({ speed * std::cos(left.heading()), speed * std::sin(left.heading()), left.yaw });
      }
      if (image_due.due(time) && spacing_->due(compose(inverse(stops_.back().base), toPlanar(nomad_.odometry()))))
      {
        store();
      }
      nomad_.step(STEP);
      trace();
    }
    nomad_.halt();
  }

  /** Adds the base's true place to the recorded way, once it is a part of it that counts. */
  void trace()
  {
    constexpr double APART = 0.01;  // [m]
    const PlanarPose base = toPlanar(nomad_.pose());
    if (way_.empty() || std::hypot(base.x - way_.back().x, base.y - way_.back().y) > APART)
    {
      way_.push_back(base);
    }
  }

  void store()
  {
    views_.push_back({ camera_.capture(nomad_.cameraPose()), {} });
    stops_.push_back({ std::to_string(views_.size()), toPlanar(nomad_.odometry()), 0.0 });
    trace();
    last_view_ = toPlanar(nomad_.pose());
    spacing_ = std::make_unique<RouteSpacing>(params_.spacing, views_.back().image, world_.camera, mount_);
  }

  // ------------------------------------------------------------------------------------------------------ following

  void beginView()
  {
    const RecordedView& view = views_[guide_->number() - 1];
    HomingTarget target;
    target.image = view.image;
    target.camera = target.view_camera = world_.camera;
    target.mount = mount_;
    target.structure = view.structure;
    homing_ = makeHoming(params_.homing, target);
    reference_ = std::make_unique<PreparedImage>(view.image, cv::Rect(), features_);
  }

  RouteOutcome follow()
  {
    guide_ = std::make_unique<RouteGuide>(params_.guide, stops_, params_.homing.blind_speed);
    beginView();
    Every odometry_due(ODOMETRY_PERIOD);
    Every control_due(CONTROL_PERIOD);
    Every image_due(1.0 / world_.camera_rate);
    Every matching_due(params_.matching_period);
    std::optional<double> end;
    double time = 0.0;
    for (; time < params_.max_duration && (!end || time < *end + SETTLING); time += STEP)
    {
      if (odometry_due.due(time))
      {
        base_ = toPlanar(nomad_.odometry());
        homing_->addOdometry(time, base_);
        guide_->addOdometry(base_);
      }
      if (!end && image_due.due(time))
      {
        const cv::Mat image = camera_.capture(nomad_.cameraPose());
        images_.add(time + IMAGE_DELAY, { time, image, toPlanar(nomad_.pose()) });
        if (matching_due.due(time))
        {
          const PreparedImage current(image, cv::Rect(), features_);
          matches_.add(
              time + params_.matching_time,
              { guide_->number(), toEvidence(time, matcher_.match(*reference_, current, GeometryModel::HOMOGRAPHY)) });
        }
      }
      deliver(time);
      if (control_due.due(time))
      {
        const HomingState state = homing_->report().state;
        if (!end && ((state == HomingState::ARRIVED && guide_->last()) || state == HomingState::FAILED))
        {
          end = time;
        }
        control();
      }
      nomad_.step(STEP);
      if (!end)
      {
        measure();
      }
    }
    return outcome(end, end.value_or(time));
  }

  void deliver(double time)
  {
    if (const std::optional<StampedImage> ready = images_.take(time))
    {
      homing_->addImage(ready->stamp, ready->image);
      guide_->addReport(homing_->report(), base_);
      if (guide_->isTimeToGoOn())
      {
        guide_->goOn();
        beginView();
        homing_->addOdometry(time, base_);
      }
    }
    const std::optional<RouteEvidence> ready = matches_.take(time);
    if (ready && ready->number == guide_->number())
    {
      homing_->addMatches(ready->evidence.stamp, ready->evidence.pixels);
    }
  }

  void control()
  {
    const HomingState state = homing_->report().state;
    const bool unknown = state == HomingState::ACQUIRING || state == HomingState::LOST;
    const bool slides = params_.homing.approach.base == BaseKind::HOLONOMIC;
    const std::optional<Course> blind = unknown && slides ? guide_->blindCourse() : std::nullopt;
    nomad_.command(limiter_.next(blind ? along(*blind, base_) : homing_->command(), CONTROL_PERIOD));
  }

  void measure()
  {
    const PlanarPose base = toPlanar(nomad_.pose());
    const double driven = compose(inverse(followed_), base).distance();
    followed_ = base;
    if (guide_->number() > 1)
    {
      const double off = distanceFrom(way_, base);
      squares_ += off * off * driven;
      measured_ += driven;
      farthest_ = std::max(farthest_, off);
    }
  }

  RouteOutcome outcome(const std::optional<double>& end, double duration) const
  {
    const PlanarPose error = compose(inverse(last_view_), toPlanar(nomad_.pose()));
    RouteOutcome outcome;
    outcome.arrived = homing_->report().state == HomingState::ARRIVED && guide_->last();
    outcome.reason = end ? homing_->report().reason : "not arrived in time: " + homing_->report().reason;
    outcome.views = views_.size();
    outcome.reached = guide_->number();
    for (std::size_t i = 1; i < way_.size(); ++i)
    {
      outcome.length += compose(inverse(way_[i - 1]), way_[i]).distance();
    }
    if (measured_ > 0.0)
    {
      outcome.sideways_rms = std::sqrt(squares_ / measured_);
      outcome.sideways_max = farthest_;
    }
    outcome.distance_error = error.distance();
    outcome.yaw_error = error.yaw;
    outcome.duration = duration;
    return outcome;
  }

  const World world_;
  const RouteTrialParams& params_;
  SimulatedCamera camera_;
  Nomad nomad_;
  const CameraMount mount_;
  BaseVelocityLimiter limiter_;
  const PointViewMatcher matcher_{ PointViewMatcherParams() };
  FeatureParams features_;

  std::vector<RecordedView> views_;
  std::vector<RouteStop> stops_;
  std::vector<PlanarPose> way_;  // true places along the recorded way
  PlanarPose last_view_;         // true pose at the last view
  std::unique_ptr<RouteSpacing> spacing_;

  std::unique_ptr<RouteGuide> guide_;
  std::unique_ptr<Homing> homing_;
  std::unique_ptr<PreparedImage> reference_;
  PlanarPose base_;  // by odometry
  Delayed<StampedImage> images_;
  Delayed<RouteEvidence> matches_;
  PlanarPose followed_;    // true pose when its distance from the way was measured last
  double squares_ = 0.0;   // of these distances, times the way driven [m^3]
  double measured_ = 0.0;  // the way driven meanwhile [m]
  double farthest_ = 0.0;
};

}  // namespace

RouteOutcome runRoute(const World& world, const RouteTrialParams& params, const std::vector<PlanarPose>& waypoints,
                      const PlanarPose& start)
{
  if (waypoints.size() < 2)
  {
    throw std::invalid_argument("a route needs at least two waypoints");
  }
  return RouteRun(world, params).run(waypoints, start);
}

}  // namespace view_servo::sim
