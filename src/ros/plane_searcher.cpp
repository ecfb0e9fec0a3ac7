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
    const auto given_up = [this] {
      return stopping_.load();
    };
    if (const auto* plane = std::get_if<PlaneFinder::Question>(&search->question))
    {
      PlaneFinder::Answer answer;
      const std::string fault = guarded("looking for the view", [&] { answer = finder_.find(*plane, given_up); });
      answer.reason = fault.empty() ? answer.reason : fault;
      search->answer = std::move(answer);
    }
    else
    {
      SceneFinder::Answer answer;
      const std::string fault = guarded("looking for the view as a scene", [&] {
        answer = scene_finder_.find(std::get<SceneFinder::Question>(search->question), given_up);
      });
      answer.reason = fault.empty() ? answer.reason : fault;
      search->answer = std::move(answer);
    }
    answers_.put(std::move(*search));
    on_finished_();
  }
}

}  // namespace view_servo
