// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "../../bench/ratios.h"

#include "support/temporary_directory.h"
#include "support/text_file.h"

#include <gtest/gtest.h>

#include <sstream>
#include <stdexcept>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
/** Two ratios, the second as given. */
Ratios measured(double second)
{
  Ratios ratios;
  ratios.add("stored, 1 thread, of ORB", 0.5);
  ratios.add("fresh, 1 thread, of LSD + LBD", second);
  return ratios;
}

/** What is said of a run after an earlier one; empty when it is as good. */
std::string complaint(const Ratios& now, const Ratios& before)
{
  std::ostringstream out;
  const bool good = now.isAsGoodAs(before, out);
  EXPECT_EQ(good, out.str().empty());
  return out.str();
}

TEST(Ratios, AreComparedWithThoseOfAnEarlierRun)
{
  const TemporaryDirectory directory;
  const std::string file = (directory.path() / "ratios").string();
  measured(1.1).write(file);
  const Ratios before = Ratios::read(file);
  EXPECT_EQ(complaint(measured(1.1), before), "");
  EXPECT_EQ(complaint(measured(0.2), before), "");
  EXPECT_EQ(complaint(measured(1.26), before), "");
  EXPECT_EQ(complaint(measured(1.27), before), "fresh, 1 thread, of LSD + LBD: 1.270, 1.100 before\n");
}

TEST(Ratios, ThatOnlyOneRunHasAreToldOf)
{
  Ratios more = measured(1.1);
  more.add("third", 2.0);
  EXPECT_EQ(complaint(more, measured(1.1)), "third: 2.000, not measured before\n");
  EXPECT_EQ(complaint(measured(1.1), more), "third: not measured, 2.000 before\n");
  EXPECT_NE(complaint(Ratios(), Ratios()), "");
}

TEST(Ratios, RefuseAFileOfSomethingElse)
{
  const TemporaryDirectory directory;
  EXPECT_THROW(Ratios::read((directory.path() / "missing").string()), std::runtime_error);
  EXPECT_THROW(measured(1.0).write((directory.path() / "missing" / "ratios").string()), std::runtime_error);
  for (const char* text : { "stored 0.5\n", "0.5\n", "0.5,stored\n", "-1 stored\n", "nan stored\n", "0.5 a\n\n" })
  {
    EXPECT_THROW(Ratios::read(writeText(directory.path() / "ratios", text)), std::runtime_error) << text;
  }
}

}  // namespace
}  // namespace test
}  // namespace view_servo
