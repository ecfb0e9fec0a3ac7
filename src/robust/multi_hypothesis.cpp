// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/robust/multi_hypothesis.h"

#include "view_servo/matching/assignment.h"
#include "view_servo/parameters/faults.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double NONE = std::numeric_limits<double>::infinity();  // error of an entry that does not agree

/** Sampson distances of entries, with the lines of all points computed once a model. */
class EpipolarFit
{
public:
  using Estimator = FundamentalEstimator;

  EpipolarFit(const Points& reference, const Points& current) : reference_(reference), lines_(reference.size())
  {
    for (const Eigen::Vector2d& point : current)
    {
      columns_.push_back({ point.x(), point.y(), 0.0 });
    }
  }

  void setModel(const Eigen::Matrix3d& f)
  {
    for (std::size_t i = 0; i < reference_.size(); ++i)
    {
      const double u = reference_[i].x();
      const double v = reference_[i].y();
      const double line_u = f(0, 0) * u + f(0, 1) * v + f(0, 2);
      const double line_v = f(1, 0) * u + f(1, 1) * v + f(1, 2);
      lines_[i] = { line_u, line_v, f(2, 0) * u + f(2, 1) * v + f(2, 2), line_u * line_u + line_v * line_v };
    }
    for (Column& column : columns_)
    {
      const double u = f(0, 0) * column.u + f(1, 0) * column.v + f(2, 0);
      const double v = f(0, 1) * column.u + f(1, 1) * column.v + f(2, 1);
      column.slope = u * u + v * v;
    }
  }

  /** The distance; infinite when it is not under the threshold. */
  double error(std::size_t row, std::size_t column, double squared_threshold) const
  {
    // The inner loop: it divides only for the few that agree.
    const Line& line = lines_[row];
    const Column& point = columns_[column];
    const double algebraic = line.u * point.u + line.v * point.v + line.w;
    const double slope = line.slope + point.slope;
    return algebraic * algebraic < squared_threshold * slope ? std::abs(algebraic) / std::sqrt(slope) : NONE;
  }

private:
  struct Line
  {
    double u, v, w;
    double slope;  // squared
  };
  struct Column
  {
    double u, v;
    double slope;  // squared, of its line in the reference
  };

  const Points& reference_;
  std::vector<Line> lines_;
  std::vector<Column> columns_;
};

/** RMS transfer errors of entries, with all points transferred once a model. */
class TransferFit
{
public:
  using Estimator = HomographyEstimator;

  TransferFit(const Points& reference, const Points& current)
    : reference_(reference), current_(current), forth_(reference.size()), back_(current.size())
  {
  }

  void setModel(const HomographyEstimator::Model& model)
  {
    transfer(model.h, reference_, forth_);
    transfer(model.h_inverse, current_, back_);
  }

  double error(std::size_t row, std::size_t column, double squared_threshold) const
  {
    const double squared =
        0.5 * ((forth_[row] - current_[column]).squaredNorm() + (back_[column] - reference_[row]).squaredNorm());
    return squared < squared_threshold ? std::sqrt(squared) : NONE;
  }

private:
  /** Points at infinity and beyond get positions that agree with nothing. */
  static void transfer(const Eigen::Matrix3d& h, const Points& from, Points& to)
  {
    for (std::size_t i = 0; i < from.size(); ++i)
    {
      const double w = h(2, 0) * from[i].x() + h(2, 1) * from[i].y() + h(2, 2);
      to[i] = Eigen::Vector2d(h(0, 0) * from[i].x() + h(0, 1) * from[i].y() + h(0, 2),
                              h(1, 0) * from[i].x() + h(1, 1) * from[i].y() + h(1, 2)) /
              (w > 0.0 ? w : std::numeric_limits<double>::quiet_NaN());
    }
  }

  const Points& reference_;
  const Points& current_;
  Points forth_;
  Points back_;
};

/** The index of the entry at the place of a match, which there must be. */
int entryOf(const AssociationMatrix& association, const Association& match)
{
  std::size_t entry = association.rowBegin(match.row);
  while (association.entries()[entry].column != match.column)
  {
    ++entry;
  }
  return static_cast<int>(entry);
}

/**
 * Support of a model by the maximum-weight matching of the entries that agree with it (Algorithm 2, steps 5 to 8). The
 * cost is the number of points that stay without a match, less a fraction that tells equal numbers apart by weight.
 */
template <typename Fit>
class MatchingConsensus : public Consensus<typename Fit::Estimator::Model>
{
public:
  using Model = typename Fit::Estimator::Model;

  MatchingConsensus(const AssociationMatrix& association, Fit fit, double threshold, double association_weight)
    : association_(association), fit_(std::move(fit)), threshold_(threshold)
  {
    double largest = 0.0;
    for (const Association& entry : association.entries())
    {
      largest = std::max(largest, entry.weight);
    }
    weight_per_association_ = largest > 0.0 ? association_weight / largest : 0.0;
    largest_sum_ = (threshold + association_weight) * std::max(1, std::min(association.rows(), association.columns()));
  }

  double cost(const Model& model, double limit) override
  {
    const double least = costOfNone() - limit;  // support to be exceeded
    if (!findAgreeing(model, threshold_, least) || bound() <= least)
    {
      return std::numeric_limits<double>::infinity();
    }
    double sum = 0.0;
    const std::vector<Association> matches = match();
    for (const Association& match : matches)
    {
      sum += match.weight;
    }
    return costOfNone() - support(matches.size(), sum);
  }

  void findInliers(const Model& model, double width, std::vector<int>& inliers) override
  {
    findAgreeing(model, width * threshold_, -1.0);
    inliers.clear();
    for (const Association& match : match())
    {
      inliers.push_back(entryOf(association_, match));
    }
    std::sort(inliers.begin(), inliers.end());
  }

  double costOfNone() const override
  {
    return static_cast<double>(association_.rows()) + 1.0;
  }

private:
  double support(std::size_t count, double sum) const
  {
    constexpr double LARGEST_FRACTION = 0.999;
    return static_cast<double>(count) + LARGEST_FRACTION * sum / largest_sum_;
  }

  /** D of eq. 9.1, with the association's weight; false, and incomplete, when support can't exceed `least`. */
  bool findAgreeing(const Model& model, double threshold, double least)
  {
    fit_.setModel(model);
    agreeing_.clear();
    rows_ = 0;
    sum_of_rows_ = 0.0;
    const double squared = threshold * threshold;
    for (int row = 0; row < association_.rows(); ++row)
    {
      double best = 0.0;
      for (std::size_t e = association_.rowBegin(row); e < association_.rowBegin(row + 1); ++e)
      {
        const Association& entry = association_.entries()[e];
        const double error = fit_.error(static_cast<std::size_t>(row), static_cast<std::size_t>(entry.column), squared);
        if (error < threshold)
        {
          const double weight = threshold - error + weight_per_association_ * entry.weight;
          agreeing_.push_back({ row, entry.column, weight });
          best = std::max(best, weight);
        }
      }
      rows_ += best > 0.0 ? 1 : 0;
      sum_of_rows_ += best;
      if (rows_ + association_.rows() - row <= least)
      {
        return false;
      }
    }
    return true;
  }

  /** What the support of the entries that agree is at most: each row, and each column, can have one. */
  double bound()
  {
    column_used_.assign(static_cast<std::size_t>(association_.columns()), 0);
    int columns = 0;
    for (const Association& entry : agreeing_)
    {
      char& used = column_used_[static_cast<std::size_t>(entry.column)];
      columns += used == 0 ? 1 : 0;
      used = 1;
    }
    return support(static_cast<std::size_t>(std::min(rows_, columns)), sum_of_rows_);
  }

  std::vector<Association> match() const
  {
    return maximumWeightMatching(AssociationMatrix(association_.rows(), association_.columns(), agreeing_));
  }

  const AssociationMatrix& association_;
  Fit fit_;
  const double threshold_;
  double weight_per_association_;
  double largest_sum_;  ///< of the weights of any matching
  // Of the model looked at last:
  std::vector<Association> agreeing_;
  int rows_ = 0;              ///< with entries that agree
  double sum_of_rows_ = 0.0;  ///< of their largest weights
  std::vector<char> column_used_;
};

/** The entries' indices of one-to-one candidates, best first. */
std::vector<int> candidateEntries(const AssociationMatrix& association)
{
  std::vector<int> result;
  for (const Association& match : maximumWeightMatching(association))
  {
    result.push_back(entryOf(association, match));
  }
  return result;
}

template <typename Fit, typename MakeEstimator>
MultiHypothesisResult<typename Fit::Estimator::Model> estimate(const AssociationMatrix& all, const Points& reference,
                                                               const Points& current, const RansacParams& ransac_params,
                                                               const MultiHypothesisParams& params, Rng& rng,
                                                               const MakeEstimator& make_estimator)
{
  using Estimator = typename Fit::Estimator;
  if (static_cast<std::size_t>(all.rows()) != reference.size() ||
      static_cast<std::size_t>(all.columns()) != current.size())
  {
    throw std::invalid_argument("the association has another size than the lists of points");
  }
  const AssociationMatrix association = all.strongestOfRows(params.entries_per_row);
  Correspondences pairs;
  pairs.reserve(association.entries().size());
  for (const Association& entry : association.entries())
  {
    pairs.push_back(
        { reference[static_cast<std::size_t>(entry.row)], current[static_cast<std::size_t>(entry.column)] });
  }
  const Estimator estimator = make_estimator(pairs);
  MatchingConsensus<Fit> consensus(association, Fit(reference, current), ransac_params.inlier_threshold,
                                   params.association_weight);
  std::vector<int> candidates = candidateEntries(association);
  MultiHypothesisResult<typename Estimator::Model> result;
  std::unique_ptr<Sampler> sampler;
  if (params.sampling == HypothesisSampling::CANDIDATES)
  {
    sampler = std::make_unique<ListSampler>(ransac_params.sampling, std::move(candidates), Estimator::SAMPLE_SIZE,
                                            0.5 * ransac_params.max_iterations);
  }
  else
  {
    // As many replacements as the improvement stage of RANSAC would try (9.4).
    sampler =
        std::make_unique<ImportanceSampler>(association, Estimator::SAMPLE_SIZE, static_cast<int>(candidates.size()));
  }
  RansacResult<typename Estimator::Model> found = ransac(estimator, *sampler, consensus, ransac_params, rng);
  result.model = found.model;
  result.statistics = found.statistics;
  for (const int entry : found.inliers)
  {
    result.matches.push_back(association.entries()[static_cast<std::size_t>(entry)]);
  }
  return result;
}

}  // namespace

std::vector<Parameter> parameters(MultiHypothesisParams& params)
{
  return {
    integer("hypotheses_per_point", params.entries_per_row, "", ">= 1",
            "strongest associations of a reference point kept for several hypotheses"),
    real("association_weight", params.association_weight, "px", ">= 0",
         "lambda: what the strongest association counts beside the fit"),
  };
}

std::vector<std::string> MultiHypothesisParams::validate() const
{
  return faultsOf(*this);
}

MultiHypothesisResult<FundamentalEstimator::Model> estimateFundamental(const AssociationMatrix& association,
                                                                       const Points& reference, const Points& current,
                                                                       const RansacParams& ransac,
                                                                       const MultiHypothesisParams& params, Rng& rng,
                                                                       double view_consistency_threshold)
{
  return estimate<EpipolarFit>(association, reference, current, ransac, params, rng, [&](const Correspondences& pairs) {
    return FundamentalEstimator(pairs, view_consistency_threshold);
  });
}

MultiHypothesisResult<HomographyEstimator::Model> estimateHomography(const AssociationMatrix& association,
                                                                     const Points& reference, const Points& current,
                                                                     const RansacParams& ransac,
                                                                     const MultiHypothesisParams& params, Rng& rng)
{
  return estimate<TransferFit>(association, reference, current, ransac, params, rng,
                               [](const Correspondences& pairs) { return HomographyEstimator(pairs); });
}

}  // namespace view_servo
