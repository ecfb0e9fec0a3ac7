// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/plane_searcher.h"

#include "view_servo/ros/node_base.h"

#include <string>
#include <utility>

namespace view_servo
{
PlaneSearcher::PlaneSearcher(const PlaneFinder& finder, double period, std::function<void()> on_finished)
  : finder_(finder),
    period_(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(period))),
    on_finished_(std::move(on_finished))
{
  worker_ = std::thread([this] { work(); });
}

PlaneSearcher::~PlaneSearcher()
{
  stopping_ = true;
  questions_.close();
  worker_.join();
}

bool PlaneSearcher::ready() const
{
  return !searching_ && Clock::now() >= next_;
}

void PlaneSearcher::begin(Search search)
{
  searching_ = true;
  next_ = Clock::now() + period_;
  questions_.put(std::move(search));
}

std::optional<PlaneSearcher::Search> PlaneSearcher::finished()
{
  std::optional<Search> search = answers_.take();
  searching_ = searching_ && !search;
  return search;
}

void PlaneSearcher::work()
{
  while (std::optional<Search> search = questions_.wait())
  {
    const std::string fault = guarded("looking for the view", [&] {
      search->answer = finder_.find(search->question, [this] { return stopping_.load(); });
    });
    if (!fault.empty())
    {
      search->answer.reason = fault;
    }
    answers_.put(std::move(*search));
    on_finished_();
  }
}

}  // namespace view_servo
