// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

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
/** Options of the filter of planes and motions. */
struct PlaneFilterParams
{
  double window = 0.1;        ///< way of the camera whose measurements are averaged, and that d takes [m], > 0
  int max_measurements = 60;  ///< averaged at most, >= 2
  double decision = 4.0;  ///< times by which the normals of one decomposition must scatter more than the other's, > 1

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(PlaneFilterParams& params);

/** What the filter knows after a measurement. */
struct PlaneEstimate
{
  EuclideanHomography motion;      ///< X_cur = R X_ref + t of the last camera, averaged
  bool normal_known = false;       ///< else a plane that faces the reference camera is taken
  bool ambiguous = false;          ///< another decomposition is as likely
  std::optional<double> distance;  ///< d, of the plane from the reference camera [m]; empty until it is known
};

/**
 * Averages what the homographies of a moving camera say (thesis 8.5), with its odometry. The normal is the same in the
 * reference frame whatever the camera does; once it is known, each homography tells its motion by it, also where the views
 * nearly agree and a decomposition would say nothing. Rotations and translations of the last part of the way are moved
 * into the last camera by odometry, where rotations are averaged by orthogonal Procrustes. d follows from how much the
 * translation over d changes for how far odometry says the camera has moved, t2/d - dR t1/d = dt/d: in least squares for
 * 1/d, as the image's part of it is noisier than odometry's, which would make d too small the other way round.
 *
 * Where a homography has two decompositions, both are followed by their normals. The true one stays where it is in the
 * reference frame, the other wanders as the camera moves: when it has scattered clearly more, or cannot be seen any more,
 * it is dropped for good. Until then the estimate says that it is ambiguous.
 */
class PlaneFilter
{
public:
  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit PlaneFilter(const PlaneFilterParams& params);

  /**
   * A homography that shows the plane from behind changes nothing.
   * @param camera_in_odom pose of the camera in a frame that does not jump; empty without odometry: then nothing but the
   * normal is averaged.
   * @param h, k, seen as of decomposeHomography().
   */
  void add(const std::optional<Eigen::Isometry3d>& camera_in_odom, const Eigen::Matrix3d& h, const Eigen::Matrix3d& k,
           const Points& seen);

  /** Empty before the first measurement. */
  std::optional<PlaneEstimate> estimate() const;

private:
  struct Measurement
  {
    std::optional<Eigen::Isometry3d> camera_in_odom;
    Eigen::Matrix3d calibrated;  // H in normalised coordinates
  };

  /** One decomposition through time. */
  struct Track
  {
    Eigen::Vector3d normals = Eigen::Vector3d::Zero();  // weighted sum
    double weight = 0.0;
    std::size_t count = 0;

    void add(const EuclideanHomography& solution);
    Eigen::Vector3d normal() const
    {
      return normals.normalized();
    }
    /** Mean squared angle of the normals from their mean [rad²]. */
    double scatter() const;
  };

  void followNormals(const std::vector<EuclideanHomography>& solutions);
  void remember(const Measurement& measurement);
  /** Of the plane, as far as it is known. */
  Eigen::Vector3d normal() const;
  std::optional<double> distance() const;

  PlaneFilterParams params_;
  std::vector<Track> tracks_;             // none, one or two; the likelier first
  std::deque<Measurement> measurements_;  // of the window, newest last
  std::deque<Measurement> places_;        // apart from each other, also when the camera stands; newest last
};

}  // namespace view_servo
