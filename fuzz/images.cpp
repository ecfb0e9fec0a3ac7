// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/images/image_io.h"

#include <opencv2/core/utils/logger.hpp>

#include <algorithm>

using namespace view_servo;

/** Bytes of an image file. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  const std::string bytes = fuzz::toString(data, size);
  fuzz::readOrRefuse<ImageError>([&] {
    const cv::Size promised = encodedImageSize(bytes, "input");
    fuzz::require(promised.area() <= MAX_IMAGE_PIXELS && std::min(promised.width, promised.height) >= MIN_IMAGE_SIDE,
                  "sizes beyond the limits are refused before decoding");
    if (promised.area() > 1'000'000)
    {
      return;  // decoding takes so long that little else would be tried
    }
    const cv::Mat grey = decodeGreyImage(bytes, "input");
    fuzz::require(grey.type() == CV_8UC1 && grey.cols <= promised.width && grey.rows <= promised.height,
                  "an image is grey and no larger than its header says");
  });
  return 0;
}
