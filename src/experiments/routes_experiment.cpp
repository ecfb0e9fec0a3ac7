// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/routes_experiment.h"

#include "experiments/parallel.h"
#include "experiments/shipped_worlds.h"
#include "trials/route_trial.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <map>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
struct RouteRunOrder
{
  std::string world;
  bool hard;
  int index;  ///< of the route
  std::vector<PlanarPose> waypoints;
  PlanarPose start;
  std::uint64_t seed;
};

/**
 * From 1.6 m behind the world's goal to 0.4 m before it, by two bends; all waypoints look about where the goal does.
 */
std::vector<PlanarPose> randomWaypoints(const sim::World& world, Rng& rng)
{
  std::vector<PlanarPose> waypoints;
  for (const double x : { -1.6, -0.9, -0.2, 0.4 })
  {
    waypoints.push_back(
        compose(toPlanar(world.goal), { x, uniform(rng, -0.25, 0.25), uniform(rng, -10.0, 10.0) / DEGREES }));
  }
  return waypoints;
}

std::vector<RouteRunOrder> makeOrders(const Worlds& worlds, const ExperimentContext& context)
{
  std::vector<RouteRunOrder> orders;
  Rng rng(context.seedOf(ROUTES, ROUTES.seed));
  for (int i = 0; i < context.runsOf(ROUTES); ++i)
  {
    const std::string name = i % 2 == 0 ? "desk" : "corridor";
    const std::vector<PlanarPose> waypoints = randomWaypoints(worlds.at(name), rng);
    const PlanarPose start = compose(
        waypoints.front(), { uniform(rng, -0.15, 0.05), uniform(rng, -0.15, 0.15), uniform(rng, -5.0, 5.0) / DEGREES });
    const std::uint64_t seed = context.seedOf(ROUTES, static_cast<std::uint64_t>(i) + 2);
    for (const bool hard : { false, true })
    {
      orders.push_back({ name, hard, i + 1, waypoints, start, seed });
    }
  }
  return orders;
}

sim::RouteTrialParams paramsOf(const RouteRunOrder& order)
{
  sim::RouteTrialParams params;
  params.seed = order.seed;
  if (order.hard)
  {
    params.conditions.image_noise = 5.0;
    params.conditions.odometry_drift = 0.05;
    params.conditions.odometry_turn_scale = 1.05;
    params.conditions.light_gain = 0.7;
  }
  return params;
}

std::string toRow(const RouteRunOrder& order, const sim::RouteOutcome& outcome)
{
  std::string reason = outcome.reason;
  std::replace(reason.begin(), reason.end(), ',', ';');
  std::ostringstream row;
  row << order.world << ',' << (order.hard ? "hard" : "plain") << ',' << order.index << ',' << outcome.views << ','
      << outcome.length << ',' << (outcome.arrived ? 1 : 0) << ',' << outcome.reached << ','
      << 1e3 * outcome.sideways_rms << ',' << 1e3 * outcome.sideways_max << ',' << 1e3 * outcome.distance_error << ','
      << outcome.yaw_error * DEGREES << ',' << outcome.duration << ',' << reason << '\n';
  return row.str();
}

/** What becomes of all routes under the same conditions. */
struct RouteSummary
{
  int arrived = 0;
  std::vector<double> rms;
  std::vector<double> farthest;
  std::vector<double> millimetres;
  std::vector<double> degrees;
  std::vector<double> seconds;

  void add(const sim::RouteOutcome& outcome)
  {
    arrived += outcome.arrived ? 1 : 0;
    if (std::isfinite(outcome.sideways_rms))  // else it has not passed a view
    {
      rms.push_back(1e3 * outcome.sideways_rms);
      farthest.push_back(1e3 * outcome.sideways_max);
    }
    millimetres.push_back(1e3 * outcome.distance_error);
    degrees.push_back(std::abs(outcome.yaw_error) * DEGREES);
    seconds.push_back(outcome.duration);
  }

  void print(std::ostream& stream) const
  {
    stream << arrived << " of " << seconds.size() << " arrive; beside the way: rms median " << medianOf(rms)
           << ", largest " << quantileOf(rms, 1.0) << ", farthest median " << medianOf(farthest) << ", largest "
           << quantileOf(farthest, 1.0) << " mm; at the end: median " << medianOf(millimetres) << ", largest "
           << quantileOf(millimetres, 1.0) << " mm, yaw median " << medianOf(degrees) << ", largest "
           << quantileOf(degrees, 1.0) << " degrees; time: median " << medianOf(seconds) << ", longest "
           << quantileOf(seconds, 1.0) << " s" << std::endl;
  }
};

}  // namespace

void runRoutesExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const Worlds worlds = readShippedWorlds({ "desk", "corridor" });
  const std::vector<RouteRunOrder> orders = makeOrders(worlds, context);
  std::vector<std::string> rows(orders.size());
  std::map<std::string, RouteSummary> summaries;  // of conditions
  std::mutex mutex;
  inParallel(orders.size(), context.threads, [&](std::size_t i) {
    const RouteRunOrder& order = orders[i];
    const sim::RouteOutcome outcome =
        sim::runRoute(worlds.at(order.world), paramsOf(order), order.waypoints, order.start);
    const std::lock_guard<std::mutex> lock(mutex);
    rows[i] = toRow(order, outcome);
    std::cerr << rows[i] << std::flush;
    summaries[order.hard ? "hard" : "plain"].add(outcome);
  });
  csv << "world,conditions,index,views,length_m,arrived,reached,sideways_rms_mm,sideways_max_mm,distance_error_mm,"
         "yaw_error_deg,duration_s,reason\n";
  for (const std::string& row : rows)
  {
    csv << row;
  }
  for (const auto& [conditions, summary] : summaries)
  {
    std::cout << conditions << ": ";
    summary.print(std::cout);
  }
}

}  // namespace view_servo
