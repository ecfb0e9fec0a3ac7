// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/world_reader.h"
#include "trials/arm_trial.h"
#include "trials/hand_eye_trial.h"

#include "support/shipped_files.h"
#include "view_servo/geometry/region.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

namespace view_servo::sim
{
namespace
{
constexpr double WRONG_BY = 0.010;            // hand-eye calibration [m]
constexpr double TURNED_BY = 3.0 * DEGREE;    // likewise
constexpr double TRANSLATION_REACHED = 1e-3;  // [m]
constexpr double ROTATION_REACHED = 0.1 * DEGREE;

/** How a run went. */
struct Path
{
  ArmOutcome outcome;
  double beside_line;  ///< largest distance of the chosen point from the straight line to its place in the view [px]
  double detour;       ///< way of the camera over the straight line from its start to its end
};

Path drive(const World& world, const std::string& start, std::uint64_t seed,
           const std::optional<Eigen::Isometry3d>& calibrated)
{
  ArmTrialParams params;
  params.conditions.encoder_noise = 1e-4;
  params.conditions.image_noise = 2.0;
  params.conditions.hand_eye_translation_error = WRONG_BY;
  params.conditions.hand_eye_rotation_error = TURNED_BY;
  params.conditions.calibrated_camera = calibrated;
  params.seed = seed;
  std::vector<Eigen::Vector2d> seen;
  std::vector<Eigen::Vector3d> places;
  Path path;
  path.outcome = ArmTrials(world, test::pumaUrdf(), params).run(world.start(start), [&](const ArmStep& step) {
    places.emplace_back(step.camera.translation());
    if (step.report.state == ServoState::SERVOING)
    {
      seen.push_back(step.report.point);
    }
  });
  const Eigen::Vector2d wanted = middleOf(world.region);
  const Eigen::Vector2d line = (wanted - seen.front()).normalized();
  path.beside_line = 0.0;
  for (const Eigen::Vector2d& point : seen)
  {
    const Eigen::Vector2d off = point - seen.front();
    path.beside_line = std::max(path.beside_line, std::abs(line.x() * off.y() - line.y() * off.x()));
  }
  double way = 0.0;
  for (std::size_t i = 1; i < places.size(); ++i)
  {
    way += (places[i] - places[i - 1]).norm();
  }
  path.detour = way / (places.back() - places.front()).norm();
  return path;
}

void expectAtView(const Path& path)
{
  EXPECT_TRUE(path.outcome.converged) << path.outcome.reason;
  EXPECT_LT(path.outcome.translation_error, TRANSLATION_REACHED);
  EXPECT_LT(path.outcome.rotation_error, ROTATION_REACHED);
}

/**
 * With noise in images and encoders, and a hand-eye calibration that is off by WRONG_BY and TURNED_BY in some
 * direction.
 */
struct HandEyeRun
{
  const char* world;
  const char* start;
  std::uint64_t seed;
};

std::ostream& operator<<(std::ostream& stream, const HandEyeRun& run)
{
  return stream << run.world << " from " << run.start << ", seed " << run.seed;
}

}  // namespace

class WrongHandEyeTest : public testing::TestWithParam<HandEyeRun>
{
};

TEST_P(WrongHandEyeTest, ServoingStillConverges)
{
  const World world = readWorld(test::worldFile(GetParam().world));
  expectAtView(drive(world, GetParam().start, GetParam().seed, std::nullopt));
}

INSTANTIATE_TEST_SUITE_P(Runs, WrongHandEyeTest,
                         testing::Values(HandEyeRun{ "rice", "extreme", 2 }, HandEyeRun{ "rice", "far", 3 },
                                         HandEyeRun{ "mouse", "extreme", 3 }));

class CalibratedHandEyeTest : public testing::TestWithParam<HandEyeRun>
{
};

TEST_P(CalibratedHandEyeTest, ThePathIsAsStraightAsWithTheTrueOne)
{
  const World world = readWorld(test::worldFile(GetParam().world));
  HandEyeTrialParams params;
  params.hand_eye_translation_error = WRONG_BY;
  params.hand_eye_rotation_error = TURNED_BY;
  params.seed = GetParam().seed;
  HandEyeTrial trial(world, test::pumaUrdf(), params);
  const HandEyeResult found = trial.run();
  ASSERT_TRUE(found.found) << found.message;
  const auto drive_with = [&](const std::optional<Eigen::Isometry3d>& camera) {
    const Path path = drive(world, GetParam().start, GetParam().seed, camera);
    expectAtView(path);
    return path;
  };
  const Path wrong = drive_with(std::nullopt);
  const Path calibrated = drive_with(trial.inDescribedCamera(found.camera_in_flange));
  const Path right = drive_with(trial.inDescribedCamera(trial.truth()));
  EXPECT_LT(calibrated.beside_line, right.beside_line + 0.25);
  EXPECT_LT(calibrated.detour, right.detour + 0.001);
  EXPECT_GT(wrong.beside_line, calibrated.beside_line + 2.0) << "else this tells nothing";
}

INSTANTIATE_TEST_SUITE_P(Runs, CalibratedHandEyeTest,
                         testing::Values(HandEyeRun{ "mouse", "far", 1 }, HandEyeRun{ "mouse", "extreme", 3 }));

}  // namespace view_servo::sim
