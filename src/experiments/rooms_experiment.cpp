// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/rooms_experiment.h"

#include "experiments/indoor_walk.h"
#include "experiments/peer_matches.h"
#include "experiments/point_pairs.h"
#include "experiments/statistics.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/features2d.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ctime>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <optional>
#include <ostream>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

constexpr double RIGHT = 3.0;   // an answer with less error [px]
constexpr double WRONG = 10.0;  // with more it is grossly wrong

struct Answer
{
  std::optional<Eigen::Matrix3d> f;
  bool is_plane = false;  ///< a homography was answered instead
  Correspondences inliers;
};

struct RoomPair
{
  std::string set;
  std::string name;
  cv::Mat reference;
  cv::Mat current;
  double baseline = std::numeric_limits<double>::quiet_NaN();  ///< [m]
  double rotation = std::numeric_limits<double>::quiet_NaN();  ///< [degrees]
  /**
   * True matches, at which answers are measured; may depend on what other answers found. Where things have moved apart,
   * each motion has its own.
   */
  std::function<std::vector<Correspondences>(const std::vector<Answer>&)> truth;
};

// -------------------------------------------------------------------------------------------------------- the pairs

/** Two views of a walk, and how the camera moved between them. */
struct WalkPair
{
  Camera camera;
  Eigen::Isometry3d current_from_reference;
  cv::Size size;

  static constexpr int COLUMNS = 12;  ///< of the grid of points in matchesAt()
  static constexpr int ROWS = 8;

  /** Whether a match may be of one point before both cameras. */
  bool agrees(const Correspondence& match) const
  {
    constexpr double AGREES = 1.5;  // [px]
    const Eigen::Vector3d translation = current_from_reference.translation();
    Eigen::Matrix3d cross;
    cross << 0.0, -translation.z(), translation.y(), translation.z(), 0.0, -translation.x(), -translation.y(),
        translation.x(), 0.0;
    const Eigen::Matrix3d inverse = camera.k.inverse();
    const Eigen::Matrix3d f = inverse.transpose() * cross * current_from_reference.linear() * inverse;
    if (sampsonError(f, match) > AGREES * AGREES)
    {
      return false;
    }
    Eigen::Matrix<double, 3, 2> rays;
    rays << current_from_reference.linear() * (inverse * match.reference.homogeneous()),
        -(inverse * match.current.homogeneous());
    const Eigen::Matrix2d square = rays.transpose() * rays;
    const Eigen::Vector2d depths = square.inverse() * (rays.transpose() * -translation);
    return depths.minCoeff() > 0.0;
  }

  /** Share of the reference image's points at a depth that the current image shows. */
  double overlapAt(double depth) const
  {
    return static_cast<double>(matchesAt({ depth }).size()) / (ROWS * COLUMNS);
  }

  /** What both views show of points all over the reference image at these depths. */
  Correspondences matchesAt(const std::vector<double>& depths) const
  {
    const cv::Rect2d frame(0.0, 0.0, size.width, size.height);
    Correspondences matches;
    for (int i = 0; i < ROWS * COLUMNS; ++i)
    {
      const int row = i / COLUMNS;
      const int column = i % COLUMNS;
      const Eigen::Vector2d at((column + 0.5) * size.width / COLUMNS, (row + 0.5) * size.height / ROWS);
      for (const double depth : depths)
      {
        const Eigen::Vector3d point = current_from_reference * (depth * (camera.k.inverse() * at.homogeneous()));
        const Eigen::Vector2d seen = (camera.k * point).hnormalized();
        if (point.z() > 0.0 && frame.contains({ seen.x(), seen.y() }))
        {
          matches.push_back({ at, seen });
        }
      }
    }
    return matches;
  }
};

/**
 * The true ones among all matches that anything found, one for each cell of the reference image; where these are few,
 * points at depths that rooms have.
 */
Correspondences trueMatches(const WalkPair& walk, const std::vector<Answer>& answers)
{
  constexpr std::size_t ENOUGH = 20;
  constexpr double CELL = 20.0;  // [px]
  std::map<std::pair<int, int>, Correspondence> of_cell;
  for (const Answer& answer : answers)
  {
    for (const Correspondence& match : answer.inliers)
    {
      if (walk.agrees(match))
      {
        of_cell.emplace(
            std::pair(static_cast<int>(match.reference.x() / CELL), static_cast<int>(match.reference.y() / CELL)),
            match);
      }
    }
  }
  if (of_cell.size() < ENOUGH)
  {
    return walk.matchesAt({ 2.0, 3.0, 4.5 });
  }
  Correspondences matches;
  for (const auto& [cell, match] : of_cell)
  {
    matches.push_back(match);
  }
  return matches;
}

cv::Mat readWalkImage(const fs::path& data, const std::string& name)
{
  return readGreyImage((data / "hololens_indoor" / "images" / name).string());
}

Eigen::Isometry3d motionBetween(const IndoorWalk& walk, const std::string& reference, const std::string& current)
{
  return walk.poses.at(current).inverse() * walk.poses.at(reference);
}

RoomPair walkPair(const fs::path& data, const IndoorWalk& walk, const std::string& set, const std::string& reference,
                  const std::string& current)
{
  RoomPair pair;
  pair.set = set;
  pair.name = fs::path(reference).stem().string() + "-" + fs::path(current).stem().string();
  pair.reference = readWalkImage(data, reference);
  pair.current = readWalkImage(data, current);
  const WalkPair motion{ walk.camera, motionBetween(walk, reference, current), pair.reference.size() };
  pair.truth = [motion](const std::vector<Answer>& answers) {
    return std::vector<Correspondences>{ trueMatches(motion, answers) };
  };
  pair.baseline = motion.current_from_reference.translation().norm();
  pair.rotation = DEGREES * Eigen::AngleAxisd(motion.current_from_reference.linear()).angle();
  return pair;
}

/** The pairs that come with the walk. */
std::vector<RoomPair> walkPairs(const fs::path& data)
{
  const IndoorWalk walk = readIndoorWalk(data);
  std::vector<RoomPair> pairs;
  for (std::size_t i = 0; i < walk.pairs.size(); i += 2)  // in one direction
  {
    pairs.push_back(walkPair(data, walk, "hololens_indoor", walk.pairs[i].reference, walk.pairs[i].current));
  }
  return pairs;
}

/** Other pairs of its views, no more than there are, that are near each other and show much of the same. */
std::vector<RoomPair> drawnWalkPairs(const fs::path& data, int count, Rng& rng)
{
  constexpr double LEAST_BASELINE = 0.1;     // [m]
  constexpr double LARGEST_BASELINE = 1.5;   // [m]
  constexpr double LARGEST_ROTATION = 60.0;  // [degrees]
  constexpr double LEAST_OVERLAP = 0.3;      // share of the one picture that the other one shows
  constexpr double DEPTH = 3.0;              // at which overlap is reckoned [m]
  const IndoorWalk walk = readIndoorWalk(data);
  std::set<std::pair<std::string, std::string>> given;
  for (const IndoorWalk::Pair& pair : walk.pairs)
  {
    given.emplace(pair.reference, pair.current);
  }
  const cv::Size size = readWalkImage(data, walk.poses.begin()->first).size();
  std::vector<std::pair<std::string, std::string>> names;
  for (const auto& [reference, unused_pose] : walk.poses)
  {
    for (const auto& [current, unused_other_pose] : walk.poses)
    {
      const WalkPair motion{ walk.camera, motionBetween(walk, reference, current), size };
      const double baseline = motion.current_from_reference.translation().norm();
      const double rotation = DEGREES * Eigen::AngleAxisd(motion.current_from_reference.linear()).angle();
      if (reference != current && given.count({ reference, current }) == 0 && baseline >= LEAST_BASELINE &&
          baseline <= LARGEST_BASELINE && rotation <= LARGEST_ROTATION && motion.overlapAt(DEPTH) >= LEAST_OVERLAP)
      {
        names.emplace_back(reference, current);
      }
    }
  }
  std::vector<RoomPair> pairs;
  for (; count > 0 && !names.empty(); --count)
  {
    const auto drawn = names.begin() + static_cast<std::ptrdiff_t>(uniformIndex(rng, names.size()));
    pairs.push_back(walkPair(data, walk, "hololens_indoor drawn", drawn->first, drawn->second));
    names.erase(drawn);
  }
  return pairs;
}

/** @param motions the same two pictures, with the true matches of one motion each. */
RoomPair toRoomPair(const std::string& set, const std::vector<PointPair>& motions)
{
  RoomPair result;
  result.set = set;
  result.name = motions.front().name;
  result.reference = motions.front().reference;
  result.current = motions.front().current;
  std::vector<Correspondences> truth;
  truth.reserve(motions.size());
  for (const PointPair& motion : motions)
  {
    truth.push_back(motion.points);
  }
  result.truth = [truth](const std::vector<Answer>&) {
    return truth;
  };
  return result;
}

std::vector<RoomPair> allPairs(const fs::path& data)
{
  std::vector<RoomPair> pairs = walkPairs(data);
  for (const std::string& name : kusvodPairs())
  {
    pairs.push_back(toRoomPair("kusvod2", { readKusvodPair(data, name) }));
  }
  for (const std::string& name : adelaidePairs(GeometryModel::FUNDAMENTAL))
  {
    pairs.push_back(toRoomPair("adelaidermf", readAdelaidePairs(data, GeometryModel::FUNDAMENTAL, name)));
  }
  for (const std::string& name : adelaidePairs(GeometryModel::HOMOGRAPHY))
  {
    PointPair all;
    for (const PointPair& plane : readAdelaidePairs(data, GeometryModel::HOMOGRAPHY, name))
    {
      Correspondences points = std::move(all.points);
      points.insert(points.end(), plane.points.begin(), plane.points.end());
      all = plane;
      all.points = std::move(points);
    }
    pairs.push_back(toRoomPair("adelaidermf", { all }));
  }
  return pairs;
}

// ------------------------------------------------------------------------------------------------------ the methods

/** Ours, with both pictures prepared anew. */
template <typename Match>
Answer answerOf(const FeatureParams& features, const RoomPair& pair, const Match& match_images)
{
  const PreparedImage reference(pair.reference, cv::Rect(), features);
  const PreparedImage current(pair.current, cv::Rect(), features);
  const ViewMatch match = match_images(reference, current);
  Answer answer;
  for (const MatchedPoint& point : match.matches)
  {
    if (point.inlier)
    {
      answer.inliers.push_back(point.position);
    }
  }
  if (match.outcome == MatchOutcome::MATCHED && match.model == GeometryModel::FUNDAMENTAL)
  {
    answer.f = match.matrix;
  }
  answer.is_plane = match.outcome == MatchOutcome::MATCHED && match.model == GeometryModel::HOMOGRAPHY;
  return answer;
}

/** A way to match two pictures; those of one family find much the same. */
struct Method
{
  std::string name;
  std::string family;
  std::function<Answer(const RoomPair&)> answer;
};

#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 5)
/** Key points, ratio test at 0.8, MAGSAC; an answer has 15 inliers at least. */
Answer answerOfPeer(const cv::Ptr<cv::Feature2D>& detector, const cv::Ptr<cv::DescriptorMatcher>& matcher,
                    const RoomPair& pair)
{
  constexpr std::size_t ENOUGH = 15;
  const auto [from, to] =
      matchesOfPeer(matcher, featuresOfPeer(detector, pair.reference), featuresOfPeer(detector, pair.current));
  if (from.size() < ENOUGH)
  {
    return {};
  }
  std::vector<unsigned char> mask;
  const cv::Mat f = cv::findFundamentalMat(from, to, cv::USAC_MAGSAC, 1.0, 0.999, 10000, mask);
  Answer answer;
  for (std::size_t i = 0; i < mask.size(); ++i)
  {
    if (mask[i] != 0)
    {
      answer.inliers.push_back({ { from[i].x, from[i].y }, { to[i].x, to[i].y } });
    }
  }
  if (f.rows == 3 && answer.inliers.size() >= ENOUGH)
  {
    Eigen::Matrix3d matrix;
    cv::cv2eigen(f, matrix);
    answer.f = matrix;
  }
  return answer;
}

std::vector<Method> peers()
{
  const auto sift = [](int count) {
    return [count](const RoomPair& pair) {
      return answerOfPeer(cv::SIFT::create(count), cv::makePtr<cv::FlannBasedMatcher>(), pair);
    };
  };
  return { { "SIFT 500", "SIFT", sift(500) },
           { "SIFT all", "SIFT", sift(0) },
           { "AKAZE", "AKAZE", [](const RoomPair& pair) {
              return answerOfPeer(cv::AKAZE::create(), cv::makePtr<cv::BFMatcher>(cv::NORM_HAMMING), pair);
            } } };
}
#else
std::vector<Method> peers()
{
  std::cerr << "without SIFT and AKAZE: MAGSAC comes with OpenCV 4.5" << std::endl;
  return {};
}
#endif

std::vector<Method> ours()
{
  const SceneMatcher scene{ SceneMatcherParams() };
  const PointViewMatcher points{ PointViewMatcherParams() };
  const LineViewMatcher lines(scene.params().lines);
  const FeatureParams features = scene.features();
  FeatureParams few_corners = features;
  few_corners.points = points.params().points;
  return { { "points and lines", "view_servo",
             [=](const RoomPair& pair) {
               return answerOf(features, pair, [&](const PreparedImage& reference, const PreparedImage& current) {
                 return scene.match(reference, current);
               });
             } },
           { "points", "view_servo",
             [=](const RoomPair& pair) {
               return answerOf(few_corners, pair, [&](const PreparedImage& reference, const PreparedImage& current) {
                 return points.match(reference, current, GeometryModel::FUNDAMENTAL);
               });
             } },
           { "lines", "view_servo", [=](const RoomPair& pair) {
              return answerOf(features, pair, [&](const PreparedImage& reference, const PreparedImage& current) {
                return lines.match(reference, current, GeometryModel::FUNDAMENTAL);
              });
            } } };
}

/** Mean Sampson distance of true matches; of the motion that an answer fits best. NaN without an answer. */
double errorOf(const Answer& answer, const std::vector<Correspondences>& truth)
{
  double least = std::numeric_limits<double>::quiet_NaN();
  for (const Correspondences& motion : truth)
  {
    double sum = 0.0;
    for (const Correspondence& match : motion)
    {
      sum += answer.f ? std::sqrt(sampsonError(*answer.f, match)) : std::numeric_limits<double>::quiet_NaN();
    }
    least = std::fmin(least, sum / static_cast<double>(motion.size()));
  }
  return least;
}

struct RoomsSummary
{
  int pairs = 0;
  int answers = 0;
  int planes = 0;  ///< answers that are homographies: one plane is all that both views show
  int right = 0;
  int wrong = 0;
  std::vector<double> errors;  ///< of right ones [px]
  std::vector<double> ms;
};

}  // namespace

void runRoomsExperiment(const ExperimentContext& context, std::ostream& csv)
{
  std::vector<Method> methods = ours();
  for (Method& peer : peers())
  {
    methods.push_back(std::move(peer));
  }
  std::vector<RoomPair> pairs = allPairs(context.data);
  if (context.brief)
  {
    pairs.resize(2);
  }
  Rng rng(context.seedOf(DRAWN_WALK_PAIRS, DRAWN_WALK_PAIRS.seed));
  for (RoomPair& pair : drawnWalkPairs(context.data, context.runsOf(DRAWN_WALK_PAIRS), rng))
  {
    pairs.push_back(std::move(pair));
  }
  std::map<std::pair<std::string, std::string>, RoomsSummary> summaries;  // of set and method
  csv << "set,pair,baseline_m,rotation_deg,method,answer,plane,error_px,inliers,ms\n";
  for (const RoomPair& pair : pairs)
  {
    std::vector<Answer> answers;
    std::vector<double> times;
    for (const Method& method : methods)
    {
      const std::clock_t begin = std::clock();
      answers.push_back(method.answer(pair));
      times.push_back(1e3 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
    }
    // Of each family: what the others have found, as its own matches are kind to its answers.
    std::map<std::string, std::vector<Correspondences>> truths;
    for (const Method& judged : methods)
    {
      std::vector<Answer> others;
      for (std::size_t i = 0; i < methods.size(); ++i)
      {
        if (methods[i].family != judged.family)
        {
          others.push_back(answers[i]);
        }
      }
      truths.emplace(judged.family, pair.truth(others));
    }
    std::cerr << pair.set << ' ' << pair.name << ':';
    for (std::size_t i = 0; i < methods.size(); ++i)
    {
      const std::string& name = methods[i].name;
      const double error = errorOf(answers[i], truths.at(methods[i].family));
      csv << pair.set << ',' << pair.name << ',' << pair.baseline << ',' << pair.rotation << ',' << name << ','
          << (answers[i].f ? 1 : 0) << ',' << (answers[i].is_plane ? 1 : 0) << ',' << error << ','
          << answers[i].inliers.size() << ',' << times[i] << '\n';
      std::cerr << ' ' << name << ' ' << error << " px (" << answers[i].inliers.size() << ')';
      RoomsSummary& summary = summaries[{ pair.set, name }];
      summary.pairs += 1;
      summary.answers += answers[i].f ? 1 : 0;
      summary.planes += answers[i].is_plane ? 1 : 0;
      summary.right += error < RIGHT ? 1 : 0;
      summary.wrong += error > WRONG ? 1 : 0;
      if (error < RIGHT)
      {
        summary.errors.push_back(error);
      }
      summary.ms.push_back(times[i]);
    }
    std::cerr << std::endl;
  }
  for (const auto& [key, summary] : summaries)
  {
    std::cout << key.first << ", " << key.second << ": of " << summary.pairs << " pairs " << summary.answers
              << " answered, " << summary.right << " right, " << summary.wrong << " grossly wrong";
    if (summary.planes > 0)
    {
      std::cout << "; besides, " << summary.planes << " homographies of a plane";
    }
    if (!summary.errors.empty())
    {
      std::cout << "; right ones " << medianOf(summary.errors) << " px in the median";
    }
    std::cout << "; " << medianOf(summary.ms) << " ms of processor time" << std::endl;
  }
}

}  // namespace view_servo
