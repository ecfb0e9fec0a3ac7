// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/servo_25d.h"

#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/parameters/numbers.h"

#include <visp3/core/vpColVector.h>
#include <visp3/core/vpThetaUVector.h>
#include <visp3/visual_features/vpFeatureDepth.h>
#include <visp3/visual_features/vpFeaturePoint.h>
#include <visp3/visual_features/vpFeatureThetaU.h>
#include <visp3/vs/vpAdaptiveGain.h>
#include <visp3/vs/vpServo.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr PlaceWatchLimits PLACE_LIMITS{ 0.004, 0.01, 0.004, 0.01, 0.05, 0.15 };
constexpr double DEAD_TIMES[] = { 0.0, 0.15, 0.3 };  // of the arms that are thought of [s]

/** The displacement of a body that moves by a twist of its own for a time: where its frame is in the former one. */
Eigen::Isometry3d displacement(const Twist& twist, double duration)
{
  const Eigen::Vector3d way = duration * twist.head<3>();
  const Eigen::Vector3d turn = duration * twist.tail<3>();
  const double angle = turn.norm();
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.translation() = way;
  if (angle > 1e-9)
  {
    const Eigen::Vector3d axis = turn / angle;
    result.linear() = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    // The exponential of the twist: along the axis straight, across it on an arc.
    const Eigen::Vector3d across = way - axis.dot(way) * axis;
    result.translation() =
        axis.dot(way) * axis + std::sin(angle) / angle * across + (1.0 - std::cos(angle)) / angle * axis.cross(across);
  }
  return result;
}

std::string describe(double translation, double rotation)
{
  char text[100];
  std::snprintf(text, sizeof(text), "%.2f mm and %.3f degrees from the view", 1e3 * translation, DEGREES * rotation);
  return text;
}

}  // namespace

Progress toProgress(const ServoReport& report)
{
  switch (report.state)
  {
    case ServoState::ACQUIRING:
      return { Progress::ACQUIRING, report.reason };
    case ServoState::SERVOING:
      return { Progress::DRIVING, "drives to the view" };
    case ServoState::LOST:
      return { Progress::LOST, report.reason };
    case ServoState::CONVERGED:
      return { Progress::ARRIVED, report.reason };
    default:
      return { Progress::FAILED, report.reason };
  }
}

Servo25dError servo25dError(const EuclideanHomography& motion, const Eigen::Vector2d& point)
{
  const Eigen::Vector3d seen = motion.matrix() * point.homogeneous();
  // X_cur = Z* (R + t nᵀ / d) m*: the third number is the ratio of the depths.
  return { seen.hnormalized() - point, std::log(seen.z()), rotationVector(motion.rotation.transpose()) };
}

/** ViSP's task: the features stay, their values change. */
struct Servo25d::Task
{
  vpFeaturePoint point;
  vpFeaturePoint wanted_point;
  vpFeatureDepth depth;
  vpFeatureThetaU turn{ vpFeatureThetaU::cdRc };
  vpServo servo;

  explicit Task(const Servo25dParams& params)
  {
    servo.setServo(vpServo::EYEINHAND_CAMERA);
    servo.setInteractionMatrixType(vpServo::CURRENT, vpServo::PSEUDO_INVERSE);
    setGains(params);
    servo.addFeature(point, wanted_point);
    servo.addFeature(depth);
    servo.addFeature(turn);
  }

  void setGains(const Servo25dParams& params)
  {
    constexpr double SLOPE = 8.0;  // of the gain where there is no error [1/s]
    servo.setLambda(vpAdaptiveGain(params.near_gain, params.gain, SLOPE));
  }
};

Servo25d::Servo25d(const ServoTarget& target, const Servo25dParams& params)
  : params_(params), target_(target), chosen_((target.k.inverse() * target.point.homogeneous()).hnormalized())
{
  requireNoFaults("parameters of 2.5D servoing", params.validate());
  if (!(gainsAt(target.point).minCoeff() > 0.0))
  {
    throw std::invalid_argument("the chosen point of the view is outside the image or within its margin");
  }
  task_ = std::make_unique<Task>(params);
  for (const double dead_time : DEAD_TIMES)
  {
    cameras_.push_back({ dead_time, PlaceWatch(PLACE_LIMITS) });
  }
}

Servo25d::~Servo25d() = default;

Eigen::Vector2d Servo25d::gainsAt(const Eigen::Vector2d& pixel) const
{
  Eigen::Vector2d gains;
  for (int i = 0; i < 2; ++i)
  {
    // Of the image's size: how far inside the margin the point is. The gain rises over as much as the margin is wide,
    // less where the chosen point's own place is nearer to it, where nothing may hold the camera back.
    const auto inside = [&](double at) {
      return std::min(at, target_.size(i) - 1.0 - at) / target_.size(i) - params_.margin;
    };
    const double ramp = std::min(std::max(params_.margin, 0.05), inside(target_.point(i)));
    gains(i) = ramp > 0.0 ? std::clamp(inside(pixel(i)) / ramp, 0.0, 1.0) : 0.0;
  }
  return gains;
}

double Servo25d::distance() const
{
  return distance_.value_or(params_.distance);
}

void Servo25d::add(const PlaneView& view)
{
  if (report_.state == ServoState::FAILED || (view_ && view.stamp < view_->stamp))
  {
    return;
  }
  if (!view.motion.matrix().allFinite() || (view.distance && !(*view.distance > 0.0)))
  {
    addLoss(view.stamp, "the homography is not finite");
    return;
  }
  view_ = view;
  if (view.distance)
  {
    distance_ = view.distance;
  }
  lost_since_.reset();
  moveOnTo(view.stamp);
  Eigen::Isometry3d view_in_camera(view.motion.rotation);
  view_in_camera.translation() = view.motion.translation_over_distance;
  if (!sent_.empty())  // in a dry run nobody knows how the camera moves
  {
    bool jumped = false;
    for (CommandedCamera& camera : cameras_)
    {
      jumped = camera.watch.add(camera.pose, view_in_camera, distance()) || jumped;
    }
    // How far the camera has moved unseen depends on how late the arm follows: it may be less than any of them says.
    for (CommandedCamera& camera : cameras_)
    {
      if (jumped && interrupted_)
      {
        camera.watch.doubt();
      }
    }
    interrupted_ = false;
  }
  updateReport();
  judge(view.stamp);
}

void Servo25d::moveOnTo(double stamp)
{
  if (moved_until_ && stamp > *moved_until_)
  {
    for (CommandedCamera& camera : cameras_)
    {
      camera.pose = camera.pose * motionSince(*moved_until_ - camera.dead_time, stamp - camera.dead_time).inverse();
    }
  }
  moved_until_ = moved_until_ ? std::max(*moved_until_, stamp) : stamp;
}

bool Servo25d::trusted() const
{
  return std::any_of(cameras_.begin(), cameras_.end(), [](const auto& camera) { return camera.watch.trusted(); });
}

bool Servo25d::contradicted() const
{
  return std::all_of(cameras_.begin(), cameras_.end(), [](const auto& camera) { return camera.watch.contradicted(); });
}

void Servo25d::updateReport()
{
  const Servo25dError error = servo25dError(view_->motion, chosen_);
  report_.error = error;
  report_.point = (target_.k * (chosen_ + error.point).homogeneous()).hnormalized();
  report_.gains = gainsAt(report_.point);
  report_.point_error = (report_.point - target_.point).norm();
  report_.rotation_error = error.rotation.norm();
  report_.translation_error = view_->motion.translation_over_distance.norm() * distance();
  report_.inliers = view_->inliers;
}

void Servo25d::judge(double stamp)
{
  const bool at_view = report_.translation_error <= params_.translation_tolerance &&
                       report_.rotation_error <= params_.rotation_tolerance;
  if (contradicted() || (at_view && !trusted()))
  {
    within_since_.reset();
    doubted_since_ = doubted_since_.value_or(stamp);
    report_.state = stamp - *doubted_since_ > params_.lost_timeout ? ServoState::FAILED : ServoState::LOST;
    report_.reason = contradicted() ? "the picture does not move as the camera is told to"
                                    : "the view appeared at once where it was not, and has not been seen to move since";
    return;
  }
  doubted_since_.reset();
  if (!at_view)
  {
    within_since_.reset();
  }
  else if (!within_since_)
  {
    within_since_ = stamp;
  }
  const bool converged = at_view && stamp - *within_since_ >= params_.dwell;
  report_.state = converged ? ServoState::CONVERGED : ServoState::SERVOING;
  report_.reason = describe(report_.translation_error, report_.rotation_error);
  if (!distance_)
  {
    report_.reason += ", if its plane is " + std::to_string(params_.distance).substr(0, 4) + " m away";
  }
}

void Servo25d::addLoss(double stamp, const std::string& reason)
{
  if (report_.state == ServoState::FAILED)
  {
    return;
  }
  lost_since_ = lost_since_.value_or(stamp);
  moveOnTo(stamp);
  within_since_.reset();
  report_.inliers = 0;
  if (view_ && stamp - view_->stamp <= params_.loss_tolerance)
  {
    return;
  }
  interrupted_ = true;
  for (CommandedCamera& camera : cameras_)
  {
    camera.watch.interrupt();
  }
  if (stamp - *lost_since_ > params_.lost_timeout)
  {
    report_.state = ServoState::FAILED;
    report_.reason = std::string(view_ ? "the view is lost: " : "the view is not found: ") + reason;
    return;
  }
  report_.state = view_ ? ServoState::LOST : ServoState::ACQUIRING;
  report_.reason = reason;
}

void Servo25d::setGains(double gain, double near_gain)
{
  Servo25dParams params = params_;
  params.gain = gain;
  params.near_gain = near_gain;
  requireNoFaults("parameters of 2.5D servoing", params.validate());
  params_ = params;
  task_->setGains(params_);
}

void Servo25d::sent(double time, const Twist& twist)
{
  constexpr double KEPT = 2.0;  // [s]
  if (!sent_.empty() && time < sent_.back().time)
  {
    sent_.clear();  // time has gone back
  }
  sent_.push_back({ time, twist });
  while (sent_.size() > 1 && sent_[1].time < time - KEPT)
  {
    sent_.pop_front();
  }
}

Eigen::Isometry3d Servo25d::motionSince(double begin, double end) const
{
  Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();  // in its frame at the beginning
  for (std::size_t i = 0; i < sent_.size(); ++i)
  {
    const double from = std::max(begin, sent_[i].time);
    const double to = i + 1 < sent_.size() ? std::min(end, sent_[i + 1].time) : end;
    if (to > from)
    {
      camera = camera * displacement(sent_[i].twist, to - from);
    }
  }
  return camera.inverse();
}

Twist Servo25d::command(double time)
{
  constexpr double LONGEST = 0.5;  // that an image is fed forward [s]
  if (report_.state != ServoState::SERVOING && report_.state != ServoState::CONVERGED)
  {
    return Twist::Zero();
  }
  const double until = std::min(time, view_->stamp + LONGEST);
  const EuclideanHomography now = movedOn(view_->motion, motionSince(view_->stamp, until), distance());
  const Servo25dError error = servo25dError(now, chosen_);
  const double depth = distance() / now.normal.dot(chosen_.homogeneous()) * std::exp(error.depth);
  const Eigen::Vector2d at = chosen_ + error.point;
  constexpr double SMALLEST_DEPTH = 1e-4;  // with which ViSP's interaction matrix can be computed [m]
  if (!at.allFinite() || !std::isfinite(depth) || !(depth > SMALLEST_DEPTH) || !error.rotation.allFinite())
  {
    return Twist::Zero();
  }
  const double slow_down = gainsAt((target_.k * at.homogeneous()).hnormalized()).minCoeff();
  const Eigen::Vector3d turn = slow_down * error.rotation;
  vpThetaUVector turn_left(turn.x(), turn.y(), turn.z());
  task_->point.buildFrom(at.x(), at.y(), depth);
  task_->wanted_point.buildFrom(chosen_.x(), chosen_.y(), depth);
  task_->depth.buildFrom(at.x(), at.y(), depth, slow_down * error.depth);
  task_->turn.buildFrom(turn_left);
  const vpColVector twist = task_->servo.computeControlLaw();
  const Twist result = Eigen::Map<const Twist>(twist.data);
  return result.allFinite() ? result : Twist(Twist::Zero());
}

}  // namespace view_servo
