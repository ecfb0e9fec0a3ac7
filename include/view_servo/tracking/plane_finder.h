// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace view_servo
{
/**
 * Finds the plane of a stored view in an image by matching points, without a prediction. A view that the image shows
 * twice is not found, as it is not known which of the two is meant, unless one of them is where the view was seen last.
 * Stateless and safe to use from several threads.
 */
class PlaneFinder
{
public:
  struct Question
  {
    std::shared_ptr<const PreparedImage> view;  ///< prepared with features()
    cv::Mat image;                              ///< 8-bit, one channel; not written to afterwards
    std::optional<Eigen::Matrix3d> last_h;      ///< where the view was seen last, x_cur ~ H x_ref [px]
  };

  struct Answer
  {
    std::optional<Eigen::Matrix3d> h;  ///< x_cur ~ H x_ref [px]; empty: not found
    Correspondences inliers;           ///< matches that agree with h [px]
    std::string reason;                ///< why the view was not found, in one line; empty when it was
  };

  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit PlaneFinder(const PointViewMatcherParams& params);

  /** What Question::view has to be prepared with. */
  FeatureParams features() const
  {
    return matcher_.params().points;
  }

  /**
   * Looks for the view in the image.
   * @param given_up as in PointViewMatcher::match(); once it holds, nothing is found.
   * @throws std::invalid_argument when the image has the wrong type.
   */
  Answer find(const Question& question, const std::function<bool()>& given_up = {}) const;

private:
  ViewMatch match(const PreparedImage& view, const cv::Mat& image, const std::function<bool()>& given_up) const;

  PointViewMatcher matcher_;
};

}  // namespace view_servo
