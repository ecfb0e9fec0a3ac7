// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/hypothesis_experiments.h"

#include "experiments/parallel.h"
#include "experiments/point_pairs.h"
#include "experiments/statistics.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/matching/assignment.h"
#include "view_servo/matching/point_matcher.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/multi_hypothesis.h"
#include "view_servo/robust/quantile.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/core/version.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <limits>
#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#define VIEW_SERVO_HAS_USAC (CV_VERSION_MAJOR * 100 + CV_VERSION_MINOR >= 405)

namespace view_servo
{
namespace
{
enum class Algorithm
{
  RANSAC,      ///< on the one-to-one candidates
  IMPORTANCE,  ///< Algorithm 2
  MODIFIED,    ///< 9.5.1
  WEIGHTED,    ///< the same with lambda (9.6.3)
  MAGSAC       ///< OpenCV's, on the one-to-one candidates
};

const char* nameOf(Algorithm algorithm)
{
  switch (algorithm)
  {
    case Algorithm::RANSAC:
      return "ransac";
    case Algorithm::IMPORTANCE:
      return "importance";
    case Algorithm::MODIFIED:
      return "modified";
    case Algorithm::WEIGHTED:
      return "weighted";
    case Algorithm::MAGSAC:
      return "usac_magsac";
  }
  return "";
}

/** Corners of two images and how they are associated. */
struct Problem
{
  Points reference;
  Points current;
  AssociationMatrix association;
};

struct Settings
{
  Algorithm algorithm;
  GeometryModel model = GeometryModel::FUNDAMENTAL;
  int iterations = 2000;
  double threshold = 1.0;  ///< [px]
  Sampling sampling = Sampling::UNIFORM;
  double view_consistency = 0.0;  ///< threshold of samples for F; 0 = not used
  bool improvement = false;
};

struct Estimate
{
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Constant(NOT_A_NUMBER);
  std::vector<Association> matches;  ///< that agree with it
  double ms = 0.0;
};

Correspondences pairsOf(const Problem& problem, const std::vector<Association>& matches)
{
  Correspondences pairs;
  for (const Association& match : matches)
  {
    pairs.push_back({ problem.reference[static_cast<std::size_t>(match.row)],
                      problem.current[static_cast<std::size_t>(match.column)] });
  }
  return pairs;
}

#if VIEW_SERVO_HAS_USAC
/**
 * USAC_MAGSAC with as many iterations and the sampling that the others have: PROGRESSIVE is PROSAC. Stops earlier only
 * where more iterations could hardly find anything better.
 */
Eigen::Matrix3d estimateByMagsac(const Problem& problem, std::vector<Association> candidates, const Settings& settings,
                                 Rng& rng)
{
  const bool is_homography = settings.model == GeometryModel::HOMOGRAPHY;
  const bool is_progressive = settings.sampling == Sampling::PROGRESSIVE;
  if (is_progressive)
  {
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Association& a, const Association& b) { return a.weight > b.weight; });
  }
  std::vector<cv::Point2d> from;
  std::vector<cv::Point2d> to;
  for (const Correspondence& pair : pairsOf(problem, candidates))
  {
    from.emplace_back(pair.reference.x(), pair.reference.y());
    to.emplace_back(pair.current.x(), pair.current.y());
  }
  cv::UsacParams params;  // what cv::USAC_MAGSAC stands for, but for sampling, confidence and state
  params.score = cv::SCORE_METHOD_MAGSAC;
  params.loMethod = cv::LOCAL_OPTIM_SIGMA;
  params.loSampleSize = is_homography ? 75 : 50;
  params.loIterations = is_homography ? 15 : 10;
  params.sampler = is_progressive ? cv::SAMPLING_PROSAC : cv::SAMPLING_UNIFORM;
  params.confidence = 1.0 - 1e-9;
  params.maxIterations = settings.iterations;
  params.threshold = settings.threshold;
  params.randomGeneratorState = static_cast<int>(uniformIndex(rng, 1U << 30U));
  Eigen::Matrix3d matrix = Eigen::Matrix3d::Constant(NOT_A_NUMBER);
  const cv::Mat found = is_homography ? cv::findHomography(from, to, cv::noArray(), params)
                                      : cv::findFundamentalMat(from, to, cv::noArray(), params);
  if (found.size() == cv::Size(3, 3))
  {
    cv::cv2eigen(found, matrix);
  }
  return matrix;
}
#endif

double squaredError(GeometryModel model, const Eigen::Matrix3d& matrix, const Correspondence& pair)
{
  return model == GeometryModel::FUNDAMENTAL ? sampsonError(matrix, pair)
                                             : 0.5 * symmetricTransferError(matrix, matrix.inverse(), pair);
}

/** As every estimator gets it: the best entries of each row, and the candidates from these. */
Estimate run(const Problem& problem, const Settings& settings, Rng& rng)
{
  RansacParams ransac_params;
  ransac_params.inlier_threshold = settings.threshold;
  ransac_params.sampling = settings.sampling;
  ransac_params.min_iterations = ransac_params.max_iterations = settings.iterations;
  ransac_params.max_rejected = std::numeric_limits<int>::max();
  ransac_params.improvement_stage = settings.improvement;
  MultiHypothesisParams params;
  Estimate result;
  const double begin = threadSeconds();
  if (settings.algorithm == Algorithm::RANSAC || settings.algorithm == Algorithm::MAGSAC)
  {
    const std::vector<Association> candidates =
        maximumWeightMatching(problem.association.strongestOfRows(params.entries_per_row));
    const Correspondences pairs = pairsOf(problem, candidates);
    if (settings.algorithm == Algorithm::MAGSAC)
    {
#if VIEW_SERVO_HAS_USAC
      result.matrix = estimateByMagsac(problem, candidates, settings, rng);
#endif
    }
    else if (settings.model == GeometryModel::FUNDAMENTAL)
    {
      const auto found = ransac(FundamentalEstimator(pairs, settings.view_consistency), ransac_params, rng);
      result.matrix = found.model.value_or(result.matrix);
    }
    else if (const auto found = ransac(HomographyEstimator(pairs), ransac_params, rng); found.model)
    {
      result.matrix = found.model->h;
    }
    for (std::size_t i = 0; i < pairs.size(); ++i)
    {
      if (squaredError(settings.model, result.matrix, pairs[i]) <= settings.threshold * settings.threshold)
      {
        result.matches.push_back(candidates[i]);
      }
    }
  }
  else
  {
    params.sampling =
        settings.algorithm == Algorithm::IMPORTANCE ? HypothesisSampling::IMPORTANCE : HypothesisSampling::CANDIDATES;
    params.association_weight = settings.algorithm == Algorithm::WEIGHTED ? settings.threshold : 0.0;
    if (settings.model == GeometryModel::FUNDAMENTAL)
    {
      const auto found = estimateFundamental(problem.association, problem.reference, problem.current, ransac_params,
                                             params, rng, settings.view_consistency);
      result.matrix = found.model.value_or(result.matrix);
      result.matches = found.matches;
    }
    else
    {
      const auto found =
          estimateHomography(problem.association, problem.reference, problem.current, ransac_params, params, rng);
      result.matrix = found.model ? found.model->h : result.matrix;
      result.matches = found.matches;
    }
  }
  result.ms = 1e3 * (threadSeconds() - begin);
  return result;
}

bool available(Algorithm algorithm)
{
  return algorithm != Algorithm::MAGSAC || VIEW_SERVO_HAS_USAC;
}

// ------------------------------------------------------------------------------------------------- the simulation

constexpr int POINTS = 500;

/** Point i of one image is point i of the other. */
Problem simulate(double sigma, Rng& rng)
{
  constexpr double FOCAL_LENGTH = 600.0;
  constexpr double CENTRE = 300.0;
  constexpr double NOISE = 0.5;  // [px]
  const Eigen::Vector3d first(0.0, 0.0, -2.0);
  const Eigen::Vector3d second(-0.7, 0.0, -2.0);
  const Eigen::Vector3d looked_at(0.0, 0.0, 0.25);
  const double turn = std::atan2(looked_at.x() - second.x(), looked_at.z() - second.z());
  const Eigen::Matrix3d rotation = Eigen::AngleAxisd(-turn, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const auto project = [&](const Eigen::Vector3d& point) {
    Eigen::Vector2d pixel = FOCAL_LENGTH * point.hnormalized() + Eigen::Vector2d::Constant(CENTRE);
    pixel.x() += NOISE * gaussian(rng);
    pixel.y() += NOISE * gaussian(rng);
    return pixel;
  };
  Problem problem;
  for (int i = 0; i < POINTS; ++i)
  {
    Eigen::Vector3d point;
    point.x() = uniform(rng, -1.0, 1.0);
    point.y() = uniform(rng, -1.0, 1.0);
    point.z() = uniform(rng, 0.0, 0.5);
    problem.reference.push_back(project(point - first));
    problem.current.push_back(project(rotation * (point - second)));
  }
  std::vector<Association> entries;
  for (int row = 0; row < POINTS; ++row)
  {
    for (int column = 0; column < POINTS; ++column)
    {
      entries.push_back({ row, column, row == column ? 1.0 : std::abs(sigma * gaussian(rng)) });
    }
  }
  problem.association = AssociationMatrix(POINTS, POINTS, std::move(entries));
  return problem;
}

/** One line of the table: an algorithm at a level of noise. */
struct Simulation
{
  double sigma;
  Settings settings;
};

std::vector<Simulation> simulations(bool brief)
{
  std::vector<Simulation> all;
  const auto add = [&](Algorithm algorithm, double sigma, int iterations) {
    if (available(algorithm))
    {
      Settings settings{ algorithm };
      settings.iterations = iterations;
      settings.improvement = algorithm == Algorithm::IMPORTANCE;
      all.push_back({ sigma, settings });
    }
  };
  const std::vector<double> sigmas =
      brief ? std::vector<double>{ 0.25, 0.31 }
            : std::vector<double>{ 0.25, 0.26, 0.27, 0.28, 0.29, 0.30, 0.31, 0.32, 0.33, 0.34 };
  for (const double sigma : sigmas)
  {
    for (const Algorithm algorithm :
         { Algorithm::MAGSAC, Algorithm::RANSAC, Algorithm::IMPORTANCE, Algorithm::MODIFIED, Algorithm::WEIGHTED })
    {
      add(algorithm, sigma, 2000);
    }
  }
  if (!brief)
  {
    for (const double sigma : { 0.25, 0.29, 0.31, 0.33 })
    {
      add(Algorithm::RANSAC, sigma, 200000);
      add(Algorithm::IMPORTANCE, sigma, 200000);
    }
    for (const int iterations : { 10000, 50000, 500000 })  // figure 9.4
    {
      add(Algorithm::IMPORTANCE, 0.31, iterations);
    }
  }
  return all;
}

}  // namespace

void runMultiHypothesisExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const int runs = context.runsOf(HYPOTHESIS_SCENES);
  cv::setNumThreads(1);  // times are those of one thread
  const std::vector<Simulation> all = simulations(context.brief);
  std::vector<std::vector<double>> correct(all.size(), std::vector<double>(static_cast<std::size_t>(runs)));
  std::vector<std::vector<double>> wrong = correct;
  std::vector<std::vector<double>> ms = correct;
  std::map<double, std::pair<double, double>> large;  // of sigma: entries off the diagonal over 1 and over 0.5
  std::mutex mutex;
  std::size_t done = 0;
  inParallel(static_cast<std::size_t>(runs), context.threads, [&](std::size_t i) {
    for (std::size_t k = 0; k < all.size(); ++k)
    {
      Rng scene_rng(context.seedOf(HYPOTHESIS_SCENES, i + 1));  // every algorithm and level sees the same points
      const Problem problem = simulate(all[k].sigma, scene_rng);
      Rng rng(context.seedOf(HYPOTHESIS_SCENES, 1000 + i));
      const Estimate estimate = run(problem, all[k].settings, rng);
      const auto right = std::count_if(estimate.matches.begin(), estimate.matches.end(),
                                       [](const Association& match) { return match.row == match.column; });
      correct[k][i] = static_cast<double>(right);
      wrong[k][i] = static_cast<double>(estimate.matches.size()) - static_cast<double>(right);
      ms[k][i] = estimate.ms;
      const std::lock_guard<std::mutex> lock(mutex);
      if (all[k].settings.algorithm == Algorithm::MODIFIED)
      {
        for (const Association& entry : problem.association.entries())
        {
          const bool noise = entry.row != entry.column;
          large[all[k].sigma].first += noise && entry.weight > 1.0 ? 1.0 / runs : 0.0;
          large[all[k].sigma].second += noise && entry.weight > 0.5 ? 1.0 / runs : 0.0;
        }
      }
      std::cerr << ++done << " of " << all.size() * static_cast<std::size_t>(runs) << ": sigma " << all[k].sigma << ", "
                << nameOf(all[k].settings.algorithm) << ", " << all[k].settings.iterations
                << " iterations: " << correct[k][i] << " correct, " << wrong[k][i] << " wrong, " << ms[k][i] << " ms"
                << std::endl;
    }
  });
  csv << "algorithm,iterations,sigma,runs,correct,correct_sd,wrong,ms,entries_over_1,entries_over_half\n";
  for (std::size_t k = 0; k < all.size(); ++k)
  {
    csv << nameOf(all[k].settings.algorithm) << ',' << all[k].settings.iterations << ',' << all[k].sigma << ',' << runs
        << ',' << mean(correct[k]) << ',' << deviation(correct[k]) << ',' << mean(wrong[k]) << ',' << medianOf(ms[k])
        << ',' << large[all[k].sigma].first << ',' << large[all[k].sigma].second << '\n';
  }
}

// ------------------------------------------------------------------------------------------------------ real pairs

namespace
{
/** Names two images of the data. */
struct Images
{
  std::string folder;
  std::string name;
  GeometryModel model;
};

std::vector<Images> realPairs(bool brief)
{
  std::vector<Images> all;
  for (const std::string& name : kusvodPairs())
  {
    all.push_back({ "kusvod2", name, GeometryModel::FUNDAMENTAL });
  }
  for (const GeometryModel model : { GeometryModel::FUNDAMENTAL, GeometryModel::HOMOGRAPHY })
  {
    for (const std::string& name : adelaidePairs(model))
    {
      all.push_back({ "adelaidermf", name, model });
    }
  }
  if (brief)
  {
    all.resize(1);
  }
  return all;
}

/** What is known of two images: one for each plane or motion. */
std::vector<PointPair> readTruths(const std::filesystem::path& data, const Images& images)
{
  return images.folder == "kusvod2" ? std::vector<PointPair>{ readKusvodPair(data, images.name) }
                                    : readAdelaidePairs(data, images.model, images.name);
}

/** Corners of two images, associated as the point matcher does. */
Problem associate(const PointPair& pair)
{
  const PointMatcherParams params;
  const PointFeatures reference = extractPointFeatures(pair.reference, params);
  const PointFeatures current = extractPointFeatures(pair.current, params);
  Problem problem;
  for (const Corner& corner : reference.corners)
  {
    problem.reference.push_back(corner.position);
  }
  for (const Corner& corner : current.corners)
  {
    problem.current.push_back(corner.position);
  }
  problem.association = associatePoints(reference, ProfileIndex(reference.profiles), current, params);
  return problem;
}

/** The most that are correct for one plane or motion. */
int mostCorrect(const std::vector<PointPair>& truths, const Correspondences& candidates)
{
  int most = 0;
  for (const PointPair& truth : truths)
  {
    most = std::max(most, truth.countCorrect(candidates));
  }
  return most;
}

Settings settingsFor(Algorithm algorithm, GeometryModel model, bool brief)
{
  constexpr double VIEW_CONSISTENCY = 0.03;  // as ViewConsistencyParams
  Settings settings{ algorithm, model };
  settings.threshold = 2.0;
  settings.sampling = Sampling::PROGRESSIVE;  // as the point matcher
  settings.view_consistency = model == GeometryModel::FUNDAMENTAL ? VIEW_CONSISTENCY : 0.0;
  settings.improvement = algorithm == Algorithm::IMPORTANCE;
  settings.iterations = algorithm == Algorithm::IMPORTANCE && !brief ? 20000 : 2000;
  return settings;
}

/** What each run of an algorithm on two images found. */
struct Outcomes
{
  std::vector<double> matches;
  std::vector<double> correct;
  std::vector<double> error;  ///< [px]
  std::vector<double> ms;
};

Outcomes runAll(const ExperimentContext& context, const std::vector<PointPair>& truths, const Problem& problem,
                const Settings& settings)
{
  const std::vector<double> zeros(static_cast<std::size_t>(context.runsOf(REAL_PAIR_RUNS)));
  Outcomes outcomes{ zeros, zeros, zeros, zeros };
  inParallel(zeros.size(), context.threads, [&](std::size_t i) {
    Rng rng(context.seedOf(REAL_PAIR_RUNS, i + 1));
    const Estimate estimate = run(problem, settings, rng);
    const Correspondences found = pairsOf(problem, estimate.matches);
    // Of several planes or motions, the one that was found.
    outcomes.error[i] = NOT_A_NUMBER;
    for (const PointPair& truth : truths)
    {
      const double candidate = truth.geometryError(settings.model, estimate.matrix);
      if (!(candidate >= outcomes.error[i]))
      {
        outcomes.error[i] = candidate;
        outcomes.correct[i] = truth.countCorrect(found);
      }
    }
    outcomes.matches[i] = static_cast<double>(found.size());
    outcomes.ms[i] = estimate.ms;
  });
  return outcomes;
}

}  // namespace

void runRealPairsExperiment(const ExperimentContext& context, std::ostream& csv)
{
  csv << "pair,model,algorithm,iterations,runs,candidates,candidates_correct,matches,correct,error_px,ms\n";
  for (const Images& images : realPairs(context.brief))
  {
    const std::vector<PointPair> truths = readTruths(context.data, images);
    const Problem problem = associate(truths.front());
    const Correspondences candidates = pairsOf(
        problem, maximumWeightMatching(problem.association.strongestOfRows(MultiHypothesisParams().entries_per_row)));
    const int most_correct = mostCorrect(truths, candidates);
    for (const Algorithm algorithm :
         { Algorithm::MAGSAC, Algorithm::RANSAC, Algorithm::MODIFIED, Algorithm::WEIGHTED, Algorithm::IMPORTANCE })
    {
      if (!available(algorithm))
      {
        continue;
      }
      const Settings settings = settingsFor(algorithm, images.model, context.brief);
      const Outcomes outcomes = runAll(context, truths, problem, settings);
      csv << images.folder << '/' << images.name << ',' << (images.model == GeometryModel::FUNDAMENTAL ? "F" : "H")
          << ',' << nameOf(algorithm) << ',' << settings.iterations << ',' << outcomes.ms.size() << ','
          << candidates.size() << ',' << most_correct << ',' << medianOf(outcomes.matches) << ','
          << medianOf(outcomes.correct) << ',' << medianOf(outcomes.error) << ',' << medianOf(outcomes.ms) << '\n';
      std::cerr << images.folder << '/' << images.name << ", " << nameOf(algorithm) << ": "
                << medianOf(outcomes.correct) << " correct of " << medianOf(outcomes.matches) << ", error "
                << medianOf(outcomes.error) << " px, " << medianOf(outcomes.ms) << " ms" << std::endl;
    }
  }
}

}  // namespace view_servo
