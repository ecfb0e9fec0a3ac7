// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/matcher_parameters.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** What is there is documented in the file: every parameter, with its default. */
template <typename Params>
void expectEveryParameterAtItsDefault(const std::string& file)
{
  SCOPED_TRACE(file);
  const YAML::Node config = YAML::LoadFile(CONFIG_DIR "/" + file);
  const std::vector<std::string> of_the_node = {
    "view", "rate", "views_dir", "allow_paths", "image_transport", "queue_size", "max_image_age"
  };
  Params params;
  const std::vector<Parameter> table = matcherParameters(params);
  EXPECT_EQ(config.size(), of_the_node.size() + table.size());
  for (const std::string& name : of_the_node)
  {
    EXPECT_TRUE(config[name]) << name;
  }
  for (const Parameter& parameter : table)
  {
    ASSERT_TRUE(config[parameter.name]) << parameter.name;
    const std::string standard = parameter.get();
    EXPECT_TRUE(parameter.set(config[parameter.name].as<std::string>())) << parameter.name;
    EXPECT_EQ(parameter.get(), standard) << parameter.name;
  }
}

TEST(Config, PointMatcherHasEveryParameterAtItsDefault)
{
  expectEveryParameterAtItsDefault<ViewMatcherParams>("point_matcher.yaml");
}

TEST(Config, LineMatcherHasEveryParameterAtItsDefault)
{
  expectEveryParameterAtItsDefault<LineMatcherParams>("line_matcher.yaml");
}

}  // namespace
}  // namespace view_servo
