// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/arm_trial.h"

#include "sim/renderer.h"
#include "trials/trial.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/views/prepared_image.h"

#include <deque>
#include <memory>
#include <optional>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
constexpr double STEP = 0.005;    // of the arm [s]
constexpr double SETTLING = 1.0;  // after servoing has ended, until the error is measured [s]
constexpr double COVERED = 2.0;   // [s]

/** An image on its way through tracking. */
struct Pending
{
  double ready;
  double stamp;
  PlaneTrack track;
};

/** Where the view has been found by its points. */
struct Found
{
  double ready;
  std::optional<Eigen::Matrix3d> h;
  Eigen::Isometry3d camera_in_base;
};

}  // namespace

struct ArmTrials::Parts
{
  Parts(const World& world, std::uint64_t seed)
    : finder(PointViewMatcherParams()),
      view(std::make_shared<const PreparedImage>(SimulatedCamera(world, {}, seed).capture(world.goal), world.region,
                                                 finder.features()))
  {
  }

  PlaneFinder finder;
  std::shared_ptr<const PreparedImage> view;
};

ArmTrials::ArmTrials(const World& world, const std::string& urdf_xml, const ArmTrialParams& params)
  : world_(withImageNoise(world, params.conditions.image_noise)),
    urdf_xml_(urdf_xml),
    params_(params),
    parts_(std::make_unique<Parts>(world_, params.seed))
{
}

ArmTrials::~ArmTrials() = default;

ArmOutcome ArmTrials::run(const Eigen::Isometry3d& start, const std::function<void(const ArmStep&)>& on_step)
{
  const ArmConditions& conditions = params_.conditions;
  PumaParams puma_params;
  puma_params.encoder_noise = conditions.encoder_noise;
  puma_params.hand_eye_translation_error = conditions.hand_eye_translation_error;
  puma_params.hand_eye_rotation_error = conditions.hand_eye_rotation_error;
  puma_params.seed = params_.seed;
  Puma puma(urdf_xml_, puma_params);
  // As the one who stores the view does: first there, then away.
  for (const Eigen::Isometry3d& pose : { world_.goal, start })
  {
    if (!puma.setCameraPose(world_.robot_base.inverse() * pose))
    {
      throw std::invalid_argument("the arm cannot bring its camera to the goal or the start");
    }
  }
  const auto camera_pose = [&] {
    return world_.robot_base * puma.cameraPose();
  };
  SimulatedCamera camera(world_, conditions.groups, params_.seed + 1);
  camera.setLight(conditions.light);

  const Eigen::Matrix3d k = withFocalLengthError(world_.camera, conditions.focal_length_error).k;
  PlaneTracker tracker(parts_->view->grey(), world_.region, k, params_.tracker);
  const cv::Rect& region = world_.region;
  Servo25d servo({ k,
                   { world_.camera.width, world_.camera.height },
                   { region.x + 0.5 * (region.width - 1), region.y + 0.5 * (region.height - 1) } },
                 params_.servo);
  TwistLimiter limiter(params_.limits);
  Every control_due(params_.control_period);
  Every image_due(1.0 / world_.camera_rate);
  std::deque<Pending> pending;
  std::optional<Found> found;
  std::optional<Eigen::Matrix3d> last_h;  // where the plane was tracked last
  Twist sent = Twist::Zero();
  ArmOutcome outcome;
  std::optional<double> end;
  std::string hindered;  // by a joint
  double time = 0.0;
  for (; time < params_.max_duration && (!end || time < *end + SETTLING); time += STEP)
  {
    if (!end && image_due.due(time))
    {
      const Eigen::Isometry3d camera_in_base = puma.nominalCameraPose(puma.measuredJoints());
      cv::Mat image = camera.capture(camera_pose());
      if (conditions.covered_from >= 0.0 && time >= conditions.covered_from && time < conditions.covered_from + COVERED)
      {
        image.setTo(40);
      }
      if (found && time >= found->ready)
      {
        if (found->h)
        {
          tracker.start(*found->h, found->camera_in_base);
        }
        found.reset();
      }
      const PlaneTrack& track = tracker.add(image, camera_in_base);
      if (track.state == TrackingState::TRACKING)
      {
        last_h = track.homography.h;
      }
      if (track.state != TrackingState::TRACKING && !found)
      {
        const PlaneFinder::Answer answer = parts_->finder.find({ parts_->view, image, last_h });
        found = Found{ time + params_.matching_time, answer.h, camera_in_base };
      }
      pending.push_back({ time + params_.image_delay, time, track });
      if (on_step)
      {
        on_step({ time, image, camera_pose(), track, servo.report(), sent });
      }
    }
    while (!pending.empty() && time >= pending.front().ready)
    {
      const Pending& next = pending.front();
      if (next.track.plane)
      {
        servo.add(
            { next.stamp, next.track.plane->motion, next.track.plane->distance, next.track.homography.supporting });
      }
      else
      {
        servo.addLoss(next.stamp, "the view is not in the image");
      }
      pending.pop_front();
    }
    if (control_due.due(time))
    {
      const ServoState state = servo.report().state;
      if (!end && (state == ServoState::CONVERGED || state == ServoState::FAILED))
      {
        end = time;
      }
      const Twist wanted = end ? Twist(Twist::Zero()) : servo.command(time);
      if (wanted.isZero())
      {
        limiter.stop();
      }
      sent = limiter.next(wanted, params_.control_period);
      servo.sent(time, sent);
      puma.command(sent);
    }
    puma.step(STEP);
    if (!end && puma.state() == Puma::State::AT_LIMIT)
    {
      end = time;
      hindered = puma.message();
      puma.halt();
    }
  }
  const Eigen::Isometry3d error = world_.goal.inverse() * camera_pose();
  outcome.converged = hindered.empty() && servo.report().state == ServoState::CONVERGED;
  outcome.reason = !hindered.empty() ? hindered
                   : end             ? servo.report().reason
                                     : "not there in time: " + servo.report().reason;
  outcome.translation_error = error.translation().norm();
  outcome.rotation_error = Eigen::AngleAxisd(error.linear()).angle();
  outcome.duration = end ? *end : time;
  return outcome;
}

}  // namespace view_servo::sim
