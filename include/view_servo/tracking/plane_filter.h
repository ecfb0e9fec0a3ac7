// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera_pose.h"
#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
struct OdometryScale;

/** Options of the filter of planes and motions. */
struct PlaneFilterParams
{
  /**
   * Measurements are averaged whose camera was within this distance of the present one [m]; d is known once two of them
   * are this far apart, and from a third of that on where it is certain to 4 %.
   */
  double window = 0.1;
  int max_measurements = 60;  ///< largest number of measurements that are averaged
  /**
   * Of two decompositions, the one whose normals scatter more is dropped once their mean squared angle from their mean
   * is this many times that of the other one's.
   */
  double decision = 4.0;

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(PlaneFilterParams& params);

/** What the filter knows after a measurement. */
struct PlaneEstimate
{
  EuclideanHomography motion;  ///< from the reference to the last camera, averaged: R, t / d and the plane's normal
  bool normal_known = false;   ///< false: the normal is not known yet, and assumed to be the reference's optical axis
  bool ambiguous = false;      ///< another decomposition has not been ruled out
  std::optional<double> distance;  ///< d, of the plane from the reference camera [m]; empty until it is known
};

/**
 * Averages the planes and motions of a moving camera's homographies (thesis 8.5), with its odometry. The plane's normal
 * in the reference frame does not depend on the camera. Once it is known, each homography and the normal give a motion,
 * also where the views nearly agree and a decomposition would give nothing.
 *
 * Averaged are the motions of those last measurements at which the camera was within `window` of where it is now:
 * odometry moves them into the last camera's frame, where the mean rotation follows from orthogonal Procrustes. The
 * distance d is known once two places of measurements are `window` apart, or less where it is certain. It follows from how much t/d changes when
 * odometry says that the camera has moved by dt: t2/d - dR t1/d = dt/d, in least squares for 1/d. Solved for d it would
 * come out too small, because the left side is noisier than odometry's dt.
 *
 * Where a homography has two decompositions, the filter follows both by their normals. The true normal stays the same
 * in the reference frame; the other one wanders as the camera moves. A decomposition whose normals scatter clearly
 * more, or that is not seen any more, is dropped for good. Until then the estimate is marked as ambiguous.
 *
 * A measurement that contradicts the average, as odometry moves it, is not averaged with it. If the next one agrees
 * with it, what is seen has been moved, or is another thing, and the average begins anew with these two.
 */
class PlaneFilter
{
public:
  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit PlaneFilter(const PlaneFilterParams& params);

  /**
   * A homography that shows the plane from behind changes nothing.
   * @param camera_in_odom pose of the camera in a frame that does not jump; empty without odometry, and then only the
   * normal is averaged.
   * @param h, k, seen as in decomposeHomography().
   */
  void add(const std::optional<Eigen::Isometry3d>& camera_in_odom, const Eigen::Matrix3d& h, const Eigen::Matrix3d& k,
           const Points& seen);

  /** Empty before the first measurement. */
  const std::optional<PlaneEstimate>& estimate() const
  {
    return estimate_;
  }

  /**
   * Where the camera was at the last measurement. The covariance is what the noise of images and odometry lets one expect,
   * that of the plane's normal and distance included; calibration and mounting are taken for exact.
   * @param k, seen as in add(), of the last measurement. @param rms of those points from where its homography sends
   * them [px].
   * @return empty while the distance is not known, the estimate is ambiguous or the last measurement contradicts it.
   */
  std::optional<CameraPose> cameraPose(const Eigen::Matrix3d& k, const Points& seen, double rms) const;

private:
  struct Measurement
  {
    std::optional<Eigen::Isometry3d> camera_in_odom;
    Eigen::Matrix3d calibrated;  // H in normalised coordinates
  };

  /** One decomposition through time. */
  struct Track
  {
    Eigen::Vector3d normals = Eigen::Vector3d::Zero();  // weighted sum of the normals seen
    double weight = 0.0;                                // sum of their weights
    std::size_t count = 0;                              // number of the normals seen

    void add(const EuclideanHomography& solution);
    Eigen::Vector3d normal() const
    {
      return normals.normalized();
    }
    /** Mean squared angle of the normals from their mean [rad²]. */
    double scatter() const;
    /** Standard deviation of normal() in either direction [rad]. */
    double deviation() const;
  };

  void followNormals(const std::vector<EuclideanHomography>& solutions);
  void remember(const Measurement& measurement);
  /** The average, as of the last measurement. */
  void average();
  /** What the last measurement alone says, and what is known of the plane. */
  PlaneEstimate estimateOf(const Measurement& last) const;
  /** Whether a measurement is where odometry moves a motion that was seen at another pose of the camera. */
  bool agrees(const Measurement& measurement, const EuclideanHomography& motion,
              const Eigen::Isometry3d& camera_in_odom) const;
  /** The motions of all measurements, moved by odometry into the last camera's frame, if the plane were this one. */
  std::vector<EuclideanHomography> motionsNow(const Eigen::Vector3d& normal, double distance) const;
  /** The plane's normal in the reference camera's frame; the optical axis while it is not known. */
  Eigen::Vector3d normal() const;
  /** The plane's distance, if its normal were this one. */
  std::optional<OdometryScale> distance(const Eigen::Vector3d& normal) const;

  PlaneFilterParams params_;
  std::vector<Track> tracks_;             // none, one or two; the likelier first
  Track others_;                          // measurements in a row whose normals are far from those of the tracks
  std::deque<Measurement> measurements_;  // of the window, newest last
  std::deque<Measurement> places_;        // apart from each other, also when the camera stands; newest last
  std::optional<Measurement> odd_;        // the last one, where it contradicts those
  std::optional<PlaneEstimate> estimate_;
  EuclideanHomography averaged_;      // motion of the average, without the odd one
  double rotation_scatter_ = 0.0;     // rms angle of the measurements from their mean [rad]
  double translation_scatter_ = 0.0;  // the same of t/d, where the distance is known
};

}  // namespace view_servo
