// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "trials/mount_trial.h"

#include "view_servo/control/still_pose.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/tracking/plane_tracker.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace view_servo::sim
{
namespace
{
/** A camera that looks ahead and a little upwards, mounted at random. */
Eigen::Isometry3d drawnMount(Rng& rng)
{
  const double x = uniform(rng, -0.2, 0.2);
  const double y = uniform(rng, -0.2, 0.2);
  const double z = uniform(rng, 0.8, 1.2);
  const double yaw = uniform(rng, -8.0, 8.0) * DEGREE;
  const double pitch = uniform(rng, -13.0, -7.0) * DEGREE;
  const double roll = uniform(rng, -3.0, 3.0) * DEGREE;
  Eigen::Matrix3d ahead;
  ahead << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  Eigen::Isometry3d mount = Eigen::Isometry3d::Identity();
  mount.translation() << x, y, z;
  mount.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()) * ahead;
  return mount;
}

/** The desk world with a camera mounted otherwise, and a goal before the photo. */
World withMount(World world, const MountTrialParams& params, Rng& rng)
{
  world = withImageNoise(std::move(world), params.image_noise);
  world.camera_on_base = drawnMount(rng);
  world.goal = planarPose(1.1, 0.75, 0.0);
  return world;
}

NomadParams nomadParams(const MountTrialParams& params, Rng& rng)
{
  NomadParams nomad;
  nomad.differential = true;
  nomad.odometry_noise = params.odometry_noise;
  nomad.odometry_turn_scale = 1.0 + params.odometry_turn_error * gaussian(rng);
  nomad.odometry_turn_drift = params.odometry_turn_drift * gaussian(rng);
  nomad.seed = params.seed;
  return nomad;
}

/** The region of the view at the goal that shows the photo only. */
cv::Rect regionOfPhoto(const World& world)
{
  constexpr int MARGIN = 16;  // what is beside the photo must not touch the corners' surroundings [px]
  const auto photo = std::find_if(world.surfaces.begin(), world.surfaces.end(),
                                  [](const Surface& surface) { return surface.name == "photo"; });
  if (photo == world.surfaces.end())
  {
    throw std::runtime_error("world " + world.name + " has no photo");
  }
  const Eigen::Isometry3d camera_from_photo = (world.goal * world.camera_on_base).inverse() * photo->pose;
  double left = 0.0;
  double top = 0.0;
  double right = world.camera.width;
  double bottom = world.camera.height;
  for (const double side : { -0.5, 0.5 })
  {
    for (const double end : { -0.5, 0.5 })
    {
      const Eigen::Vector3d corner(side * photo->size.x(), end * photo->size.y(), 0.0);
      const Eigen::Vector2d seen = (world.camera.k * (camera_from_photo * corner)).hnormalized();
      const Eigen::Vector3d inside = camera_from_photo * Eigen::Vector3d::Zero();
      const Eigen::Vector2d middle = (world.camera.k * inside).hnormalized();
      (seen.x() < middle.x() ? left : right) =
          seen.x() < middle.x() ? std::max(left, seen.x()) : std::min(right, seen.x());
      (seen.y() < middle.y() ? top : bottom) =
          seen.y() < middle.y() ? std::max(top, seen.y()) : std::min(bottom, seen.y());
    }
  }
  const cv::Rect region(cv::Point(cvCeil(left) + MARGIN, cvCeil(top) + MARGIN),
                        cv::Point(cvFloor(right) - MARGIN, cvFloor(bottom) - MARGIN));
  return region & cv::Rect(0, 0, world.camera.width, world.camera.height);
}

}  // namespace

MountTrial::MountTrial(const World& world, const MountTrialParams& params)
  : params_(params),
    rng_(params.seed),
    world_(withMount(world, params, rng_)),
    camera_(world_, {}, params.seed),
    nomad_(world_, nomadParams(params, rng_)),
    finder_(PointViewMatcherParams()),
    region_(regionOfPhoto(world_))
{
  view_ = std::make_shared<const PreparedImage>(camera_.capture(nomad_.cameraPose()), region_, finder_.features());
}

MountResult MountTrial::run()
{
  constexpr double TURN_RATE = 0.3;  // [rad/s]
  constexpr double SPEED = 0.2;      // [m/s]
  HandEyeView view;
  view.k = world_.camera.k;
  const auto corners = cornersOf(region_);
  view.corners.assign(corners.begin(), corners.end());
  std::vector<HandEyePose> poses;
  const int most_stops = 3 * params_.poses;
  for (int stop = 0; stop < most_stops && static_cast<int>(poses.size()) < params_.poses; ++stop)
  {
    if (stop % 2 == 1)
    {
      const double yaw = (stop % 4 == 1 ? 1.0 : -1.0) * uniform(rng_, 0.12, 0.28);
      const double turn = yaw - yawOf(nomad_.pose());
      drive(0.0, std::copysign(TURN_RATE, turn), std::abs(turn) / TURN_RATE);
    }
    else if (stop > 0)
    {
      const double ahead = nomad_.pose().translation().x() > 0.8 ? uniform(rng_, 0.2, 0.6) : uniform(rng_, 0.95, 1.2);
      const double way = ahead - nomad_.pose().translation().x();
      drive(std::copysign(SPEED, way), 0.0, std::abs(way) / SPEED);
    }
    if (const std::optional<Eigen::Matrix3d> h = look())
    {
      poses.push_back({ nomad_.odometry(), *h });
    }
  }
  MountParams calibration;
  calibration.height = world_.camera_on_base.translation().z();
  return calibrateMount(view, poses, calibration);
}

/** Drives as told for a time [s], then stops. */
void MountTrial::drive(double speed, double turn_rate, double duration)
{
  constexpr double CYCLE = 0.02;  // [s]
  constexpr double STOPPING = 1.0;
  nomad_.command({ speed, 0.0, turn_rate });
  for (double time = 0.0; time < duration; time += CYCLE)
  {
    nomad_.step(CYCLE);
  }
  nomad_.command(Nomad::Velocity::Zero());
  for (double time = 0.0; time < STOPPING; time += CYCLE)
  {
    nomad_.step(CYCLE);
  }
}

/** The homography of the view in images from here; empty when it is not followed. */
std::optional<Eigen::Matrix3d> MountTrial::look()
{
  constexpr int MOST_IMAGES = 15;
  constexpr double IMAGE_RATE = 10.0;  // [Hz]
  const Eigen::Isometry3d place = nomad_.cameraPose();
  const PlaneFinder::Answer answer = finder_.find({ view_, camera_.capture(place), std::nullopt });
  if (!answer.h)
  {
    return std::nullopt;
  }
  PlaneTracker tracker(view_->grey(), region_, world_.camera.k, {});
  tracker.start(*answer.h, std::nullopt);
  const auto corners = cornersOf(region_);
  StillPose still;
  for (int i = 0; i < MOST_IMAGES; ++i)
  {
    const PlaneTrack& track = tracker.add(camera_.capture(place), std::nullopt);
    if (track.state != TrackingState::TRACKING)
    {
      still.clear();
      continue;
    }
    ArmSample sample;
    sample.stamp = i / IMAGE_RATE;
    sample.flange_in_base = nomad_.odometry();
    for (const Eigen::Vector2d& corner : corners)
    {
      sample.seen.push_back(transfer(track.homography.h, corner));
    }
    if (const std::optional<ArmSample> mean = still.add(sample))
    {
      Correspondences pairs;
      for (std::size_t k = 0; k < mean->seen.size(); ++k)
      {
        pairs.push_back({ corners[k], mean->seen[k] });
      }
      return homographyFromPoints(pairs);
    }
  }
  return std::nullopt;
}

}  // namespace view_servo::sim
