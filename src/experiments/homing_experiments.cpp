// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/homing_experiments.h"

#include "experiments/indoor_walk.h"
#include "experiments/parallel.h"
#include "experiments/shipped_worlds.h"
#include "experiments/statistics.h"
#include "trials/homing_trial.h"
#include "view_servo/control/heading_hypotheses.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

/** One run of homing. */
struct HomingRun
{
  std::string world;
  BaseKind base;
  HomingMode mode;
  bool hard;
  int index;  ///< of the start; 0: the thesis' one
  PlanarPose start;
  std::uint64_t seed;
};

sim::HomingTrialParams paramsOf(const HomingRun& run)
{
  sim::HomingTrialParams params;
  params.seed = run.seed;
  params.homing.approach.base = run.base;
  if (run.hard && run.base == BaseKind::DIFFERENTIAL)
  {
    params.conditions.odometry_turn_scale = 1.2;
    params.conditions.deadband_speed = 0.01;
    params.conditions.deadband_turn_rate = 0.04;
  }
  if (run.hard)
  {
    params.conditions.image_noise = 5.0;
    params.conditions.odometry_drift = 0.05;
    params.conditions.light_gain = 0.7;
    params.conditions.focal_length_error = 0.02;
    params.conditions.occluded_from = 3.0;
  }
  if (run.mode == HomingMode::THESIS)
  {
    params.homing.mode = HomingMode::THESIS;
    params.use_points = false;
    params.line_pairs = true;
    params.lines_period = 0.1;
    params.max_duration = 200.0;
  }
  return params;
}

std::string toRow(const HomingRun& run, const sim::HomingOutcome& outcome)
{
  std::string reason = outcome.reason;
  std::replace(reason.begin(), reason.end(), ',', ';');
  std::ostringstream row;
  row << run.world << ',' << (run.mode == HomingMode::THESIS ? "thesis" : "servo") << ','
      << (run.hard ? "hard" : "plain") << ',' << run.index << ',' << run.start.x << ',' << run.start.y << ','
      << run.start.yaw * DEGREES << ',' << (outcome.arrived ? 1 : 0) << ',' << 1e3 * outcome.distance_error << ','
      << 1e3 * outcome.ahead_error << ',' << 1e3 * outcome.side_error << ',' << outcome.yaw_error * DEGREES << ','
      << outcome.duration << ',' << outcome.travelled << ',' << outcome.reversals << ',' << outcome.in_sight << ','
      << reason << '\n';
  return row.str();
}

/** What becomes of all random starts under the same conditions. */
class HomingSummary
{
public:
  /** @param distance from the start to the goal [m]. */
  void add(const sim::HomingOutcome& outcome, double distance)
  {
    constexpr double NEAR_ENOUGH = 0.02;            // [m]
    constexpr double STRAIGHT_ENOUGH = M_PI / 180;  // [rad]
    arrived_ += outcome.arrived ? 1 : 0;
    good_ += outcome.arrived && outcome.distance_error <= NEAR_ENOUGH && std::abs(outcome.yaw_error) <= STRAIGHT_ENOUGH;
    millimetres_.push_back(1e3 * outcome.distance_error);
    degrees_.push_back(std::abs(outcome.yaw_error) * DEGREES);
    seconds_.push_back(outcome.duration);
    reversals_.push_back(outcome.reversals);
    ways_.push_back(outcome.travelled / distance);
    in_sight_.push_back(outcome.in_sight);
  }

  void print(std::ostream& stream) const
  {
    stream << good_ << " of " << millimetres_.size() << " random starts end within 2 cm and 1 degree, " << arrived_
           << " say so; distance: median " << medianOf(millimetres_) << ", 95 % " << quantileOf(millimetres_, 0.95)
           << ", largest " << quantileOf(millimetres_, 1.0) << " mm; yaw: median " << medianOf(degrees_) << ", largest "
           << quantileOf(degrees_, 1.0) << " degrees; time: median " << medianOf(seconds_) << ", 95 % "
           << quantileOf(seconds_, 0.95) << ", longest " << quantileOf(seconds_, 1.0) << " s; reversals: median "
           << medianOf(reversals_) << ", most " << quantileOf(reversals_, 1.0) << "; way: median " << medianOf(ways_)
           << " of the straight one; the view in sight in " << 100.0 * medianOf(in_sight_)
           << " % of the images in the median" << std::endl;
  }

private:
  int arrived_ = 0;
  int good_ = 0;
  std::vector<double> millimetres_;
  std::vector<double> degrees_;
  std::vector<double> seconds_;
  std::vector<double> reversals_;
  std::vector<double> ways_;  // as parts of the straight one
  std::vector<double> in_sight_;
};

constexpr std::array<const char*, 3> HOMING_WORLDS = { "desk", "cabinet", "corridor" };

Worlds readHomingWorlds()
{
  return readShippedWorlds({ HOMING_WORLDS.begin(), HOMING_WORLDS.end() });
}

/** Runs from random starts under both conditions. @param max_yaw by which starts are turned at most [rad]. */
std::vector<HomingRun> randomRuns(const Worlds& worlds, BaseKind base, double max_yaw, const ExperimentContext& context)
{
  std::vector<HomingRun> runs;
  Rng rng(context.seedOf(HOMING_STARTS, HOMING_STARTS.seed));
  for (int i = 0; i < context.runsOf(HOMING_STARTS); ++i)
  {
    const std::string name = HOMING_WORLDS[static_cast<std::size_t>(i) % HOMING_WORLDS.size()];
    const PlanarPose start = sim::randomStart(worlds.at(name), rng, max_yaw);
    const std::uint64_t seed = context.seedOf(HOMING_STARTS, static_cast<std::uint64_t>(i) + 2);
    for (const bool hard : { false, true })
    {
      runs.push_back({ name, base, HomingMode::SERVO, hard, i + 1, start, seed });
    }
  }
  return runs;
}

/** Does all runs, and writes what came of each. */
void home(const std::vector<HomingRun>& runs, const Worlds& worlds, const ExperimentContext& context, std::ostream& csv)
{
  std::vector<std::string> rows(runs.size());
  std::map<std::string, HomingSummary> summaries;  // of conditions
  std::mutex mutex;
  std::size_t done = 0;
  inParallel(runs.size(), context.threads, [&](std::size_t i) {
    const sim::World& world = worlds.at(runs[i].world);
    const sim::HomingOutcome outcome = sim::HomingTrials(world, paramsOf(runs[i])).run(runs[i].start);
    const double distance = compose(inverse(toPlanar(world.goal)), runs[i].start).distance();
    const std::lock_guard<std::mutex> lock(mutex);
    rows[i] = toRow(runs[i], outcome);
    std::cerr << ++done << " of " << runs.size() << ": " << rows[i] << std::flush;
    if (runs[i].index > 0)
    {
      summaries[runs[i].hard ? "hard" : "plain"].add(outcome, distance);
    }
  });
  csv << "world,mode,conditions,index,start_x,start_y,start_yaw_deg,arrived,distance_error_mm,ahead_mm,side_mm,"
         "yaw_error_deg,duration_s,travelled_m,reversals,in_sight,reason\n";
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

}  // namespace

void runHomingExperiment(const ExperimentContext& context, std::ostream& csv)
{
  constexpr double MAX_YAW = M_PI / 18.0;
  const Worlds worlds = readHomingWorlds();
  std::vector<HomingRun> runs;
  for (const char* name : { "desk", "cabinet" })
  {
    const PlanarPose start = context.brief ? PlanarPose{ -0.1, 0.05, 0.0 } : toPlanar(worlds.at(name).start("thesis"));
    for (const HomingMode mode : { HomingMode::THESIS, HomingMode::SERVO })
    {
      runs.push_back({ name, BaseKind::HOLONOMIC, mode, false, 0, start, context.seedOf(HOMING_STARTS, 1) });
    }
  }
  const std::vector<HomingRun> random = randomRuns(worlds, BaseKind::HOLONOMIC, MAX_YAW, context);
  runs.insert(runs.end(), random.begin(), random.end());
  home(runs, worlds, context, csv);
}

void runHomingDifferentialExperiment(const ExperimentContext& context, std::ostream& csv)
{
  constexpr double MAX_YAW = M_PI / 9.0;
  const Worlds worlds = readHomingWorlds();
  home(randomRuns(worlds, BaseKind::DIFFERENTIAL, MAX_YAW, context), worlds, context, csv);
}

namespace
{
Correspondences onUnitPlane(const ViewMatch& match, const Camera& camera)
{
  Correspondences pairs;
  for (const MatchedPoint& point : match.matches)
  {
    pairs.push_back({ camera.normalized(point.position.reference), camera.normalized(point.position.current) });
  }
  return pairs;
}

}  // namespace

void runDirectionsExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const fs::path folder = context.data / "hololens_indoor";
  IndoorWalk walk = readIndoorWalk(context.data);
  if (context.brief)
  {
    walk.pairs.resize(std::min<std::size_t>(walk.pairs.size(), 6));
  }
  PointViewMatcherParams point_params;
  point_params.seed = context.seedOf(DIRECTION_DRAWS, point_params.seed);
  const PointViewMatcher points{ point_params };
  LineMatcherParams line_params;
  line_params.seed = context.seedOf(DIRECTION_DRAWS, line_params.seed);
  const LineViewMatcher lines{ line_params };
  FeatureParams features;
  features.points = points.params().points;
  features.segments = lines.params().segments;
  features.lines = lines.params().features;
  HeadingHypothesesParams params;
  params.motion = CameraMotion::FREE;
  params.seed = context.seedOf(DIRECTION_DRAWS, params.seed);

  std::vector<std::string> rows(walk.pairs.size());
  std::mutex mutex;
  std::size_t done = 0;
  inParallel(walk.pairs.size(), context.threads, [&](std::size_t i) {
    const IndoorWalk::Pair& pair = walk.pairs[i];
    const PreparedImage reference(readGreyImage((folder / "images" / pair.reference).string()), cv::Rect(), features);
    const PreparedImage current(readGreyImage((folder / "images" / pair.current).string()), cv::Rect(), features);
    HeadingHypotheses hypotheses(params, walk.camera.k(0, 0));
    hypotheses.update(onUnitPlane(points.match(reference, current, GeometryModel::HOMOGRAPHY), walk.camera), {});
    if (hypotheses.list().empty())
    {
      // Where there is too little texture.
      hypotheses.update(onUnitPlane(lines.match(reference, current), walk.camera), {});
    }
    const Eigen::Isometry3d truth = walk.poses.at(pair.current).inverse() * walk.poses.at(pair.reference);
    const double true_heading = std::atan2(-truth.translation().x(), truth.translation().z());
    const bool accepted = !hypotheses.list().empty();
    double heading_error = std::numeric_limits<double>::quiet_NaN();
    double rotation_error = heading_error;
    std::size_t inliers = 0;
    if (accepted)
    {
      const HeadingHypothesis& best = hypotheses.list().front();
      heading_error = std::abs(wrapAngle(best.view_in_camera.heading() - true_heading)) * DEGREES;
      rotation_error = Eigen::AngleAxisd(best.motion.rotation * truth.linear().transpose()).angle() * DEGREES;
      inliers = best.support.size();
    }
    std::ostringstream row;
    row << pair.reference << ',' << pair.current << ',' << pair.baseline << ',' << pair.rotation << ',' << pair.overlap
        << ',' << (accepted ? 1 : 0) << ',' << heading_error << ',' << rotation_error << ',' << inliers << '\n';
    const std::lock_guard<std::mutex> lock(mutex);
    rows[i] = row.str();
    std::cerr << ++done << " of " << rows.size() << ": " << rows[i] << std::flush;
  });
  csv << "reference,current,baseline_m,rotation_deg,overlap,accepted,heading_error_deg,rotation_error_deg,inliers\n";
  for (const std::string& row : rows)
  {
    csv << row;
  }
}

}  // namespace view_servo
