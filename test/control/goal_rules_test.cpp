// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/goal_rules.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** A goal that nothing hinders. */
Circumstances fine()
{
  Circumstances circumstances;
  circumstances.elapsed = 1.0;
  circumstances.timeout = 60.0;
  circumstances.patience = 5.0;
  return circumstances;
}

struct Row
{
  const char* name;
  std::function<void(Circumstances&)> change;
  Progress::State state;
  const char* words;
  Verdict::What what;
  const char* reason;
};

void nothing(Circumstances& /*circumstances*/)
{
}

std::vector<Row> table()
{
  const auto silent = [](double since) {
    return [since](Circumstances& c) {
      c.missing_input = "no image";
      c.missing_for = since;
    };
  };
  return {
    // How far it has come.
    { "preparing", nothing, Progress::PREPARING, "no image yet", Verdict::STAND, "no image yet" },
    { "acquiring", nothing, Progress::ACQUIRING, "looks", Verdict::STAND, "looks" },
    { "driving", nothing, Progress::DRIVING, "drives", Verdict::DRIVE, "drives" },
    { "lost", nothing, Progress::LOST, "hidden", Verdict::STAND, "hidden" },
    { "arrived", nothing, Progress::ARRIVED, "agree", Verdict::SUCCEED, "agree" },
    { "failed", nothing, Progress::FAILED, "gone", Verdict::ABORT, "gone" },
    { "failed without a word", nothing, Progress::FAILED, "", Verdict::ABORT, "nothing is known yet" },
    { "failed while silent", silent(0.5), Progress::FAILED, "gone", Verdict::ABORT, "gone: no image" },
    { "failed as it was silent", silent(0.5), Progress::FAILED, "lost: no image", Verdict::ABORT, "lost: no image" },
    // What ends it whatever it has come to.
    { "ending", [](Circumstances& c) { c.shutting_down = true; }, Progress::DRIVING, "drives", Verdict::ABORT,
      "the node is shutting down" },
    { "replaced", [](Circumstances& c) { c.replaced = true; }, Progress::DRIVING, "drives", Verdict::ABORT,
      "another goal has come" },
    { "fault", [](Circumstances& c) { c.fault = "time went back"; }, Progress::DRIVING, "drives", Verdict::ABORT,
      "time went back" },
    { "disabled", [](Circumstances& c) { c.enabled = false; }, Progress::DRIVING, "drives", Verdict::ABORT,
      "disabled" },
    { "cancelled", [](Circumstances& c) { c.cancelled = true; }, Progress::DRIVING, "drives", Verdict::ABORT,
      "the goal was cancelled" },
    { "late", [](Circumstances& c) { c.elapsed = 61.0; }, Progress::DRIVING, "drives", Verdict::ABORT,
      "not at the view within 60 s: drives" },
    { "late, of unknown age", [](Circumstances& c) { c.elapsed = std::numeric_limits<double>::quiet_NaN(); },
      Progress::DRIVING, "drives", Verdict::ABORT, "not at the view within 60 s: drives" },
    { "late without a word", [](Circumstances& c) { c.elapsed = 61.0; }, Progress::LOST, "", Verdict::ABORT,
      "not at the view within 60 s: nothing is known yet" },
    // The same while it is prepared.
    { "preparing, ending", [](Circumstances& c) { c.shutting_down = true; }, Progress::PREPARING, "no image yet",
      Verdict::ABORT, "the node is shutting down" },
    { "preparing, replaced", [](Circumstances& c) { c.replaced = true; }, Progress::PREPARING, "no image yet",
      Verdict::ABORT, "another goal has come" },
    { "preparing, fault", [](Circumstances& c) { c.fault = "time went back"; }, Progress::PREPARING, "no image yet",
      Verdict::ABORT, "time went back" },
    { "preparing, disabled", [](Circumstances& c) { c.enabled = false; }, Progress::PREPARING, "no image yet",
      Verdict::ABORT, "disabled" },
    { "preparing, cancelled", [](Circumstances& c) { c.cancelled = true; }, Progress::PREPARING, "no image yet",
      Verdict::ABORT, "the goal was cancelled" },
    { "preparing, late", [](Circumstances& c) { c.elapsed = 61.0; }, Progress::PREPARING, "no image yet",
      Verdict::ABORT, "not begun within 60 s: no image yet" },
    // What is waited for then is no reason to end.
    { "preparing, unheard", [](Circumstances& c) { c.has_listener = false; }, Progress::PREPARING, "no image yet",
      Verdict::STAND, "no image yet" },
    { "preparing, silent", silent(9.0), Progress::PREPARING, "no image yet", Verdict::STAND, "no image yet" },
    // Afterwards it is.
    { "unheard", [](Circumstances& c) { c.has_listener = false; }, Progress::DRIVING, "drives", Verdict::ABORT,
      "nobody listens any more to the commands" },
    { "silent", silent(0.0), Progress::DRIVING, "drives", Verdict::STAND, "no image" },
    { "silent for too long", silent(5.1), Progress::DRIVING, "drives", Verdict::ABORT, "no image" },
    { "silent until the timeout",
      [&](Circumstances& c) {
        c.missing_input = "no image";
        c.elapsed = 61.0;
      },
      Progress::DRIVING, "drives", Verdict::ABORT, "not at the view within 60 s: no image" },
    { "held", [](Circumstances& c) { c.held = "a person"; }, Progress::DRIVING, "drives", Verdict::STAND, "a person" },
    { "held at the view", [](Circumstances& c) { c.held = "a person"; }, Progress::ARRIVED, "agree", Verdict::SUCCEED,
      "agree" },
    { "preparing, held", [](Circumstances& c) { c.held = "a person"; }, Progress::PREPARING, "no image yet",
      Verdict::STAND, "no image yet" },
    // What counts first.
    { "silent before held",
      [](Circumstances& c) {
        c.held = "a person";
        c.missing_input = "no image";
      },
      Progress::DRIVING, "drives", Verdict::STAND, "no image" },
    { "ending before replaced", [](Circumstances& c) { c.shutting_down = c.replaced = true; }, Progress::DRIVING,
      "drives", Verdict::ABORT, "the node is shutting down" },
    { "replaced before cancelled", [](Circumstances& c) { c.replaced = c.cancelled = true; }, Progress::DRIVING,
      "drives", Verdict::ABORT, "another goal has come" },
    { "disabled before arrived", [](Circumstances& c) { c.enabled = false; }, Progress::ARRIVED, "agree",
      Verdict::ABORT, "disabled" },
    { "cancelled before arrived", [](Circumstances& c) { c.cancelled = true; }, Progress::ARRIVED, "agree",
      Verdict::ABORT, "the goal was cancelled" },
    { "arrived before late", [](Circumstances& c) { c.elapsed = 61.0; }, Progress::ARRIVED, "agree", Verdict::SUCCEED,
      "agree" },
    { "arrived before silent", silent(9.0), Progress::ARRIVED, "agree", Verdict::SUCCEED, "agree" },
    { "failed before late", [](Circumstances& c) { c.elapsed = 61.0; }, Progress::FAILED, "gone", Verdict::ABORT,
      "gone" },
  };
}

TEST(GoalRules, DecideAsTheTableSays)
{
  for (const Row& row : table())
  {
    SCOPED_TRACE(row.name);
    Circumstances circumstances = fine();
    row.change(circumstances);
    const Verdict verdict = judge(circumstances, { row.state, row.words });
    EXPECT_EQ(verdict.what, row.what);
    EXPECT_EQ(verdict.reason, row.reason);
  }
}

RC_GTEST_PROP(GoalRules, MoveOnlyWhenNothingSpeaksAgainstIt, ())
{
  Circumstances c = fine();
  c.shutting_down = *rc::gen::arbitrary<bool>();
  c.replaced = *rc::gen::arbitrary<bool>();
  c.enabled = *rc::gen::arbitrary<bool>();
  c.cancelled = *rc::gen::arbitrary<bool>();
  c.has_listener = *rc::gen::arbitrary<bool>();
  c.elapsed = *rc::gen::element(1.0, 61.0);
  c.fault = *rc::gen::element<std::string>("", "time went back");
  c.missing_input = *rc::gen::element<std::string>("", "no image");
  c.missing_for = *rc::gen::element(1.0, 6.0);
  const auto state = static_cast<Progress::State>(*rc::gen::inRange<int>(Progress::PREPARING, Progress::FAILED + 1));
  const Verdict verdict = judge(c, { state, *rc::gen::element<std::string>("", "a reason") });
  const bool may = !c.shutting_down && !c.replaced && c.enabled && !c.cancelled && c.has_listener && c.elapsed < 60.0 &&
                   c.fault.empty() && c.missing_input.empty() && state == Progress::DRIVING;
  RC_ASSERT((verdict.what == Verdict::DRIVE) == may);
  RC_ASSERT(verdict.what != Verdict::SUCCEED || state == Progress::ARRIVED);
  RC_ASSERT(!verdict.reason.empty());
}

}  // namespace
}  // namespace view_servo
