// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/scene_tracker.h"

#include "corner_patches.h"
#include "odometry_scale.h"
#include "patch.h"
#include "scene_structure.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/robust/quantile.h"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
/** A pose of the camera, and what was seen from there. */
struct Place
{
  SceneFrame frame;
  std::optional<Eigen::Isometry3d> camera_in_odom;
};

/** What one image shows. */
struct Sight
{
  bool found = false;
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  int looked_for = 0;
  std::vector<SceneSighting> supporting;
  double rms = 0.0;  // of their residuals, in points
};

}  // namespace

class SceneTracker::Impl
{
public:
  Impl(const cv::Mat& reference, const cv::Rect& region, const Eigen::Matrix3d& k, const PlaneTrackerParams& params)
    : params_(params),
      k_(k),
      region_(checkedRegion(reference, region, params.aligner)),
      pixels_(findCorners(reference, region_, params.aligner)),
      patches_(patchesOf(reference, pixels_, params.aligner))
  {
  }

  const Points& points() const
  {
    return pixels_;
  }

  std::vector<double> depths() const
  {
    std::vector<double> depths;
    for (const ScenePoint& point : structure_)
    {
      depths.push_back(1.0 / (point.inverse_depth * unitDepth()));
    }
    return depths;
  }

  void start(const SceneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom);
  PlaneTrack add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom);
  std::optional<CameraPose> cameraPose() const;

private:
  struct Last
  {
    Eigen::Isometry3d motion;
    std::vector<SceneSighting> supporting;
    std::optional<Eigen::Isometry3d> camera_in_odom;
  };

  double pixel() const
  {
    return 2.0 / (k_(0, 0) + k_(1, 1));
  }
  Eigen::Isometry3d predict(const std::optional<Eigen::Isometry3d>& camera_in_odom) const;
  bool contradictsOdometry(const Eigen::Isometry3d& motion, const Eigen::Isometry3d& camera_in_odom) const;
  void forgetOdometry();
  Sight look(const std::vector<cv::Mat>& pyramid, const Eigen::Isometry3d& predicted) const;
  Sight lookFrom(const std::vector<cv::Mat>& pyramid, const Eigen::Isometry3d& predicted, int coarsest) const;
  std::vector<SceneSighting> alignAll(const cv::Mat& current, std::size_t level, const Eigen::Isometry3d& motion,
                                      const std::vector<double>& inverse_depths, int iterations, int& looked_for) const;
  bool remember(const Sight& sight, const std::optional<Eigen::Isometry3d>& camera_in_odom);
  std::optional<OdometryScale> metresPerUnit() const;
  double unitDepth() const;
  PlaneTrack trackOf(const Sight& sight) const;

  PlaneTrackerParams params_;
  Eigen::Matrix3d k_;
  cv::Rect region_;
  Points pixels_;                            // corners of the full image
  std::vector<std::vector<Patch>> patches_;  // of levels, of corners
  std::vector<ScenePoint> structure_;        // of the corners; empty before a start
  bool confirmed_ = false;                   // the structure was found in some image
  std::vector<Place> places_;                // apart from each other, newest last
  std::optional<OdometryScale> scale_;       // of the structure's unit
  std::optional<Last> last_;                 // where the scene was found last
  bool odd_ = false;                         // the last sight contradicts the odometry of the places
  bool found_once_ = false;                  // in some image
  int missed_ = 0;                           // images in a row without the scene
};

void SceneTracker::Impl::start(const SceneFinder::Answer& answer,
                               const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  if (answer.kind != SceneFinder::Kind::SCENE || (missed_ == 0 && found_once_))
  {
    return;
  }
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  if (!confirmed_ || locate(structure_, answer.matches, pixel(), motion) == 0)
  {
    structure_.assign(pixels_.size(), ScenePoint());
    const Eigen::Matrix3d inverse = k_.inverse();
    for (std::size_t i = 0; i < pixels_.size(); ++i)
    {
      structure_[i].point = (inverse * pixels_[i].homogeneous()).hnormalized();
    }
    motion = beginStructure(answer.motion, answer.matches, pixel(), structure_);
    findSlopes(structure_, pixel());
    places_.clear();
    scale_.reset();
    confirmed_ = false;
  }
  last_ = Last{ motion, {}, camera_in_odom };
}

Eigen::Isometry3d SceneTracker::Impl::predict(const std::optional<Eigen::Isometry3d>& camera_in_odom) const
{
  if (!camera_in_odom || !last_->camera_in_odom)
  {
    return last_->motion;
  }
  Eigen::Isometry3d moved = camera_in_odom->inverse() * *last_->camera_in_odom;
  moved.translation() *= scale_ ? 1.0 / scale_->metres : 0.0;
  return moved * last_->motion;
}

/** Whether the scene is seen elsewhere than odometry lets one expect by the place nearest to the camera. */
bool SceneTracker::Impl::contradictsOdometry(const Eigen::Isometry3d& motion,
                                             const Eigen::Isometry3d& camera_in_odom) const
{
  // Where the camera is mounted, and how long the unit is, is not exact.
  constexpr double MOST_TURN = 0.04;  // [rad]
  constexpr double MOST_WAY = 0.06;   // of the things' depth
  constexpr double BY_WAY = 0.2;      // part of the way, or of the turn, since that place
  const Place* nearest = nullptr;
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();  // from the place to the camera
  for (const Place& place : places_)
  {
    if (!place.camera_in_odom)
    {
      continue;
    }
    const Eigen::Isometry3d from = camera_in_odom.inverse() * *place.camera_in_odom;
    if (nearest == nullptr || from.translation().norm() < moved.translation().norm())
    {
      nearest = &place;
      moved = from;
    }
  }
  if (nearest == nullptr || !scale_)
  {
    return false;
  }
  moved.translation() /= scale_->metres;
  const Eigen::Isometry3d expected = moved * nearest->frame.motion;
  const double turn = rotationVector(expected.linear().transpose() * motion.linear()).norm();
  const double way = (expected.translation() - motion.translation()).norm();
  return turn > MOST_TURN + BY_WAY * rotationVector(moved.linear()).norm() ||
         way > MOST_WAY * unitDepth() + BY_WAY * moved.translation().norm();
}

/** The scene has been moved, or odometry has jumped: what is known of the depths and of their unit stays true. */
void SceneTracker::Impl::forgetOdometry()
{
  for (Place& place : places_)
  {
    place.camera_in_odom.reset();
  }
}

/** Looks for every corner that a motion puts into the image, in one level. @param looked_for how many these are. */
std::vector<SceneSighting> SceneTracker::Impl::alignAll(const cv::Mat& current, std::size_t level,
                                                        const Eigen::Isometry3d& motion,
                                                        const std::vector<double>& inverse_depths, int iterations,
                                                        int& looked_for) const
{
  constexpr double LEAST_ERROR = 0.1;  // of where a patch is found, beside its own [px of the level]
  const Eigen::Matrix3d down = toLevel(static_cast<int>(level));
  const Eigen::Matrix3d left = down * k_;
  const Eigen::Matrix3d right = left.inverse();
  std::vector<SceneSighting> all;
  looked_for = 0;
  for (std::size_t i = 0; i < structure_.size(); ++i)
  {
    ScenePoint point = structure_[i];
    point.inverse_depth = inverse_depths[i];
    const Patch& patch = patches_[level][i];
    const Eigen::Vector2d at = transfer(down, pixels_[i]);
    const Eigen::Matrix3d h = left * (motion.linear() + motion.translation() * point.surface().transpose()) * right;
    const Eigen::Vector2d expected = transfer(h, at);
    if (!patch.usable || !projected(point, motion).allFinite() ||
        !(expected.x() >= 0.0 && expected.y() >= 0.0 && expected.x() < current.cols && expected.y() < current.rows))
    {
      continue;
    }
    ++looked_for;
    const std::optional<PatchAlignment> found = align(patch, at, current, h, iterations);
    if (!found || found->correlation < params_.aligner.min_correlation)
    {
      continue;
    }
    Eigen::Matrix2d warp;  // of the patch, from the view to the image
    warp << transfer(h, at + Eigen::Vector2d::UnitX()) - expected,
        transfer(h, at + Eigen::Vector2d::UnitY()) - expected;
    SceneSighting sighting;
    sighting.index = i;
    sighting.seen = (right * found->found.homogeneous()).hnormalized();
    const double scale = right(0, 0);
    sighting.covariance = scale * scale *
                          (warp * patch.information.inverse() * warp.transpose() +
                           LEAST_ERROR * LEAST_ERROR * Eigen::Matrix2d::Identity());
    if (sighting.seen.allFinite() && sighting.covariance.allFinite())
    {
      all.push_back(sighting);
    }
  }
  return all;
}

Sight SceneTracker::Impl::lookFrom(const std::vector<cv::Mat>& pyramid, const Eigen::Isometry3d& predicted,
                                   int coarsest) const
{
  constexpr int COARSE_ITERATIONS = 5;
  constexpr int FINE_ITERATIONS = 3;
  constexpr int FINE_ROUNDS = 2;
  Sight sight;
  sight.motion = predicted;
  std::vector<double> inverse_depths;
  for (const ScenePoint& point : structure_)
  {
    inverse_depths.push_back(point.inverse_depth);
  }
  bool verified = false;
  for (int level = coarsest; level >= 0; --level)
  {
    const auto l = static_cast<std::size_t>(level);
    const int rounds = level == 0 ? FINE_ROUNDS : 1;
    for (int round = 0; round < rounds; ++round)
    {
      const std::vector<SceneSighting> sightings =
          alignAll(pyramid[l], l, sight.motion, inverse_depths, verified ? FINE_ITERATIONS : COARSE_ITERATIONS,
                   sight.looked_for);
      sight.supporting.clear();
      if (static_cast<int>(sightings.size()) < params_.aligner.min_supporting)
      {
        verified = false;
        sight.motion = predicted;
        break;
      }
      verified = true;
      sight.motion = fitMotion(structure_, sightings, sight.motion);
      const double radius = params_.aligner.max_residual * std::ldexp(pixel(), level);
      double squares = 0.0;
      for (const SceneSighting& sighting : sightings)
      {
        const ScenePoint& point = structure_[sighting.index];
        double residual = 0.0;
        if (supports(point, sighting, sight.motion, radius, residual))
        {
          squares += residual * residual;
          sight.supporting.push_back(sighting);
          inverse_depths[sighting.index] = withSighting(point, sighting, sight.motion);
        }
      }
      sight.rms = std::sqrt(squares / std::max<double>(1.0, static_cast<double>(sight.supporting.size())));
    }
  }
  const int enough =
      std::max(params_.aligner.min_supporting,
               static_cast<int>(std::ceil(params_.aligner.min_support * static_cast<double>(sight.looked_for))));
  sight.found = verified && static_cast<int>(sight.supporting.size()) >= enough;
  return sight;
}

Sight SceneTracker::Impl::look(const std::vector<cv::Mat>& pyramid, const Eigen::Isometry3d& predicted) const
{
  constexpr double WELL_SUPPORTED = 0.6;  // part of the points in sight
  constexpr int SMALL_PATCHES = 1;        // level
  const int coarsest = static_cast<int>(std::min(pyramid.size(), patches_.size())) - 1;
  Sight sight = lookFrom(pyramid, predicted, coarsest);
  if (static_cast<double>(sight.supporting.size()) < WELL_SUPPORTED * sight.looked_for && coarsest > SMALL_PATCHES)
  {
    // The patches of coarse levels are wide: they reach across edges where the depth jumps.
    const Sight other = lookFrom(pyramid, predicted, SMALL_PATCHES);
    if (other.supporting.size() > sight.supporting.size())
    {
      sight = other;
    }
  }
  return sight;
}

/**
 * Keeps what was seen from a place that is away from all others, or the first there with odometry, and learns the depths
 * from all of them.
 * @return whether it is.
 */
bool SceneTracker::Impl::remember(const Sight& sight, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  constexpr double APART = 0.04;  // places, of the things' depth
  constexpr std::size_t MOST = 16;
  const auto centre = [](const Eigen::Isometry3d& motion) -> Eigen::Vector3d {
    return motion.inverse().translation();
  };
  const double apart = APART * unitDepth();
  const auto is_here = [&](const Place& place) {
    return (centre(place.frame.motion) - centre(sight.motion)).norm() < apart;
  };
  if (std::any_of(places_.begin(), places_.end(),
                  [&](const Place& place) { return is_here(place) && (place.camera_in_odom || !camera_in_odom); }))
  {
    return false;
  }
  places_.erase(std::remove_if(places_.begin(), places_.end(), is_here), places_.end());
  places_.push_back({ { sight.motion, sight.supporting }, camera_in_odom });
  if (places_.size() > MOST)
  {
    // The one that is nearest to the one before it says least.
    std::size_t least = 1;
    double shortest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 1; i + 1 < places_.size(); ++i)
    {
      const double way = (centre(places_[i].frame.motion) - centre(places_[i - 1].frame.motion)).norm();
      if (way < shortest)
      {
        shortest = way;
        least = i;
      }
    }
    places_.erase(places_.begin() + static_cast<std::ptrdiff_t>(least));
  }
  std::vector<SceneFrame> frames;
  for (const Place& place : places_)
  {
    frames.push_back(place.frame);
  }
  adjustStructure(structure_, frames);
  for (std::size_t i = 0; i < places_.size(); ++i)
  {
    places_[i].frame.motion = frames[i].motion;
  }
  findSlopes(structure_, pixel());
  if (const std::optional<OdometryScale> scale = metresPerUnit())
  {
    scale_ = scale;
  }
  return true;
}

/**
 * Empty while the places are too close to each other. They may be closer than those of a plane, as depths do not leave
 * way and turn to be mistaken for each other.
 */
std::optional<OdometryScale> SceneTracker::Impl::metresPerUnit() const
{
  constexpr double OF_WINDOW = 0.3;
  std::vector<MeasuredWay> ways;
  for (const Place& place : places_)
  {
    if (place.camera_in_odom)
    {
      ways.push_back({ place.frame.motion.translation(), *place.camera_in_odom });
    }
  }
  return scaleByOdometry(ways, OF_WINDOW * params_.filter.window);
}

/** Depth of the virtual plane: the median of what is around the chosen point, in the structure's unit. */
double SceneTracker::Impl::unitDepth() const
{
  constexpr std::size_t NEIGHBOURS = 15;
  const Eigen::Vector2d middle = middleOf(region_);
  std::vector<std::pair<double, double>> nearest;  // distance, inverse depth
  for (std::size_t i = 0; i < structure_.size(); ++i)
  {
    nearest.emplace_back((pixels_[i] - middle).norm(), structure_[i].inverse_depth);
  }
  const std::size_t count = std::min(NEIGHBOURS, nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(count), nearest.end());
  std::vector<double> values;
  for (std::size_t i = 0; i < count; ++i)
  {
    values.push_back(nearest[i].second);
  }
  return 1.0 / medianOf(values);
}

PlaneTrack SceneTracker::Impl::trackOf(const Sight& sight) const
{
  PlaneTrack track;
  track.state = TrackingState::TRACKING;
  PlaneEstimate plane;
  plane.motion.rotation = last_->motion.linear();
  plane.motion.translation_over_distance = last_->motion.translation() / unitDepth();
  plane.motion.normal = Eigen::Vector3d::UnitZ();
  plane.normal_known = true;
  if (scale_)
  {
    plane.distance = scale_->metres * unitDepth();
  }
  track.plane = plane;
  TrackedHomography& homography = track.homography;
  homography.found = true;
  homography.h = normalizedHomography(k_ * plane.motion.matrix() * k_.inverse());
  homography.looked_for = sight.looked_for;
  homography.supporting = static_cast<int>(sight.supporting.size());
  homography.rms = sight.rms / pixel();
  for (const SceneSighting& sighting : sight.supporting)
  {
    homography.points.push_back(pixels_[sighting.index]);
  }
  return track;
}

PlaneTrack SceneTracker::Impl::add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  if (image.empty() || image.type() != CV_8UC1)
  {
    throw std::invalid_argument("the current image is not an 8-bit grey image");
  }
  PlaneTrack track;
  if (!last_)
  {
    return track;
  }
  const std::vector<cv::Mat> pyramid = pyramidOf(image, static_cast<int>(patches_.size()));
  Sight sight = look(pyramid, predict(camera_in_odom));
  if (!sight.found)
  {
    // Odometry may be wrong.
    sight = look(pyramid, last_->motion);
  }
  if (!sight.found)
  {
    ++missed_;
    track.state = found_once_ && missed_ >= params_.lost_after ? TrackingState::LOST : TrackingState::SEARCHING;
    return track;
  }
  missed_ = 0;
  found_once_ = true;
  confirmed_ = true;
  last_ = Last{ sight.motion, sight.supporting, camera_in_odom };
  const bool odd = camera_in_odom && contradictsOdometry(sight.motion, *camera_in_odom);
  if (odd && odd_)
  {
    forgetOdometry();
  }
  odd_ = odd && !odd_;
  if (!odd_ && remember(sight, camera_in_odom))
  {
    last_->motion = fitMotion(structure_, sight.supporting, sight.motion);
  }
  return trackOf(sight);
}

std::optional<CameraPose> SceneTracker::Impl::cameraPose() const
{
  using Vector6d = Eigen::Matrix<double, 6, 1>;
  if (!last_ || missed_ > 0 || last_->supporting.empty() || !scale_)
  {
    return std::nullopt;
  }
  Eigen::Isometry3d motion = last_->motion;
  Eigen::Matrix<double, 6, 6> covariance = motionCovariance(structure_, last_->supporting, motion);
  motion.translation() *= scale_->metres;
  covariance.bottomRows<3>() *= scale_->metres;
  covariance.rightCols<3>() *= scale_->metres;
  Vector6d by_scale = Vector6d::Zero();
  by_scale.tail<3>() = scale_->relative_deviation * motion.translation();
  covariance += by_scale * by_scale.transpose();
  return cameraPoseAfter(motion, covariance);
}

SceneTracker::SceneTracker(const cv::Mat& reference, const cv::Rect& region, const Eigen::Matrix3d& k,
                           const PlaneTrackerParams& params)
{
  requireNoFaults("parameters of the scene tracker", params.validate());
  impl_ = std::make_unique<Impl>(reference, region, k, params);
}

SceneTracker::~SceneTracker() = default;

void SceneTracker::start(const SceneFinder::Answer& answer, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  impl_->start(answer, camera_in_odom);
}

const PlaneTrack& SceneTracker::add(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom)
{
  track_ = impl_->add(image, camera_in_odom);
  return track_;
}

std::optional<CameraPose> SceneTracker::cameraPose() const
{
  return impl_->cameraPose();
}

const std::vector<Eigen::Vector2d>& SceneTracker::points() const
{
  return impl_->points();
}

std::vector<double> SceneTracker::depths() const
{
  return impl_->depths();
}

}  // namespace view_servo
