// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/consensus.h"
#include "view_servo/robust/random.h"
#include "view_servo/robust/sampler.h"

#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of the one RANSAC loop. */
struct RansacParams
{
  double inlier_threshold = 3.0;   ///< largest error of an inlier, in the unit of the estimator's data, mostly [px]
  double confidence = 0.999;       ///< probability to be reached that some sample drawn is free of outliers, (0, 1)
  int min_iterations = 100;        ///< samples solved before the adaptive stop (thesis eq. 9.5) may end the search
  int max_iterations = 2000;       ///< random samples solved at most
  int max_rejected = 50000;        ///< samples that Estimator::accepts() may refuse in all; one more ends the search
  int local_optimizations = 10;    ///< refits to the inliers of a new best model (Chum, Matas & Kittler 2003), 0 = off
  bool improvement_stage = false;  ///< thesis 9.4: replace each datum of the best sample by others in turn
  Sampling sampling = Sampling::PROGRESSIVE;  ///< how samples are drawn from the data

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(RansacParams& params);

/** Why a search ended. */
enum class RansacStop
{
  CONFIDENCE_REACHED,  ///< so many samples were drawn that one without outliers is likely enough
  ITERATION_LIMIT,     ///< RansacParams::max_iterations samples were solved
  REJECTION_LIMIT,     ///< more than RansacParams::max_rejected samples were refused
  TOO_FEW_DATA         ///< no sample can be drawn from so few
};

struct RansacStatistics
{
  int iterations = 0;                          ///< random samples solved (those of the improvement stage come on top)
  int rejected_samples = 0;                    ///< samples refused by the estimator before solving
  int models = 0;                              ///< models scored
  int local_optimizations = 0;                 ///< refits that improved the best model
  RansacStop stop = RansacStop::TOO_FEW_DATA;  ///< why the search ended
  double elapsed_ms = 0.0;                     ///< time of the whole search [ms]
};

template <typename Model>
struct RansacResult
{
  std::optional<Model> model;  ///< empty: no sample gave a model
  std::vector<int> inliers;    ///< indices of the data within the threshold, ascending
  /**
   * Cost of the model as the Consensus computes it, the smaller the better; with MSAC the sum over all data of
   * min(error(), inlier_threshold²), in that unit squared. Without a model: Consensus::costOfNone().
   */
  double cost = 0.0;
  RansacStatistics statistics;
};

/**
 * Random sample consensus over an estimator (Fischler & Bolles 1981; thesis ch. 2.6) with truncated quadratic scores
 * (MSAC, Torr & Zisserman 2000), adaptive stop, local optimisation and progressive sampling.
 *
 * An Estimator is a small type with
 *  - `using Model`, `static constexpr int SAMPLE_SIZE`,
 *  - `std::size_t size() const`: number of data,
 *  - `bool accepts(const std::vector<int>& sample) const`: cheap test before solving,
 *  - `void solve(const std::vector<int>& sample, std::vector<Model>& models) const`: appends the minimal solutions,
 *  - `double error(const Model&, std::size_t i) const`: squared error of datum i, in the unit of the data squared,
 *    possibly infinite,
 *  - `std::optional<Model> refit(const Model&, const std::vector<int>& inliers) const`: fit to many.
 *
 * The same generator state and data give the same result on every machine.
 */
template <typename Estimator>
RansacResult<typename Estimator::Model> ransac(const Estimator& estimator, const RansacParams& params, Rng& rng);

/** The same with a given source of samples and a given measure of support; params.sampling is not used. */
template <typename Estimator>
RansacResult<typename Estimator::Model> ransac(const Estimator& estimator, Sampler& sampler,
                                               Consensus<typename Estimator::Model>& consensus,
                                               const RansacParams& params, Rng& rng);

}  // namespace view_servo

#include "view_servo/robust/impl/ransac.hpp"
