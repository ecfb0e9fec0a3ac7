// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/euclidean_homography.h"

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
  double window = 0.1;        ///< way of the camera whose measurements are averaged, and that d takes first [m], > 0
  int max_measurements = 60;  ///< averaged at most, >= 2
  double decision = 4.0;  ///< times by which the normals of one decomposition must scatter more than the other's, > 1

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** What the filter knows after a measurement. */
struct PlaneEstimate
{
  EuclideanHomography motion;      ///< X_cur = R X_ref + t of the last camera, averaged
  bool ambiguous = false;          ///< another decomposition is as likely
  std::optional<double> distance;  ///< d, of the plane from the reference camera [m]; empty until it is known
};

/**
 * Averages what the homographies of a moving camera say (thesis 8.5), with its odometry. The normal is the same in the
 * reference frame whatever the camera does; rotations and translations of the last part of the way are moved into the
 * last camera by odometry, where rotations are averaged by orthogonal Procrustes. d follows from how much the translation
 * over d changes for how far odometry says the camera has moved, t2/d - dR t1/d = dt/d: in least squares for 1/d, as the
 * image's part of it is noisier than odometry's, which would make d too small the other way round.
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
   * @param camera_in_odom pose of the camera in a frame that does not jump.
   * @param solutions of decomposeHomography(); without any, or without a normal, nothing changes.
   */
  void add(const Eigen::Isometry3d& camera_in_odom, const std::vector<EuclideanHomography>& solutions);

  /** Empty before the first measurement. */
  std::optional<PlaneEstimate> estimate() const;

private:
  struct Measurement
  {
    Eigen::Isometry3d camera_in_odom;
    EuclideanHomography motion;
  };

  /** One decomposition through time. */
  struct Track
  {
    std::deque<Measurement> measurements;  // of the window, newest last
    Eigen::Vector3d normals = Eigen::Vector3d::Zero();
    std::size_t count = 0;
    double squared_way = 0.0;  // sums of the equations of 1 / d
    double change_by_way = 0.0;
    double way = 0.0;

    Eigen::Vector3d normal() const
    {
      return normals.normalized();
    }
    /** Mean squared angle of the normals from their mean [rad²]. */
    double scatter() const;
  };

  void append(Track& track, const Measurement& measurement) const;

  PlaneFilterParams params_;
  std::vector<Track> tracks_;  // one or two; the likelier first
};

}  // namespace view_servo
