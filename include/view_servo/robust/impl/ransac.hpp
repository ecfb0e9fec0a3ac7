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

/** Samples needed for one free of outliers with the given confidence (thesis eq. 9.5); possibly infinite. */
double requiredSamples(double inlier_ratio, int sample_size, double confidence);

/**
 * Truncated squared errors of all data (MSAC, Torr & Zisserman 2000), in random order so that most models fail early.
 */
template <typename Estimator>
class MsacConsensus : public Consensus<typename Estimator::Model>
{
public:
  using Model = typename Estimator::Model;

  MsacConsensus(const Estimator& estimator, double threshold, Rng& rng)
    : estimator_(estimator), squared_threshold_(threshold * threshold), order_(randomOrder(rng, estimator.size()))
  {
  }

  /** NaN counts as an outlier. Without a limit, exact. */
  double cost(const Model& model, double limit) override
  {
    const bool limited = std::isfinite(limit);
    double cost = 0.0;
    double evidence = 0.0;
    for (const int i : order_)
    {
      const double error = estimator_.error(model, static_cast<std::size_t>(i));
      const bool inlier = error < squared_threshold_;
      cost += inlier ? error : squared_threshold_;
      test_.add(inlier, evidence);
      if (limited && (!(cost < limit) || SequentialTest::fails(evidence)))
      {
        return std::numeric_limits<double>::infinity();
      }
    }
    return cost;
  }

  void findInliers(const Model& model, double width, std::vector<int>& inliers) override
  {
    inliers.clear();
    for (std::size_t i = 0; i < estimator_.size(); ++i)
    {
      if (estimator_.error(model, i) <= width * width * squared_threshold_)
      {
        inliers.push_back(static_cast<int>(i));
      }
    }
  }

  void setBest(const std::vector<int>& inliers) override
  {
    test_.setBest(static_cast<double>(inliers.size()) / static_cast<double>(estimator_.size()));
  }

  double costOfNone() const override
  {
    return static_cast<double>(estimator_.size()) * squared_threshold_;
  }

private:
  const Estimator& estimator_;
  const double squared_threshold_;
  const std::vector<int> order_;
  SequentialTest test_;
};

/** The state of one call of ransac(). */
template <typename Estimator>
class RansacLoop
{
public:
  using Model = typename Estimator::Model;

  RansacLoop(const Estimator& estimator, Sampler& sampler, Consensus<Model>& consensus, const RansacParams& params,
             Rng& rng)
    : estimator_(estimator), sampler_(sampler), consensus_(consensus), params_(params), rng_(rng)
  {
  }

  RansacResult<Model> run()
  {
    const auto start = std::chrono::steady_clock::now();
    if (estimator_.size() >= SIZE)
    {
      statistics().stop = drawSamples();
      if (statistics().iterations < FIRST_OPTIMIZED && to_optimize_)
      {
        optimizeLocally(*to_optimize_);
      }
      if (params_.improvement_stage && result_.model)
      {
        replaceSampleData();
      }
    }
    if (result_.model)
    {
      consensus_.findInliers(*result_.model, 1.0, result_.inliers);
    }
    else
    {
      result_.cost = consensus_.costOfNone();
    }
    statistics().elapsed_ms =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    return std::move(result_);
  }

private:
  static constexpr std::size_t SIZE = Estimator::SAMPLE_SIZE;
  static constexpr int FIRST_OPTIMIZED =
      50;  ///< after this many samples the best is; before, nearly each is the best so far

  RansacStatistics& statistics()
  {
    return result_.statistics;
  }

  RansacStop drawSamples()
  {
    std::vector<int> sample;
    double required = std::numeric_limits<double>::infinity();
    while (statistics().iterations < params_.max_iterations)
    {
      if (statistics().iterations >= params_.min_iterations && statistics().iterations >= required)
      {
        return RansacStop::CONFIDENCE_REACHED;
      }
      if (!sampler_.draw(rng_, sample))
      {
        return RansacStop::TOO_FEW_DATA;
      }
      if (!estimator_.accepts(sample))
      {
        if (++statistics().rejected_samples > params_.max_rejected)
        {
          return RansacStop::REJECTION_LIMIT;
        }
        continue;
      }
      ++statistics().iterations;
      bool improved = trySample(sample);
      if (statistics().iterations == FIRST_OPTIMIZED && to_optimize_)
      {
        improved = optimizeLocally(*to_optimize_) || improved;
      }
      if (improved)
      {
        consensus_.findInliers(*result_.model, 1.0, inliers_);
        required = requiredSamples(sampler_.share(inliers_), Estimator::SAMPLE_SIZE, params_.confidence);
      }
    }
    return statistics().iterations >= required ? RansacStop::CONFIDENCE_REACHED : RansacStop::ITERATION_LIMIT;
  }

  /** Thesis 9.4: each position of the best sample in turn takes other data; improvements are kept at once. */
  void replaceSampleData()
  {
    std::vector<int> sample;
    for (std::size_t position = 0; position < SIZE; ++position)
    {
      for (int trial = 0; trial < sampler_.replacements(); ++trial)
      {
        sample = best_sample_;
        if (!sampler_.replace(rng_, trial, position, sample))
        {
          continue;
        }
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

  /**
   * Solves and scores a sample; optimises it locally when it is the best so far, unless it is one of the first, of
   * which only the best is. Whether the result improved.
   */
  bool trySample(const std::vector<int>& sample)
  {
    models_.clear();
    estimator_.solve(sample, models_);
    const Model* best = nullptr;
    for (const Model& model : models_)
    {
      ++statistics().models;
      const double cost = consensus_.cost(model, sample_cost_);
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
    consensus_.findInliers(*best, 1.0, inliers_);
    consensus_.setBest(inliers_);
    const bool improved = keepIfBetter(*best, sample_cost_);
    if (statistics().iterations < FIRST_OPTIMIZED)
    {
      to_optimize_ = *best;
      return improved;
    }
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
      consensus_.findInliers(model, width, inliers_);
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
      const double cost = consensus_.cost(model, std::numeric_limits<double>::infinity());
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

  const Estimator& estimator_;
  Sampler& sampler_;
  Consensus<Model>& consensus_;
  const RansacParams& params_;
  Rng& rng_;
  RansacResult<Model> result_;
  std::vector<int> best_sample_;
  std::optional<Model> to_optimize_;                              ///< the best of the first samples
  double sample_cost_ = std::numeric_limits<double>::infinity();  ///< of the best sample, before local optimisation
  std::vector<Model> models_;                                     ///< of one sample
  std::vector<int> inliers_;                                      ///< scratch
};

}  // namespace detail

template <typename Estimator>
RansacResult<typename Estimator::Model> ransac(const Estimator& estimator, const RansacParams& params, Rng& rng)
{
  detail::MsacConsensus<Estimator> consensus(estimator, params.inlier_threshold, rng);
  // Half of the samples allowed for the growth: an order that misleads leaves the other half to uniform sampling.
  ListSampler sampler(params.sampling, estimator.size(), Estimator::SAMPLE_SIZE, 0.5 * params.max_iterations);
  return ransac(estimator, sampler, consensus, params, rng);
}

template <typename Estimator>
RansacResult<typename Estimator::Model> ransac(const Estimator& estimator, Sampler& sampler,
                                               Consensus<typename Estimator::Model>& consensus,
                                               const RansacParams& params, Rng& rng)
{
  return detail::RansacLoop<Estimator>(estimator, sampler, consensus, params, rng).run();
}

}  // namespace view_servo
