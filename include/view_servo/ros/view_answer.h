// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <string>
#include <utility>

namespace view_servo
{
/**
 * What a matcher or a tracker has answered, in its messages, to the view that a driver wants (WantedView). Messages without a
 * goal's id count, too: somebody else has chosen the same view.
 */
class ViewAnswer
{
public:
  /** @param what the messages are, in the plural. @param topic that they come on, for people. */
  ViewAnswer(std::string what, std::string topic) : what_(std::move(what)), topic_(std::move(topic))
  {
  }

  /** Another view is wanted from now on; empty: none. */
  void want(const std::string& view, const std::string& goal);

  /** A message has come. @return whether it is about the view that is wanted, and can be used. */
  template <typename Message>
  bool add(const Message& message)
  {
    return add(message.view, message.goal, message.refused != 0, message.reason);
  }

  const std::string& view() const
  {
    return view_;
  }
  /** Whether a message about the wanted view has come that does not refuse it. */
  bool came() const
  {
    return came_;
  }
  /** Why the view cannot be matched or followed at all; empty: it can, or nothing was said. */
  const std::string& refusal() const
  {
    return refusal_;
  }
  /** Says that messages are about another view, when the last one was; empty: it was not. */
  const std::string& otherView() const
  {
    return other_view_;
  }
  /** What has not come, and what came instead, in one line; empty: it has come. */
  std::string missing() const;

private:
  bool add(const std::string& view, const std::string& goal, bool refused, const std::string& reason);

  std::string what_;
  std::string topic_;
  std::string view_;
  std::string goal_;
  bool came_ = false;
  std::string refusal_;
  std::string other_view_;
};

/**
 * What has not come of several, one of which has to answer; empty: one has.
 * @throws std::runtime_error with the reason when all refuse the view.
 */
std::string missingAnswer(std::initializer_list<const ViewAnswer*> answers);

}  // namespace view_servo
