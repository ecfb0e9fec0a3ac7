// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/homing_parameters.h"
#include "view_servo/control/servo_parameters.h"
#include "view_servo/tracking/plane_tracker_parameters.h"
#include "view_servo/views/matcher_parameters.h"
#include "test_paths.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

namespace view_servo
{
namespace
{
/** What is there is documented in the file: every parameter, with its default. */
void expectEveryParameterAtItsDefault(const std::string& file, const std::vector<Parameter>& table,
                                      const std::vector<std::string>& of_the_node)
{
  SCOPED_TRACE(file);
  const YAML::Node config = YAML::LoadFile(PACKAGE_DIR "/config/" + file);
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

const std::vector<std::string> OF_MATCHERS = {
  "view", "rate", "views_dir", "allow_paths", "image_transport", "queue_size", "max_image_age", "image_patience"
};

TEST(Config, PointMatcherHasEveryParameterAtItsDefault)
{
  PointViewMatcherParams params;
  expectEveryParameterAtItsDefault("point_matcher.yaml", matcherParameters(params), OF_MATCHERS);
}

TEST(Config, LineMatcherHasEveryParameterAtItsDefault)
{
  LineMatcherParams params;
  expectEveryParameterAtItsDefault("line_matcher.yaml", matcherParameters(params), OF_MATCHERS);
}

TEST(Config, HomingHasEveryParameterAtItsDefault)
{
  HomingParams params;
  VelocityLimits limits;
  expectEveryParameterAtItsDefault(
      "homing.yaml", homingParameters(params, limits),
      { "view", "views_dir", "base_frame", "dry_run", "timeout", "start_patience", "control_rate", "image_timeout",
        "odometry_timeout", "match_timeout", "image_transport", "queue_size", "max_image_age" });
}

TEST(Config, HomographyTrackerHasEveryParameterAtItsDefault)
{
  PlaneTrackerParams params;
  expectEveryParameterAtItsDefault("homography_tracker.yaml", planeTrackerParameters(params),
                                   { "view", "views_dir", "odom_frame", "tf_patience", "match_period",
                                     "image_transport", "queue_size", "max_image_age" });
}

TEST(Config, ServoHasEveryParameterAtItsDefault)
{
  Servo25dParams params;
  VelocityLimits limits = ARM_LIMITS;
  expectEveryParameterAtItsDefault(
      "servo_25d.yaml", servoParameters(params, limits),
      { "views_dir", "dry_run", "timeout", "start_patience", "acquire_timeout", "control_rate", "joint_timeout",
        "homography_timeout", "max_homography_age", "joint_margin" });
}

}  // namespace
}  // namespace view_servo
