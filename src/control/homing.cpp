// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/homing.h"

#include "view_servo/control/place_watch.h"
#include "view_servo/geometry/camera_warp.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/parameters/numbers.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double ODOMETRY_KEPT = 10.0;    // [s]
constexpr double ODOMETRY_BEHIND = 0.45;  // of an image, at most; nodes refuse more [s]
constexpr PlaceWatchLimits PLACE_LIMITS{ 0.015, 0.02, 0.04, 0.03, 0.2, 0.15 };

const char* const MOVES_OTHERWISE = "the picture does not move as the base does by odometry";

Eigen::Isometry3d toIsometry(const PlanarPose& pose)
{
  Eigen::Isometry3d result(Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitZ()));
  result.translation() << pose.x, pose.y, 0.0;
  return result;
}

/** Chapter 5 as printed. */
class ThesisHoming : public Homing
{
public:
  ThesisHoming(const HomingParams& params, const HomingTarget& target)
    : Homing(params, target), region_(params.vote), arrival_(params.arrival)
  {
  }

  Course course() const override
  {
    Course course;
    if (moving_ && !ended())
    {
      course.kind = Course::STEP;
      course.start = step_start_;
      course.heading = step_heading_;
      course.length = step_length_;
      course.speed = params_.step_speed;
    }
    return course;
  }

protected:
  void onOdometry(const PlanarPose& base_in_odom) override
  {
    if (moving_ && compose(inverse(step_start_), base_in_odom).distance() >= step_length_)
    {
      moving_ = false;
      step_end_known_ = false;
    }
  }

  void onMatches(double stamp, const HeadingEvidence& evidence, const PlanarPose& /*camera_in_odom*/) override
  {
    if (moving_ || ended() || !step_end_known_ || stamp < step_end_ || !(similarity_stamp_ >= step_end_))
    {
      return;  // not yet seen from where the last step ended
    }
    const HeadingHistogram histogram(evidence, 0.0, params_.vote);
    const double camera_yaw = target_.mount.on_base.yaw;
    report_.histogram = histogram.votesFor(camera_yaw);
    const std::optional<double> chosen = region_.choose(histogram);
    report_.roi_min = camera_yaw + region_.min();
    report_.roi_max = camera_yaw + region_.max();
    if (!chosen)
    {
      return;
    }
    last_trace_ = stamp;
    double sum = 0.0;
    for (const double vote : histogram.votes())
    {
      sum += vote;
    }
    const std::optional<std::size_t> bin = histogram.peak(*chosen, *chosen);
    report_.confidence = bin && sum > 0.0 ? histogram.votes()[*bin] / sum : 0.0;
    report_.inliers = static_cast<int>(evidence.pairs.size());

    const Arrival arrival = arrival_.add(report_.similarity);
    if (arrival == Arrival::REACHED)
    {
      report_.at_view = true;
      setState(HomingState::ARRIVED, "the correlation has dropped after its rise");
      return;
    }
    step_length_ = arrival == Arrival::NEAR ? params_.near_step : params_.step;
    // The camera's heading in base_link. Without rotation the base moves as the camera does.
    step_heading_ = target_.mount.on_base.yaw + *chosen;
    report_.heading = wrapAngle(step_heading_);
    report_.yaw_error = 0.0;
    step_start_ = *odometry_.newest();
    moving_ = true;
    setState(arrival == Arrival::NEAR ? HomingState::NEAR : HomingState::APPROACHING,
             arrival == Arrival::NEAR ? "the correlation has risen" : "the heading is known");
  }

  void onImage(double stamp, const cv::Mat& /*grey*/) override
  {
    constexpr double AT_REST = 0.003;  // moved between two images of a base that stands [m]
    if (ended())
    {
      return;
    }
    if (moving_)
    {
      last_trace_ = std::max(last_trace_, stamp);  // matches count only where the base stands, however long it is held
    }
    if (stamp - last_trace_ > params_.lost_timeout)
    {
      moving_ = false;
      setState(HomingState::FAILED,
               report_.state == HomingState::ACQUIRING ? "the view was not found" : "the view was lost");
      return;
    }
    const std::optional<PlanarPose> base = odometry_.at(stamp, ODOMETRY_BEHIND);
    if (!base || moving_)
    {
      last_base_.reset();
      return;
    }
    if (last_base_ && !step_end_known_ && compose(inverse(*last_base_), *base).distance() < AT_REST)
    {
      step_end_ = stamp;
      step_end_known_ = true;
    }
    last_base_ = base;
    similarity_stamp_ = stamp;
  }

private:
  HeadingRegion region_;
  ArrivalDetector arrival_;
  bool moving_ = false;
  double step_heading_ = 0.0;  // in the base's frame at its beginning
  double step_length_ = 0.0;
  PlanarPose step_start_;
  bool step_end_known_ = false;
  double step_end_ = 0.0;  // stamp of the first image at rest
  double similarity_stamp_ = NOT_A_NUMBER;
  std::optional<PlanarPose> last_base_;
};

/** Hypotheses from matches, then the view's points in image space. */
class ServoHoming : public Homing
{
public:
  ServoHoming(const HomingParams& params, const HomingTarget& target)
    : Homing(params, target),
      hypotheses_(params.hypotheses, target.camera.k(0, 0)),
      tracker_(target.image, target.camera, target.mount, params.tracker),
      law_(makeApproachLaw(params.approach, params.arrival_distance))
  {
    std::vector<ViewTracker::Point> points;
    for (const StructurePoint& point : target.structure.points)
    {
      const Eigen::Vector2d level = target.mount.level(target.view_camera.normalized(point.pixel));
      points.push_back({ { level, point.inverse_depth }, point.information, point.pixel });
    }
    if (tracker_.restore(points))
    {
      scale_corrections_ = ENOUGH_CORRECTIONS;
    }
  }

  ViewStructure structure() const override
  {
    constexpr double FADING = 0.25;  // of the information of points that are not seen at the view
    constexpr double LEAST = 0.001;  // information that is worth to be kept: of a point seen from 3 cm aside [m^2]
    ViewStructure result;
    if (!isMetric())
    {
      return result;
    }
    for (const ViewTracker::Point& point : tracker_.points())
    {
      const double fading = supports(point) || !report_.at_view ? 1.0 : FADING;
      const double information = scale_ * scale_ * point.information * fading;
      const Eigen::Vector2d pixel =
          target_.view_camera.project(target_.mount.unlevel(point.landmark.reference).homogeneous());
      if (information >= LEAST && pixel.allFinite())
      {
        result.points.push_back({ pixel, point.landmark.inverse_depth / scale_, information });
      }
    }
    return result;
  }

  std::vector<HomingLandmark> landmarks() const override
  {
    std::vector<HomingLandmark> result;
    if (!isMetric())
    {
      return result;
    }
    for (const ViewTracker::Point& point : tracker_.points())
    {
      const double depth = scale_ / point.landmark.inverse_depth;
      if (depth > 0.0 && std::isfinite(depth))
      {
        const Eigen::Vector3d level = depth * point.landmark.reference.homogeneous();
        result.push_back({ target_.mount.level_from_camera.transpose() * level, supports(point) });
      }
    }
    return result;
  }

  Course course() const override
  {
    if (!view_in_odom_ || ended() || report_.state == HomingState::LOST || report_.state == HomingState::ACQUIRING)
    {
      return Course();
    }
    if (isTesting())
    {
      return *test_;
    }
    Course course = law_->course();
    if (blind_)
    {
      // Matches alone do not say how far it is. The base slows down while it waits for the next ones.
      constexpr double SLOWEST = 0.2;
      const double left = (blindPatience() - (report_.stamp - last_trace_)) / (blindPatience() - matches_delay_);
      course.max_speed = params_.blind_speed * std::clamp(2.0 * left, SLOWEST, 1.0);
      course.min_speed = tracker_.hasStructure() ? course.min_speed : course.max_speed;
    }
    return course;
  }

protected:
  void onOdometry(const PlanarPose& base_in_odom) override
  {
    if (view_in_odom_ && !ended())
    {
      const PlanarPose moved = compose(inverse(blind_to_), base_in_odom);
      blind_to_ = base_in_odom;
      blind_distance_ += moved.distance();
      blind_turn_ += std::abs(moved.yaw);
      constexpr double ENOUGH = 0.75;  // of the step, whose last part is slow
      tested_ = tested_ || (test_ && compose(inverse(test_->start), base_in_odom).distance() >= ENOUGH * test_->length);
      approach(base_in_odom, false, false);
    }
  }

  void onMatches(double stamp, const HeadingEvidence& evidence, const PlanarPose& camera_in_odom) override
  {
    measurePace(stamp);
    hypotheses_.update(evidence.pairs, camera_in_odom);
    const bool any = !hypotheses_.list().empty();
    const PlanarPose followed = view_in_odom_ ? compose(inverse(camera_in_odom), *view_in_odom_)
                                              : (any ? hypotheses_.list().front().view_in_camera : PlanarPose());
    report_.histogram = HeadingHistogram(evidence, followed.yaw, params_.vote).votesFor(target_.mount.on_base.yaw);
    if (ended() || !any)
    {
      return;
    }
    if (!view_in_odom_ && tracker_.hasStructure() && locate(stamp, evidence.pairs, camera_in_odom))
    {
      return;  // by what was learnt of the view before
    }
    const HeadingHypothesis& best = hypotheses_.list().front();
    if (best.updates < MIN_UPDATES || best.support.empty())
    {
      return;
    }
    bool located = tracker_.hasStructure() && !tracked_ && locate(stamp, evidence.pairs, camera_in_odom);
    if (tracked_ || located)
    {
      checkStructure(best, evidence.pairs, camera_in_odom);
    }
    else if (tracker_.hasStructure())
    {
      contradict();  // matches are there, but its points are nowhere
    }
    if (params_.hypotheses.motion == CameraMotion::PLANAR && best.support.size() >= ENOUGH_SUPPORT)
    {
      if (startStructure(best, camera_in_odom))
      {
        // Matches that hardly move tell no direction to follow, but where the points are.
        located = !tracker_.depthsKnown() && locate(stamp, evidence.pairs, camera_in_odom);
      }
    }
    const bool trusted = !tracker_.hasStructure() || !view_in_odom_ || isNear(best.view_in_odom, camera_in_odom);
    if (!tracked_ && !located && trusted)
    {
      // Follow the direction; the next image may say more.
      follow(stamp, best.view_in_odom);
      report_.confidence = static_cast<double>(best.support.size()) / static_cast<double>(evidence.pairs.size());
      report_.inliers = static_cast<int>(best.support.size());
    }
  }

  void onImage(double stamp, const cv::Mat& grey) override
  {
    if (ended())
    {
      return;
    }
    tracked_ = report_.tracked = false;
    const std::optional<PlanarPose> base = odometry_.at(stamp, ODOMETRY_BEHIND);
    if (!base)
    {
      return;
    }
    const PlanarPose camera = compose(*base, target_.mount.on_base);
    if (tracker_.hasStructure() && view_in_odom_)
    {
      const PlanarPose predicted = compose(inverse(camera), *view_in_odom_);
      const ViewTracker::Result result =
          tracker_.track(grey, { predicted.x / scale_, predicted.y / scale_, predicted.yaw });
      if (result.found)
      {
        tracked_ = report_.tracked = true;
        correctScale(camera, result.pose);
        if (params_.check_motion)
        {
          watchPlace(camera, result.pose);
        }
        report_.inliers = result.supporting;
        report_.confidence = static_cast<double>(result.supporting) / result.looked_for;
        report_.displacement = result.displacement;
        clocks_.addImage(stamp, result.pose.yaw);
        if (stamp >= clocks_due_)
        {
          report_.odometry_delay = clocks_.estimate().value_or(report_.odometry_delay);
          clocks_due_ = stamp + CLOCKS_PERIOD;
        }
        const PlanarPose view = compose(camera, { scale_ * result.pose.x, scale_ * result.pose.y, result.pose.yaw });
        follow(stamp, averageAtRest(*base, view));
        view_covariance_ = inOdometry(result, camera.yaw);
        supporters_ = result.supporters;
        if (result.displacement <= IN_PLACE && watch_.trusted())
        {
          in_place_ = *view_in_odom_;
        }
      }
      else
      {
        watch_.interrupt();
      }
    }
    if (view_in_odom_)
    {
      approach(*odometry_.newest(), last_trace_ > last_known_, tracked_);
      last_known_ = last_trace_;
    }
    judge(stamp, *base);
  }

private:
  static constexpr std::size_t ENOUGH_SUPPORT = 40;  // matches that structure is made from
  static constexpr double CLOCKS_PERIOD = 0.5;       // between two estimates of their offset, which take a while [s]
  static constexpr int ENOUGH_CORRECTIONS = 10;      // of the scale, until it is that of metres
  static constexpr double IN_PLACE = 1.5;            // median displacement of the view's points at the view [px]
  static constexpr int MIN_UPDATES = 2;              // sets of matches that agree before a hypothesis is followed

  /** Whether a point was found where the pose puts it, in the last image in which the points were found. */
  bool supports(const ViewTracker::Point& point) const
  {
    return std::find(supporters_.begin(), supporters_.end(), point.landmark.reference) != supporters_.end();
  }

  /** The base's pose at the view, in odometry's frame. */
  PlanarPose goalInOdom() const
  {
    return compose(*view_in_odom_, inverse(target_.mount.on_base));
  }

  /** Tells the law of approach what is known; see Situation. */
  void approach(const PlanarPose& base_in_odom, bool known_anew, bool seen)
  {
    law_->update({ base_in_odom, goalInOdom(), known_anew, seen, [this](const PlanarPose& base) {
                    return shareInSight(base);
                  } });
  }

  /** Of the view, when the base is at a pose in the goal's frame. */
  double shareInSight(const PlanarPose& base_in_goal) const
  {
    const PlanarPose view = target_.mount.ofCamera(inverse(base_in_goal));
    return tracker_.shareInSight({ view.x / scale_, view.y / scale_, view.yaw });
  }

  /** The view's base pose as seen from the base. */
  PlanarPose goalInBase(const PlanarPose& base) const
  {
    return target_.mount.ofBase(compose(inverse(compose(base, target_.mount.on_base)), *view_in_odom_));
  }

  void follow(double stamp, const PlanarPose& view_in_odom)
  {
    view_in_odom_ = view_in_odom;
    blind_ = !tracked_;
    last_trace_ = std::max(stamp, last_trace_);
    blind_to_ = *odometry_.newest();
    blind_distance_ = blind_turn_ = 0.0;
  }

  /** @param stamp of the image in which matches have been found. */
  void measurePace(double stamp)
  {
    constexpr double WEIGHT = 0.3;
    constexpr double LONGEST = 0.5;  // [s]
    if (stamp > newest_matches_)
    {
      matches_period_ += WEIGHT * (std::min(stamp - newest_matches_, LONGEST) - matches_period_);
    }
    matches_delay_ += WEIGHT * (std::clamp(report_.stamp - stamp, 0.0, LONGEST) - matches_delay_);
    newest_matches_ = std::fmax(newest_matches_, stamp);
  }

  /**
   * How old the last matches' image may be while the base goes on by them: three periods of their rate after they are
   * due [s].
   */
  double blindPatience() const
  {
    constexpr double LEAST = 0.4;
    return matches_delay_ + std::max(3.0 * matches_period_, LEAST);
  }

  /** Whether the view's points are tracked, and their depths are known in metres. */
  bool isMetric() const
  {
    constexpr double MOST_DOUBT = 0.1;  // of the scale
    return tracked_ && tracker_.depthsKnown() && scale_corrections_ >= ENOUGH_CORRECTIONS &&
           scale_variance_ <= MOST_DOUBT * MOST_DOUBT;
  }

  /**
   * A base that cannot slide stands to look: what is seen from one place is averaged. @param view in odometry's frame.
   */
  PlanarPose averageAtRest(const PlanarPose& base_in_odom, const PlanarPose& view)
  {
    constexpr double AT_REST = 0.001;  // [m, rad]
    constexpr int MOST = 10;           // images
    const PlanarPose moved = compose(inverse(rest_), base_in_odom);
    if (params_.approach.base == BaseKind::HOLONOMIC || moved.distance() > AT_REST || std::abs(moved.yaw) > AT_REST)
    {
      rest_ = base_in_odom;
      images_at_rest_ = 1;
      return view;
    }
    images_at_rest_ = std::min(images_at_rest_ + 1, MOST);
    const double part = 1.0 / images_at_rest_;
    const PlanarPose& mean = *view_in_odom_;
    return { mean.x + part * (view.x - mean.x), mean.y + part * (view.y - mean.y),
             wrapAngle(mean.yaw + part * wrapAngle(view.yaw - mean.yaw)) };
  }

  /**
   * The covariance of where the view is: that of its pose in the camera, and of the scale that odometry has given it.
   */
  Eigen::Matrix3d inOdometry(const ViewTracker::Result& result, double camera_yaw) const
  {
    constexpr double LEAST_DOUBT = 0.05;  // wheels measure distances by some per cent wrong
    const double doubt = scale_ * std::max(LEAST_DOUBT, std::sqrt(scale_variance_));
    const Eigen::DiagonalMatrix<double, 3> metres(scale_, scale_, 1.0);
    const Eigen::Vector3d along(doubt * result.pose.x, doubt * result.pose.y, 0.0);
    const Eigen::Matrix3d turned = Eigen::AngleAxisd(camera_yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    return turned * (metres * result.covariance * metres + along * along.transpose()) * turned.transpose();
  }

  /**
   * Whether a base that cannot slide goes on by odometry: its way may lead over where little of the view is in sight.
   */
  bool mayGoOn() const
  {
    const ManoeuvreParams& limits = params_.approach.manoeuvre;
    return params_.approach.base == BaseKind::DIFFERENTIAL && blind_distance_ <= limits.max_blind_distance &&
           blind_turn_ <= limits.max_blind_turn &&
           shareInSight(compose(inverse(goalInOdom()), *odometry_.newest())) < limits.min_share;
  }

  /**
   * Structure from the matches of a hypothesis, when there is none, or when its depths are only assumed and these tell
   * them: the base was near the view then. @return whether it is new.
   */
  bool startStructure(const HeadingHypothesis& best, const PlanarPose& camera_in_odom)
  {
    if (tracker_.hasStructure() && tracker_.depthsKnown())
    {
      return false;
    }
    constexpr double LONGEST = 1.0;  // way by odometry that says how far it is from where the view was in place [m]
    const bool from_view = in_place_ && compose(inverse(camera_in_odom), *in_place_).distance() < LONGEST;
    const PlanarPose unit = best.view_in_camera;
    const double distance = compose(inverse(camera_in_odom), from_view ? *in_place_ : best.view_in_odom).distance();
    ViewTracker fresh = tracker_;
    if (!fresh.start(best.support, { distance * unit.x, distance * unit.y, unit.yaw }) ||
        (tracker_.hasStructure() && !fresh.depthsKnown()))
    {
      return false;
    }
    tracker_ = std::move(fresh);
    if (view_in_odom_ && params_.check_motion)
    {
      watch_.restart(toIsometry(*view_in_odom_));
    }
    scale_ = trusted_scale_ = 1.0;
    scale_corrections_ = from_view ? ENOUGH_CORRECTIONS : 0;
    scale_variance_ = 0.0;
    trail_.clear();
    contradictions_ = 0;
    return true;
  }

  /** After the points were not found: where are they by matches? */
  bool locate(double stamp, const Correspondences& matches, const PlanarPose& camera)
  {
    const ViewTracker::Result result = tracker_.locate(matches);
    if (!result.found)
    {
      return false;
    }
    follow(stamp, compose(camera, { scale_ * result.pose.x, scale_ * result.pose.y, result.pose.yaw }));
    return true;
  }

  /** Matches that agree with the structure extend it; several sets that agree more with another motion end it. */
  void checkStructure(const HeadingHypothesis& best, const Correspondences& matches, const PlanarPose& camera)
  {
    constexpr double CLEARLY_LESS = 0.7;
    if (report_.tracked && report_.displacement <= params_.hypotheses.inlier_threshold)
    {
      return;  // where nothing has moved, any motion explains matches
    }
    const PlanarPose pose = compose(inverse(camera), *view_in_odom_);
    const double threshold = params_.hypotheses.inlier_threshold / target_.camera.k(0, 0);
    const Eigen::Matrix3d essential = essentialMatrix(pose);
    Correspondences agreeing;
    for (const Correspondence& match : matches)
    {
      if (sampsonError(essential, match) <= threshold * threshold && inverseDepth(match, pose).value > 0.0)
      {
        agreeing.push_back(match);
      }
    }
    if (static_cast<double>(agreeing.size()) < CLEARLY_LESS * static_cast<double>(best.support.size()))
    {
      contradict();
      return;
    }
    contradictions_ = 0;
    tracker_.extend(agreeing, { pose.x / scale_, pose.y / scale_, pose.yaw });
  }

  /**
   * Whether matches put the view about where its points were last: one set that says otherwise is no reason to forget
   * these. @param view_in_odom by matches.
   */
  bool isNear(const PlanarPose& view_in_odom, const PlanarPose& camera_in_odom) const
  {
    constexpr double DIRECTION = 0.35;  // [rad]
    constexpr double NEAR = 0.3;        // where a direction means little [m]
    const PlanarPose other = compose(inverse(camera_in_odom), view_in_odom);
    const PlanarPose known = compose(inverse(camera_in_odom), *view_in_odom_);
    const bool same_direction =
        known.distance() < NEAR || std::abs(wrapAngle(other.heading() - known.heading())) < DIRECTION;
    return same_direction && std::abs(wrapAngle(other.yaw - known.yaw)) < DIRECTION;
  }

  void contradict()
  {
    constexpr int MAX_CONTRADICTIONS = 3;
    if (++contradictions_ >= MAX_CONTRADICTIONS)
    {
      tracker_.clear();
      tracked_ = false;
      contradictions_ = 0;
    }
  }

  /**
   * What does not move as the base does makes the unit of the structure wrong, too, which is what it was before then.
   */
  void watchPlace(const PlanarPose& camera_in_odom, const PlanarPose& view_in_camera)
  {
    const bool contradicted = watch_.contradicted();
    watch_.add(toIsometry(camera_in_odom), toIsometry(view_in_camera), contradicted ? trusted_scale_ : scale_);
    if (watch_.trusted())
    {
      trusted_scale_ = scale_;
    }
    else if (contradicted && !watch_.contradicted())
    {
      scale_ = trusted_scale_;
      trail_.clear();
    }
  }

  /** The unit of the structure, from how far odometry says the camera has moved within it. */
  void correctScale(const PlanarPose& camera_in_odom, const PlanarPose& view_in_camera)
  {
    constexpr double LONGEST = 0.3;    // of the motion compared: near the end, recent motion counts [m]
    constexpr double SHORTEST = 0.08;  // [m]
    constexpr double WEIGHT = 0.2;
    constexpr double MAX_CHANGE = 4.0;
    constexpr double MAX_SCALE = 20.0;
    constexpr std::size_t MOST = 1000;
    const PlanarPose camera_in_view = inverse(view_in_camera);
    if (trail_.size() >= MOST)
    {
      trail_.pop_back();  // the camera stands
    }
    trail_.push_back({ camera_in_odom, camera_in_view });
    while (trail_.size() > 2 && compose(inverse(trail_[1].in_odom), camera_in_odom).distance() > LONGEST)
    {
      trail_.pop_front();
    }
    const PlanarPose by_odometry = compose(inverse(trail_.front().in_odom), camera_in_odom);
    const PlanarPose by_view = compose(inverse(trail_.front().in_view), camera_in_view);
    if (by_odometry.distance() >= SHORTEST)
    {
      // The seen way counts as far as it goes along the driven one: errors make it longer, but not that part of it.
      const double squared = by_odometry.distance() * by_odometry.distance();
      const double along = by_odometry.x * by_view.x + by_odometry.y * by_view.y;
      const double measured = std::clamp(squared / std::max(along, 0.0), scale_ / MAX_CHANGE, scale_ * MAX_CHANGE);
      const double change = std::log(measured / scale_);
      const double weight = std::max(WEIGHT, 1.0 / (scale_corrections_ + 1));  // a plain mean of the first ones
      scale_variance_ += weight * (change * change - scale_variance_);
      scale_ = std::clamp(scale_ * std::pow(measured / scale_, weight), 1.0 / MAX_SCALE, MAX_SCALE);
      ++scale_corrections_;
    }
  }

  /** State, arrival and loss after an image. */
  void judge(double stamp, const PlanarPose& base)
  {
    constexpr double LONGEST_BLIND = 3.0;  // that a base goes on by odometry [s]
    if (!view_in_odom_)
    {
      giveUpAfter(stamp, started_, "the view was not found", HomingState::ACQUIRING, "looking for the view");
      way_known_ = stamp;
      return;
    }
    const PlanarPose goal = reportGoal(base);
    report_.at_view = report_.contradicted = false;
    report_.trusted = watch_.trusted();
    const bool blank = std::isnan(report_.similarity);
    const double unseen = stamp - last_trace_;
    if (!law_->failure().empty())
    {
      setState(HomingState::FAILED, law_->failure());
      return;
    }
    if (law_->course().kind != Course::STAND)
    {
      way_known_ = stamp;
    }
    else if (stamp - way_known_ > params_.lost_timeout)
    {
      setState(HomingState::FAILED, law_->text());
      return;
    }
    if (blank || unseen > (mayGoOn() ? LONGEST_BLIND : blind_ ? blindPatience() : 0.0))
    {
      within_since_ = NOT_A_NUMBER;
      giveUpAfter(stamp, last_trace_, "the view was lost", HomingState::LOST,
                  blank ? "the image shows nothing" : "the view is not found any more");
      return;
    }
    if (!watch_.contradicted())
    {
      contradicted_since_ = NOT_A_NUMBER;
    }
    else
    {
      report_.contradicted = true;
      within_since_ = NOT_A_NUMBER;
      contradicted_since_ = std::fmin(contradicted_since_, stamp);
      giveUpAfter(stamp, contradicted_since_, MOVES_OTHERWISE, HomingState::LOST, MOVES_OTHERWISE);
      return;
    }
    if (!tracked_)
    {
      within_since_ = NOT_A_NUMBER;
      setState(HomingState::APPROACHING, "the heading is known");
      return;
    }
    judgePlace(stamp, goal);
  }

  /** What the report says of the view's pose, once it is known. @return this pose in the base. */
  PlanarPose reportGoal(const PlanarPose& base)
  {
    constexpr double POSITION_DOUBT = 0.05;  // of where the view is, for the region of interest [m]
    const PlanarPose goal = goalInBase(base);
    report_.heading = goal.heading();
    report_.yaw_error = goal.yaw;
    report_.distance = goal.distance();
    const double half_width =
        std::clamp(std::atan2(POSITION_DOUBT, report_.distance), params_.vote.min_half_width, M_PI_2);
    report_.roi_min = report_.heading - half_width;
    report_.roi_max = report_.heading + half_width;

    report_.manoeuvre = law_->text();
    report_.goal_in_odom.reset();
    if (isMetric())
    {
      report_.goal_in_odom = goalInOdom();
      // The base stands beside its camera: an error of the view's yaw moves it about there.
      Eigen::Matrix3d by_view = Eigen::Matrix3d::Identity();
      by_view(0, 2) = view_in_odom_->y - report_.goal_in_odom->y;
      by_view(1, 2) = report_.goal_in_odom->x - view_in_odom_->x;
      report_.goal_covariance = by_view * view_covariance_ * by_view.transpose();
    }
    return goal;
  }

  /** State and arrival while the view's points are tracked. */
  void judgePlace(double stamp, const PlanarPose& goal)
  {
    constexpr double ARRIVED_CONFIDENCE = 0.75;  // share of the points that must be there
    constexpr double AT_VIEW_DISPLACEMENT = 15.0;
    // Whatever the structure and its scale say, the points must be where the view has them.
    const bool in_place = report_.displacement <= IN_PLACE && report_.confidence >= ARRIVED_CONFIDENCE &&
                          report_.similarity >= params_.min_similarity;
    const bool near = report_.distance <= params_.arrival_distance && std::abs(goal.yaw) <= params_.arrival_yaw &&
                      report_.displacement <= AT_VIEW_DISPLACEMENT && report_.similarity >= params_.min_similarity;
    report_.at_view = near && watch_.trusted();
    const bool within =
        in_place && report_.distance <= law_->tolerance() && std::abs(goal.yaw) <= params_.approach.yaw_tolerance;
    if (isInDoubt(in_place, within))
    {
      within_since_ = NOT_A_NUMBER;
      doubted_since_ = std::fmin(doubted_since_, stamp);
      if (isTesting())
      {
        setState(HomingState::DOCKING, "it steps back to see whether the view moves as it does");
      }
      else
      {
        report_.contradicted = true;
        giveUpAfter(stamp, doubted_since_, MOVES_OTHERWISE, HomingState::LOST, MOVES_OTHERWISE);
      }
      return;
    }
    doubted_since_ = NOT_A_NUMBER;
    if (!within)
    {
      within_since_ = NOT_A_NUMBER;
    }
    else if (std::isnan(within_since_))
    {
      within_since_ = stamp;
    }
    if (within && stamp - within_since_ >= params_.dwell)
    {
      setState(HomingState::ARRIVED, "the views agree");
    }
    else if (report_.displacement <= params_.docking_displacement)
    {
      setState(HomingState::DOCKING, "the view's points are nearly in place");
    }
    else if (report_.displacement <= 2.0 * params_.docking_displacement)
    {
      setState(HomingState::NEAR, "the view's points are tracked, and come nearer to their place");
    }
    else
    {
      setState(HomingState::APPROACHING, "the view's points are tracked");
    }
  }

  /**
   * Whether something speaks against what looks like the view, as it appeared at once where it was not. The base is to
   * step back then, once, to see whether the view moves.
   * @param in_place whether the view's points are where they have to be. @param within whether the base is, too.
   */
  bool isInDoubt(bool in_place, bool within)
  {
    if (within && !watch_.trusted() && !test_)
    {
      constexpr double LENGTH = 0.08;  // [m]
      constexpr double SPEED = 0.05;   // [m/s]
      tested_ = false;
      test_.emplace();
      test_->kind = Course::STEP;
      test_->start = *odometry_.newest();
      test_->heading = M_PI;
      test_->length = LENGTH;
      test_->speed = SPEED;
    }
    if (watch_.trusted())
    {
      test_.reset();
    }
    return test_ && (in_place || isTesting());
  }

  /** Whether the base is on its step back. */
  bool isTesting() const
  {
    return test_ && !tested_;
  }

  void giveUpAfter(double stamp, double since, const std::string& failure, HomingState waiting, const std::string& why)
  {
    if (stamp - since > params_.lost_timeout)
    {
      setState(HomingState::FAILED, failure);
    }
    else
    {
      setState(waiting, why);
    }
  }

  struct Place
  {
    PlanarPose in_odom;
    PlanarPose in_view;
  };

  double clocks_due_ = 0.0;  // stamp of the image after which the offset of clocks is estimated anew
  HeadingHypotheses hypotheses_;
  ViewTracker tracker_;
  std::unique_ptr<ApproachLaw> law_;
  std::optional<PlanarPose> view_in_odom_;                     // the view's level camera
  double scale_ = 1.0;                                         // metres in a unit of the tracker's
  double trusted_scale_ = 1.0;                                 // what it was when the view last moved as the base did
  int scale_corrections_ = 0;                                  // of it, by odometry
  double scale_variance_ = 0.0;                                // of the parts by which the last ones changed it
  Eigen::Matrix3d view_covariance_ = Eigen::Matrix3d::Zero();  // of the view's place in odometry's frame [m, rad]
  std::deque<Place> trail_;                                    // of the camera, newest last
  PlaceWatch watch_{ PLACE_LIMITS };
  double contradicted_since_ = NOT_A_NUMBER;  // stamp of the first image with which watch_ was so
  double doubted_since_ = NOT_A_NUMBER;       // of the first at the view that watch_ does not trust
  std::optional<Course> test_;                // the step back, from when the view was doubted until it is trusted
  bool tested_ = false;                       // the step back has been made
  bool tracked_ = false;                      // in the last image
  bool blind_ = true;                         // what was followed last were matches
  double last_known_ = 0.0;                   // last_trace_ when the law of approach was told of it
  double way_known_ = 0.0;                    // stamp of the last image with a way to the view
  PlanarPose rest_;                           // where the base stood when the first of these images was taken
  int images_at_rest_ = 0;                    // in a row
  PlanarPose blind_to_;          // the newest base pose; the next two are the way there since the view was seen
  double blind_distance_ = 0.0;  // [m]
  double blind_turn_ = 0.0;      // [rad]
  double within_since_ = NOT_A_NUMBER;
  int contradictions_ = 0;
  std::optional<PlanarPose> in_place_;       // where the view was, in odometry's frame, when its points were in place
  std::vector<Eigen::Vector2d> supporters_;  // in the last image in which the points were found
  double newest_matches_ = NOT_A_NUMBER;     // stamp of the newest image with matches
  double matches_period_ = 0.2;              // between the images with matches, in the mean of late [s]
  double matches_delay_ = 0.1;               // until their matches come, in the mean of late [s]
};

/** The parameters that no part of homing has by itself. */
std::vector<Parameter> rowsOfHoming(HomingParams& params)
{
  return {
    choice<HomingMode>("mode", params.mode, { { "servo", HomingMode::SERVO }, { "thesis", HomingMode::THESIS } },
                       "how to home: by all that this package knows, or as printed in chapter 5 of the thesis: without "
                       "rotation, straight to a "
                       "goal ahead, in steps, until the correlation of the gradients has risen and drops again"),
    real("lost_timeout", params.lost_timeout, "s", "> 0", "time without a trace of the view, after which it gives up"),
    real("blind_speed", params.blind_speed, "m/s", "> 0", "speed while only the heading is known"),
    real("dwell", params.dwell, "s", ">= 0", "time that it has to stay within the tolerances"),
    real("arrival_distance", params.arrival_distance, "m", "> 0",
         "distance at which the heading is published as ARRIVED"),
    real("arrival_yaw", params.arrival_yaw, "rad", "> 0", "yaw error at which the heading is published as ARRIVED"),
    boolean("check_motion", params.check_motion,
            "whether the view has to be seen to move as the base does by odometry; false: for a base on a stand"),
    real("min_similarity", params.min_similarity, "", "[-1, 1)",
         "least correlation of the gradients where homing may end"),
    real("docking_displacement", params.docking_displacement, "px", "> 0",
         "median displacement of the view's points below which homing docks"),
    real("step", params.step, "m", "> 0", "thesis: length of a step, after which it looks for the heading again"),
    real("near_step", params.near_step, "m", "> 0", "thesis: the same after the rise of the correlation"),
    real("step_speed", params.step_speed, "m/s", "> 0", "thesis: speed of a step"),
  };
}

}  // namespace

Progress toProgress(const HomingReport& report)
{
  const std::string reason = report.reason.empty() ? "no image has been worked on yet" : report.reason;
  switch (report.state)
  {
    case HomingState::ACQUIRING:
      return { Progress::ACQUIRING, reason };
    case HomingState::LOST:
      return { Progress::LOST, reason };
    case HomingState::ARRIVED:
      return { Progress::ARRIVED, reason };
    case HomingState::FAILED:
      return { Progress::FAILED, reason };
    default:
      return { Progress::DRIVING, reason };
  }
}

std::vector<Parameter> parameters(HomingParams& params)
{
  return joined({ rowsOfHoming(params), parameters(params.approach), parameters(params.hypotheses),
                  parameters(params.tracker), parameters(params.vote), parameters(params.arrival) });
}

std::vector<std::string> HomingParams::validate() const
{
  HomingParams copy = *this;
  Faults faults;
  faults.add(faultsOf(rowsOfHoming(copy)));
  faults.add(faultsOf(parameters(copy.approach)));
  faults.require(mode != HomingMode::THESIS || approach.base == BaseKind::HOLONOMIC,
                 "mode thesis drives without turning: it needs base: holonomic");
  faults.add(hypotheses.validate());
  faults.add(tracker.validate());
  faults.add(vote.validate());
  faults.add(arrival.validate());
  return faults.list();
}

Homing::Homing(const HomingParams& params, HomingTarget target)
  : params_(params),
    target_(std::move(target)),
    odometry_(ODOMETRY_KEPT),
    started_(NOT_A_NUMBER),
    last_trace_(NOT_A_NUMBER),
    reference_gradients_(gradientMagnitude(target_.image))
{
}

void Homing::addMatches(double stamp, const HeadingEvidence& pixels)
{
  const std::optional<PlanarPose> base = odometry_.at(stamp, ODOMETRY_BEHIND);
  if (!base)
  {
    return;
  }
  Points reference;
  Points current;
  for (const Correspondence& pair : pixels.pairs)
  {
    reference.push_back(pair.reference);
    current.push_back(pair.current);
  }
  reference = target_.view_camera.normalized(reference);
  current = target_.camera.normalized(current);
  HeadingEvidence evidence;
  for (std::size_t i = 0; i < pixels.pairs.size(); ++i)
  {
    const Correspondence pair{ target_.mount.level(reference[i]), target_.mount.level(current[i]) };
    if (pair.reference.allFinite() && pair.current.allFinite())
    {
      evidence.pairs.push_back(pair);
      evidence.weights.push_back(pixels.weights[i]);
    }
  }
  onMatches(stamp, evidence, compose(*base, target_.mount.on_base));
}

void Homing::addImage(double stamp, const cv::Mat& grey)
{
  if (std::isnan(started_))
  {
    started_ = last_trace_ = stamp;
  }
  report_.stamp = stamp;
  report_.similarity = gradientSimilarity(reference_gradients_, gradientMagnitude(grey));
  onImage(stamp, grey);
}

std::unique_ptr<Homing> makeHoming(const HomingParams& params, const HomingTarget& target)
{
  requireNoFaults("parameters of homing", params.validate());
  if (target.image.empty() || target.image.type() != CV_8UC1)
  {
    throw std::invalid_argument("the stored view is not an 8-bit grey image");
  }
  HomingTarget seen = target;  // as the camera that drives would have taken it
  seen.image = CameraWarp(target.view_camera, target.camera).image(target.image);
  if (params.mode == HomingMode::THESIS)
  {
    return std::make_unique<ThesisHoming>(params, seen);
  }
  return std::make_unique<ServoHoming>(params, seen);
}

}  // namespace view_servo
