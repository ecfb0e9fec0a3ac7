// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/robust/ransac.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace view_servo
{
namespace detail
{
/** Replaces `sample` by `size` distinct indices in [0, count), every set equally likely (Floyd). size <= count. */
void drawDistinct(Rng& rng, std::size_t count, std::size_t size, std::vector<int>& sample);

/** The indices [0, count), every order equally likely (Fisher & Yates). */
std::vector<int> randomOrder(Rng& rng, std::size_t count);

/**
 * Wald's sequential test of a model against the best one (Matas & Chum 2005): evidence grows, in log likelihood ratio,
 * with data taken in random order. A model with as many inliers as the best is lost with a probability under 1e-4.
 */
class SequentialTest
{
public:
  /** Until it is given a ratio, no model fails. A failing model is one with a quarter of the inliers, or fewer. */
  void setBest(double inlier_ratio);

  void add(bool inlier, double& evidence) const
  {
    evidence += inlier ? inlier_evidence_ : outlier_evidence_;
  }
  static bool fails(double evidence)
  {
    constexpr double LOG_CERTAIN = 9.21;  // log(1e4)
    return evidence > LOG_CERTAIN;
  }

private:
  double inlier_evidence_ = 0.0;
  double outlier_evidence_ = 0.0;
};

/**
 * Samples for RANSAC: uniform, or from a growing best-first prefix (PROSAC; Chum & Matas 2005, sec. 2.1). The growth
 * is that of the paper with its T_N set to `schedule_length`; when it is through, samples are uniform over all data.
 */
class Sampler
{
public:
  /** size <= count, size > 0. */
  Sampler(Sampling sampling, std::size_t count, std::size_t size, double schedule_length);

  void draw(Rng& rng, std::vector<int>& sample);

private:
  std::size_t count_;
  std::size_t size_;
  std::size_t prefix_;      ///< n: samples come from the best n data
  double prefix_samples_;   ///< T_n: samples expected from within the best n, real-valued
  double samples_drawn_;    ///< t
  double samples_to_grow_;  ///< T'_n: n grows when t passes it
};

/** Samples needed for one free of outliers with the given confidence (thesis eq. 9.5); possibly infinite. */
double requiredSamples(double inlier_ratio, int sample_size, double confidence);

/** The state of one call of ransac(). */
template <typename Estimator>
class RansacLoop
{
public:
  using Model = typename Estimator::Model;

  RansacLoop(const Estimator& estimator, const RansacParams& params, Rng& rng)
    : estimator_(estimator),
      params_(params),
      rng_(rng),
      squared_threshold_(params.inlier_threshold * params.inlier_threshold)
  {
  }

  RansacResult<Model> run()
  {
    const auto start = std::chrono::steady_clock::now();
    if (estimator_.size() >= SIZE)
    {
      order_ = randomOrder(rng_, estimator_.size());
      statistics().stop = drawSamples();
      if (params_.improvement_stage && result_.model)
      {
        replaceSampleData();
      }
    }
    if (result_.model)
    {
      findInliers(*result_.model, squared_threshold_, result_.inliers);
    }
    else
    {
      result_.cost = static_cast<double>(estimator_.size()) * squared_threshold_;
    }
    statistics().elapsed_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    return std::move(result_);
  }

private:
  static constexpr std::size_t SIZE = Estimator::SAMPLE_SIZE;

  RansacStatistics& statistics()
  {
    return result_.statistics;
  }

  RansacStop drawSamples()
  {
    // Half of the samples allowed for the growth: an order that misleads leaves the other half to uniform sampling.
    Sampler sampler(params_.sampling, estimator_.size(), SIZE, 0.5 * params_.max_iterations);
    std::vector<int> sample;
    double required = std::numeric_limits<double>::infinity();
    while (statistics().iterations < params_.max_iterations)
    {
      if (statistics().iterations >= params_.min_iterations && statistics().iterations >= required)
      {
        return RansacStop::CONFIDENCE_REACHED;
      }
      sampler.draw(rng_, sample);
      if (!estimator_.accepts(sample))
      {
        if (++statistics().rejected_samples > params_.max_rejected)
        {
          return RansacStop::REJECTION_LIMIT;
        }
        continue;
      }
      ++statistics().iterations;
      if (trySample(sample))
      {
        findInliers(*result_.model, squared_threshold_, inliers_);
        required = requiredSamples(static_cast<double>(inliers_.size()) / static_cast<double>(estimator_.size()),
                                   Estimator::SAMPLE_SIZE, params_.confidence);
      }
    }
    return statistics().iterations >= required ? RansacStop::CONFIDENCE_REACHED : RansacStop::ITERATION_LIMIT;
  }

  /** Thesis 9.4: each position of the best sample in turn takes every other datum; improvements are kept at once. */
  void replaceSampleData()
  {
    std::vector<int> sample;
    for (std::size_t position = 0; position < SIZE; ++position)
    {
      for (int datum = 0; datum < static_cast<int>(estimator_.size()); ++datum)
      {
        if (std::find(best_sample_.begin(), best_sample_.end(), datum) != best_sample_.end())
        {
          continue;
        }
        sample = best_sample_;
        sample[position] = datum;
        if (estimator_.accepts(sample))
        {
          trySample(sample);
        }
        else if (++statistics().rejected_samples > params_.max_rejected)
        {
          return;
        }
      }
    }
  }

  /** Solves and scores a sample; optimises it locally when it is the best so far. Whether the result improved. */
  bool trySample(const std::vector<int>& sample)
  {
    models_.clear();
    estimator_.solve(sample, models_);
    const Model* best = nullptr;
    for (const Model& model : models_)
    {
      ++statistics().models;
      const double cost = testAndScore(model);
      if (cost < sample_cost_)
      {
        sample_cost_ = cost;
        best = &model;
      }
    }
    if (best == nullptr)
    {
      return false;
    }
    best_sample_ = sample;
    findInliers(*best, squared_threshold_, inliers_);
    test_.setBest(static_cast<double>(inliers_.size()) / static_cast<double>(estimator_.size()));
    const bool improved = keepIfBetter(*best, sample_cost_);
    return optimizeLocally(*best) || improved;
  }

  /**
   * Refits to the inliers again and again (Chum, Matas & Kittler 2003), first to those of a wider threshold, which
   * recovers inliers that a noisy minimal model misses. Whether the result improved.
   */
  bool optimizeLocally(Model model)
  {
    constexpr double WIDEST = 2.0;
    constexpr double NARROWING = 0.5;
    constexpr double WORTHWHILE = 1e-3;  // relative decrease of the cost that deserves another refit
    bool improved = false;
    double width = WIDEST;
    double last_cost = std::numeric_limits<double>::infinity();
    for (int i = 0; i < params_.local_optimizations; ++i)
    {
      findInliers(model, width * width * squared_threshold_, inliers_);
      if (inliers_.size() < SIZE)
      {
        break;
      }
      const std::optional<Model> refitted = estimator_.refit(model, inliers_);
      if (!refitted)
      {
        break;
      }
      model = *refitted;
      ++statistics().models;
      const double cost = score(model);
      if (keepIfBetter(model, cost))
      {
        ++statistics().local_optimizations;
        improved = true;
      }
      if (width == 1.0 && !(cost < (1.0 - WORTHWHILE) * last_cost))
      {
        break;
      }
      last_cost = cost;
      width = std::max(width - NARROWING, 1.0);
    }
    return improved;
  }

  bool keepIfBetter(const Model& model, double cost)
  {
    if (result_.model && !(cost < result_.cost))
    {
      return false;
    }
    result_.model = model;
    result_.cost = cost;
    return true;
  }

  /** MSAC cost. NaN counts as an outlier. */
  double score(const Model& model) const
  {
    double cost = 0.0;
    for (std::size_t i = 0; i < estimator_.size(); ++i)
    {
      const double error = estimator_.error(model, i);
      cost += error < squared_threshold_ ? error : squared_threshold_;
    }
    return cost;
  }

  /** As score(), but infinite as soon as the model is seen not to beat the best sample. */
  double testAndScore(const Model& model) const
  {
    double cost = 0.0;
    double evidence = 0.0;
    for (const int i : order_)
    {
      const double error = estimator_.error(model, static_cast<std::size_t>(i));
      const bool inlier = error < squared_threshold_;
      cost += inlier ? error : squared_threshold_;
      test_.add(inlier, evidence);
      if (!(cost < sample_cost_) || SequentialTest::fails(evidence))
      {
        return std::numeric_limits<double>::infinity();
      }
    }
    return cost;
  }

  void findInliers(const Model& model, double squared_threshold, std::vector<int>& inliers) const
  {
    inliers.clear();
    for (std::size_t i = 0; i < estimator_.size(); ++i)
    {
      if (estimator_.error(model, i) <= squared_threshold)
      {
        inliers.push_back(static_cast<int>(i));
      }
    }
  }

  const Estimator& estimator_;
  const RansacParams& params_;
  Rng& rng_;
  const double squared_threshold_;
  RansacResult<Model> result_;
  std::vector<int> order_;  ///< in which data are scored
  SequentialTest test_;
  std::vector<int> best_sample_;
  double sample_cost_ = std::numeric_limits<double>::infinity();  ///< of the best sample, before local optimisation
  std::vector<Model> models_;                                     ///< of one sample
  std::vector<int> inliers_;                                      ///< scratch
};

}  // namespace detail

template <typename Estimator>
RansacResult<typename Estimator::Model> ransac(const Estimator& estimator, const RansacParams& params, Rng& rng)
{
  return detail::RansacLoop<Estimator>(estimator, params, rng).run();
}

}  // namespace view_servo
