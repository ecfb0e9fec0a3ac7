// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <initializer_list>
#include <string>
#include <utility>

namespace view_servo
{
/**
 * Follows the messages of a matcher or tracker, as its answer to the view that a driver wants (WantedView): whether
 * they are about that view, or refuse it. Messages without a goal's id count as well, as somebody else may have chosen
 * the same view.
 */
class ViewAnswer
{
public:
  /** @param what the messages are, in the plural. @param topic that they come on. Both are for texts. */
  ViewAnswer(std::string what, std::string topic) : what_(std::move(what)), topic_(std::move(topic))
  {
  }

  /** Another view is wanted from now on; empty: none. @param goal id of the goal that it is wanted for. */
  void expect(const std::string& view, const std::string& goal);

  /** To be called with each message. @return whether it is about the wanted view and does not refuse it. */
  template <typename Message>
  bool add(const Message& message)
  {
    return add(message.view, message.goal, message.refused != 0, message.reason);
  }

  /** The name of the wanted view, as given to expect(). */
  const std::string& view() const
  {
    return view_;
  }
  /** Whether a message about the wanted view has come that does not refuse it. */
  bool came() const
  {
    return came_;
  }
  /** Why the sender refuses the wanted view; empty when it does not. */
  const std::string& refusal() const
  {
    return refusal_;
  }
  /** A sentence that names the other view, when the last message was about another one; else empty. */
  const std::string& otherView() const
  {
    return other_view_;
  }
  /** What has not come, and what came instead, in one line; empty once a message about the wanted view has come. */
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
 * The same for several senders, one of which has to answer: what has not come; empty once one has answered.
 * @throws std::runtime_error with the reason when all of them refuse the view.
 */
std::string missingAnswer(std::initializer_list<const ViewAnswer*> answers);

}  // namespace view_servo
