// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>

namespace view_servo
{
/**
 * Calls `work(i)` once for each i below `count`, on several threads. When one call throws, no further ones begin, and
 * the exception is thrown here.
 * @param max_threads 0: as many as there are processors.
 */
void inParallel(std::size_t count, int max_threads, const std::function<void(std::size_t)>& work);

/** Processor time that the calling thread has used [s]. */
double threadSeconds();

}  // namespace view_servo
