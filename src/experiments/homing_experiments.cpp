// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "homing_experiments.h"

#include "input_file.h"
#include "tools/package_folder.h"
#include "parallel.h"
#include "trials/homing_trial.h"
#include "sim/world_reader.h"
#include "view_servo/control/heading_hypotheses.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/robust/random.h"
#include "view_servo/images/image_io.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/point_view_matcher.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
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

constexpr double DEGREES = 180.0 / M_PI;

/** One run of homing. */
struct Run
{
  std::string world;
  HomingMode mode;
  bool hard;
  int index;
  PlanarPose start;
};

sim::HomingTrialParams paramsOf(const Run& run)
{
  sim::HomingTrialParams params;
  params.seed = static_cast<std::uint64_t>(run.index) + 1;
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

std::string toRow(const Run& run, const sim::HomingOutcome& outcome)
{
  std::string reason = outcome.reason;
  std::replace(reason.begin(), reason.end(), ',', ';');
  std::ostringstream row;
  row << run.world << ',' << (run.mode == HomingMode::THESIS ? "thesis" : "servo") << ','
      << (run.hard ? "hard" : "plain") << ',' << run.index << ',' << run.start.x << ',' << run.start.y << ','
      << run.start.yaw * DEGREES << ',' << (outcome.arrived ? 1 : 0) << ',' << 1e3 * outcome.distance_error << ','
      << 1e3 * outcome.ahead_error << ',' << 1e3 * outcome.side_error << ',' << outcome.yaw_error * DEGREES << ','
      << outcome.duration << ',' << outcome.travelled << ',' << reason << '\n';
  return row.str();
}

std::vector<Run> allRuns(const std::map<std::string, sim::World>& worlds, bool brief)
{
  constexpr std::uint64_t SEED = 5;
  const int starts = brief ? 3 : 100;
  std::vector<Run> runs;
  for (const char* name : { "desk", "cabinet" })
  {
    const PlanarPose start = brief ? PlanarPose{ -0.1, 0.05, 0.0 } : toPlanar(worlds.at(name).start("thesis"));
    runs.push_back({ name, HomingMode::THESIS, false, 0, start });
    runs.push_back({ name, HomingMode::SERVO, false, 0, start });
  }
  Rng rng(SEED);
  const std::array<const char*, 3> names = { "desk", "cabinet", "corridor" };
  for (int i = 0; i < starts; ++i)
  {
    const std::string name = names[static_cast<std::size_t>(i) % names.size()];
    const PlanarPose start = sim::randomStart(worlds.at(name), rng);
    for (const bool hard : { false, true })
    {
      runs.push_back({ name, HomingMode::SERVO, hard, i + 1, start });
    }
  }
  return runs;
}

}  // namespace

void runHomingExperiment(const ExperimentContext& context, std::ostream& csv)
{
  constexpr double NEAR_ENOUGH = 0.02;            // [m]
  constexpr double STRAIGHT_ENOUGH = M_PI / 180;  // [rad]
  std::map<std::string, sim::World> worlds;
  for (const char* name : { "desk", "cabinet", "corridor" })
  {
    worlds.emplace(name, sim::findWorld(name, packageFolder() / "config" / "worlds"));
  }
  const std::vector<Run> runs = allRuns(worlds, context.brief);
  std::vector<std::string> rows(runs.size());
  std::map<std::string, std::pair<int, int>> counts;  // of conditions: near enough, all
  std::mutex mutex;
  std::size_t done = 0;
  inParallel(runs.size(), context.threads, [&](std::size_t i) {
    sim::HomingTrials trials(worlds.at(runs[i].world), paramsOf(runs[i]));
    const sim::HomingOutcome outcome = trials.run(runs[i].start);
    const std::lock_guard<std::mutex> lock(mutex);
    rows[i] = toRow(runs[i], outcome);
    std::cerr << ++done << " of " << runs.size() << ": " << rows[i] << std::flush;
    if (runs[i].index > 0)
    {
      auto& [good, all] = counts[runs[i].hard ? "hard" : "plain"];
      good +=
          outcome.arrived && outcome.distance_error <= NEAR_ENOUGH && std::abs(outcome.yaw_error) <= STRAIGHT_ENOUGH;
      ++all;
    }
  });
  csv << "world,mode,conditions,index,start_x,start_y,start_yaw_deg,arrived,distance_error_mm,ahead_mm,side_mm,"
         "yaw_error_deg,duration_s,travelled_m,reason\n";
  for (const std::string& row : rows)
  {
    csv << row;
  }
  for (const auto& [conditions, count] : counts)
  {
    std::cout << conditions << ": " << count.first << " of " << count.second
              << " random starts end within 2 cm and 1 degree" << std::endl;
  }
}

namespace
{
/** What hololens_indoor holds. */
struct IndoorWalk
{
  Camera camera;
  std::map<std::string, Eigen::Isometry3d> poses;  ///< world from camera
  struct Pair
  {
    std::string reference;
    std::string current;
    double baseline;  ///< [m]
    double rotation;  ///< [degrees]
    double overlap;
  };
  std::vector<Pair> pairs;  ///< each in both directions
};

IndoorWalk readIndoorWalk(const fs::path& folder)
{
  IndoorWalk walk;
  std::ifstream k = openForReading(folder / "K.txt");
  for (int i = 0; i < 9; ++i)
  {
    k >> walk.camera.k(i / 3, i % 3);
  }
  std::string line;
  std::ifstream poses = openForReading(folder / "poses.txt");
  while (std::getline(poses, line))
  {
    std::istringstream words(line);
    std::string name;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    words >> name;
    for (int i = 0; i < 16; ++i)
    {
      words >> pose.matrix()(i / 4, i % 4);
    }
    if (words && name.front() != '#')
    {
      walk.poses[name] = pose;
    }
  }
  std::ifstream pairs = openForReading(folder / "pairs_wide_baseline.txt");
  while (std::getline(pairs, line))
  {
    std::istringstream words(line);
    IndoorWalk::Pair pair;
    if (words >> pair.reference >> pair.current >> pair.baseline >> pair.rotation >> pair.overlap)
    {
      walk.pairs.push_back(pair);
      std::swap(pair.reference, pair.current);
      walk.pairs.push_back(pair);
    }
  }
  return walk;
}

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
  IndoorWalk walk = readIndoorWalk(folder);
  if (context.brief)
  {
    walk.pairs.resize(std::min<std::size_t>(walk.pairs.size(), 6));
  }
  const PointViewMatcher points{ PointViewMatcherParams() };
  const LineViewMatcher lines{ LineMatcherParams() };
  FeatureParams features;
  features.points = points.params().points;
  features.segments = lines.params().segments;
  features.lines = lines.params().features;
  HeadingHypothesesParams params;
  params.motion = CameraMotion::FREE;

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
