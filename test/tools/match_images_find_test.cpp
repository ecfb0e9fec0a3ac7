// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "match_images_test.h"

#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** A folder of the views, and what a camera sees of one of them. */
class MatchImagesFindTest : public MatchImagesTest
{
protected:
  MatchImagesFindTest()
  {
    std::filesystem::create_directory(path("views"));
    for (int scene = 1; scene <= 4; ++scene)
    {
      write("views/scene" + std::to_string(scene) + ".png", texturedPicture(static_cast<std::uint64_t>(scene)));
    }
    write("now.png", seen(3));
    write("elsewhere.png", seen(9));
  }

  static cv::Mat seen(std::uint64_t scene)
  {
    const cv::Mat picture = texturedPicture(scene);
    return warpedPicture(picture, exampleHomography(), picture.size());
  }
};

TEST_F(MatchImagesFindTest, PrintsJsonOfNamesThatAreNotUtf8)
{
  write("views/caf\xe9.png", texturedPicture(5));
  const ProgramRun outcome = run({ "find", path("views"), path("now.png"), "--json", "--max", "9" });
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(json::parse(outcome.out)["indexed"], 5);
}

TEST_F(MatchImagesFindTest, NamesTheImageFileThatShowsTheScene)
{
  const ProgramRun outcome = run({ "find", path("views"), path("now.png"), "--json", "--max", "2" });
  ASSERT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(outcome.out);
  EXPECT_TRUE(result["success"].get<bool>());
  EXPECT_EQ(result["indexed"], 4);
  ASSERT_GE(result["views"].size(), 1U);
  ASSERT_LE(result["views"].size(), 2U);
  EXPECT_EQ(result["views"][0]["view"], "scene3.png");
  EXPECT_TRUE(result["views"][0]["verified"].get<bool>());
  EXPECT_GT(result["views"][0]["inliers"].get<int>(), 20);
  EXPECT_GT(result["elapsed_ms"]["total"].get<double>(), 0.0);
  const ProgramRun text = run({ "find", path("views"), path("now.png"), "--max", "1" });
  EXPECT_EQ(text.status, 0);
  EXPECT_EQ(text.out.rfind("scene3.png: score ", 0), 0U) << text.out;
}

TEST_F(MatchImagesFindTest, FindsStoredViewsAndLeavesTheFolderAsItIs)
{
  const ViewStore store(path("stored"));
  for (const std::uint64_t scene : { 3U, 4U })
  {
    StoredView view;
    view.name = "place" + std::to_string(scene);
    view.image = texturedPicture(scene);
    store.save(view, false);
  }
  const ProgramRun outcome = run({ "find", path("stored"), path("now.png"), "--max", "1" });
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out.rfind("place3: ", 0), 0U) << outcome.out;
  EXPECT_FALSE(std::filesystem::exists(path("stored/views.index")));
}

TEST_F(MatchImagesFindTest, FindsNoneForAnUnknownScene)
{
  const ProgramRun outcome = run({ "find", path("views"), path("elsewhere.png"), "--json" });
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  const json result = json::parse(outcome.out);
  EXPECT_FALSE(result["success"].get<bool>());
  for (const json& view : result["views"])
  {
    EXPECT_FALSE(view["verified"].get<bool>());
  }
}

TEST_F(MatchImagesFindTest, NamesFilesThatItLeavesOut)
{
  writeText("views/bad.png", "no image");
  const ProgramRun outcome = run({ "find", path("views"), path("now.png") });
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("bad.png"), std::string::npos) << outcome.out;
}

TEST_F(MatchImagesFindTest, RefusesBadInputInOneLine)
{
  std::filesystem::create_directory(path("empty"));
  const std::vector<std::pair<std::vector<std::string>, std::string>> faults{
    { { "find" }, "DIR" },
    { { "find", path("views") }, "CUR" },
    { { "find", path("none"), path("now.png") }, "none" },
    { { "find", path("now.png"), path("now.png") }, "no folder" },
    { { "find", path("empty"), path("now.png") }, "empty" },
    { { "find", path("views"), path("nothing.png") }, "nothing.png" },
    { { "find", path("views"), path("now.png"), "more" }, "more" },
    { { "find", path("views"), path("now.png"), "--max", "0" }, "max" },
    { { "find", path("views"), path("now.png"), "--set", "candidates=0" }, "candidates" },
    { { "find", path("views"), path("now.png"), "--set", "nonsense=1" }, "nonsense" },
  };
  for (const auto& [arguments, named] : faults)
  {
    const ProgramRun outcome = run(arguments);
    EXPECT_EQ(outcome.status, 2) << named;
    EXPECT_NE(outcome.err.find(named), std::string::npos) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

}  // namespace
}  // namespace test
}  // namespace view_servo
