// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <deque>
#include <optional>

namespace view_servo
{
/**
 * How far the stamps of odometry and images are apart, from the turns of a base: what the images say of them has to be
 * what odometry says, at another time. Only turns that begin, end or change show the offset; a turn of constant speed
 * looks the same at all times. Where the begin of a turn is not seen, odometry that turns 5 % too much looks as if it
 * were 50 ms late. Times are those of the messages [s], angles are [rad].
 */
class ClockOffset
{
public:
  /** Yaw of the base in odometry's frame. Stamps that are not later than the last one are left out. */
  void addOdometry(double stamp, double yaw);

  /** Yaw of the stored view as seen in an image; it falls as the base turns to the left. */
  void addImage(double stamp, double view_yaw);

  /**
   * Odometry's stamp minus the image's for one and the same moment [s], within +-LARGEST; by the last seconds. Empty
   * while the base has not turned enough to tell, or fewer than FEWEST_IMAGES have seen it.
   */
  std::optional<double> estimate() const;

  static constexpr double LARGEST = 0.6;            ///< largest offset that is looked for [s]
  static constexpr std::size_t FEWEST_IMAGES = 15;  ///< estimate() is empty until so many images are known

private:
  struct Sample
  {
    double stamp;
    double yaw;
  };

  struct Fit
  {
    double unexplained = 0.0;      // mean difference of the view's turns from what odometry explains of them [rad]
    std::optional<double> offset;  // odometry's stamp minus the image's [s]; empty: not determined
  };

  /** The best offset when odometry measures turns too large or too small by at most this part of them. */
  Fit fit(double turn_error) const;
  /** Unwrapped yaw by odometry at a time, interpolated [rad]. */
  double odometryAt(double stamp) const;

  std::deque<Sample> odometry_;  // oldest first; yaw of the base, unwrapped
  std::deque<Sample> images_;    // oldest first; yaw of the view, unwrapped
};

}  // namespace view_servo
