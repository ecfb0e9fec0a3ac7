// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/clock_offset.h"

#include "view_servo/geometry/planar_pose.h"
#include "view_servo/robust/quantile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <numeric>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double KEPT = 15.0;  // [s]
constexpr double STEP = 0.02;  // of the search [s]

/** Adds an angle, unwrapped, unless its stamp is not later than the last one; drops what is older than `kept` [s]. */
template <typename Samples>
void append(Samples& samples, double stamp, double yaw, double kept)
{
  if (!samples.empty())
  {
    if (stamp <= samples.back().stamp)
    {
      return;
    }
    yaw = samples.back().yaw + wrapAngle(yaw - samples.back().yaw);
  }
  samples.push_back({ stamp, yaw });
  while (samples.front().stamp < stamp - kept)
  {
    samples.pop_front();
  }
}

/**
 * Mean turn of the view that no turn of the base explains. @param turn_error by which part odometry may turn too much
 * or too little.
 */
double unexplained(const std::vector<double>& views, const std::vector<double>& bases, double turn_error)
{
  const auto count = static_cast<double>(views.size());
  const double mean_view = std::accumulate(views.begin(), views.end(), 0.0) / count;
  const double mean_base = std::accumulate(bases.begin(), bases.end(), 0.0) / count;
  double product = 0.0;
  double square = 0.0;
  for (std::size_t i = 0; i < views.size(); ++i)
  {
    product += (views[i] - mean_view) * (bases[i] - mean_base);
    square += (bases[i] - mean_base) * (bases[i] - mean_base);
  }
  const double scale = square > 0.0 ? std::clamp(-product / square, 1.0 - turn_error, 1.0 + turn_error) : 1.0;
  std::vector<double> angles(views.size());
  std::transform(views.begin(), views.end(), bases.begin(), angles.begin(),
                 [&](double view, double base) { return view + scale * base; });
  const double middle = medianOf(angles);
  return std::accumulate(angles.begin(), angles.end(), 0.0,
                         [&](double sum, double angle) { return sum + std::abs(angle - middle); }) /
         count;
}

}  // namespace

void ClockOffset::addOdometry(double stamp, double yaw)
{
  append(odometry_, stamp, yaw, KEPT + 2.0 * LARGEST);
}

void ClockOffset::addImage(double stamp, double view_yaw)
{
  append(images_, stamp, view_yaw, KEPT);
}

double ClockOffset::odometryAt(double stamp) const
{
  const auto after = std::lower_bound(odometry_.begin() + 1, odometry_.end() - 1, stamp,
                                      [](const Sample& sample, double time) { return sample.stamp < time; });
  const Sample& a = *(after - 1);
  const Sample& b = *after;
  return a.yaw + (b.yaw - a.yaw) * (stamp - a.stamp) / (b.stamp - a.stamp);
}

std::optional<double> ClockOffset::estimate() const
{
  constexpr double SKIDDING = 0.2;
  constexpr double CLEARLY_BETTER = 0.6;
  // Where a turn only dies away, as a control makes it, an error of odometry and one of time look nearly the same:
  // odometry's turns are taken for right unless they explain the view's much worse.
  const Fit right = fit(0.0);
  const Fit wrong = fit(SKIDDING);
  return wrong.unexplained < CLEARLY_BETTER * right.unexplained ? wrong.offset : right.offset;
}

ClockOffset::Fit ClockOffset::fit(double turn_error) const
{
  constexpr double CLEAR = 0.0006;       // what a wrong offset has to leave unexplained [rad]
  constexpr double CLEARLY_WORSE = 4.0;  // than the best one
  constexpr int NEIGHBOUR = 5;           // steps to a wrong offset: 0.1 s
  if (odometry_.size() < 2)
  {
    return {};
  }
  std::vector<Sample> images;
  std::copy_if(images_.begin(), images_.end(), std::back_inserter(images), [this](const Sample& image) {
    return image.stamp - LARGEST >= odometry_.front().stamp && image.stamp + LARGEST <= odometry_.back().stamp;
  });
  if (images.size() < FEWEST_IMAGES)
  {
    return {};
  }
  const int steps = static_cast<int>(std::lround(LARGEST / STEP));
  std::vector<double> costs;
  std::vector<double> views(images.size());
  std::vector<double> bases(images.size());
  std::transform(images.begin(), images.end(), views.begin(), [](const Sample& image) { return image.yaw; });
  for (int i = -steps; i <= steps; ++i)
  {
    std::transform(images.begin(), images.end(), bases.begin(),
                   [&](const Sample& image) { return odometryAt(image.stamp + i * STEP); });
    costs.push_back(unexplained(views, bases, turn_error));
  }
  const auto best = static_cast<int>(std::min_element(costs.begin(), costs.end()) - costs.begin());
  const auto cost = [&](int step) {
    return costs[static_cast<std::size_t>(step)];
  };
  if (best < NEIGHBOUR || best + NEIGHBOUR >= static_cast<int>(costs.size()))
  {
    return { cost(best), std::nullopt };
  }
  const double wrong = std::min(cost(best - NEIGHBOUR), cost(best + NEIGHBOUR));
  if (wrong < CLEAR || wrong < CLEARLY_WORSE * cost(best))
  {
    return { cost(best), std::nullopt };
  }
  // The cost is like |x| beyond its noise: lines through both flanks meet at the offset.
  const double left = cost(best - NEIGHBOUR) - cost(best - 1);
  const double right = cost(best + NEIGHBOUR) - cost(best + 1);
  double refined = 0.0;
  if (left > 0.0 && right > 0.0)
  {
    const double left_slope = left / (NEIGHBOUR - 1);
    const double right_slope = right / (NEIGHBOUR - 1);
    // cost(best - 1) - left_slope (x + 1) = cost(best + 1) + right_slope (x - 1)
    refined = (cost(best - 1) - cost(best + 1) - left_slope + right_slope) / (left_slope + right_slope);
    refined = std::clamp(refined, -1.0, 1.0);
  }
  return { cost(best), (best - steps + refined) * STEP };
}

}  // namespace view_servo
