// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/mailbox.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/tracking/scene_finder.h"

#include <Eigen/Geometry>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <thread>
#include <variant>

namespace view_servo
{
/**
 * Searches for a view, as a plane or as a scene with depth, in a thread of its own, so that images are still handled
 * meanwhile. There is one search at a time, and a least period between them. All methods are to be called by one and
 * the same thread.
 */
class PlaneSearcher
{
public:
  struct Search
  {
    std::uint64_t era;  ///< a number of the caller's, by which it tells outdated answers
    /** The view, and the image in which it is looked for: of the kind of search that is meant. */
    std::variant<PlaneFinder::Question, SceneFinder::Question> question;
    std::optional<Eigen::Isometry3d> camera_in_odom;  ///< the camera's pose when the image was taken; empty: not known
    /** Of the same kind; set when the search has ended. */
    std::variant<PlaneFinder::Answer, SceneFinder::Answer> answer;
  };

  /**
   * @param period least time from the begin of one search to the next [s]. @param finder must outlive this; scenes are
   * looked for by a SceneFinder with its own parameters.
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
  const SceneFinder scene_finder_;
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
