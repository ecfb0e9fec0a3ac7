// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/error_text.h"

#include "view_servo/parameters/shown_text.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <new>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace
{
TEST(OneLine, JoinsLines)
{
  EXPECT_EQ(oneLine(std::runtime_error("no camera:\nlook there\n\n")), "no camera: look there");
}

TEST(Shown, IsOneShortLine)
{
  EXPECT_EQ(shown("rgb8; jpeg compressed bgr8"), "rgb8; jpeg compressed bgr8");
  EXPECT_EQ(shown("caf\xC3\xA9"), "caf\xC3\xA9");
  EXPECT_EQ(shown(std::string("a\nb\r\tc\x7F\0d", 9)), "a?b??c??d");
  EXPECT_EQ(shown(std::string(80, 'x')), std::string(80, 'x'));
  EXPECT_EQ(shown(std::string(1000, 'x')), std::string(80, 'x') + "...");
  EXPECT_EQ(shown(""), "");
}

TEST(OneLine, IsNeverEmpty)
{
  EXPECT_EQ(oneLine(std::runtime_error("")), "an exception without a text");
  EXPECT_EQ(oneLine(std::runtime_error("\n")), "an exception without a text");
  EXPECT_FALSE(oneLine(std::bad_alloc()).empty());
}

TEST(OneLine, ShowsNoAssertionOfOpenCv)
{
  try
  {
    cv::Mat(3, 3, CV_8UC1).reshape(7);
    FAIL() << "OpenCV does not complain";
  }
  catch (const cv::Exception& error)
  {
    const std::string text = oneLine(error);
    EXPECT_NE(text.find("reshape"), std::string::npos) << text;
    EXPECT_EQ(text.find("error:"), std::string::npos) << text;
    EXPECT_EQ(text.find(".cpp"), std::string::npos) << text;
  }
  const cv::Exception memory(cv::Error::StsNoMem, "Failed to allocate 7 bytes", "OutOfMemoryError", "alloc.cpp", 73);
  EXPECT_EQ(oneLine(memory), "memory is short");
}

}  // namespace
}  // namespace view_servo
