// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "match_images_test.h"

#include "view_servo/geometry/homography.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** A plane full of straight edges, from two sides. */
class MatchImagesLinesTest : public MatchImagesTest
{
protected:
  MatchImagesLinesTest()
  {
    const cv::Mat picture = texturedPicture(1);
    reference_ = write("lines_reference.png", picture);
    current_ = write("lines_current.png", warpedPicture(picture, exampleHomography(), picture.size()));
  }

  ProgramRun matchLines(const std::vector<std::string>& more = {}) const
  {
    std::vector<std::string> arguments{ "lines", reference_, current_ };
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }

  json linesJson(int expected_status, std::vector<std::string> more = {}) const
  {
    more.emplace_back("--json");
    const ProgramRun outcome = matchLines(more);
    EXPECT_EQ(outcome.status, expected_status) << outcome.out << outcome.err;
    EXPECT_EQ(outcome.err, "");
    return json::parse(outcome.out, nullptr, false);
  }

  /** Writes segments, each a JSON array of four numbers, in the order given. */
  std::string writeSegments(const std::string& name, const std::vector<json>& segments) const
  {
    std::ostringstream text;
    text.precision(17);
    for (const json& segment : segments)
    {
      text << segment[0] << ' ' << segment[1] << '\t' << segment[2] << ' ' << segment[3] << " \n";
    }
    return writeText(name, text.str());
  }

  std::string randomSegments(const std::string& name, int count) const
  {
    std::mt19937 rng(5);
    std::ostringstream text;
    const auto random = [&](int first, int last) {
      return first + static_cast<int>(rng() % static_cast<unsigned>(last - first));
    };
    for (int i = 0; i < count; ++i)
    {
      const int x = random(-100, 580);
      const int y = random(-100, 460);
      text << x << ' ' << y << ' ' << x + random(1, 80) << ' ' << y + random(-80, 80) << '\n';
    }
    return writeText(name, text.str());
  }
};

/** Distance of a point from the line through a segment [px]. */
double distanceToLine(const cv::Point2d& point, const json& segment)
{
  const cv::Point2d start(segment[0], segment[1]);
  const cv::Point2d along = cv::Point2d(segment[2], segment[3]) - start;
  return std::abs(along.cross(point - start)) / cv::norm(along);
}

/** Where exampleHomography() sends the ends of a segment. */
std::vector<cv::Point2d> trueEnds(const json& segment)
{
  std::vector<cv::Point2d> ends;
  for (const std::size_t i : { 0U, 2U })
  {
    const Eigen::Vector2d end = transfer(exampleHomography(), Eigen::Vector2d(segment[i], segment[i + 1]));
    ends.emplace_back(end.x(), end.y());
  }
  return ends;
}

bool isEitherWay(const json& reported, const json& written)
{
  const json reversed{ written[2], written[3], written[0], written[1] };
  return reported == written || reported == reversed;
}

TEST_F(MatchImagesLinesTest, FindsAPlane)
{
  const ProgramRun outcome = matchLines();
  EXPECT_EQ(outcome.status, 0) << outcome.out;
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("homography"), std::string::npos) << outcome.out;
  const json pairs = linesJson(0, { "--groups", "pairs" });
  EXPECT_LT(cornerError(pairs), 2.0);
}

/** It matches as line_matcher does, whose answers name too little light, and which refuses mirrored images. */
TEST_F(MatchImagesLinesTest, SaysThatAPictureIsBlack)
{
  const std::string black = write("black.png", cv::Mat::zeros(360, 480, CV_8UC1));
  const ProgramRun outcome = run({ "lines", reference_, black });
  EXPECT_EQ(outcome.status, 1);
  EXPECT_NE((outcome.out + outcome.err).find("black"), std::string::npos) << outcome.out << outcome.err;
}

TEST_F(MatchImagesLinesTest, JsonHasEveryField)
{
  const json result = linesJson(0);
  EXPECT_EQ(result.at("success"), true);
  EXPECT_TRUE(result.at("message").is_string());
  EXPECT_EQ(result.at("model"), "homography");
  EXPECT_LT(cornerError(result), 2.0);
  EXPECT_GT(result.at("rms_error").get<double>(), 0.0);
  EXPECT_GT(result.at("inliers").get<int>(), 20);
  EXPECT_TRUE(result.at("fundamental").is_null()) << "one plane leaves it open";
  ASSERT_GE(result.at("planes").size(), 1U);
  EXPECT_EQ(result.at("planes").at(0), result.at("matrix"));

  double stages = 0.0;
  for (const auto& [name, ms] : result.at("elapsed_ms").items())
  {
    stages += name == "total" ? 0.0 : ms.get<double>();
  }
  EXPECT_GT(result.at("elapsed_ms").at("segments").get<double>(), 0.0);
  EXPECT_NEAR(result.at("elapsed_ms").at("total").get<double>(), stages, 0.1 * stages);

  double last_score = 1.0;
  int on_plane = 0;
  int right = 0;
  const json& matches = result.at("matches");
  for (const json& line : matches)
  {
    EXPECT_LE(line.at("score").get<double>(), last_score) << "best first";
    last_score = line.at("score");
    EXPECT_GE(line.at("reference_index").get<int>(), 0);
    EXPECT_GE(line.at("current_index").get<int>(), 0);
    EXPECT_LT(line.at("plane").get<int>(), static_cast<int>(result.at("planes").size()));
    on_plane += line.at("plane") == 0 ? 1 : 0;
    const std::vector<cv::Point2d> ends = trueEnds(line.at("reference"));
    const json& current = line.at("current");
    const cv::Point2d along(current[2].get<double>() - current[0].get<double>(),
                            current[3].get<double>() - current[1].get<double>());
    const bool same_sense = along.dot(ends[1] - ends[0]) > 0.0;
    right += same_sense && distanceToLine(ends[0], current) < 4.0 && distanceToLine(ends[1], current) < 4.0 ? 1 : 0;
  }
  EXPECT_EQ(result.at("inliers"), on_plane);
  EXPECT_GT(matches.size(), 30U);
  EXPECT_GT(right, 0.9 * static_cast<double>(matches.size()));

  EXPECT_GT(result.at("points").size(), 10U);
  for (const json& point : result.at("points"))
  {
    EXPECT_EQ(point.at("reference").size(), 2U);
    EXPECT_EQ(point.at("current").size(), 2U);
    EXPECT_TRUE(point.at("score").is_number());
    EXPECT_TRUE(point.at("inlier").is_boolean());
  }
}

TEST_F(MatchImagesLinesTest, GivesTheSameBytesAgain)
{
  json first = linesJson(0);
  json one_thread = linesJson(0, { "--threads", "1" });
  first.erase("elapsed_ms");
  one_thread.erase("elapsed_ms");
  EXPECT_EQ(first.dump(), one_thread.dump());
}

TEST_F(MatchImagesLinesTest, ListsLinesWhenTheyLeaveTheModelOpen)
{
  const json result = linesJson(1, { "--model", "fundamental" });
  EXPECT_EQ(result.at("success"), false);
  EXPECT_EQ(result.at("model"), "fundamental");
  EXPECT_TRUE(result.at("matrix").is_null());
  EXPECT_GT(result.at("matches").size(), 30U);
  EXPECT_FALSE(result.at("message").get<std::string>().empty());
}

TEST_F(MatchImagesLinesTest, TakesSegmentsFromFiles)
{
  // What was detected and matched, in an order of our own and every other one turned round.
  std::vector<json> reference;
  std::vector<json> current;
  const json detected = linesJson(0);
  for (const json& line : detected.at("matches"))
  {
    const json& at = line.at("reference");
    reference.push_back(reference.size() % 2 == 0 ? at : json{ at[2], at[3], at[0], at[1] });
    current.push_back(line.at("current"));
  }
  std::mt19937 rng(3);
  std::shuffle(reference.begin(), reference.end(), rng);
  std::shuffle(current.begin(), current.end(), rng);
  const std::string reference_file = writeSegments("reference.txt", reference);
  const std::string current_file = writeSegments("current.txt", current);

  const json both = linesJson(0, { "--segments-ref", reference_file, "--segments-cur", current_file });
  EXPECT_GT(both.at("matches").size(), 0.7 * static_cast<double>(reference.size()));
  for (const json& line : both.at("matches"))
  {
    EXPECT_TRUE(isEitherWay(line.at("reference"), reference.at(line.at("reference_index").get<std::size_t>())));
    EXPECT_TRUE(isEitherWay(line.at("current"), current.at(line.at("current_index").get<std::size_t>())));
  }
  EXPECT_LT(cornerError(both), 2.0);

  const json only_reference = linesJson(0, { "--segments-ref", reference_file });
  for (const json& line : only_reference.at("matches"))
  {
    EXPECT_TRUE(isEitherWay(line.at("reference"), reference.at(line.at("reference_index").get<std::size_t>())));
  }
  const json only_current = linesJson(0, { "--segments-cur", current_file });
  for (const json& line : only_current.at("matches"))
  {
    EXPECT_TRUE(isEitherWay(line.at("current"), current.at(line.at("current_index").get<std::size_t>())));
  }
}

TEST_F(MatchImagesLinesTest, CountsSegmentsNotLinesOfTheFile)
{
  std::vector<json> reference;
  std::ostringstream text;
  text.precision(17);
  text << "# remark\n";
  const json detected = linesJson(0);
  for (const json& line : detected.at("matches"))
  {
    const json& segment = line.at("reference");
    reference.push_back(segment);
    text << "\n" << segment[0] << ' ' << segment[1] << ' ' << segment[2] << ' ' << segment[3] << "\n# another\n";
  }
  const json result = linesJson(0, { "--segments-ref", writeText("spaced.txt", text.str()) });
  for (const json& line : result.at("matches"))
  {
    EXPECT_TRUE(isEitherWay(line.at("reference"), reference.at(line.at("reference_index").get<std::size_t>())));
  }
}

TEST_F(MatchImagesLinesTest, NamesFaultsInSegmentFiles)
{
  const std::string missing = path("none.txt");
  for (const std::string option : { "--segments-ref", "--segments-cur" })
  {
    expectBadInput(matchLines({ option, missing }), missing);
    expectBadInput(matchLines({ option, path(".") }), path("."));
    for (const std::string bad : { "1 2 3", "1 2 3 4 5", "1 2 3 x", "nan 2 3 4", "1 2 3 inf", "7 8 7 8", "1 2 3 1e9" })
    {
      const std::string file = writeText("bad.txt", "10 10 50 50\n\n" + bad + "\n");
      const ProgramRun outcome = matchLines({ option, file });
      expectBadInput(outcome, file);
      expectBadInput(outcome, "line 3 ");
    }
  }
}

TEST_F(MatchImagesLinesTest, FindsNothingWithFewSegments)
{
  for (const std::string text : { "", "# none\n", "100 100 200 150\n", "-900 -900 -800 -800\n" })
  {
    const std::string file = writeText("few.txt", text);
    for (const std::string option : { "--segments-ref", "--segments-cur" })
    {
      const json result = linesJson(1, { option, file });
      EXPECT_EQ(result.at("success"), false);
      EXPECT_TRUE(result.at("matrix").is_null());
      EXPECT_TRUE(result.at("rms_error").is_null());
      EXPECT_TRUE(result.at("matches").empty());
      EXPECT_TRUE(result.at("points").empty());
      EXPECT_TRUE(result.at("planes").empty());
      EXPECT_NE(result.at("message").get<std::string>().find("too few"), std::string::npos);
    }
  }
}

TEST_F(MatchImagesLinesTest, AnswersForManyRandomSegments)
{
  const json result =
      linesJson(1, { "--segments-ref", randomSegments("many.txt", 5000), "--segments-cur", path("many.txt") });
  EXPECT_EQ(result.at("success"), false);
}

TEST_F(MatchImagesLinesTest, SurvivesSegmentsFarOutside)
{
  std::string text;
  for (int i = 0; i < 40; ++i)
  {
    const std::string n = std::to_string(i);
    text += "-1e6 " + n + " 1e6 -" + n + "\n" + n + "00 -1e6 -5 1e6\n1e6 1e6 999999 99" + n + "\n";
  }
  const std::string file = writeText("far.txt", text);
  EXPECT_EQ(matchLines({ "--segments-ref", file, "--overlay", path("far.png") }).status, 1);
  EXPECT_EQ(matchLines({ "--segments-cur", file }).status, 1);
}

TEST_F(MatchImagesLinesTest, WritesAnOverlay)
{
  const ProgramRun outcome = matchLines({ "--overlay", path("overlay.png") });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.out.find(path("overlay.png")), std::string::npos);
  const cv::Mat picture = cv::imread(path("overlay.png"));
  EXPECT_GE(picture.cols, 960);
  EXPECT_GT(picture.rows, 360);
  expectBadInput(matchLines({ "--overlay", path("none/overlay.png") }), path("none/overlay.png"));
}

TEST_F(MatchImagesLinesTest, ComparesWithTheTruth)
{
  writeText("truth.txt", TRUTH);
  const json result = linesJson(0, { "--truth", path("truth.txt") });
  EXPECT_NEAR(result.at("mean_corner_error").get<double>(), cornerError(result), 1e-6);
}

TEST_F(MatchImagesLinesTest, TakesParameters)
{
  const json few = linesJson(0, { "--set", "max_segments=150", "segment_min_length=20" });
  for (const json& line : few.at("matches"))
  {
    EXPECT_LT(line.at("reference_index").get<int>(), 150);
    const json& at = line.at("reference");
    EXPECT_GE(std::hypot(at[2].get<double>() - at[0].get<double>(), at[3].get<double>() - at[1].get<double>()), 20.0);
  }
  const ProgramRun outcome = run({ "--list-parameters" });
  EXPECT_NE(outcome.out.find("line_order (contrast|upright, default contrast): "), std::string::npos) << outcome.out;

  expectBadInput(matchLines({ "--set", "max_corners=100" }), "max_corners");
  expectBadInput(matchLines({ "--set", "detector=hough" }), "detector");
  expectBadInput(matchLines({ "--set", "edge_sigma=0" }), "edge_sigma");
  expectBadInput(matchLines({ "--set", "min_plane_lines=1" }), "min_plane_lines");
}

TEST_F(MatchImagesLinesTest, RefusesUnknownOptions)
{
  expectBadInput(run({ "lines" }), "REF");
  expectBadInput(matchLines({ "--groups", "quartets" }), "--groups");
  expectBadInput(matchLines({ "--model", "affine" }), "--model");
  expectBadInput(matchLines({ "--segments-ref" }), "--segments-ref");
  expectBadInput(run({ "points", reference_, current_, "--groups", "pairs" }), "--groups");
  EXPECT_NE(run({ "lines", "--help" }).out.find("--segments-cur"), std::string::npos);
}

TEST_F(MatchImagesLinesTest, RefusesFilesThatAreNotImages)
{
  const std::string text = writeText("text.png", "not an image\n");
  expectBadInput(run({ "lines", reference_, text }), text);
  expectBadInput(run({ "lines", text, current_ }), text);
}

TEST_F(MatchImagesLinesTest, FindsNothingInUnrelatedOrConstantImages)
{
  const std::string constant = write("constant.png", cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)));
  const std::string other = write("other.png", texturedPicture(2));
  for (const std::string& file : { constant, other })
  {
    const ProgramRun outcome = run({ "lines", reference_, file, "--overlay", path("overlay.png") });
    EXPECT_EQ(outcome.status, 1) << outcome.out;
    EXPECT_EQ(outcome.err, "");
    EXPECT_FALSE(cv::imread(path("overlay.png")).empty()) << "a picture says why";
  }
}

}  // namespace
}  // namespace test
}  // namespace view_servo
