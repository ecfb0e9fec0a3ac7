// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/corner_error.h"
#include "support/program_run.h"
#include "support/temporary_directory.h"
#include "support/textured_plane.h"
#include "test_paths.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cstddef>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** @file Runs the program match_images itself, as a shell does. */

using nlohmann::json;

/** exampleHomography(), as a file of --truth has it. */
constexpr char TRUTH[] = "0.87 -0.12 50\n0.09 0.93 -5\n-2e-4 1e-4 1\n";

/** The matrix of a result, as JSON has it. */
inline Eigen::Matrix3d matrixOf(const json& numbers)
{
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 9; ++i)
  {
    matrix(i / 3, i % 3) = numbers.at(static_cast<std::size_t>(i));
  }
  return matrix;
}

/** Of the matrix of a result, against the truth [px]. */
inline double cornerError(const json& result)
{
  return cornerError(matrixOf(result.at("matrix")), exampleHomography());
}

/** Two pictures of a plane, from two sides, in a directory for files, and the program that is to match them. */
class MatchImagesTest : public ::testing::Test
{
protected:
  MatchImagesTest()
  {
    reference_ = write("reference.png", texturedPicture(1));
    current_ = write("current.png", warpedPicture(texturedPicture(1), exampleHomography(), { 480, 360 }));
  }

  std::string path(const std::string& name) const
  {
    return directory_.path() / name;
  }

  std::string write(const std::string& name, const cv::Mat& image) const
  {
    EXPECT_TRUE(cv::imwrite(path(name), image));
    return path(name);
  }

  std::string writeText(const std::string& name, const std::string& text) const
  {
    return test::writeText(path(name), text);
  }

  static ProgramRun run(const std::vector<std::string>& arguments)
  {
    return runProgram(MATCH_IMAGES_PATH, arguments);
  }

  ProgramRun match(const std::string& reference, const std::string& current,
                   const std::vector<std::string>& more = {}) const
  {
    std::vector<std::string> arguments{ "points", reference, current };
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }

  json matchJson(const std::string& reference, const std::string& current, int expected_status,
                 std::vector<std::string> more = {}) const
  {
    more.emplace_back("--json");
    const ProgramRun outcome = match(reference, current, more);
    EXPECT_EQ(outcome.status, expected_status) << outcome.out;
    EXPECT_EQ(outcome.err, "");
    return json::parse(outcome.out);
  }

  std::string reference_;
  std::string current_;

private:
  TemporaryDirectory directory_;
};

}  // namespace test
}  // namespace view_servo
