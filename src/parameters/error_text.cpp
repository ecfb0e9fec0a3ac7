// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/error_text.h"

#include <opencv2/core.hpp>

#include <algorithm>
#include <cctype>
#include <sstream>

namespace view_servo
{
std::string oneLine(const std::exception& error)
{
  if (const auto* opencv_error = dynamic_cast<const cv::Exception*>(&error))
  {
    return opencv_error->code == cv::Error::StsNoMem
               ? "memory is short"
               : "OpenCV's " + opencv_error->func + "() failed, which is a fault of this program";
  }
  std::string text = error.what();
  std::replace_if(
      text.begin(), text.end(), [](unsigned char character) { return std::iscntrl(character) != 0; }, '\n');
  std::istringstream lines(text);
  std::string joined;
  for (std::string line; std::getline(lines >> std::ws, line);)
  {
    joined += (joined.empty() ? "" : " ") + line;
  }
  return joined.empty() ? "an exception without a text" : joined;
}

}  // namespace view_servo
