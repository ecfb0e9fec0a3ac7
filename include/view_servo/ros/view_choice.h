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
  std::string goal;  ///< id of the goal for which a driver wants the view; empty: no driver does
};

/**
 * The view that a node works on. People choose it by a service or parameter, drivers by WantedView; the newest choice
 * counts.
 */
class ViewChoice
{
public:
  /** A person's choice. @param view name of a stored view; empty: none. */
  void choose(const std::string& view);

  /**
   * A driver's choice. A message without a view ends the choice of a driver, but not that of a person, because it may
   * be an old latched one. The same latched message once more changes nothing.
   * @return whether the choice changes.
   */
  bool want(const WantedView& message);

  /** The choice that counts now. */
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
