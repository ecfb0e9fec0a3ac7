// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/side_correlation.h"

#include "view_servo/geometry/line_homography.h"
#include "view_servo/images/sampling.h"
#include "view_servo/images/universal_intrinsics.h"

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

  /** @param count a multiple of four. */
  void add(const float* a, const float* b, int count)
  {
    constexpr int LANES = 4;
    const cv::v_float32x4 middle = cv::v_setall_f32(MIDDLE);
    cv::v_float32x4 sums[5] = { cv::v_setzero_f32(), cv::v_setzero_f32(), cv::v_setzero_f32(), cv::v_setzero_f32(),
                                cv::v_setzero_f32() };
    for (int i = 0; i < count; i += LANES)
    {
      const cv::v_float32x4 x = cv::v_load(a + i) - middle;
      const cv::v_float32x4 y = cv::v_load(b + i) - middle;
      sums[0] = sums[0] + x;
      sums[1] = sums[1] + y;
      sums[2] = sums[2] + x * x;
      sums[3] = sums[3] + y * y;
      sums[4] = sums[4] + x * y;
    }
    sum_a_ += cv::v_reduce_sum(sums[0]);
    sum_b_ += cv::v_reduce_sum(sums[1]);
    sum_aa_ += cv::v_reduce_sum(sums[2]);
    sum_bb_ += cv::v_reduce_sum(sums[3]);
    sum_ab_ += cv::v_reduce_sum(sums[4]);
    count_ += count;
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
  const auto seen = [&to](const Eigen::Vector3f& there) {
    return there.z() > 0.0F && to.contains(there.x() / there.z(), there.y() / there.z());
  };

  // Between ends that are this far inside, and of about one depth, rounding puts no sample outside.
  constexpr float SLACK = 0.05F;     // [px]
  constexpr float MAX_RATIO = 4.0F;  // of the third coordinates of the two ends
  const auto well_inside = [](const BilinearSampler& image, const Eigen::Vector2f& at) {
    return image.contains(at.x(), at.y()) && image.contains(at.x() + SLACK, at.y() + SLACK);
  };
  const auto all_inside = [&](const Eigen::Vector2f(&here)[2], const Eigen::Vector3f(&there)[2]) {
    const float z[2] = { there[0].z(), there[1].z() };
    return z[0] > 0.0F && z[1] > 0.0F && z[0] < MAX_RATIO * z[1] && z[1] < MAX_RATIO * z[0] &&
           well_inside(from, here[0]) && well_inside(from, here[1]) && well_inside(to, there[0].hnormalized()) &&
           well_inside(to, there[1].hnormalized());
  };

  // Lines of samples beside the segment, and what the homography makes of them.
  const double step = (last - first) / ALONG;
  const Eigen::Vector2f step_here = (step * along).cast<float>();
  const Eigen::Vector3f step_there = (step * along_there).cast<float>();
  const double begin = first + 0.5 * step;
  const Eigen::Vector2f begin_here = (reference_segment.start + begin * along).cast<float>();
  const Eigen::Vector3f begin_there = (start_there + begin * along_there).cast<float>();
  double best = -1.0;
  for (const float side : { -1.0F, 1.0F })
  {
    PairedIntensities samples;
    for (int j = 0; j < ACROSS; ++j)
    {
      const float offset = side * (FIRST + STEP * static_cast<float>(j));
      const Eigen::Vector2f here = begin_here + offset * normal.cast<float>();
      const Eigen::Vector3f there = begin_there + offset * normal_there.cast<float>();
      if (all_inside({ here, here + (ALONG - 1) * step_here }, { there, there + (ALONG - 1) * step_there }))
      {
        float values_here[ALONG];
        float values_there[ALONG];
        from.alongLine(here, step_here, ALONG, values_here);
        to.alongLine(there, step_there, ALONG, values_there);
        samples.add(values_here, values_there, ALONG);
        continue;
      }
      for (int i = 0; i < ALONG; ++i)
      {
        const Eigen::Vector2f at = here + static_cast<float>(i) * step_here;
        const Eigen::Vector3f at_there = there + static_cast<float>(i) * step_there;
        if (from.contains(at.x(), at.y()) && seen(at_there))
        {
          samples.add(from.at(at.x(), at.y()), to.at(at_there.x() / at_there.z(), at_there.y() / at_there.z()));
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
