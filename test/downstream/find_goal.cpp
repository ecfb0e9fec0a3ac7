// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include <view_servo/images/image_io.h>
#include <view_servo/views/point_view_matcher.h>

#include <iostream>
#include <string>
#include <variant>  // C++17

/** Matches two pictures as the README does: find_goal GOAL NOW. */
int main(int argc, char** argv)
{
  if (argc != 3)
  {
    return 2;
  }
  const view_servo::PointViewMatcher matcher{ view_servo::PointViewMatcherParams() };
  const view_servo::PreparedImage goal(view_servo::readGreyImage(argv[1]), cv::Rect(), matcher.params().points);
  const view_servo::PreparedImage now(view_servo::readGreyImage(argv[2]), cv::Rect(), matcher.params().points);
  const view_servo::ViewMatch match = matcher.match(goal, now, view_servo::GeometryModel::HOMOGRAPHY);
  std::cout << match.message << '\n';
  return match.outcome == view_servo::MatchOutcome::MATCHED ? 0 : 1;
}
