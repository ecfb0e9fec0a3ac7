// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/WantedView.h"

#include <optional>
#include <string>

namespace view_servo
{
/** A stored view that somebody has chosen. */
struct ChosenView
{
  std::string view;  ///< empty: none
  std::string goal;  ///< of the driver that wants the view; empty: of nobody
};

/** The view that a node works on: people choose it by a service or parameter, drivers by a WantedView. The newest choice counts. */
class ViewChoice
{
public:
  /** A person's choice. */
  void choose(const std::string& view);

  /**
   * A driver's choice. A message without a view ends what a driver has chosen, but not what a person has: it may be a latched
   * one from before. A latched message that comes once more says nothing new.
   * @return whether the choice changes.
   */
  bool want(const WantedView& message);

  const ChosenView& chosen() const
  {
    return chosen_;
  }

private:
  ChosenView chosen_;
  bool by_driver_ = false;
  std::optional<WantedView> last_message_;
};

}  // namespace view_servo
