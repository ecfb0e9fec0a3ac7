// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace view_servo
{
/** What an experiment does again and again with new random numbers. */
struct Repetition
{
  const char* what;    ///< what is repeated, in the plural; empty: nothing is, though random numbers are drawn
  int runs;            ///< how often it is repeated unless `--runs` is given; 0 when nothing is repeated
  int brief_runs;      ///< how often in the brief form
  std::uint64_t seed;  ///< the seed that the tables of docs/results/ were made with
};

/** What an experiment is given. */
struct ExperimentContext
{
  std::filesystem::path data;  ///< real images, for experiments that need them
  bool brief = false;          ///< do a small part only
  int threads = 0;             ///< largest number of threads to use; 0: as many as there are processors
  int runs = 0;                ///< how often to repeat what is repeated; 0: as often as the experiment does by itself
  std::optional<std::uint64_t> seed;  ///< from which all random numbers are drawn; empty: that of the experiment

  /** How often to repeat it. */
  int runsOf(const Repetition& repetition) const
  {
    return runs > 0 ? runs : brief ? repetition.brief_runs : repetition.runs;
  }

  /**
   * The seed to use instead of one that the experiment has for a run, a scene or an estimator: that one itself unless
   * another seed than the repetition's is asked for, else one that depends on both.
   */
  std::uint64_t seedOf(const Repetition& repetition, std::uint64_t own) const
  {
    constexpr std::uint64_t STRIDE = 0x9E3779B97F4A7C15;  // odd: different seeds of the context never give the same
    return own + (seed.value_or(repetition.seed) - repetition.seed) * STRIDE;
  }
};

}  // namespace view_servo
