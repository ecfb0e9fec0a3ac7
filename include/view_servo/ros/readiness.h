// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

namespace view_servo
{
/** How long nodes wait by default for what they need before they can begin, as other nodes may start slowly [s]. */
constexpr double START_PATIENCE = 30.0;

/**
 * Waits until nothing is missing any more, by a steady clock, so that neither a paused `/clock` nor a change of the
 * system's clock matters. What is missing is logged every few seconds.
 * @param patience longest wait [s].
 * @param missing returns what is still missing, in words; empty: nothing. Called every few milliseconds, and at least
 * once.
 * @param given_up called as often; the wait ends once it returns true. May be empty.
 * @return what is still missing; empty when everything is there.
 */
std::string waitUntilReady(double patience, const std::function<std::string()>& missing,
                           const std::function<bool()>& given_up = {});

}  // namespace view_servo
