// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/parameter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
/** What faultsOf() says of one number; empty: nothing. */
std::string faultOf(double value, const std::string& range, const std::string& unit = "")
{
  const std::vector<std::string> faults =
      faultsOf(std::vector<Parameter>{ real("it", value, unit, range, "a number") });
  return faults.empty() ? "" : faults.front();
}

TEST(Range, HoldsWhatItSays)
{
  struct Case
  {
    std::string range;
    std::vector<double> inside;
    std::vector<double> outside;
  };
  for (const Case& one : std::vector<Case>{ { "> 0", { 1e-9, 5.0 }, { 0.0, -1.0 } },
                                            { ">= 1", { 1.0, 7.0 }, { 0.999 } },
                                            { "> -1", { -0.5 }, { -1.0 } },
                                            { "[0, 1)", { 0.0, 0.5 }, { -0.1, 1.0 } },
                                            { "(0, 1]", { 1.0, 0.5 }, { 0.0, 1.1 } },
                                            { "[-1, 1]", { -1.0, 1.0 }, { -1.1, 1.1 } },
                                            { "(0, pi/2)", { 1.5 }, { 0.0, 1.571, M_PI_2 } },
                                            { "[0, pi]", { M_PI, 0.0 }, { 3.15 } },
                                            { "4, 6 or 8", { 4.0, 6.0, 8.0 }, { 5.0, 7.0, 0.0 } },
                                            { "odd, >= 5", { 5.0, 7.0 }, { 3.0, 6.0 } },
                                            { "", { -1e300, 0.0 }, {} } })
  {
    for (const double value : one.inside)
    {
      EXPECT_EQ(faultOf(value, one.range), "") << value << " in " << one.range;
    }
    for (const double value : one.outside)
    {
      EXPECT_NE(faultOf(value, one.range), "") << value << " in " << one.range;
    }
  }
}

TEST(Range, IsNamedWithUnitAndValue)
{
  EXPECT_EQ(faultOf(0.0, "> 0", "m/s"), "it must be > 0 m/s, not 0");
  EXPECT_EQ(faultOf(2.5, "[0, 1)"), "it must lie in [0, 1), not 2.5");
  EXPECT_EQ(faultOf(5.0, "4, 6 or 8"), "it must be 4, 6 or 8, not 5");
}

TEST(Range, HoldsFiniteNumbersOnly)
{
  for (const double value : { std::numeric_limits<double>::infinity(), std::numeric_limits<double>::quiet_NaN() })
  {
    EXPECT_NE(faultOf(value, "> 0"), "");
    EXPECT_NE(faultOf(value, ""), "");
  }
}

TEST(Range, RefersToAnotherParameterOfTheTable)
{
  double low = 2.0;
  double high = 1.0;
  const std::vector<Parameter> table{ real("low", low, "", "> 0", "one"), real("high", high, "", ">= low", "another") };
  ASSERT_EQ(faultsOf(table).size(), 1U);
  EXPECT_EQ(faultsOf(table).front(), "high must be >= low, not 1");
  high = 2.0;
  EXPECT_TRUE(faultsOf(table).empty());
}

TEST(Range, ThatCannotBeReadIsAFaultOfTheProgram)
{
  for (const std::string range : { "positive", ">= other", "[0; 1]", "[0, 1" })
  {
    EXPECT_THROW(faultOf(1.0, range), std::logic_error) << range;
  }
}

enum class Colour
{
  RED,
  GREEN
};

TEST(Choice, ThatIsNoneOfTheWordsIsAFault)
{
  auto colour = Colour::RED;
  const std::vector<Parameter> table{ choice<Colour>(
      "colour", colour, { { "red", Colour::RED }, { "green", Colour::GREEN } }, "a colour") };
  EXPECT_TRUE(faultsOf(table).empty());
  EXPECT_TRUE(table.front().set("green"));
  EXPECT_FALSE(table.front().set("blue"));
  EXPECT_EQ(colour, Colour::GREEN);
  colour = static_cast<Colour>(7);
  ASSERT_EQ(faultsOf(table).size(), 1U);
  EXPECT_EQ(faultsOf(table).front(), "colour must be one of red|green");
}

TEST(Prefixed, RenamesParametersAlsoInRanges)
{
  double low = 1.0;
  double high = 2.0;
  int number = 5;
  const std::vector<Parameter> table =
      prefixed("line_", { real("low", low, "", "[0, high]", "a number"), real("high", high, "", ">= low", "a number"),
                          integer("number", number, "", "4, 5 or 6", "a number") });
  EXPECT_EQ(table[0].name, "line_low");
  EXPECT_EQ(table[0].range, "[0, line_high]");
  EXPECT_EQ(table[1].range, ">= line_low");
  EXPECT_EQ(table[2].range, "4, 5 or 6");
  EXPECT_TRUE(faultsOf(table).empty());
  setParameter(table, "line_high", "0.5");
  EXPECT_EQ(high, 0.5);
  EXPECT_EQ(faultsOf(table).size(), 2U);
}

TEST(SetParameter, StoresTextsAndPathsAsTheyAre)
{
  std::string text = "before";
  std::filesystem::path folder;
  const std::vector<Parameter> table{ view_servo::text("text", text, "a text"), path("folder", folder, "a folder") };
  setParameter(table, "text", "");
  setParameter(table, "folder", "/tmp/with space");
  EXPECT_EQ(text, "");
  EXPECT_EQ(folder, "/tmp/with space");
  EXPECT_EQ(table[1].get(), "/tmp/with space");
  EXPECT_TRUE(faultsOf(table).empty());
}

TEST(SetParameter, NamesTheNearest)
{
  int number = 1;
  const std::vector<Parameter> table{ integer("number", number, "", "", "a number") };
  EXPECT_THROW(setParameter(table, "nummer", "2"), std::invalid_argument);
  EXPECT_EQ(nearestName(table, "nummer"), "number");
  EXPECT_EQ(nearestName({}, "nummer"), "");
  EXPECT_EQ(number, 1);
}

}  // namespace
}  // namespace view_servo
