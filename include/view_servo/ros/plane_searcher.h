// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/mailbox.h"
#include "view_servo/tracking/plane_finder.h"

#include <Eigen/Geometry>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <thread>

namespace view_servo
{
/**
 * Looks for the plane of a view in a thread of its own, so that images go on meanwhile: one search at a time, none sooner than a
 * while after the one before. All methods are for one and the same thread.
 */
class PlaneSearcher
{
public:
  struct Search
  {
    std::uint64_t era;  ///< what is asked for; answers of another era are of no use
    PlaneFinder::Question question;
    std::optional<Eigen::Isometry3d> camera_in_odom;  ///< of the image
    PlaneFinder::Answer answer;
  };

  /** @param period from one search to the next [s]. @param finder must outlive this. */
  PlaneSearcher(const PlaneFinder& finder, double period);
  /** Waits for the match that is under way. */
  ~PlaneSearcher();
  PlaneSearcher(const PlaneSearcher&) = delete;
  PlaneSearcher& operator=(const PlaneSearcher&) = delete;

  /** Whether a search may begin now. */
  bool ready() const;

  void begin(Search search);

  /** A search that is finished, once. */
  std::optional<Search> finished();

private:
  using Clock = std::chrono::steady_clock;

  void work();

  const PlaneFinder& finder_;
  const Clock::duration period_;
  bool searching_ = false;
  Clock::time_point next_;
  std::atomic<bool> stopping_{ false };
  Mailbox<Search> questions_;
  Mailbox<Search> answers_;
  std::thread worker_;
};

}  // namespace view_servo
