// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/hand_eye_trial.h"

#include "sim/visibility.h"
#include "view_servo/control/still_pose.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/tracking/plane_tracker.h"

#include <cstddef>
#include <stdexcept>
#include <vector>

namespace view_servo::sim
{
namespace
{
PumaParams pumaParams(const HandEyeTrialParams& params)
{
  PumaParams puma;
  puma.encoder_noise = params.encoder_noise;
  puma.hand_eye_translation_error = params.hand_eye_translation_error;
  puma.hand_eye_rotation_error = params.hand_eye_rotation_error;
  puma.seed = params.seed;
  return puma;
}

}  // namespace

HandEyeTrial::HandEyeTrial(const World& world, const std::string& urdf_xml, const HandEyeTrialParams& params)
  : params_(params),
    world_(withImageNoise(world, params.image_noise)),
    rng_(params.seed),
    camera_(world_, {}, params.seed),
    puma_(urdf_xml, pumaParams(params)),
    finder_(PointViewMatcherParams())
{
  // What is beside the plane must not touch the corners' surroundings.
  constexpr int MARGIN = 16;  // of the region from that of the world [px]
  world_.region = cv::Rect(world_.region.x + MARGIN, world_.region.y + MARGIN, world_.region.width - 2 * MARGIN,
                           world_.region.height - 2 * MARGIN);
  described_camera_in_flange_ =
      Eigen::Translation3d(0.03, -0.05, 0.07) * Eigen::AngleAxisd(1.2, Eigen::Vector3d(1.0, 2.0, -1.0).normalized());
  hold(world_.goal);
  view_ = std::make_shared<const PreparedImage>(camera_.capture(world_.robot_base * puma_.cameraPose()), world_.region,
                                                finder_.features());
  // The true camera is where the description has it, and then the hand-eye error further.
  camera_in_flange_ =
      described_camera_in_flange_ * puma_.nominalCameraPose(puma_.joints()).inverse() * puma_.cameraPose();
  const Eigen::Vector3d ray = (world_.camera.k.inverse() * middleOf(world_.region).homogeneous()).normalized();
  const std::optional<double> distance = firstHit(world_, world_.goal.translation(), world_.goal.linear() * ray);
  if (!distance)
  {
    throw std::runtime_error("the view of world " + world_.name + " shows nothing");
  }
  middle_ = world_.goal * Eigen::Vector3d(*distance * ray);
}

HandEyeResult HandEyeTrial::run()
{
  const int most_tries = 8 * params_.poses;
  HandEyeView view;
  view.k = world_.camera.k;
  const auto corners = cornersOf(world_.region);
  view.corners.assign(corners.begin(), corners.end());
  std::vector<HandEyePose> poses;
  for (int i = 0; i < most_tries && static_cast<int>(poses.size()) < params_.poses; ++i)
  {
    if (const std::optional<HandEyePose> pose = observe(elsewhere()))
    {
      poses.push_back(*pose);
    }
  }
  return calibrateHandEye(view, poses);
}

bool HandEyeTrial::hold(const Eigen::Isometry3d& camera)
{
  return puma_.setCameraPose(world_.robot_base.inverse() * camera);
}

/** A pose from which somebody might look at the view: in a box around the goal, turned about the camera's axis. */
Eigen::Isometry3d HandEyeTrial::elsewhere()
{
  constexpr double SIDEWAYS = 0.2;  // [m]
  constexpr double NEARER = 0.06;   // [m]
  constexpr double FARTHER = 0.2;   // [m]
  constexpr double BESIDE = 0.04;   // of the middle of the view, looked at [m]
  constexpr double ROLL = 0.9;      // [rad]
  const double x = uniform(rng_, -SIDEWAYS, SIDEWAYS);
  const double y = uniform(rng_, -SIDEWAYS, SIDEWAYS);
  const Eigen::Vector3d place = world_.goal * Eigen::Vector3d(x, y, uniform(rng_, -FARTHER, NEARER));
  const double u = uniform(rng_, -BESIDE, BESIDE);
  const Eigen::Vector3d at = middle_ + world_.goal.linear() * Eigen::Vector3d(u, uniform(rng_, -BESIDE, BESIDE), 0.0);
  // Turned like the goal's camera: the shortest rotation from its direction to the new one.
  const Eigen::Vector3d ahead = (at - place).normalized();
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(world_.goal.linear().col(2), ahead);
  return Eigen::Translation3d(place) * Eigen::Isometry3d(turn * Eigen::Quaterniond(world_.goal.linear())) *
         Eigen::AngleAxisd(uniform(rng_, -ROLL, ROLL), Eigen::Vector3d::UnitZ());
}

/** What the arm and the images say at a pose; empty when the arm cannot go there, or the view is not followed there. */
std::optional<HandEyePose> HandEyeTrial::observe(const Eigen::Isometry3d& camera)
{
  constexpr int MOST_IMAGES = 15;
  constexpr double IMAGE_RATE = 10.0;  // [Hz]
  if (!hold(camera))
  {
    return std::nullopt;
  }
  const Eigen::Isometry3d place = world_.robot_base * puma_.cameraPose();
  const PlaneFinder::Answer answer = finder_.find({ view_, camera_.capture(place), std::nullopt });
  if (!answer.h)
  {
    return std::nullopt;
  }
  PlaneTracker tracker(view_->grey(), world_.region, world_.camera.k, {});
  tracker.start(*answer.h, std::nullopt);
  const auto corners = cornersOf(world_.region);
  StillPose still;
  for (int i = 0; i < MOST_IMAGES; ++i)
  {
    ArmSample sample;
    sample.stamp = i / IMAGE_RATE;
    sample.flange_in_base = puma_.nominalCameraPose(puma_.measuredJoints()) * described_camera_in_flange_.inverse();
    const PlaneTrack& track = tracker.add(camera_.capture(place), std::nullopt);
    if (track.state != TrackingState::TRACKING)
    {
      still.clear();
      continue;
    }
    Correspondences pairs;
    for (const Eigen::Vector2d& corner : corners)
    {
      sample.seen.push_back(transfer(track.homography.h, corner));
      pairs.push_back({ corner, Eigen::Vector2d::Zero() });
    }
    if (const std::optional<ArmSample> mean = still.add(sample))
    {
      for (std::size_t k = 0; k < pairs.size(); ++k)
      {
        pairs[k].current = mean->seen[k];
      }
      if (const std::optional<Eigen::Matrix3d> h = homographyFromPoints(pairs))
      {
        return HandEyePose{ mean->flange_in_base, *h };
      }
    }
  }
  return std::nullopt;
}

}  // namespace view_servo::sim
