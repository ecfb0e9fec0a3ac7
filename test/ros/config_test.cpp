// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * The files in config/ and the tables in docs/ say what the tables of parameters in the sources say: names,
 * types, defaults, units, ranges and meanings. VIEW_SERVO_UPDATE=1 writes them anew.
 */
#include "sim/puma.h"
#include "sim_ros/nomad_robot.h"
#include "sim_ros/run_params.h"
#include "sim_ros/simulation_params.h"
#include "support/text_file.h"
#include "test_paths.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/ros/driver_params.h"
#include "view_servo/ros/node_params.h"
#include "view_servo/ros/streaming_matcher.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/scene_matcher.h"

#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cstdlib>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
/** All tables, bound to defaults. */
class Tables
{
public:
  StreamingMatcherParams points_node;
  StreamingMatcherParams lines_node;
  StreamingMatcherParams scene_node;
  PointViewMatcherParams points;
  LineMatcherParams lines;
  SceneMatcherParams scene;
  HomingDriverParams homing;
  RouteFollowerParams follower;
  RouteRecorderParams route_recorder;
  HomographyTrackerNodeParams tracker;
  ServoDriverParams servo;
  ViewStoreNodeParams store;
  ViewRecognizerNodeParams recognizer;
  sim::SimulationParams simulation;
  sim::NomadNodeParams nomad;
  sim::PumaParams puma;
  RunParams homing_run = homingRunParams();
  RunParams route_run = routeRunParams();
  RunParams arm_run;

  Tables()
  {
    lines_node.rate = LINES_RATE;
    scene_node.rate = SCENE_RATE;
  }

  /** Titles and tables of a file in config/. */
  using Sections = std::vector<std::pair<std::string, std::vector<Parameter>>>;

  std::vector<std::pair<std::string, Sections>> files()
  {
    return {
      { "point_matcher",
        { { "the node", parameters(points_node) },
          { "matching; these are also names of `match_images points --set name=value`", parameters(points) } } },
      { "line_matcher",
        { { "the node", parameters(lines_node) },
          { "matching; these are also names of `match_images lines --set name=value`", parameters(lines) } } },
      { "scene_matcher",
        { { "the node", parameters(scene_node) },
          { "matching; these are also names of `match_images scene --set name=value`", parameters(scene) } } },
      { "view_recognizer",
        { { "the node", nodeParameters(recognizer) },
          { "recognition; its verification has the parameters of scene_matcher as well",
            recognitionParameters(recognizer.recognition) } } },
      { "homing", { { "the node, homing and the base", parameters(homing) } } },
      { "route_follower",
        { { "when it goes on to the next view", parameters(follower.guide) },
          { "the node, homing and the base, as of homing", homingParameters(follower) } } },
      { "route_recorder", { { "the node", parameters(route_recorder) } } },
      { "homography_tracker", { { "the node and tracking", parameters(tracker) } } },
      { "servo_25d", { { "the node, servoing and the camera's motion", parameters(servo) } } },
    };
  }

  /** Headings and tables of the files in docs/. */
  std::vector<std::pair<std::string, Sections>> documented()
  {
    return {
      { "parameters",
        { { "## Matchers", parameters(points_node) },
          { "## Points", parameters(points) },
          { "## Lines", parameters(lines) },
          { "## Scenes", sceneParameters(scene) } } },
      { "parameters_of_drivers",
        { { "## Homing", parameters(homing) },
          { "## Homography tracker", parameters(tracker) },
          { "## 2.5D servoing", parameters(servo) },
          { "## View store", parameters(store) } } },
      { "routes",
        { { "## Parameters of `route_recorder`", parameters(route_recorder) },
          { "## Parameters of `route_follower`", parameters(follower.guide) },
          { "## Parameters of `run_route`", parameters(route_run) } } },
      { "simulation",
        { { "## Parameters of both", parameters(simulation) },
          { "## Parameters of `nomad_sim`", parameters(nomad) },
          { "## Parameters of `puma_sim`", parameters(puma) },
          { "## Parameters of `run_homing`", parameters(homing_run) },
          { "## Parameters of `run_arm`", parameters(arm_run) } } },
    };
  }
};

/** "meaning [unit], range" */
std::string meaning(const Parameter& parameter)
{
  const std::string words = parameter.type.find('|') == std::string::npos ? "" : " (" + parameter.type + ")";
  return parameter.description + words + (parameter.unit.empty() ? "" : " [" + parameter.unit + "]") +
         (parameter.range.empty() ? "" : ", " + parameter.range);
}

std::string commented(const std::string& text)
{
  constexpr std::size_t WIDTH = 120;
  std::istringstream words(text);
  std::string result;
  std::string line = "#";
  for (std::string word; words >> word; line += " " + word)
  {
    if (line.size() + 1 + word.size() > WIDTH)
    {
      result += line + "\n";
      line = "#";
    }
  }
  return result + line + "\n";
}

std::string yamlOf(const std::string& node, const Tables::Sections& sections)
{
  std::string text = commented("Parameters of the node " + node +
                               ", at their defaults. Above each stands what it means, [its unit] and its range. "
                               "docs/parameters.md and docs/parameters_of_drivers.md say which to turn.");
  for (const auto& [title, table] : sections)
  {
    text += "\n# --- " + title + "\n";
    for (const Parameter& parameter : table)
    {
      const std::string value = parameter.get();
      text += "\n" + commented(meaning(parameter)) + parameter.name + ": " + (value.empty() ? "\"\"" : value) + "\n";
    }
  }
  return text;
}

std::string rowsOf(const std::vector<Parameter>& table)
{
  std::string text = "| name | type | default | unit | range | meaning |\n|---|---|---|---|---|---|\n";
  for (const Parameter& parameter : table)
  {
    std::string type = parameter.type;
    for (std::size_t at = 0; (at = type.find('|', at)) != std::string::npos;)
    {
      type.replace(at, 1, ", ");
    }
    const std::string value = parameter.get();
    text += "| `" + parameter.name + "` | " + type + " | " + (value.empty() ? "\"\"" : value) + " | " + parameter.unit +
            " | " + parameter.range + " | " + parameter.description + " |\n";
  }
  return text;
}

/** Compares, or writes where that is asked for. */
void expectText(const std::string& file, const std::string& text)
{
  if (std::getenv("VIEW_SERVO_UPDATE") != nullptr)
  {
    test::writeText(file, text);
  }
  EXPECT_EQ(test::readText(file), text) << "run this test with VIEW_SERVO_UPDATE=1 to write " << file << " anew";
}

TEST(Config, FilesSayWhatTheTablesSay)
{
  Tables tables;
  for (const auto& [node, sections] : tables.files())
  {
    expectText(PACKAGE_DIR "/config/" + node + ".yaml", yamlOf(node, sections));
  }
}

TEST(Config, FilesHoldTheDefaults)
{
  Tables tables;
  for (const auto& [node, sections] : tables.files())
  {
    SCOPED_TRACE(node);
    const YAML::Node config = YAML::LoadFile(PACKAGE_DIR "/config/" + node + ".yaml");
    std::size_t count = 0;
    for (const auto& section : sections)
    {
      count += section.second.size();
      for (const Parameter& parameter : section.second)
      {
        ASSERT_TRUE(config[parameter.name]) << parameter.name;
        const std::string standard = parameter.get();
        EXPECT_TRUE(parameter.set(config[parameter.name].as<std::string>())) << parameter.name;
        EXPECT_EQ(parameter.get(), standard) << parameter.name;
      }
    }
    EXPECT_EQ(config.size(), count) << "as many names as parameters";
  }
}

TEST(Config, DocumentedTablesAreThoseOfTheSources)
{
  Tables tables;
  for (const auto& [document, sections] : tables.documented())
  {
    const std::string file = PACKAGE_DIR "/docs/" + document + ".md";
    std::string text = test::readText(file);
    for (const auto& [heading, table] : sections)
    {
      const std::size_t section = text.find("\n" + heading + "\n");
      ASSERT_NE(section, std::string::npos) << heading;
      const std::size_t begin = text.find("\n| name |", section) + 1;
      ASSERT_NE(begin, 0U) << heading;
      const std::size_t end = text.find("\n\n", begin);
      text.replace(begin, (end == std::string::npos ? text.size() : end + 1) - begin, rowsOf(table));
    }
    expectText(file, text);
  }
}

TEST(Config, DefaultsAreValidAndNamesUnique)
{
  Tables tables;
  for (const auto& [document, sections] : tables.documented())
  {
    for (const auto& [heading, table] : sections)
    {
      SCOPED_TRACE(heading);
      EXPECT_EQ(faultsOf(table), std::vector<std::string>());
      std::set<std::string> names;
      for (const Parameter& parameter : table)
      {
        EXPECT_TRUE(names.insert(parameter.name).second) << parameter.name;
        EXPECT_FALSE(parameter.description.empty()) << parameter.name;
      }
    }
  }
  EXPECT_EQ(tables.points_node.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.points.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.lines.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.scene.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.homing.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.follower.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.route_recorder.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.tracker.validate(), std::vector<std::string>());
  EXPECT_EQ(tables.servo.validate(), std::vector<std::string>());
}

}  // namespace
}  // namespace view_servo
