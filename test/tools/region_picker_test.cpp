// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/region_picker.h"

#include <gtest/gtest.h>

namespace view_servo
{
namespace
{
RegionPicker drag(const cv::Size& image, const cv::Point& from, const cv::Point& to)
{
  RegionPicker picker;
  picker.setImageSize(image);
  picker.press(from);
  picker.move(to);
  picker.release(to);
  return picker;
}

TEST(RegionPicker, TakesCornersInAnyOrder)
{
  const cv::Rect expected(100, 50, 200, 150);
  EXPECT_EQ(drag({ 640, 480 }, { 100, 50 }, { 300, 200 }).region(), expected);
  EXPECT_EQ(drag({ 640, 480 }, { 300, 200 }, { 100, 50 }).region(), expected);
  EXPECT_EQ(drag({ 640, 480 }, { 100, 200 }, { 300, 50 }).region(), expected);
}

TEST(RegionPicker, StaysWithinTheImage)
{
  EXPECT_EQ(drag({ 640, 480 }, { 600, 400 }, { 900, 700 }).region(), cv::Rect(600, 400, 40, 80));
  EXPECT_EQ(drag({ 640, 480 }, { 100, 100 }, { -20, -30 }).region(), cv::Rect(0, 0, 100, 100));
}

TEST(RegionPicker, CountsInPixelsOfALargeImage)
{
  const RegionPicker picker = drag({ 2560, 1600 }, { 100, 50 }, { 300, 200 });
  EXPECT_DOUBLE_EQ(picker.scale(), 0.5);
  EXPECT_EQ(picker.region(), cv::Rect(200, 100, 400, 300));
}

TEST(RegionPicker, ClickTakesTheRegionBack)
{
  RegionPicker picker = drag({ 640, 480 }, { 100, 50 }, { 300, 200 });
  picker.press({ 10, 10 });
  EXPECT_TRUE(picker.isDragged());
  picker.release({ 12, 300 });
  EXPECT_FALSE(picker.isDragged());
  EXPECT_TRUE(picker.region().empty());
}

TEST(RegionPicker, MovesCountOnlyWhileTheButtonIsDown)
{
  RegionPicker picker = drag({ 640, 480 }, { 100, 50 }, { 300, 200 });
  picker.move({ 500, 400 });
  EXPECT_EQ(picker.region(), cv::Rect(100, 50, 200, 150));
}

TEST(RegionPicker, AnotherImageSizeTakesTheRegionBack)
{
  RegionPicker picker = drag({ 640, 480 }, { 100, 50 }, { 300, 200 });
  picker.setImageSize({ 640, 480 });
  EXPECT_FALSE(picker.region().empty());
  picker.setImageSize({ 320, 240 });
  EXPECT_TRUE(picker.region().empty());
}

}  // namespace
}  // namespace view_servo
