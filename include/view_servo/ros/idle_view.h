// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <string>
#include <utility>

namespace view_servo
{
/** The view that a driver follows while it has no goal: the one of its parameters, unless another has to be learnt. */
class IdleView
{
public:
  /** @param view name of a stored view; empty: none. */
  explicit IdleView(std::string view) : view_(std::move(view))
  {
  }

  /** Name of the view that is followed: the one to be learnt, else the constructor's; empty: none. */
  const std::string& name() const
  {
    return learnt_.empty() ? view_ : learnt_;
  }

  /** Name of the view that has to be learnt; empty: none. */
  const std::string& toBeLearnt() const
  {
    return learnt_;
  }

  /** From now on a view has to be learnt; empty: none any more. */
  void learn(const std::string& view)
  {
    learnt_ = view;
    since_ = Clock::now();
  }

  /** Whether it takes too long already to learn a view. */
  bool overdue() const
  {
    return !learnt_.empty() && Clock::now() - since_ > PATIENCE;
  }

private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::minutes PATIENCE{ 5 };  // longest time that learning a view may take

  std::string view_;         // of the parameters
  std::string learnt_;       // to be learnt
  Clock::time_point since_;  // when learn() was called
};

}  // namespace view_servo
