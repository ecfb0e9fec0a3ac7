// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/docking_experiment.h"

#include "experiments/parallel.h"
#include "experiments/shipped_worlds.h"
#include "sim/nomad.h"
#include "sim/visibility.h"
#include "trials/homing_trial.h"
#include "trials/trial.h"
#include "view_servo/control/approach_law.h"
#include "view_servo/control/velocity_limiter.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
constexpr double DOCKED = 0.01;  // distance from the goal at which a base counts as there [m]

/** What a tracker of the view knows, without its pictures. */
class Sight
{
public:
  /** @param world must outlive this. */
  Sight(const sim::World& world, std::uint64_t seed) : world_(world), rng_(seed), goal_(toPlanar(world.goal))
  {
    constexpr int STEP = 40;  // [px]
    const Eigen::Isometry3d camera = world.goal * world.camera_on_base;
    const Eigen::Matrix3d inverse = world.camera.k.inverse();
    for (int v = STEP / 2; v < world.camera.height; v += STEP)
    {
      for (int u = STEP / 2; u < world.camera.width; u += STEP)
      {
        const Eigen::Vector3d ray = (inverse * Eigen::Vector3d(u, v, 1.0)).normalized();
        if (const std::optional<double> far = sim::firstHit(world, camera.translation(), camera.linear() * ray))
        {
          points_.emplace_back(world.camera_on_base * Eigen::Vector3d(*far * ray));
        }
      }
    }
  }

  /** The share of the view's points that lie in the image. @param base_in_goal pose of the base. */
  double share(const PlanarPose& base_in_goal) const
  {
    constexpr double NEAREST = 0.1;  // [m]
    const Eigen::Isometry3d camera_from_goal =
        (sim::planarPose(base_in_goal.x, base_in_goal.y, base_in_goal.yaw) * world_.camera_on_base).inverse();
    const auto seen = std::count_if(points_.begin(), points_.end(), [&](const Eigen::Vector3d& point) {
      const Eigen::Vector3d at = camera_from_goal * point;
      const Eigen::Vector2d pixel = (world_.camera.k * at).hnormalized();
      return at.z() > NEAREST && pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= world_.camera.width - 1.0 &&
             pixel.y() <= world_.camera.height - 1.0;
    });
    return static_cast<double>(seen) / static_cast<double>(points_.size());
  }

  /** An image. @param base its true pose in the world. @return the goal in the base; empty when it is not seen. */
  std::optional<PlanarPose> look(const PlanarPose& base)
  {
    const PlanarPose goal_in_base = compose(inverse(base), goal_);
    if (share(inverse(goal_in_base)) < ManoeuvreParams().blind_share)
    {
      return std::nullopt;
    }
    const double distance = goal_in_base.distance();
    const double metres = 0.001 + 0.003 * distance;
    const double radians = 0.0005 + 0.0015 * distance;
    PlanarPose measured = goal_in_base;
    measured.x += metres * gaussian(rng_);
    measured.y += metres * gaussian(rng_);
    measured.yaw = wrapAngle(measured.yaw + radians * gaussian(rng_));
    return measured;
  }

private:
  const sim::World& world_;
  Rng rng_;
  PlanarPose goal_;
  std::vector<Eigen::Vector3d> points_;  // in the base's frame at the goal
};

/** What a law is told, once for each reading of odometry. Poses are in odometry's frame. */
struct Told
{
  double time;         ///< [s]
  PlanarPose base;     ///< newest pose
  PlanarPose goal;     ///< as of the images so far
  bool seen;           ///< this is an image with the goal in it
  double seen_last;    ///< time of the last such image [s]
  ShareInSight share;  ///< of the view, from a pose in the goal's frame
};

/** Brings a base to the goal. */
class Docker
{
public:
  virtual ~Docker() = default;
  /** What to do now. */
  virtual BaseVelocity next(const Told& told) = 0;
  bool arrived() const
  {
    return arrived_;
  }
  /** Why it was given up; empty while it was not. */
  const std::string& failure() const
  {
    return failure_;
  }

protected:
  bool arrived_ = false;
  std::string failure_;
};

/** The law of homing, with homing's bounds for what is driven blindly. */
class TurnAndDrive : public Docker
{
public:
  TurnAndDrive()
  {
    params_.base = BaseKind::DIFFERENTIAL;
    law_ = makeApproachLaw(params_, DOCKED);
  }

  BaseVelocity next(const Told& told) override
  {
    constexpr double SLACK = 1.5;  // plans are kept to within bounds, driving adds to them
    constexpr int IN_A_ROW = 3;    // images that show the base at the goal
    law_->update({ told.base, told.goal, told.seen, told.seen, told.share });
    failure_ = law_->failure();
    const PlanarPose left = compose(inverse(told.base), told.goal);
    if (told.seen)
    {
      const bool there = left.distance() <= law_->tolerance() && std::abs(left.yaw) <= params_.yaw_tolerance;
      there_ = there ? there_ + 1 : 0;
      arrived_ = there_ >= IN_A_ROW;
      seen_from_ = told.base;
    }
    const PlanarPose blind = compose(inverse(seen_from_.value_or(told.base)), told.base);
    if (blind.distance() > SLACK * params_.manoeuvre.max_blind_distance ||
        std::abs(blind.yaw) > SLACK * params_.manoeuvre.max_blind_turn)
    {
      failure_ = "the goal is not seen any more";
    }
    return along(law_->course(), told.base);
  }

private:
  ApproachParams params_;
  std::unique_ptr<ApproachLaw> law_;
  int there_ = 0;
  std::optional<PlanarPose> seen_from_;
};

/** The law of Park and Kuipers, and what is tried when it does not bring the base home. */
class ParkKuipers : public Docker
{
public:
  /** @param turns whether it turns to the goal's yaw in the end; else a base is there when the place is right. */
  explicit ParkKuipers(bool turns) : turns_(turns)
  {
  }

  BaseVelocity next(const Told& told) override
  {
    constexpr double YAW_DOCKED = 0.5 * M_PI / 180.0;  // [rad]
    constexpr double PATIENCE = 3.0;                   // for which the goal may be out of sight in an attempt [s]
    constexpr int MOST_ATTEMPTS = 4;
    constexpr double LONGEST_ATTEMPT = 30.0;         // [s]
    constexpr PlanarPose STAGING{ -0.7, 0.0, 0.0 };  // in the goal's frame
    constexpr double AT_STAGING = 0.1;               // [m]
    if (begin_ < 0.0)
    {
      begin(told);
    }
    if (staging_)
    {
      const PlanarPose staging = compose(told.goal, STAGING);
      const PlanarPose left = compose(inverse(told.base), staging);
      if (left.distance() > AT_STAGING && told.time - begin_ < LONGEST_ATTEMPT)
      {
        return towards(left, left.x < 0.0);
      }
      staging_ = false;
      begin(told);
    }
    const PlanarPose left = compose(inverse(told.base), told.goal);
    if (!turns_ && told.seen && left.distance() <= DOCKED)
    {
      arrived_ = true;
      return BaseVelocity::Zero();
    }
    if (turns_ && (turning_ || left.distance() <= DOCKED))
    {
      // Its end has the right place, and nearly the right yaw: the rest is turned on the spot.
      turning_ = true;
      arrived_ = told.seen && left.distance() <= 2.0 * DOCKED && std::abs(left.yaw) <= YAW_DOCKED;
      if (std::abs(left.yaw) > YAW_DOCKED)
      {
        return { 0.0, 0.0, std::copysign(std::max(std::abs(left.yaw), ApproachParams().min_turn_rate), left.yaw) };
      }
      if (left.distance() <= 2.0 * DOCKED && told.time - std::max(told.seen_last, begin_) <= PATIENCE)
      {
        return BaseVelocity::Zero();
      }
    }
    if (turning_ || told.time - std::max(told.seen_last, begin_) > PATIENCE || told.time - begin_ > LONGEST_ATTEMPT)
    {
      turning_ = false;
      if (++attempts_ >= MOST_ATTEMPTS)
      {
        failure_ = "four attempts have failed";
        return BaseVelocity::Zero();
      }
      staging_ = true;
      begin_ = told.time;
      return BaseVelocity::Zero();
    }
    return towards(left, backwards_);
  }

private:
  void begin(const Told& told)
  {
    begin_ = told.time;
    backwards_ = compose(inverse(told.base), told.goal).x < 0.0;
  }

  /** The paper's curvature, and its speed, which falls with that; slower near the target. @param target in the base. */
  static BaseVelocity towards(const PlanarPose& target, bool backwards)
  {
    constexpr double K1 = 3.0;
    constexpr double K2 = 2.0;
    constexpr double BETA = 0.4;
    constexpr double LAMBDA = 2.0;
    constexpr double SLOW_WITHIN = 0.25;  // [m]
    constexpr double LEAST = 0.1;         // of the largest speed
    const VelocityLimits limits;
    // Driving backwards is driving ahead with everything turned round.
    const double turned = backwards ? M_PI : 0.0;
    const double sight = target.heading();
    const double theta = wrapAngle(target.yaw + turned - sight);
    const double delta = wrapAngle(turned - sight);
    const double r = std::max(target.distance(), 1e-3);
    const double curvature =
        -(K2 * (delta - std::atan(-K1 * theta)) + (1.0 + K1 / (1.0 + std::pow(K1 * theta, 2.0))) * std::sin(delta)) / r;
    double speed = limits.max_speed / (1.0 + BETA * std::pow(std::abs(curvature), LAMBDA));
    speed = std::clamp(std::min(speed, limits.max_speed * r / SLOW_WITHIN), LEAST * limits.max_speed, limits.max_speed);
    const double turn = std::clamp(curvature * speed, -limits.max_turn_rate, limits.max_turn_rate);
    speed = std::abs(curvature * speed) > limits.max_turn_rate ? limits.max_turn_rate / std::abs(curvature) : speed;
    return { backwards ? -speed : speed, 0.0, turn };
  }

  const bool turns_;
  double begin_ = -1.0;  // of the attempt, or of the way to where the next one begins [s]
  int attempts_ = 0;
  bool staging_ = false;
  bool turning_ = false;  // on the spot, at the goal
  bool backwards_ = false;
};

struct DockingRun
{
  std::string world;
  std::string law;
  bool hard;
  int index;
  PlanarPose start;
  std::uint64_t seed;
};

struct DockingOutcome
{
  bool arrived = false;  ///< as the law says
  std::string reason;
  PlanarPose error;  ///< true pose of the base in the goal's frame, at the end
  double duration = 0.0;
  double travelled = 0.0;
  int reversals = 0;

  bool isThere() const
  {
    constexpr double NEAR_ENOUGH = 0.02;       // [m]
    constexpr double STRAIGHT = M_PI / 180.0;  // [rad]
    return error.distance() <= NEAR_ENOUGH && std::abs(error.yaw) <= STRAIGHT;
  }
};

constexpr const char* OURS = "turn and drive";
constexpr const char* PARK_KUIPERS = "Park-Kuipers";
constexpr const char* WITH_TURN = "Park-Kuipers and a turn";

std::unique_ptr<Docker> makeDocker(const std::string& law)
{
  if (law == OURS)
  {
    return std::make_unique<TurnAndDrive>();
  }
  return std::make_unique<ParkKuipers>(law == WITH_TURN);
}

sim::NomadParams baseOf(const DockingRun& run)
{
  sim::NomadParams params;
  params.differential = true;
  params.seed = run.seed;
  if (run.hard)
  {
    params.odometry_drift = 0.05;
    params.odometry_turn_scale = 1.2;
    params.deadband_speed = 0.01;
    params.deadband_turn_rate = 0.04;
  }
  return params;
}

DockingOutcome dock(const sim::World& world, const DockingRun& run)
{
  constexpr double IMAGE_PERIOD = 0.1;  // [s]
  constexpr double LONGEST = 120.0;     // of a run [s]
  constexpr double NEW_PART = 0.5;      // of a measurement in what is believed
  sim::Nomad nomad(world, baseOf(run));
  nomad.setPose(sim::planarPose(run.start.x, run.start.y, run.start.yaw));
  Sight sight(world, run.seed);
  const std::unique_ptr<Docker> docker = makeDocker(run.law);
  BaseVelocityLimiter limiter{ VelocityLimits() };
  sim::Every image_due(IMAGE_PERIOD);
  sim::Every control_due(sim::CONTROL_PERIOD);
  std::optional<PlanarPose> goal;  // in odometry's frame
  double seen_last = 0.0;
  DockingOutcome outcome;
  double sense = 0.0;
  PlanarPose last = run.start;
  double time = 0.0;
  for (; time < LONGEST && !docker->arrived() && docker->failure().empty(); time += sim::ODOMETRY_PERIOD)
  {
    const PlanarPose base = toPlanar(nomad.odometry());
    bool seen = false;
    if (image_due.due(time))
    {
      if (const std::optional<PlanarPose> in_base = sight.look(toPlanar(nomad.pose())))
      {
        const PlanarPose measured = compose(base, *in_base);
        const PlanarPose before = goal.value_or(measured);
        goal = PlanarPose{ before.x + NEW_PART * (measured.x - before.x), before.y + NEW_PART * (measured.y - before.y),
                           wrapAngle(before.yaw + NEW_PART * wrapAngle(measured.yaw - before.yaw)) };
        seen = true;
        seen_last = time;
      }
    }
    if (goal)
    {
      const BaseVelocity wanted = docker->next({ time, base, *goal, seen, seen_last, [&](const PlanarPose& pose) {
                                                  return sight.share(pose);
                                                } });
      if (control_due.due(time))
      {
        nomad.command(limiter.next(wanted, sim::CONTROL_PERIOD));
      }
    }
    nomad.step(sim::ODOMETRY_PERIOD);
    const PlanarPose here = toPlanar(nomad.pose());
    outcome.travelled += std::hypot(here.x - last.x, here.y - last.y);
    last = here;
    if (const double ahead = nomad.velocity().x(); std::abs(ahead) > 0.005)
    {
      outcome.reversals += ahead * sense < 0.0 ? 1 : 0;
      sense = ahead;
    }
  }
  outcome.arrived = docker->arrived();
  outcome.reason = outcome.arrived ? "arrived" : docker->failure().empty() ? "not in time" : docker->failure();
  outcome.error = compose(inverse(toPlanar(world.goal)), last);
  outcome.duration = time;
  return outcome;
}

/** What becomes of all starts by one law under the same conditions. */
struct DockingSummary
{
  int good = 0;
  int arrived = 0;
  std::vector<double> millimetres;  ///< of those that say that they have arrived, here and below
  std::vector<double> degrees;
  std::vector<double> seconds;
  std::vector<double> ways;  ///< as parts of the straight one
  std::vector<double> reversals;
  std::size_t runs = 0;

  void add(const DockingOutcome& outcome, double distance)
  {
    ++runs;
    if (outcome.arrived)
    {
      ++arrived;
      good += outcome.isThere() ? 1 : 0;
      millimetres.push_back(1e3 * outcome.error.distance());
      degrees.push_back(std::abs(outcome.error.yaw) * DEGREES);
      seconds.push_back(outcome.duration);
      ways.push_back(outcome.travelled / distance);
      reversals.push_back(outcome.reversals);
    }
  }

  void print(std::ostream& stream) const
  {
    stream << good << " of " << runs << " end within 2 cm and 1 degree, " << arrived - good
           << " say so and do not; of those that say so: distance median " << medianOf(millimetres) << ", largest "
           << quantileOf(millimetres, 1.0) << " mm; yaw median " << medianOf(degrees) << ", largest "
           << quantileOf(degrees, 1.0) << " degrees; time median " << medianOf(seconds) << ", 95 % "
           << quantileOf(seconds, 0.95) << " s; way median " << medianOf(ways)
           << " of the straight one; reversals median " << medianOf(reversals) << ", most "
           << quantileOf(reversals, 1.0) << std::endl;
  }
};

std::vector<DockingRun> makeRuns(const Worlds& worlds, const std::vector<std::string>& names,
                                 const ExperimentContext& context)
{
  constexpr double MAX_YAW = M_PI / 9.0;
  std::vector<DockingRun> runs;
  Rng rng(context.seedOf(DOCKING_STARTS, DOCKING_STARTS.seed));
  for (int i = 0; i < context.runsOf(DOCKING_STARTS); ++i)
  {
    const std::string& name = names[static_cast<std::size_t>(i) % names.size()];
    const PlanarPose start = sim::randomStart(worlds.at(name), rng, MAX_YAW);
    const std::uint64_t seed = context.seedOf(DOCKING_STARTS, static_cast<std::uint64_t>(i) + 2);
    for (const bool hard : { false, true })
    {
      for (const char* law : { OURS, PARK_KUIPERS, WITH_TURN })
      {
        runs.push_back({ name, law, hard, i + 1, start, seed });
      }
    }
  }
  return runs;
}

}  // namespace

void runDockingExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const std::vector<std::string> names = { "desk", "cabinet", "corridor" };
  const Worlds worlds = readShippedWorlds(names);
  const std::vector<DockingRun> runs = makeRuns(worlds, names, context);
  std::vector<std::string> rows(runs.size());
  std::vector<DockingOutcome> outcomes(runs.size());
  inParallel(runs.size(), context.threads, [&](std::size_t i) {
    const DockingRun& run = runs[i];
    outcomes[i] = dock(worlds.at(run.world), run);
    const DockingOutcome& outcome = outcomes[i];
    std::ostringstream row;
    row << run.world << ',' << run.law << ',' << (run.hard ? "hard" : "plain") << ',' << run.index << ',' << run.start.x
        << ',' << run.start.y << ',' << run.start.yaw * DEGREES << ',' << (outcome.arrived ? 1 : 0) << ','
        << (outcome.isThere() ? 1 : 0) << ',' << 1e3 * outcome.error.distance() << ',' << outcome.error.yaw * DEGREES
        << ',' << outcome.duration << ',' << outcome.travelled << ',' << outcome.reversals << ',' << outcome.reason
        << '\n';
    rows[i] = row.str();
  });
  std::map<std::pair<std::string, std::string>, DockingSummary> summaries;  // of conditions and law
  for (std::size_t i = 0; i < runs.size(); ++i)
  {
    const double distance = compose(inverse(toPlanar(worlds.at(runs[i].world).goal)), runs[i].start).distance();
    summaries[{ runs[i].hard ? "hard" : "plain", runs[i].law }].add(outcomes[i], distance);
  }
  csv << "world,law,conditions,index,start_x,start_y,start_yaw_deg,arrived,there,distance_error_mm,yaw_error_deg,"
         "duration_s,travelled_m,reversals,reason\n";
  for (const std::string& row : rows)
  {
    csv << row;
  }
  for (const auto& [key, summary] : summaries)
  {
    std::cout << key.first << ", " << key.second << ": ";
    summary.print(std::cout);
  }
}

}  // namespace view_servo
