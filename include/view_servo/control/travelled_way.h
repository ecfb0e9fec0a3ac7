// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <vector>

namespace view_servo
{
/**
 * The places that a robot or its camera has passed, thinned so that a long way takes no more memory and time than a
 * short one: places are left out that are nearer than a spacing to the last one kept, and whenever there are too many,
 * every second one is dropped and the spacing doubled.
 */
class TravelledWay
{
public:
  /**
   * @param spacing between the places kept at first [m]; > 0. @param most places that are kept; at least 2.
   * @throws std::logic_error when they are less.
   */
  explicit TravelledWay(double spacing = 0.01, std::size_t most = 2000);

  /** A place, in a frame that does not jump [m]. One that is not finite is left out. */
  void add(const Eigen::Vector3d& place);
  /** Forgets all places; the spacing is that of the constructor again. */
  void clear();

  /** The places kept, oldest first, and the newest one. */
  std::vector<Eigen::Vector3d> places() const;

private:
  const double first_spacing_;
  const std::size_t most_;
  double spacing_;
  std::vector<Eigen::Vector3d> kept_;
  Eigen::Vector3d newest_ = Eigen::Vector3d::Zero();  // where there are any
};

}  // namespace view_servo
