// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/images/sampling.h"

#include "view_servo/images/universal_intrinsics.h"

#include <Eigen/Geometry>

#include <cstdint>

namespace view_servo
{
namespace
{
constexpr int LANES = 4;

/** Grey levels at four places, from an image's data and step. */
cv::v_float32x4 interpolated(const unsigned char* data, std::size_t step, const cv::v_float32x4& u,
                             const cv::v_float32x4& v)
{
  const cv::v_uint32x4 byte = cv::v_setall_u32(0xFFU);
  const auto to_float = [](const cv::v_uint32x4& number) {
    return cv::v_cvt_f32(cv::v_reinterpret_as_s32(number));
  };
  const cv::v_int32x4 left = cv::v_trunc(u);
  const cv::v_int32x4 top = cv::v_trunc(v);
  int lefts[LANES];
  int tops[LANES];
  cv::v_store(lefts, left);
  cv::v_store(tops, top);
  std::uint32_t packed[LANES];  // the four pixels around each place
  for (int k = 0; k < LANES; ++k)
  {
    const unsigned char* p = data + static_cast<std::size_t>(tops[k]) * step + lefts[k];
    const unsigned char* q = p + step;
    packed[k] = static_cast<std::uint32_t>(p[0] | p[1] << 8) | static_cast<std::uint32_t>(q[0] | q[1] << 8) << 16U;
  }
  const cv::v_uint32x4 pixels = cv::v_load(packed);
  const cv::v_float32x4 top_left = to_float(pixels & byte);
  const cv::v_float32x4 top_right = to_float((pixels >> 8) & byte);
  const cv::v_float32x4 bottom_left = to_float((pixels >> 16) & byte);
  const cv::v_float32x4 bottom_right = to_float(pixels >> 24);
  const cv::v_float32x4 fu = u - cv::v_cvt_f32(left);
  const cv::v_float32x4 fv = v - cv::v_cvt_f32(top);
  const cv::v_float32x4 above = top_left + fu * (top_right - top_left);
  const cv::v_float32x4 below = bottom_left + fu * (bottom_right - bottom_left);
  return above + fv * (below - above);
}

}  // namespace

void BilinearSampler::alongLine(const Eigen::Vector2f& first, const Eigen::Vector2f& step, int count,
                                float* values) const
{
  const cv::v_float32x4 step_u = cv::v_setall_f32(step.x());
  const cv::v_float32x4 step_v = cv::v_setall_f32(step.y());
  cv::v_float32x4 numbers(0.0F, 1.0F, 2.0F, 3.0F);
  int i = 0;
  for (; i + LANES <= count; i += LANES)
  {
    const cv::v_float32x4 u = cv::v_setall_f32(first.x()) + numbers * step_u;
    const cv::v_float32x4 v = cv::v_setall_f32(first.y()) + numbers * step_v;
    cv::v_store(values + i, interpolated(data_, step_, u, v));
    numbers = numbers + cv::v_setall_f32(static_cast<float>(LANES));
  }
  for (; i < count; ++i)
  {
    values[i] = at(first.x() + static_cast<float>(i) * step.x(), first.y() + static_cast<float>(i) * step.y());
  }
}

void BilinearSampler::alongLine(const Eigen::Vector3f& first, const Eigen::Vector3f& step, int count,
                                float* values) const
{
  const cv::v_float32x4 one = cv::v_setall_f32(1.0F);
  const cv::v_float32x4 step_u = cv::v_setall_f32(step.x());
  const cv::v_float32x4 step_v = cv::v_setall_f32(step.y());
  const cv::v_float32x4 step_w = cv::v_setall_f32(step.z());
  cv::v_float32x4 numbers(0.0F, 1.0F, 2.0F, 3.0F);
  int i = 0;
  for (; i + LANES <= count; i += LANES)
  {
    const cv::v_float32x4 scale = one / (cv::v_setall_f32(first.z()) + numbers * step_w);
    const cv::v_float32x4 u = (cv::v_setall_f32(first.x()) + numbers * step_u) * scale;
    const cv::v_float32x4 v = (cv::v_setall_f32(first.y()) + numbers * step_v) * scale;
    cv::v_store(values + i, interpolated(data_, step_, u, v));
    numbers = numbers + cv::v_setall_f32(static_cast<float>(LANES));
  }
  for (; i < count; ++i)
  {
    const Eigen::Vector2f place = (first + static_cast<float>(i) * step).hnormalized();
    values[i] = at(place.x(), place.y());
  }
}

}  // namespace view_servo
