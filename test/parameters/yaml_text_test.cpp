// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/yaml_text.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
TEST(YamlText, IsRead)
{
  EXPECT_EQ(parseYaml("{a: {b: 1}, c: [2, 3]}")["c"][1].as<int>(), 3);
  EXPECT_EQ(parseYaml("a: 1\n\n")["a"].as<int>(), 1);
  EXPECT_TRUE(parseYaml("").IsNull());
}

TEST(YamlText, NumbersAreReadAsTheyWereWritten)
{
  for (const double number : { 1.7e9 + 1.0 / 3.0, -1.0 / 3.0, 1e-300, 5e-324, 1.7976931348623157e308, 0.0, -0.1 })
  {
    YAML::Emitter yaml;
    yaml << YAML::Flow << std::vector<std::string>{ exactText(number), "1" };
    EXPECT_EQ(parseYaml(yaml.c_str())[0].as<double>(), number) << yaml.c_str();
  }
}

TEST(YamlText, IsRefusedWhereItEndsTooEarly)
{
  for (const char* text : { "a: {b:", "{name: rice, position:", "- [a:", "[a:", "a: [ {b:", "{a: b:", "{:", "{? a:",
                            "{", "[", "a: [1, 2", "a: {b: \"", "a: {b: 'c" })
  {
    EXPECT_THROW(parseYaml(text), YAML::Exception) << text;
  }
}

TEST(YamlText, IsRefusedWhereItsAliasesMakeTooMuchOfIt)
{
  std::string bomb = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int i = 1; i < 9; ++i)
  {
    const std::string before = "*a" + std::to_string(i - 1);
    bomb += "a" + std::to_string(i) + ": &a" + std::to_string(i) + " [" + before;
    for (int k = 1; k < 10; ++k)
    {
      bomb += ", " + before;
    }
    bomb += "]\n";
  }
  EXPECT_THROW(parseYaml(bomb), std::runtime_error);
  EXPECT_THROW(parseYaml("&a [*a]"), std::runtime_error);
  EXPECT_THROW(parseYaml(std::string(4000001, '#')), std::runtime_error);
}

TEST(YamlText, IsRefusedInAFileThatEndsTooEarlyOrIsTooLarge)
{
  const test::TemporaryDirectory directory;
  const std::string file = (directory.path() / "cut.yaml").string();
  test::writeText(file, "{name: rice, position:");
  EXPECT_THROW(loadSmallYamlFile(file), YAML::Exception);
  test::writeText(file, "a: 1 #" + std::string(1000000, '#'));
  EXPECT_THROW(loadSmallYamlFile(file), std::exception);
  EXPECT_THROW(loadSmallYamlFile(directory.path().string()), std::exception);
  test::writeText(file, "a: 1");
  EXPECT_EQ(loadSmallYamlFile(file)["a"].as<int>(), 1);
}

}  // namespace
}  // namespace view_servo
