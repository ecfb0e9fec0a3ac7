// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/heading_vote.h"

#include "view_servo/geometry/planar_motion.h"
#include "view_servo/parameters/faults.h"

#include <algorithm>
#include <cmath>

namespace view_servo
{
namespace
{
/** Convolved with a Gaussian; sd in bins. */
std::vector<double> smoothed(const std::vector<double>& votes, double sd)
{
  const int reach = static_cast<int>(std::ceil(3.0 * sd));
  std::vector<double> kernel;
  double sum = 0.0;
  for (int i = -reach; i <= reach; ++i)
  {
    kernel.push_back(reach > 0 ? std::exp(-0.5 * i * i / (sd * sd)) : 1.0);
    sum += kernel.back();
  }
  const int count = static_cast<int>(votes.size());
  std::vector<double> result(votes.size(), 0.0);
  for (int i = 0; i < count; ++i)
  {
    for (int k = std::max(0, i - reach); k <= std::min(count - 1, i + reach); ++k)
    {
      result[static_cast<std::size_t>(i)] += kernel.begin()[k - i + reach] / sum * votes[static_cast<std::size_t>(k)];
    }
  }
  return result;
}

}  // namespace

std::vector<Parameter> parameters(HeadingVoteParams& params)
{
  return {
    integer("heading_bins", params.bins, "", ">= 3", "bins of the histogram of headings"),
    real("heading_margin", params.margin, "rad", "[0, pi/2)", "headings nearer to +-pi/2 are not taken"),
    real("heading_smoothing", params.smoothing, "rad", "[0, pi/2)", "standard deviation that votes are spread by"),
    real("roi_narrowing", params.narrowing, "", "(0, 1]",
         "factor of the region of interest when the highest peak is inside"),
    real("roi_widening", params.widening, "", ">= 1", "factor of the region of interest when it is not"),
    real("roi_min_half_width", params.min_half_width, "rad", "(0, pi/2)", "least half width of the region of interest"),
  };
}

std::vector<std::string> HeadingVoteParams::validate() const
{
  std::vector<std::string> faults = faultsOf(*this);
  if (min_half_width > M_PI_2 - margin)
  {
    faults.emplace_back("roi_min_half_width must leave room for heading_margin");
  }
  return faults;
}

HeadingHistogram::HeadingHistogram(const HeadingEvidence& evidence, double yaw, const HeadingVoteParams& params)
  : votes_(static_cast<std::size_t>(params.bins), 0.0)
{
  constexpr double MIN_RISE = 1e-4;  // of a line that says where it meets the horizon; a twentieth of a pixel or so
  const Eigen::Matrix3d to_reference = levelRotation(yaw).transpose();
  const double bin_width = M_PI / (params.bins - 1);
  for (std::size_t i = 0; i < evidence.pairs.size(); ++i)
  {
    const Eigen::Vector2d& reference = evidence.pairs[i].reference;
    const Eigen::Vector3d ray = to_reference * evidence.pairs[i].current.homogeneous();
    if (!(ray.z() > 0.0))
    {
      continue;
    }
    const Eigen::Vector2d current = ray.hnormalized();
    const double rise = current.y() - reference.y();
    if (!(std::abs(rise) > MIN_RISE))
    {
      continue;
    }
    const double epipole = reference.x() - reference.y() * (current.x() - reference.x()) / rise;
    // The line says where the epipole is, not which way along it: the one of the two headings that is ahead.
    const double heading = std::remainder(yaw - std::atan(epipole), M_PI);
    const double bin = std::round((heading + M_PI_2) / bin_width);
    if (bin >= 0.0 && bin < params.bins)
    {
      votes_[static_cast<std::size_t>(bin)] += evidence.weights[i];
    }
  }
  votes_ = smoothed(votes_, params.smoothing / bin_width);
}

std::vector<double> HeadingHistogram::votesFor(double yaw) const
{
  // As headings ahead and behind are one, the first bin comes after the last, which has the same heading.
  const auto count = static_cast<double>(votes_.size() - 1);
  std::vector<double> result(votes_.size());
  for (std::size_t bin = 0; bin < result.size(); ++bin)
  {
    const double in_camera = std::remainder(heading(bin) - yaw, M_PI);
    result[bin] =
        yaw == 0.0 ? votes_[bin] : votes_[static_cast<std::size_t>(std::round((in_camera + M_PI_2) / M_PI * count))];
  }
  return result;
}

double HeadingHistogram::heading(std::size_t bin) const
{
  return -M_PI_2 + M_PI * static_cast<double>(bin) / static_cast<double>(votes_.size() - 1);
}

std::optional<std::size_t> HeadingHistogram::peak(double min, double max) const
{
  std::optional<std::size_t> best;
  for (std::size_t bin = 0; bin < votes_.size(); ++bin)
  {
    if (heading(bin) >= min && heading(bin) <= max && votes_[bin] > (best ? votes_[*best] : 0.0))
    {
      best = bin;
    }
  }
  return best;
}

HeadingRegion::HeadingRegion(const HeadingVoteParams& params) : params_(params), half_width_(M_PI_2 - params.margin)
{
}

double HeadingRegion::min() const
{
  return std::max(centre_ - half_width_, params_.margin - M_PI_2);
}

double HeadingRegion::max() const
{
  return std::min(centre_ + half_width_, M_PI_2 - params_.margin);
}

std::optional<double> HeadingRegion::choose(const HeadingHistogram& histogram)
{
  const std::optional<std::size_t> inside = histogram.peak(min(), max());
  if (!inside)
  {
    return std::nullopt;
  }
  const std::optional<std::size_t> anywhere = histogram.peak(params_.margin - M_PI_2, M_PI_2 - params_.margin);
  centre_ = histogram.heading(*inside);
  half_width_ *= anywhere == inside ? params_.narrowing : params_.widening;
  half_width_ = std::clamp(half_width_, params_.min_half_width, M_PI_2 - params_.margin);
  return centre_;
}

}  // namespace view_servo
