// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/false_answers_experiment.h"

#include "experiments/parallel.h"
#include "experiments/pictures.h"
#include "view_servo/images/image_io.h"
#include "view_servo/robust/random.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cstddef>
#include <iostream>
#include <map>
#include <ostream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

struct Pair
{
  std::string kind;
  std::string name;
  cv::Mat reference;
  cv::Mat current;
};

struct Answer
{
  std::string matcher;
  std::string model;
  bool given;
  int inliers;
  double log_significance;
};

// ----------------------------------------------------------------------------------------------------- real pictures

class Pictures
{
public:
  explicit Pictures(const fs::path& data)
  {
    constexpr int LEAST = 320;  // [px]
    for (const auto& [scene, files] : findPictures(data))
    {
      const cv::Size size = readGreyImage(files.front().string()).size();
      if (std::min(size.width, size.height) >= LEAST)
      {
        scenes_.push_back(files);
      }
    }
    if (scenes_.size() < 2)
    {
      throw std::runtime_error("there are no pictures of two scenes in " + data.string());
    }
  }

  Pair drawUnrelated(Rng& rng) const
  {
    const std::size_t first = uniformIndex(rng, scenes_.size());
    const std::size_t second = (first + 1 + uniformIndex(rng, scenes_.size() - 1)) % scenes_.size();
    return pairOf("unrelated", draw(rng, first), draw(rng, second));
  }

  Pair drawMirrored(Rng& rng) const
  {
    const std::size_t scene = uniformIndex(rng, scenes_.size());
    const fs::path reference = draw(rng, scene);
    Pair pair = pairOf("mirrored", reference, draw(rng, scene));
    cv::flip(pair.current, pair.current, 1);
    return pair;
  }

private:
  const fs::path& draw(Rng& rng, std::size_t scene) const
  {
    return scenes_[scene][uniformIndex(rng, scenes_[scene].size())];
  }

  static Pair pairOf(const std::string& kind, const fs::path& reference, const fs::path& current)
  {
    const auto name = [](const fs::path& file) {
      return file.parent_path().filename().string() + "/" + file.stem().string();
    };
    return { kind, name(reference) + " " + name(current), readGreyImage(reference.string()),
             readGreyImage(current.string()) };
  }

  std::vector<std::vector<fs::path>> scenes_;
};

// ---------------------------------------------------------------------------------------------------- drawn pictures

/** A wall that repeats in both directions: windows of some panes, or tiles with a dot and a joint. */
cv::Mat drawWall(Rng& rng, bool windows, int period, const cv::Size& size)
{
  const auto between = [&rng](int least, int most) {
    const int count = most - least + 1;
    return least + static_cast<int>(uniformIndex(rng, static_cast<std::size_t>(count)));
  };
  cv::Mat element(period, period, CV_8UC1, cv::Scalar(between(20, 230)));
  if (windows)
  {
    for (int pane = 0; pane < 4; ++pane)
    {
      const cv::Point corner(between(period / 12, period / 2), between(period / 12, period / 2));
      const cv::Size side(between(period / 6, period / 3), between(period / 6, period / 3));
      cv::rectangle(element, cv::Rect(corner, side), cv::Scalar(between(20, 230)), cv::FILLED);
    }
  }
  else
  {
    const cv::Scalar joint(between(20, 230));
    cv::rectangle(element, cv::Rect(0, 0, period, 4), joint, cv::FILLED);
    cv::rectangle(element, cv::Rect(0, 0, 4, period), joint, cv::FILLED);
    cv::circle(element, { between(period / 3, 2 * period / 3), between(period / 3, 2 * period / 3) },
               between(period / 8, period / 5), cv::Scalar(between(20, 230)), cv::FILLED, cv::LINE_AA);
  }
  const cv::Mat all = cv::repeat(element, size.height / period + 1, size.width / period + 1);
  return all(cv::Rect(cv::Point(), size)).clone();
}

/** A picture of a wall as a camera takes it: a little turned and nearer or farther, blurred, with noise. */
cv::Mat photograph(Rng& rng, const cv::Mat& wall, const cv::Rect& window)
{
  constexpr double SIGMA = 0.8;  // [px]
  constexpr double NOISE = 2.0;
  const cv::Point2f middle(window.x + 0.5F * static_cast<float>(window.width),
                           window.y + 0.5F * static_cast<float>(window.height));
  cv::Mat motion = cv::getRotationMatrix2D(middle, uniform(rng, -4.0, 4.0), uniform(rng, 0.95, 1.05));
  motion.at<double>(0, 2) -= window.x;
  motion.at<double>(1, 2) -= window.y;
  cv::Mat picture;
  cv::warpAffine(wall, picture, motion, window.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  cv::GaussianBlur(picture, picture, cv::Size(), SIGMA);
  cv::Mat noise(picture.size(), CV_16SC1);
  cv::RNG(rng()).fill(noise, cv::RNG::NORMAL, 0.0, NOISE);
  cv::add(picture, noise, picture, cv::noArray(), CV_8U);
  return picture;
}

Pair drawShifted(Rng& rng, int number)
{
  const cv::Size size(640, 480);
  constexpr int MARGIN = 60;  // what a turned camera sees beside the window [px]
  const bool windows = number % 2 == 0;
  const int period = 48 + 8 * static_cast<int>(uniformIndex(rng, 6));
  const cv::Mat wall = drawWall(rng, windows, period, size + cv::Size(2 * MARGIN + period, 2 * MARGIN));
  Pair pair{ "shifted", (windows ? "windows " : "tiles ") + std::to_string(number), {}, {} };
  pair.reference = photograph(rng, wall, cv::Rect(cv::Point(MARGIN, MARGIN), size));
  pair.current = photograph(rng, wall, cv::Rect(cv::Point(MARGIN + period, MARGIN), size));
  return pair;
}

// ------------------------------------------------------------------------------------------------------ the matchers

std::vector<Answer> match(const Pair& pair)
{
  const SceneMatcher scene{ SceneMatcherParams() };
  const PointViewMatcher points{ PointViewMatcherParams() };
  const LineViewMatcher lines(scene.params().lines);
  FeatureParams few_corners = scene.features();  // as point_matcher has them
  few_corners.points = points.params().points;
  const PreparedImage reference(pair.reference, cv::Rect(), scene.features());
  const PreparedImage current(pair.current, cv::Rect(), scene.features());
  const PreparedImage points_reference(pair.reference, cv::Rect(), few_corners);
  const PreparedImage points_current(pair.current, cv::Rect(), few_corners);
  std::vector<Answer> answers;
  for (const GeometryModel model : { GeometryModel::HOMOGRAPHY, GeometryModel::FUNDAMENTAL })
  {
    const auto add = [&](const std::string& matcher, const ViewMatch& found) {
      answers.push_back({ matcher, model == GeometryModel::HOMOGRAPHY ? "homography" : "fundamental",
                          found.outcome == MatchOutcome::MATCHED, found.inliers, found.log_significance });
    };
    add("points", points.match(points_reference, points_current, model));
    add("lines", lines.match(reference, current, model));
    add("scene", scene.match(reference, current, model));
  }
  return answers;
}

}  // namespace

void runFalseAnswersExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const Pictures pictures(context.data);
  const int unrelated = context.runsOf(UNRELATED_PAIRS);
  const int others = std::max(1, unrelated / 2);
  const std::size_t count = static_cast<std::size_t>(unrelated) + 2 * static_cast<std::size_t>(others);
  std::vector<std::string> names(count);
  std::vector<std::string> kinds(count);
  std::vector<std::vector<Answer>> answers(count);
  inParallel(count, context.threads, [&](std::size_t i) {
    const int number = static_cast<int>(i);
    Rng rng(context.seedOf(UNRELATED_PAIRS, i));
    const Pair pair = number < unrelated            ? pictures.drawUnrelated(rng)
                      : number < unrelated + others ? pictures.drawMirrored(rng)
                                                    : drawShifted(rng, number - unrelated - others);
    kinds[i] = pair.kind;
    names[i] = pair.name;
    answers[i] = match(pair);
  });
  csv << "kind,pair,matcher,model,answer,inliers,log_significance\n";
  std::map<std::tuple<std::string, std::string, std::string>, std::pair<int, int>> counts;  // given, of
  for (std::size_t i = 0; i < count; ++i)
  {
    for (const Answer& answer : answers[i])
    {
      csv << kinds[i] << ',' << names[i] << ',' << answer.matcher << ',' << answer.model << ','
          << (answer.given ? 1 : 0) << ',' << answer.inliers << ',' << answer.log_significance << '\n';
      std::pair<int, int>& number = counts[{ kinds[i], answer.matcher, answer.model }];
      number.first += answer.given ? 1 : 0;
      number.second += 1;
    }
  }
  for (const auto& [key, number] : counts)
  {
    const auto& [kind, matcher, model] = key;
    std::cout << kind << ", " << matcher << ", " << model << ": " << number.first << " answers for " << number.second
              << " pairs" << std::endl;
  }
}

}  // namespace view_servo
