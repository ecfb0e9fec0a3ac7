// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/side_correlation.h"

#include "view_servo/geometry/line_homography.h"
#include "view_servo/images/sampling.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace view_servo
{
double sideCorrelation(const cv::Mat& reference, const cv::Mat& current, const Eigen::Matrix3d& h,
                       const Segment& reference_segment, const Segment& current_segment)
{
  constexpr int ALONG = 16;
  constexpr int ACROSS = 6;
  constexpr float FIRST = 1.0F;     // distance of the samples from the segment [px]
  constexpr float STEP = 1.5F;      // [px]
  constexpr int MIN_SAMPLES = 30;   // of a side, within both images
  constexpr float NOISE = 4.0F;     // variance of intensities that means nothing
  constexpr float MIDDLE = 128.0F;  // keeps sums small
  const auto mapped = transfer(h, reference_segment);
  if (!mapped)
  {
    return 0.0;
  }
  // The part that both show, as fractions of the reference segment; what a homography does to fractions is neglected.
  const Eigen::Vector2d direction = current_segment.direction();
  const double start = (mapped->start - current_segment.start).dot(direction);
  const double end = (mapped->end - current_segment.start).dot(direction);
  const double length = current_segment.length();
  const double first = std::clamp((std::clamp(start, 0.0, length) - start) / (end - start), 0.0, 1.0);
  const double last = std::clamp((std::clamp(end, 0.0, length) - start) / (end - start), 0.0, 1.0);

  // The homography is linear in the samples' homogeneous coordinates.
  const Eigen::Vector2d along = reference_segment.end - reference_segment.start;
  const Eigen::Vector2d normal = reference_segment.normal();
  const Eigen::Vector3d start_there = h * reference_segment.start.homogeneous();
  const Eigen::Vector3d along_there = h.leftCols<2>() * along;
  const Eigen::Vector3d normal_there = h.leftCols<2>() * normal;
  const BilinearSampler from(reference);
  const BilinearSampler to(current);

  double best = -1.0;
  for (const double side : { -1.0, 1.0 })
  {
    float sum_a = 0.0F;
    float sum_b = 0.0F;
    float sum_aa = 0.0F;
    float sum_bb = 0.0F;
    float sum_ab = 0.0F;
    int n = 0;
    for (int i = 0; i < ALONG; ++i)
    {
      const double fraction = first + (last - first) * (i + 0.5) / ALONG;
      const Eigen::Vector2f on_line = (reference_segment.start + fraction * along).cast<float>();
      const Eigen::Vector3f on_line_there = (start_there + fraction * along_there).cast<float>();
      const Eigen::Vector2f across = (side * normal).cast<float>();
      const Eigen::Vector3f across_there = (side * normal_there).cast<float>();
      for (int j = 0; j < ACROSS; ++j)
      {
        const float offset = FIRST + STEP * static_cast<float>(j);
        const Eigen::Vector2f at = on_line + offset * across;
        const Eigen::Vector3f seen = on_line_there + offset * across_there;
        const float scale = 1.0F / seen.z();
        const Eigen::Vector2f there = scale * seen.head<2>();
        if (!(seen.z() > 0.0F) || !from.contains(at.x(), at.y()) || !to.contains(there.x(), there.y()))
        {
          continue;
        }
        const float a = from.at(at.x(), at.y()) - MIDDLE;
        const float b = to.at(there.x(), there.y()) - MIDDLE;
        sum_a += a;
        sum_b += b;
        sum_aa += a * a;
        sum_bb += b * b;
        sum_ab += a * b;
        ++n;
      }
    }
    if (n >= MIN_SAMPLES)
    {
      const float samples = static_cast<float>(n);
      const float variance_a = sum_aa / samples - sum_a / samples * (sum_a / samples);
      const float variance_b = sum_bb / samples - sum_b / samples * (sum_b / samples);
      const float covariance = sum_ab / samples - sum_a / samples * (sum_b / samples);
      best = std::max<double>(best, covariance / std::sqrt((variance_a + NOISE) * (variance_b + NOISE)));
    }
  }
  return best;
}

}  // namespace view_servo
