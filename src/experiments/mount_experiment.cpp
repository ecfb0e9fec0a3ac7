// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/mount_experiment.h"

#include "experiments/parallel.h"
#include "experiments/shipped_worlds.h"
#include "experiments/statistics.h"
#include "trials/mount_trial.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/numbers.h"

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
void runMountExperiment(const ExperimentContext& context, std::ostream& csv)
{
  const auto runs = static_cast<std::size_t>(context.runsOf(MOUNT_RUNS));
  const sim::World world = readShippedWorld("desk");
  std::vector<std::string> lines(runs);
  std::vector<double> millimetres;
  std::vector<double> degrees;
  std::mutex mutex;
  inParallel(runs, context.threads, [&](std::size_t i) {
    sim::MountTrialParams params;
    params.seed = context.seedOf(MOUNT_RUNS, i + 1);
    sim::MountTrial trial(world, params);
    const MountResult result = trial.run();
    const Eigen::Isometry3d off = trial.truth().inverse() * result.camera_in_base;
    const Eigen::Vector3d on_floor = 1e3 * (result.camera_in_base.translation() - trial.truth().translation());
    const Eigen::Vector3d turn =
        DEGREES * rotationVector(result.camera_in_base.linear() * trial.truth().linear().transpose());
    const auto used = std::count_if(result.residuals.begin(), result.residuals.end(),
                                    [](const MountResidual& residual) { return residual.used; });
    std::ostringstream line;
    line << i << ',' << (result.found ? 1 : 0) << ',' << result.residuals.size() << ',' << used << ','
         << 1e3 * off.translation().norm() << ',' << turn.norm() << ',' << 1e3 * result.translationSigma() << ','
         << DEGREES * result.rotationSigma() << ',' << result.image_error << ',' << 100.0 * result.way_error << ','
         << 100.0 * result.turn_error << ',' << on_floor.x() << ',' << on_floor.y() << ',' << turn.x() << ','
         << turn.y() << ',' << turn.z() << '\n';
    const std::lock_guard<std::mutex> lock(mutex);
    lines[i] = line.str();
    std::cerr << line.str() << (result.message.empty() ? "" : result.message + "\n") << std::flush;
    if (result.found)
    {
      millimetres.push_back(1e3 * off.translation().norm());
      degrees.push_back(turn.norm());
    }
  });
  csv << "index,found,poses,used,translation_error_mm,rotation_error_deg,translation_sigma_mm,rotation_sigma_deg,"
         "image_error_px,way_error_percent,turn_error_percent,ahead_mm,left_mm,roll_deg,pitch_deg,yaw_deg\n";
  for (const std::string& line : lines)
  {
    csv << line;
  }
  std::printf("%zu of %zu failed", runs - millimetres.size(), runs);
  if (!millimetres.empty())
  {
    std::printf("; mean %.3f mm, %.4f degrees, largest %.3f mm, %.4f degrees", mean(millimetres), mean(degrees),
                *std::max_element(millimetres.begin(), millimetres.end()),
                *std::max_element(degrees.begin(), degrees.end()));
  }
  std::printf("\n");
}

}  // namespace view_servo
