// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/view_answer.h"

#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/shown_text.h"

#include <stdexcept>

namespace view_servo
{
void ViewAnswer::expect(const std::string& view, const std::string& goal)
{
  view_ = view;
  goal_ = goal;
  came_ = false;
  refusal_.clear();
  other_view_.clear();
}

bool ViewAnswer::add(const std::string& view, const std::string& goal, bool refused, const std::string& reason)
{
  if (view_.empty())
  {
    return false;
  }
  if (view != view_)
  {
    other_view_ = what_ + " on '" + topic_ + "' are of view '" + shown(view) + "', not of '" + view_ + "'";
    return false;
  }
  if (!goal.empty() && goal != goal_)
  {
    return false;  // a former goal's
  }
  other_view_.clear();
  if (refused)
  {
    refusal_ = what_ + " on '" + topic_ +
               "': " + (reason.empty() ? "the view is refused" : oneLine(std::runtime_error(reason)));
    return false;
  }
  refusal_.clear();
  came_ = true;
  return true;
}

std::string ViewAnswer::missing() const
{
  if (came_)
  {
    return "";
  }
  if (!refusal_.empty())
  {
    return refusal_;
  }
  return other_view_.empty() ? "no " + what_ + " of view '" + view_ + "' have come on '" + topic_ + "'" : other_view_;
}

std::string missingAnswer(std::initializer_list<const ViewAnswer*> answers)
{
  std::string missing;
  bool refused = true;
  for (const ViewAnswer* answer : answers)
  {
    if (answer->came())
    {
      return "";
    }
    missing += (missing.empty() ? "" : "; ") + answer->missing();
    refused = refused && !answer->refusal().empty();
  }
  if (refused)
  {
    throw std::runtime_error(missing);
  }
  return missing;
}

}  // namespace view_servo
