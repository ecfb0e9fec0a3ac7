// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "child_process.h"
#include "node_test.h"
#include "sim/renderer.h"
#include "sim/world.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <functional>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** @file What the replays of approaches share, whose node is to find the view "goal". */

/** Stores "goal" where a node keeps its views: what the world's camera sees from a pose. @param region of interest. */
inline void saveGoal(const std::string& node, const sim::World& world, const Eigen::Isometry3d& camera,
                     const cv::Rect& region = cv::Rect())
{
  constexpr int SEED = 77;  // of the image's noise: none of the bag's images is the same
  StoredView view = viewOf("goal", sim::SimulatedCamera(world, {}, SEED).capture(camera));
  view.region = region;
  saveView(node, view);
}

/**
 * Plays some topics of a bag, with its clock, until its end.
 * @param rate times its own pace. @param step is done all the while.
 */
inline void playBag(const std::string& bag, double rate, const std::vector<std::string>& topics,
                    const std::function<void()>& step = nullptr)
{
  std::vector<std::string> command{ "rosbag",  "play", "--clock", "--quiet", playRate(rate), "--wait-for-subscribers",
                                    "--topics" };
  command.insert(command.end(), topics.begin(), topics.end());
  command.push_back("--bags=" + bag);
  ChildProcess play(command);
  constexpr int PATIENCE = 4;  // deadlines
  bool played = false;
  for (int i = 0; i < PATIENCE && !played; ++i)
  {
    played = waitUntil([&] { return play.exited(); }, step);
  }
  ASSERT_TRUE(played) << bag;
}

}  // namespace test
}  // namespace view_servo
