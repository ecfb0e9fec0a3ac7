// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/mailbox.h"
#include "view_servo/tracking/plane_finder.h"

#include <Eigen/Geometry>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>

namespace view_servo
{
/**
 * Searches for the plane of a view in a thread of its own, so that images are still handled meanwhile. There is one
 * search at a time, and a least period between them. All methods are to be called by one and the same thread.
 */
class PlaneSearcher
{
public:
  struct Search
  {
    std::uint64_t era;                                ///< a number of the caller's, by which it tells outdated answers
    PlaneFinder::Question question;                   ///< the view, and the image in which it is looked for
    std::optional<Eigen::Isometry3d> camera_in_odom;  ///< the camera's pose when the image was taken; empty: not known
    PlaneFinder::Answer answer;                       ///< set when the search has ended
  };

  /**
   * @param period least time from the begin of one search to the next [s]. @param finder must outlive this.
   * @param on_finished is called by another thread when finished() has an answer.
   */
  PlaneSearcher(const PlaneFinder& finder, double period, std::function<void()> on_finished);
  /** Waits until the running search has ended. */
  ~PlaneSearcher();
  PlaneSearcher(const PlaneSearcher&) = delete;
  PlaneSearcher& operator=(const PlaneSearcher&) = delete;

  /** Whether a search may begin now. */
  bool ready() const;

  /** Begins a search, whose `answer` need not be set; ready() must hold. */
  void begin(Search search);

  /** Takes the search that has finished; empty when none has since the last call. */
  std::optional<Search> finished();

private:
  using Clock = std::chrono::steady_clock;

  void work();

  const PlaneFinder& finder_;
  const Clock::duration period_;
  const std::function<void()> on_finished_;
  bool searching_ = false;
  Clock::time_point next_;  // when the next search may begin
  std::atomic<bool> stopping_{ false };
  Mailbox<Search> questions_;
  Mailbox<Search> answers_;
  std::thread worker_;
};

}  // namespace view_servo
