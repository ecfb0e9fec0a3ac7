// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/region_judgement.h"

#include "check/judgements.h"
#include "check/picture.h"
#include "view_servo/images/image_io.h"
#include "view_servo/views/self_repetition.h"

#include <cmath>

namespace view_servo
{
RegionJudgement judgeRegion(const cv::Mat& picture, const cv::Rect& region)
{
  const cv::Rect everywhere({ 0, 0 }, picture.size());
  const cv::Rect part = region.empty() ? everywhere : region & everywhere;
  RegionJudgement judgement;
  judgement.text = "Region " + std::to_string(part.width) + " x " + std::to_string(part.height) + " px: ";
  if (part.width < MIN_IMAGE_SIDE || part.height < MIN_IMAGE_SIDE)
  {
    judgement.text += "too small to match";
    judgement.is_good = false;
    return judgement;
  }
  std::string remedies;
  const char* separator = "";
  const cv::Mat grey = toGrey(picture, "picture");
  check::Findings findings = check::judgePicture(check::measurePicture(grey(part).clone()));
  if (const auto other = otherPlaceInPicture(grey, part))
  {
    findings.push_back(check::warning("repetition",
                                      "repeats itself " + std::to_string(std::lround(other->norm())) + " px away",
                                      "let the region show what is there only once"));
  }
  for (const check::Finding& finding : findings)
  {
    judgement.text += separator + finding.message;
    judgement.is_good = judgement.is_good && finding.level == check::Level::OK;
    remedies += finding.remedy.empty() ? "" : "; " + finding.remedy;
    separator = ", ";
  }
  judgement.text += remedies;
  return judgement;
}

}  // namespace view_servo
