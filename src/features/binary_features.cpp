// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/features/binary_features.h"

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr double LARGEST_SIDE = 640.0;   // of the working image's longer side [px]
constexpr double SMALLEST_SIDE = 480.0;  // [px]
constexpr int EDGE = 16;                 // no corners closer than this to the border [px]
constexpr int PATCH = 31;                // side of the patches that ORB's pattern is made for [px]

}  // namespace

std::vector<Parameter> parameters(BinaryFeatureParams& params)
{
  return {
    integer("max_features", params.max_features, "", "[1, 5000]",
            "corners of an image that are described, the strongest"),
    integer("scales", params.scales, "", "[1, 16]", "scales at which corners are looked for"),
    real("scale_factor", params.scale_factor, "", "[1.05, 2]", "ratio of one scale to the next"),
    integer("fast_threshold", params.fast_threshold, "grey levels", "[1, 100]",
            "least difference of grey values around a corner"),
  };
}

std::vector<std::string> BinaryFeatureParams::validate() const
{
  return faultsOf(*this);
}

std::vector<BinaryFeature> detectBinaryFeatures(const cv::Mat& grey, const cv::Rect& region,
                                                const BinaryFeatureParams& params)
{
  if (grey.empty() || grey.type() != CV_8UC1)
  {
    throw std::invalid_argument("binary features: the image must be 8-bit with one channel");
  }
  const cv::Rect frame(cv::Point(), grey.size());
  if ((region & frame) != region)
  {
    throw std::invalid_argument("binary features: the region leaves the image");
  }
  cv::Mat image = region.empty() ? grey : grey(region);
  const double side = std::max(grey.cols, grey.rows);
  const double factor = std::clamp(1.0, SMALLEST_SIDE / side, LARGEST_SIDE / side);
  if (factor != 1.0)
  {
    const cv::Size size(std::max(1, static_cast<int>(std::lround(factor * image.cols))),
                        std::max(1, static_cast<int>(std::lround(factor * image.rows))));
    cv::Mat scaled;
    cv::resize(image, scaled, size, 0.0, 0.0, factor < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
    image = scaled;
  }
  // At the coarsest scale there is still room for a corner between the borders.
  const double room = std::min(image.cols, image.rows) / (2.0 * EDGE + 1.0);
  if (room < 1.0)
  {
    return {};
  }
  const int scales = std::min(params.scales, 1 + static_cast<int>(std::log(room) / std::log(params.scale_factor)));
  const cv::Ptr<cv::ORB> orb = cv::ORB::create(params.max_features, static_cast<float>(params.scale_factor), scales,
                                               EDGE, 0, 2, cv::ORB::HARRIS_SCORE, PATCH, params.fast_threshold);
  std::vector<cv::KeyPoint> corners;
  cv::Mat bits;
  orb->detectAndCompute(image, cv::noArray(), corners, bits);
  // Of corners that are alike OpenCV keeps all, however many they are.
  std::vector<int> strongest(static_cast<std::size_t>(bits.rows));
  std::iota(strongest.begin(), strongest.end(), 0);
  if (bits.rows > params.max_features)
  {
    std::stable_sort(strongest.begin(), strongest.end(), [&](int a, int b) {
      return corners[static_cast<std::size_t>(a)].response > corners[static_cast<std::size_t>(b)].response;
    });
    strongest.resize(static_cast<std::size_t>(params.max_features));
    std::sort(strongest.begin(), strongest.end());
  }
  std::vector<BinaryFeature> features;
  features.reserve(strongest.size());
  for (const int i : strongest)
  {
    BinaryFeature feature;
    std::memcpy(feature.word.data(), bits.ptr(i), sizeof(BinaryWord));
    const float angle = corners[static_cast<std::size_t>(i)].angle;
    feature.angle = static_cast<std::uint8_t>(std::lround(angle * 256.0F / 360.0F) % 256);
    features.push_back(feature);
  }
  return features;
}

}  // namespace view_servo
