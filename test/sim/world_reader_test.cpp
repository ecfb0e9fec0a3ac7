// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/world_reader.h"

#include "sim/nomad.h"
#include "sim/renderer.h"
#include "support/shipped_files.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/thrown_message.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo::sim
{
namespace
{
namespace fs = std::filesystem;

std::vector<std::string> worldFiles()
{
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(test::WORLDS_DIRECTORY))
  {
    if (entry.path().extension() == ".yaml")
    {
      files.push_back(entry.path().string());
    }
  }
  return files;
}

/** Part of the image that shows edges: a world that is nearly bare is of no use. */
double structure(const cv::Mat& image)
{
  cv::Mat edges;
  cv::Canny(image, edges, 40.0, 100.0);
  return static_cast<double>(cv::countNonZero(edges)) / static_cast<double>(image.total());
}

const char* const SMALL_WORLD =
    "robot: {kind: nomad, camera_height: 1.0}\n"
    "camera: {fx: 500}\n"
    "textures:\n"
    "  grey: {kind: plain}\n"
    "boxes:\n"
    "  - {name: post, size: [0.2, 0.2, 1], position: [1, 0, 0], texture: grey}\n"
    "goal: {x: 0, y: 0}\n";

/** What reading a world says that differs from the small one in one place. */
std::string faultOf(const std::string& from, const std::string& to)
{
  const test::TemporaryDirectory directory;
  const std::string file = test::writeText(directory.path() / "world.yaml", test::edited(SMALL_WORLD, from, to));
  return test::thrownMessage<std::invalid_argument>([&] { readWorld(file); });
}

}  // namespace

class ShippedWorldTest : public testing::TestWithParam<std::string>
{
};

TEST_P(ShippedWorldTest, CanBeSeenFromItsGoalAndStarts)
{
  const World world = readWorld(GetParam());
  EXPECT_EQ(world.name, fs::path(GetParam()).stem().string());
  SimulatedCamera camera(world, {}, 1);
  std::vector<Eigen::Isometry3d> poses = { world.goal };
  for (const auto& [name, pose] : world.starts)
  {
    poses.push_back(pose);
  }
  EXPECT_GE(world.starts.size(), 3U);
  EXPECT_FALSE(world.trajectories.empty());
  for (const Eigen::Isometry3d& pose : poses)
  {
    const bool nomad = world.robot == RobotKind::NOMAD;
    if (nomad)
    {
      NomadParams params;
      EXPECT_NO_THROW(Nomad(world, params).setPose(pose));
    }
    const cv::Mat image = camera.capture(nomad ? Eigen::Isometry3d(pose * world.camera_on_base) : pose);
    EXPECT_EQ(image.size(), cv::Size(world.camera.width, world.camera.height));
    EXPECT_GT(structure(image), 0.02) << world.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Config, ShippedWorldTest, testing::ValuesIn(worldFiles()),
                         [](const testing::TestParamInfo<std::string>& file) {
                           return fs::path(file.param).stem().string();
                         });

TEST(WorldReader, PutsTheCameraOnTheBase)
{
  const test::TemporaryDirectory directory;
  const std::string file =
      test::writeText(directory.path() / "world.yaml",
                      test::edited(SMALL_WORLD, "camera_height: 1.0", "camera_height: 0.6, camera_ahead: -0.15"));
  EXPECT_EQ(readWorld(file).camera_on_base.translation(), Eigen::Vector3d(-0.15, 0.0, 0.6));
}

TEST(WorldReader, FaultsNameFileAndLine)
{
  EXPECT_EQ(faultOf("fx: 500", "fx: 500"), "");
  const auto expectFault = [](const std::string& from, const std::string& to, const std::string& line,
                              const std::string& what) {
    const std::string fault = faultOf(from, to);
    EXPECT_NE(fault.find("world.yaml: line " + line), std::string::npos) << fault;
    EXPECT_NE(fault.find(what), std::string::npos) << fault;
  };
  expectFault("kind: nomad", "kind: tank", "1", "unknown kind of robot 'tank'");
  expectFault("camera_height: 1.0", "camera_height: -1.0", "1", "camera_height must be positive");
  expectFault("camera_height: 1.0", "camera_ahead: .inf", "1", "camera_ahead must be finite");
  expectFault("fx: 500", "fxx: 500", "2", "unknown key 'fxx'");
  expectFault("fx: 500", "fx: .nan", "2", "fx must be finite");
  expectFault("fx: 500", "width: 640.5", "2", "whole numbers");
  expectFault("fx: 500", "supersampling: 9", "2", "supersampling must lie in [1, 4]");
  expectFault("kind: plain", "kind: marble", "4", "unknown kind of picture 'marble'");
  expectFault("kind: plain", "file: nowhere.png", "4", "nowhere.png");
  expectFault("[0.2, 0.2, 1]", "[0.2, 0.2]", "6", "size must be a list of 3 numbers");
  expectFault("[0.2, 0.2, 1]", "[0.2, 0, 1]", "6", "sides must be positive");
  expectFault("texture: grey}", "texture: green}", "6", "there is no texture 'green'");
  expectFault("texture: grey}", "texture: grey, copies: {count: 0, step: [1, 0, 0]}}", "6", "count");
  expectFault("{x: 0, y: 0}", "{x: 0}", "7", "needs 'y'");
  expectFault("goal:", "gaol:", "7", "unknown key 'gaol'");
  expectFault("goal:", "rectangles: {size: [1, 1]}\ngoal:", "7", "'rectangles' must be a list");
  expectFault("goal:", "starts: [here]\ngoal:", "7", "'starts' must be a map of names");
  expectFault("goal:", "starts: 5\ngoal:", "7", "'starts' must be a map of names");
  expectFault("goal:", "trajectories: {there: {x: 0, y: 0, time: 0}}\ngoal:", "7", "must be a list of waypoints");
  EXPECT_NE(faultOf("goal: {x: 0, y: 0}\n", "").find("needs 'goal'"), std::string::npos);
  EXPECT_NE(faultOf("kind: nomad, ", "kind: [nomad, ").find("world.yaml"), std::string::npos);
  for (const char* region : { "[1e300, 0, 9, 9]", "[0, 0, 9, 1e300]", "[-1, 0, 9, 9]", "[0.5, 0, 9, 9]",
                              "[0, 0, 641, 9]", "[2147483647, 0, 2147483647, 9]", "[0, 0, 0, 9]" })
  {
    const std::string line = "region: " + std::string(region) + "\n";
    expectFault("goal:", line + "goal:", "7",
                "'region' must be [x, y, width, height] in whole pixels, within the image");
  }
  EXPECT_EQ(faultOf("goal:", "region: [1, 2, 639, 478]\ngoal:"), "");
  EXPECT_THROW(readWorld("/nowhere/world.yaml"), std::invalid_argument);
}

}  // namespace view_servo::sim
