// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/arm_trial.h"

#include "sim/renderer.h"
#include "trials/trial.h"
#include "view_servo/geometry/region.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/tracking/scene_finder.h"
#include "view_servo/views/prepared_image.h"

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

namespace view_servo::sim
{
namespace
{
constexpr double COVERED = 2.0;  // how long the camera is covered, if it is [s]

/** What tracking makes of an image. */
struct StampedTrack
{
  double stamp;  // [s]
  PlaneTrack track;
};

/** Where matching finds the view. */
struct Found
{
  std::optional<Eigen::Matrix3d> h;          // of a plane, view to image; empty: nowhere
  std::optional<SceneFinder::Answer> scene;  // of a search for a scene; empty: it was one for a plane
  Eigen::Isometry3d camera_in_base;          // when the image was taken
};

Puma makePuma(const std::string& urdf_xml, const ArmTrialParams& params)
{
  PumaParams puma_params;
  puma_params.encoder_noise = params.conditions.encoder_noise;
  puma_params.hand_eye_translation_error = params.conditions.hand_eye_translation_error;
  puma_params.hand_eye_rotation_error = params.conditions.hand_eye_rotation_error;
  puma_params.seed = params.seed;
  return Puma(urdf_xml, puma_params);
}

/** The twist of a frame by the twist of another one on the same body. @param other in the former frame. */
Twist carried(const Eigen::Isometry3d& other, const Twist& twist)
{
  Twist result;
  result.tail<3>() = other.linear() * twist.tail<3>();
  result.head<3>() = other.linear() * twist.head<3>() + other.translation().cross(result.tail<3>());
  return result;
}

ServoTarget targetOf(const World& world, const Eigen::Matrix3d& k)
{
  return { k, { world.camera.width, world.camera.height }, middleOf(world.region) };
}

}  // namespace

struct ArmTrials::Parts
{
  Parts(const World& world, std::uint64_t seed)
    : finder(PointViewMatcherParams()),
      view(std::make_shared<const PreparedImage>(SimulatedCamera(world, {}, seed).capture(world.goal), world.region,
                                                 finder.features())),
      scene_view(std::make_shared<const PreparedImage>(view->grey(), view->region(), scene_finder.features()))
  {
  }

  PlaneFinder finder;
  SceneFinder scene_finder;
  std::shared_ptr<const PreparedImage> view;
  std::shared_ptr<const PreparedImage> scene_view;  // the same, with what a search for a scene needs
};

ArmTrials::ArmTrials(const World& world, const std::string& urdf_xml, const ArmTrialParams& params)
  : world_(withImageNoise(world, params.conditions.image_noise)),
    urdf_xml_(urdf_xml),
    params_(params),
    parts_(std::make_unique<Parts>(world_, params.seed))
{
}

ArmTrials::~ArmTrials() = default;

/** One run: what moves, what is on its way, and the steps of a cycle. */
class ArmTrials::Run
{
public:
  Run(const World& world, const std::string& urdf_xml, const ArmTrialParams& params, Parts& parts,
      const std::function<void(const ArmStep&)>& on_step)
    : world_(world),
      params_(params),
      parts_(parts),
      on_step_(on_step),
      puma_(makePuma(urdf_xml, params)),
      camera_(world, params.conditions.groups, params.seed + 1),
      camera_in_described_(params.conditions.calibrated_camera.value_or(Eigen::Isometry3d::Identity())),
      calibrated_(withFocalLengthError(world.camera, params.conditions.focal_length_error)),
      tracker_(parts.view->grey(), world.region, calibrated_.k, params.tracker, params.target),
      servo_(targetOf(world, calibrated_.k), params.servo),
      limiter_(params.limits),
      control_due_(params.control_period),
      image_due_(1.0 / world.camera_rate)
  {
    camera_.setLight(params.conditions.light);
  }

  ArmOutcome run(const Eigen::Isometry3d& start)
  {
    // As somebody does who stores the view: first there, then away.
    for (const Eigen::Isometry3d& pose : { world_.goal, start })
    {
      if (!puma_.setCameraPose(world_.robot_base.inverse() * pose))
      {
        throw std::invalid_argument("the arm cannot bring its camera to the goal or the start");
      }
    }
    for (time_ = 0.0; time_ < params_.max_duration && (!end_ || time_ < *end_ + SETTLING); time_ += STEP)
    {
      if (!end_ && image_due_.due(time_))
      {
        track();
      }
      deliverTracks();
      if (control_due_.due(time_))
      {
        control();
      }
      move();
    }
    return outcome();
  }

private:
  /** World from the true camera. */
  Eigen::Isometry3d cameraPose() const
  {
    return world_.robot_base * puma_.cameraPose();
  }

  cv::Mat takeImage()
  {
    cv::Mat image = camera_.capture(cameraPose());
    const double covered_from = params_.conditions.covered_from;
    if (covered_from >= 0.0 && time_ >= covered_from && time_ < covered_from + COVERED)
    {
      image.setTo(40);
    }
    return image;
  }

  /** Takes an image and tracks the view in it, or begins to look for the view by its points when it is not tracked. */
  void track()
  {
    const Eigen::Isometry3d camera_in_base = puma_.nominalCameraPose(puma_.measuredJoints()) * camera_in_described_;
    const cv::Mat image = takeImage();
    if (const std::optional<Found> found = found_.take(time_))
    {
      if (found->scene)
      {
        tracker_.addSceneSearch(*found->scene, found->camera_in_base);
      }
      else
      {
        tracker_.addPlaneSearch(found->h, found->camera_in_base);
      }
    }
    const PlaneTrack& track = tracker_.add(image, camera_in_base);
    if (track.state == TrackingState::TRACKING)
    {
      last_h_ = track.homography.h;
    }
    if (found_.empty() && tracker_.wanted() != TargetTracker::Search::NONE)
    {
      found_.add(time_ + params_.matching_time, search(image, camera_in_base));
    }
    tracks_.add(time_ + params_.image_delay, { time_, track });
    if (on_step_)
    {
      on_step_({ time_, image, cameraPose(), track, servo_.report(), sent_ });
    }
  }

  Found search(const cv::Mat& image, const Eigen::Isometry3d& camera_in_base) const
  {
    if (tracker_.wanted() == TargetTracker::Search::PLANE)
    {
      return { parts_.finder.find({ parts_.view, image, last_h_ }).h, std::nullopt, camera_in_base };
    }
    return { std::nullopt, parts_.scene_finder.find({ parts_.scene_view, calibrated_, image, calibrated_ }),
             camera_in_base };
  }

  void deliverTracks()
  {
    while (const std::optional<StampedTrack> ready = tracks_.take(time_))
    {
      const PlaneTrack& track = ready->track;
      if (track.plane)
      {
        servo_.add({ ready->stamp, track.plane->motion, track.plane->distance, track.homography.supporting });
      }
      else
      {
        servo_.addLoss(ready->stamp, "the view is not in the image");
      }
    }
  }

  void control()
  {
    const ServoState state = servo_.report().state;
    if (!end_ && (state == ServoState::CONVERGED || state == ServoState::FAILED))
    {
      end_ = time_;
    }
    sent_ = limiter_.next(end_ ? Twist(Twist::Zero()) : servo_.command(time_), params_.control_period);
    servo_.sent(time_, sent_);
    puma_.command(carried(camera_in_described_, sent_));
  }

  void move()
  {
    puma_.step(STEP);
    if (!end_ && puma_.state() == Puma::State::AT_LIMIT)
    {
      end_ = time_;
      hindrance_ = puma_.message();
      puma_.halt();
    }
  }

  ArmOutcome outcome() const
  {
    const Eigen::Isometry3d error = world_.goal.inverse() * cameraPose();
    const ServoReport& report = servo_.report();
    ArmOutcome outcome;
    outcome.converged = hindrance_.empty() && report.state == ServoState::CONVERGED;
    outcome.reason = !hindrance_.empty() ? hindrance_ : end_ ? report.reason : "not there in time: " + report.reason;
    outcome.translation_error = error.translation().norm();
    outcome.rotation_error = Eigen::AngleAxisd(error.linear()).angle();
    outcome.duration = end_ ? *end_ : time_;
    return outcome;
  }

  const World& world_;
  const ArmTrialParams& params_;
  Parts& parts_;
  const std::function<void(const ArmStep&)>& on_step_;
  Puma puma_;
  SimulatedCamera camera_;
  Eigen::Isometry3d camera_in_described_;  // as tf has it
  Camera calibrated_;                      // as the calibration has it
  TargetTracker tracker_;
  Servo25d servo_;
  TwistLimiter limiter_;
  Every control_due_;
  Every image_due_;
  Delayed<Found> found_;  // one at most
  Delayed<StampedTrack> tracks_;
  std::optional<Eigen::Matrix3d> last_h_;  // where the plane was tracked last
  Twist sent_ = Twist::Zero();
  std::string hindrance_;      // by a joint
  std::optional<double> end_;  // when servoing ended [s]
  double time_ = 0.0;          // [s]
};

ArmOutcome ArmTrials::run(const Eigen::Isometry3d& start, const std::function<void(const ArmStep&)>& on_step)
{
  return Run(world_, urdf_xml_, params_, *parts_, on_step).run(start);
}

}  // namespace view_servo::sim
