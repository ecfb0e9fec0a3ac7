// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/planar_motion.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of the view tracker. */
struct ViewTrackerParams
{
  int max_landmarks = 200;  ///< largest number of points of the stored view that are tracked
  int window = 21;          ///< side of the patches [px]
  int levels = 2;           ///< number of levels of the pyramid besides the image
  /** Largest distance between where a supporting point is found and where the pose sends it [px] */
  double max_residual = 2.0;
  int min_supporting = 15;    ///< least number of points that support a pose
  double min_support = 0.35;  ///< least share of the points looked for that have to support the pose, (0, 1]
  /**
   * Points whose images have grown or shrunk by a factor that differs by more than this part from the median are left
   * out.
   */
  double max_scale_difference = 0.35;
  double assumed_depth = 2.5;  ///< depth of points while nothing is known of it [m]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(ViewTrackerParams& params);

/**
 * Follows the stored view from a camera that moves on the floor, in image space: points of the stored view, whose depth
 * is known from two views but for one common scale, are found in each image where the last pose and odometry predict
 * them (Lucas & Kanade, in an image normalised against light), and the pose that explains their positions is fitted.
 * Points are always compared with the stored view itself, so nothing drifts. At the view all displacements are zero
 * whatever the depths, so that the pose becomes exact there although the epipole is undetermined (thesis 5.4).
 *
 * Poses are those of the stored view's level camera in the current one. Their unit of length is that of the pose that
 * the structure came from.
 */
class ViewTracker
{
public:
  /**
   * The parameters must be valid.
   * @param reference the stored view as `camera` would have taken it; 8-bit, one channel. @param camera calibration of
   * all images. @param mount where the camera is on the base.
   */
  ViewTracker(const cv::Mat& reference, const Camera& camera, const CameraMount& mount,
              const ViewTrackerParams& params);

  /** A point of the stored view that is tracked. */
  struct Point
  {
    Landmark landmark;         ///< where it is in the stored view, and its inverse depth
    double information = 0.0;  ///< inverse variance of the inverse depth, for errors of 1 in level points
    Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< in the stored view as the camera would have taken it
  };

  /** The points that are tracked; empty before start() and restore(). */
  const std::vector<Point>& points() const
  {
    return landmarks_;
  }

  /** Whether there are points to track. */
  bool hasStructure() const
  {
    return !landmarks_.empty();
  }
  /** Forgets all points. */
  void clear()
  {
    landmarks_.clear();
  }

  /** Whether the points' depths came from two views far enough apart; if not, they are assumed. */
  bool depthsKnown() const
  {
    return depths_known_;
  }

  /**
   * Landmarks from matches (level points) that agree with a motion; their depths are in the unit of `pose`. Where the
   * motion is too small to tell depths, params.assumed_depth is taken.
   * @return false, and nothing changes, when there are too few.
   */
  bool start(const Correspondences& matches, const PlanarPose& pose);

  /**
   * The landmarks that an earlier tracker of this view had, with their depths known, instead of those there are.
   * @param points their pixels need not be set. @return false, and nothing changes, when too few lie in the view.
   */
  bool restore(const std::vector<Point>& points);

  /** Adds landmarks from such matches, and improves the depths of those there are. Arguments as for start(). */
  void extend(const Correspondences& matches, const PlanarPose& pose);

  struct Result
  {
    bool found = false;  ///< whether enough landmarks support a pose
    PlanarPose pose;     ///< valid when found
    /**
     * Of (x, y, yaw) of the pose, as the supporting landmarks' residuals let one expect it when no more than 25 of them
     * err independently; the structure is taken for exact. NaN unless found [unit of the structure, rad].
     */
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
    /** track(): landmarks predicted to be in the image, in about its scale; locate(): those matched. */
    int looked_for = 0;
    int supporting = 0;         ///< landmarks found where the pose puts them
    double rms = 0.0;           ///< root mean square of the supporting landmarks' residuals [px]
    double displacement = 0.0;  ///< median distance of the supporting ones from where the stored view has them [px]
    std::vector<Eigen::Vector2d> supporters;  ///< Landmark::reference of the supporting ones
  };

  /**
   * Finds the landmarks in an image. @param predicted pose expected. @throws std::invalid_argument for another size.
   */
  Result track(const cv::Mat& current, const PlanarPose& predicted) const;

  /**
   * The share of the view, [0, 1], that is in the image, and not of another size than can be matched, when the stored
   * view's level camera is at a pose in the current one: of the landmarks, but no more than of the whole stored view
   * after the turn alone. Without landmarks: of points all over the stored view, params.assumed_depth away.
   */
  double shareInSight(const PlanarPose& view_in_camera) const;

  /**
   * The pose from matches (level points) without a prediction. Only matches whose reference point lies at a landmark
   * count; Result::found is false when too few of them agree.
   */
  Result locate(const Correspondences& matches) const;

private:
  /** Level point -> pixel of an image, distortion applied; levelOf() is the inverse. */
  Eigen::Vector2d pixelOf(const Eigen::Vector2d& level_point) const;
  Eigen::Vector2d levelOf(const Eigen::Vector2d& pixel) const;
  /** Whether a patch around a pixel lies in the stored view. */
  bool insideReference(const Eigen::Vector2d& pixel) const;
  /** The point at a level point of the stored view; null when there is none near enough to be the same. */
  const Point* nearest(const Eigen::Vector2d& level_point) const;
  /** The pose that most sightings agree with to within a residual [px]. */
  Result fit(const std::vector<Sighting>& sightings, double max_residual) const;

  Camera camera_;
  CameraMount mount_;
  ViewTrackerParams params_;
  cv::Mat reference_;  // the stored view, each pixel less the mean around it and over the deviation around it
  std::vector<Point> landmarks_;
  bool depths_known_ = false;
};

}  // namespace view_servo
