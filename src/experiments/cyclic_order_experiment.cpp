// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/cyclic_order_experiment.h"

#include "experiments/line_ground_truth.h"
#include "experiments/point_pairs.h"
#include "sim/textures.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

/** A picture on a surface: a drawn one, or one of oxford_affine. */
struct Picture
{
  Surface surface;
  std::string name;
  cv::Mat image;
};

/** Pictures side by side, to go all around a cylinder. */
cv::Mat sideBySide(const std::vector<cv::Mat>& images)
{
  constexpr int HEIGHT = 560;  // [px]
  std::vector<cv::Mat> scaled;
  for (const cv::Mat& image : images)
  {
    scaled.emplace_back();
    cv::resize(image, scaled.back(), cv::Size(image.cols * HEIGHT / image.rows, HEIGHT), 0.0, 0.0, cv::INTER_AREA);
  }
  cv::Mat row;
  cv::hconcat(scaled, row);
  return row;
}

/** Drawn pictures of two kinds, some of each on planes, and four of each together around a cylinder. */
std::vector<Picture> drawnPictures(const ExperimentContext& context)
{
  constexpr double GREY = 128.0;
  constexpr int COUNT = 10;  // of what is drawn
  constexpr int AROUND_CYLINDER = 4;
  const int on_planes = context.runsOf(DRAWN_PICTURES);
  std::vector<Picture> pictures;
  for (const char* kind : { "poster", "print" })
  {
    std::vector<cv::Mat> all;
    for (int i = 1; i <= std::max(on_planes, AROUND_CYLINDER); ++i)
    {
      const std::uint64_t seed = context.seedOf(DRAWN_PICTURES, static_cast<std::uint64_t>(i));
      const cv::Mat image = sim::drawTexture(kind, cv::Size(900, 720), GREY, COUNT, seed);
      if (i <= on_planes)
      {
        pictures.push_back({ Surface::PLANE, kind + std::to_string(i), image });
      }
      if (i <= AROUND_CYLINDER)
      {
        all.push_back(image);
      }
    }
    pictures.push_back({ Surface::CYLINDER, kind, sideBySide(all) });
  }
  return pictures;
}

/** The first images of the sequences: each on a plane, and all together around a cylinder. */
std::vector<Picture> oxfordPictures(const fs::path& data)
{
  std::vector<Picture> pictures;
  std::vector<cv::Mat> all;
  for (const std::string& sequence : oxfordSequences())
  {
    all.push_back(readOxfordPair(data, sequence, 2).reference);
    pictures.push_back({ Surface::PLANE, sequence, all.back() });
  }
  pictures.push_back({ Surface::CYLINDER, "oxford", sideBySide(all) });
  return pictures;
}

/** Parameters for which both orders are compared. */
struct OrderSetting
{
  std::string name;
  PointViewMatcherParams params;
};

/** The defaults, and the thesis' values (7.4; N_f as in 6.2.1), which take ten times as long. */
std::vector<OrderSetting> orderSettings(const ExperimentContext& context)
{
  OrderSetting ours{ "default", {} };
  ours.params.view_consistency = ViewConsistency::OFF;
  ours.params.seed = context.seedOf(DRAWN_PICTURES, ours.params.seed);
  ours.params.guided = false;
  ours.params.scale_search = false;
  ours.params.side_search = false;
  ours.params.unique = false;  // pictures that repeat themselves are no other question for one order than for the other
  ours.params.first_share = 1.0;  // so that both orders look at the same profiles
  OrderSetting thesis = ours;
  thesis.name = "thesis";
  thesis.params.points.profiles.neighbours = 200;
  thesis.params.points.profiles.coefficients = 6;
  thesis.params.points.search.neighbours = 25;
  thesis.params.points.cyclic_entries = 0;
  return context.brief ? std::vector<OrderSetting>{ ours } : std::vector<OrderSetting>{ ours, thesis };
}

/** Matches a pair with and without cyclic order, a row each. `view` says which of a series it is. */
void compareOrders(const PointPair& pair, const OrderSetting& setting, const std::string& series,
                   const std::string& picture, int view, std::ostream& csv)
{
  constexpr double MAX_HOMOGRAPHY_ERROR = 10.0;  // [px]
  constexpr double MAX_FUNDAMENTAL_ERROR = 3.0;
  const PreparedImage reference(pair.reference, cv::Rect(), setting.params.points);
  const PreparedImage current(pair.current, cv::Rect(), setting.params.points);
  std::cerr << series << ' ' << picture << ' ' << view << ", " << setting.name << ':';
  for (const bool cyclic : { false, true })
  {
    PointViewMatcherParams params = setting.params;
    params.points.cyclic_order = cyclic;
    const ViewMatch match = PointViewMatcher(params).match(reference, current, pair.model);
    Correspondences candidates;
    Correspondences inliers;
    for (const MatchedPoint& point : match.matches)
    {
      candidates.push_back(point.position);
      if (point.inlier)
      {
        inliers.push_back(point.position);
      }
    }
    const double error =
        match.outcome == MatchOutcome::MATCHED ? pair.geometryError(pair.model, match.matrix) : NOT_A_NUMBER;
    const bool solved =
        error < (pair.model == GeometryModel::HOMOGRAPHY ? MAX_HOMOGRAPHY_ERROR : MAX_FUNDAMENTAL_ERROR);
    const int correct = pair.countCorrect(inliers);
    csv << series << ',' << picture << ',' << view << ',' << setting.name << ',' << (cyclic ? "cyclic" : "plain") << ','
        << candidates.size() << ',' << pair.countCorrect(candidates) << ',' << inliers.size() << ',' << correct << ','
        << error << ',' << (solved ? 1 : 0) << std::endl;
    std::cerr << ' ' << correct << (solved ? "*" : "");
  }
  std::cerr << std::endl;
}

}  // namespace

void runCyclicOrderExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const std::vector<int> plane_angles = { 40, 55, 65, 72, 76, 80 };     // [degrees]
  const std::vector<int> cylinder_angles = { 30, 45, 60, 70, 80, 90 };  // what both see shrinks, too
  cv::setNumThreads(context.threads > 0 ? context.threads : -1);
  const std::optional<fs::path> data = context.brief ? std::nullopt : dataFolder();
  std::vector<Picture> pictures = drawnPictures(context);
  if (data)
  {
    const std::vector<Picture> more = oxfordPictures(*data);
    pictures.insert(pictures.end(), more.begin(), more.end());
  }
  csv << "series,picture,view,parameters,order,candidates,correct_candidates,matches,correct_matches,error_px,solved\n";
  const std::vector<OrderSetting> settings = orderSettings(context);
  const auto compare = [&](const PointPair& pair, const std::string& series, const std::string& picture, int view) {
    for (const OrderSetting& setting : settings)
    {
      compareOrders(pair, setting, series, picture, view, csv);
    }
  };
  for (const Picture& picture : pictures)
  {
    const std::vector<int>& angles = picture.surface == Surface::PLANE ? plane_angles : cylinder_angles;
    for (std::size_t i = 0; i < angles.size(); i += context.brief ? 3 : 1)
    {
      const PointPair pair = renderPair(picture.surface, picture.image, angles[i] * M_PI / 180.0,
                                        context.seedOf(DRAWN_PICTURES, static_cast<std::uint64_t>(angles[i])));
      compare(pair, pair.name, picture.name, angles[i]);
    }
  }
  if (data)
  {
    for (const std::string& sequence : oxfordSequences())
    {
      for (int number = 2; number <= 6; ++number)
      {
        compare(readOxfordPair(*data, sequence, number), "oxford", sequence, number);
      }
    }
    for (const std::string& name : kusvodPairs())
    {
      compare(readKusvodPair(*data, name), "kusvod2", name, 2);
    }
  }
}

}  // namespace view_servo
