// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <string>

namespace view_servo
{
/** How long nodes wait, unless told otherwise, for what has to be there before they can begin: others may start slowly [s]. */
constexpr double START_PATIENCE = 30.0;

/**
 * Waits until everything that is needed is there, by a steady clock: neither a paused `/clock` nor a set system clock matters.
 * What is missing is logged every few seconds.
 * @param patience longest wait [s].
 * @param missing what is still missing, in words; empty: nothing is. Asked again every few milliseconds, and at least once.
 * @param given_up asked as often; once it holds the wait ends. May be empty.
 * @return what is still missing; empty when everything is there.
 */
std::string waitUntilReady(double patience, const std::function<std::string()>& missing,
                           const std::function<bool()>& given_up = {});

}  // namespace view_servo
