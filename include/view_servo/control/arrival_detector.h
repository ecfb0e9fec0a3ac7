// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"

#include <opencv2/core/mat.hpp>

#include <string>
#include <vector>

namespace view_servo
{
/** Magnitude of the gradient of the smoothed image, 32-bit [grey levels / px]. @param grey 8-bit, one channel. */
cv::Mat gradientMagnitude(const cv::Mat& grey);

/**
 * Correlation coefficient of two gradient magnitude images, -1..1; NaN when one of them is blank: its
 * gradients vary less than a tenth of the other's.
 * @throws std::invalid_argument when their sizes differ.
 */
double gradientSimilarity(const cv::Mat& reference, const cv::Mat& current);

/** Options of the arrival detector. */
struct ArrivalDetectorParams
{
  double rise = 1.0;       ///< of a step's rise that is sudden: times the standard deviation of what went before, > 0
  double min_rise = 0.08;  ///< ... and at least this much, > 0
  double drop = 0.1;       ///< part of the gain since the approach that is lost again once the view was passed, (0, 1)
  int min_history = 5;     ///< similarities before any rise counts, >= 2

  /** All faults, one a line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(ArrivalDetectorParams& params);

enum class Arrival
{
  APPROACHING,
  NEAR,    ///< the similarity has risen suddenly
  REACHED  ///< ... and has dropped again
};

/** Decides from the similarity of the current with the stored view, step after step, when to stop (thesis 5.3). */
class ArrivalDetector
{
public:
  explicit ArrivalDetector(const ArrivalDetectorParams& params) : params_(params)
  {
  }

  Arrival add(double similarity);

  Arrival state() const
  {
    return state_;
  }

private:
  ArrivalDetectorParams params_;
  Arrival state_ = Arrival::APPROACHING;
  std::vector<double> history_;  ///< before the rise
  double last_ = 0.0;
  double largest_ = 0.0;  ///< since the rise
};

}  // namespace view_servo
