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

  /** Empty: none. */
  const std::string& name() const
  {
    return learnt_.empty() ? view_ : learnt_;
  }

  /** Name of the view that has to be learnt; empty: none. */
  const std::string& learnt() const
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
  static constexpr std::chrono::minutes PATIENCE{ 5 };

  std::string view_;
  std::string learnt_;
  Clock::time_point since_;
};

}  // namespace view_servo
