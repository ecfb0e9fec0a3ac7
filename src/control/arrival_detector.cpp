// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/arrival_detector.h"

#include "view_servo/parameters/faults.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace view_servo
{
cv::Mat gradientMagnitude(const cv::Mat& grey)
{
  constexpr double SIGMA = 1.0;  // [px]
  constexpr double SOBEL_SUM = 1.0 / 8.0;
  cv::Mat smooth;
  cv::Mat dx;
  cv::Mat dy;
  cv::Mat magnitude;
  cv::GaussianBlur(grey, smooth, cv::Size(5, 5), SIGMA);
  cv::Sobel(smooth, dx, CV_32F, 1, 0, 3, SOBEL_SUM);
  cv::Sobel(smooth, dy, CV_32F, 0, 1, 3, SOBEL_SUM);
  cv::magnitude(dx, dy, magnitude);
  return magnitude;
}

double gradientSimilarity(const cv::Mat& reference, const cv::Mat& current)
{
  if (reference.size() != current.size())
  {
    throw std::invalid_argument("the current image has another size than the stored view");
  }
  constexpr double BLANK = 0.1;
  cv::Scalar reference_mean;
  cv::Scalar reference_sd;
  cv::Scalar current_mean;
  cv::Scalar current_sd;
  cv::meanStdDev(reference, reference_mean, reference_sd);
  cv::meanStdDev(current, current_mean, current_sd);
  const double scale = reference_sd[0] * current_sd[0] * static_cast<double>(reference.total());
  if (!(current_sd[0] > BLANK * reference_sd[0]) || !(reference_sd[0] > BLANK * current_sd[0]))
  {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return (reference.dot(current) - static_cast<double>(reference.total()) * reference_mean[0] * current_mean[0]) /
         scale;
}

std::vector<Parameter> parameters(ArrivalDetectorParams& params)
{
  return {
    real("arrival_rise", params.rise, "", "> 0",
         "thesis: a rise of the correlation counts as sudden when it exceeds this many standard deviations of those "
         "before it"),
    real("arrival_min_rise", params.min_rise, "", "> 0", "thesis: and when it is at least this large"),
    real("arrival_drop", params.drop, "", "(0, 1)", "thesis: part of the rise that is lost again past the view"),
    integer("arrival_min_history", params.min_history, "", ">= 2", "thesis: correlations before any rise counts"),
  };
}

std::vector<std::string> ArrivalDetectorParams::validate() const
{
  return faultsOf(*this);
}

Arrival ArrivalDetector::add(double similarity)
{
  if (!std::isfinite(similarity))
  {
    return state_;
  }
  if (state_ == Arrival::APPROACHING)
  {
    const double count = static_cast<double>(history_.size());
    if (static_cast<int>(history_.size()) >= params_.min_history)
    {
      const double mean = std::accumulate(history_.begin(), history_.end(), 0.0) / count;
      const double squares = std::inner_product(history_.begin(), history_.end(), history_.begin(), 0.0);
      const double sd = std::sqrt(std::max(0.0, squares / count - mean * mean));
      if (similarity - last_ > std::max(params_.rise * sd, params_.min_rise))
      {
        state_ = Arrival::NEAR;
        largest_ = similarity;
      }
    }
    if (state_ == Arrival::APPROACHING)
    {
      history_.push_back(similarity);
    }
  }
  else if (state_ == Arrival::NEAR)
  {
    largest_ = std::max(largest_, similarity);
    const double before = std::accumulate(history_.begin(), history_.end(), 0.0) / static_cast<double>(history_.size());
    if (similarity < largest_ - params_.drop * (largest_ - before))
    {
      state_ = Arrival::REACHED;
    }
  }
  last_ = similarity;
  return state_;
}

}  // namespace view_servo
