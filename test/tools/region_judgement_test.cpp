// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/region_judgement.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <string>

namespace view_servo
{
namespace
{
/** Many rectangles of different grey on the left half, BGR; the right half is of one grey. */
cv::Mat halfTextured()
{
  cv::Mat picture(480, 640, CV_8UC3, cv::Scalar::all(128));
  cv::RNG random(1);
  for (int k = 0; k < 400; ++k)
  {
    const cv::Point corner(random.uniform(0, 290), random.uniform(0, 450));
    cv::rectangle(picture, cv::Rect(corner, cv::Size(random.uniform(8, 30), random.uniform(8, 30))),
                  cv::Scalar::all(random.uniform(20, 235)), cv::FILLED);
  }
  return picture;
}

bool says(const RegionJudgement& judgement, const std::string& part)
{
  return judgement.text.find(part) != std::string::npos;
}

TEST(RegionJudgement, TellsTextureFromAPlainWall)
{
  const cv::Mat picture = halfTextured();
  const RegionJudgement textured = judgeRegion(picture, { 20, 20, 280, 440 });
  EXPECT_TRUE(textured.is_good) << textured.text;
  EXPECT_TRUE(says(textured, "Region 280 x 440 px: ")) << textured.text;
  EXPECT_TRUE(says(textured, " corners")) << textured.text;
  const RegionJudgement plain = judgeRegion(picture, { 360, 20, 240, 440 });
  EXPECT_FALSE(plain.is_good) << plain.text;
  EXPECT_TRUE(says(plain, "the same everywhere")) << plain.text;
}

TEST(RegionJudgement, SaysThatARegionIsBlurred)
{
  cv::Mat blurred;
  cv::GaussianBlur(halfTextured(), blurred, {}, 4.0);
  const RegionJudgement judgement = judgeRegion(blurred, { 20, 20, 280, 440 });
  EXPECT_FALSE(judgement.is_good) << judgement.text;
  EXPECT_TRUE(says(judgement, "focus")) << judgement.text;
}

TEST(RegionJudgement, SaysWhatIsThereMoreThanOnce)
{
  cv::Mat picture = halfTextured();
  const cv::Rect left(0, 0, 300, 480);
  picture(left).copyTo(picture(left + cv::Point(320, 0)));
  const RegionJudgement judgement = judgeRegion(picture, { 20, 20, 240, 300 });
  EXPECT_FALSE(judgement.is_good) << judgement.text;
  EXPECT_TRUE(says(judgement, "repeats itself 320 px away")) << judgement.text;
  EXPECT_TRUE(says(judgement, "only once")) << judgement.text;
}

TEST(RegionJudgement, TakesAnyRegion)
{
  const cv::Mat picture = halfTextured();
  EXPECT_TRUE(says(judgeRegion(picture, {}), "Region 640 x 480 px: "));
  EXPECT_TRUE(says(judgeRegion(picture, { 600, 400, 200, 200 }), "Region 40 x 80 px: "));
  EXPECT_FALSE(judgeRegion(picture, { 40, 40, 16, 16 }).text.empty());
  EXPECT_TRUE(says(judgeRegion(picture, { 40, 40, 200, 15 }), "too small to match"));
  EXPECT_TRUE(says(judgeRegion(picture, { 700, 40, 200, 200 }), "too small to match"));
}

}  // namespace
}  // namespace view_servo
