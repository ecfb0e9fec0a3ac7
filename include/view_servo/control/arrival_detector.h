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
 * Correlation coefficient of two images of gradientMagnitude(), in [-1, 1]. NaN when one of them is blank: the standard
 * deviation of its values is less than a tenth of the other's.
 * @throws std::invalid_argument when their sizes differ.
 */
double gradientSimilarity(const cv::Mat& reference, const cv::Mat& current);

/** Options of the arrival detector. */
struct ArrivalDetectorParams
{
  double rise =
      1.0;  ///< a rise counts as sudden when it exceeds this many standard deviations of the similarities before it
  double min_rise = 0.08;  ///< a smaller rise never counts as sudden, however small that standard deviation is
  double drop = 0.1;       ///< the view has been passed when the similarity has lost this part of its rise again
  int min_history = 5;     ///< similarities that must be known before a rise counts

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(ArrivalDetectorParams& params);

/** How far an approach has come. */
enum class Arrival
{
  APPROACHING,  ///< the similarity has not risen suddenly yet
  NEAR,         ///< the similarity has risen suddenly
  REACHED       ///< it has dropped again since
};

/** Decides from the similarity of the current with the stored view, step after step, when to stop (thesis 5.3). */
class ArrivalDetector
{
public:
  explicit ArrivalDetector(const ArrivalDetectorParams& params) : params_(params)
  {
  }

  /** The gradientSimilarity() after the next step; one that is not finite changes nothing. @return state(). */
  Arrival add(double similarity);

  Arrival state() const
  {
    return state_;
  }

private:
  ArrivalDetectorParams params_;
  Arrival state_ = Arrival::APPROACHING;
  std::vector<double> history_;  ///< similarities before the rise, oldest first
  double last_ = 0.0;            ///< the similarity added last
  double largest_ = 0.0;         ///< largest similarity since the rise
};

}  // namespace view_servo
