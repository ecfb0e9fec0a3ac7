// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/side_correlation.h"

#include "view_servo/geometry/line_homography.h"
#include "view_servo/images/sampling.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace view_servo
{
namespace
{
/** Sums over pairs of intensities. */
class PairedIntensities
{
public:
  void add(float a, float b)
  {
    a -= MIDDLE;
    b -= MIDDLE;
    sum_a_ += a;
    sum_b_ += b;
    sum_aa_ += a * a;
    sum_bb_ += b * b;
    sum_ab_ += a * b;
    ++count_;
  }

  int count() const
  {
    return count_;
  }

  double correlation() const
  {
    constexpr float NOISE = 4.0F;  // variance of intensities that means nothing
    const float n = static_cast<float>(count_);
    const float variance_a = sum_aa_ / n - sum_a_ / n * (sum_a_ / n);
    const float variance_b = sum_bb_ / n - sum_b_ / n * (sum_b_ / n);
    const float covariance = sum_ab_ / n - sum_a_ / n * (sum_b_ / n);
    return covariance / std::sqrt((variance_a + NOISE) * (variance_b + NOISE));
  }

private:
  static constexpr float MIDDLE = 128.0F;  // keeps sums small

  float sum_a_ = 0.0F;
  float sum_b_ = 0.0F;
  float sum_aa_ = 0.0F;
  float sum_bb_ = 0.0F;
  float sum_ab_ = 0.0F;
  int count_ = 0;
};

/**
 * The part of a segment that another one shows, too: first and last, as fractions of `mapped`, the segment as the other
 * image shows it. What a homography does to fractions is neglected.
 */
std::pair<double, double> partInCommon(const Segment& mapped, const Segment& other)
{
  const Eigen::Vector2d direction = other.direction();
  const double start = (mapped.start - other.start).dot(direction);
  const double end = (mapped.end - other.start).dot(direction);
  const double length = other.length();
  return { std::clamp((std::clamp(start, 0.0, length) - start) / (end - start), 0.0, 1.0),
           std::clamp((std::clamp(end, 0.0, length) - start) / (end - start), 0.0, 1.0) };
}
}  // namespace

double sideCorrelation(const cv::Mat& reference, const cv::Mat& current, const Eigen::Matrix3d& h,
                       const Segment& reference_segment, const Segment& current_segment)
{
  constexpr int ALONG = 16;
  constexpr int ACROSS = 6;
  constexpr float FIRST = 1.0F;    // distance of the samples from the segment [px]
  constexpr float STEP = 1.5F;     // [px]
  constexpr int MIN_SAMPLES = 30;  // of a side, within both images
  const auto mapped = transfer(h, reference_segment);
  if (!mapped)
  {
    return 0.0;
  }
  const auto [first, last] = partInCommon(*mapped, current_segment);

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
    PairedIntensities samples;
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
        if (seen.z() > 0.0F && from.contains(at.x(), at.y()) && to.contains(there.x(), there.y()))
        {
          samples.add(from.at(at.x(), at.y()), to.at(there.x(), there.y()));
        }
      }
    }
    if (samples.count() >= MIN_SAMPLES)
    {
      best = std::max(best, samples.correlation());
    }
  }
  return best;
}

}  // namespace view_servo
