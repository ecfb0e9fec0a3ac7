// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "match_images_test.h"

#include "support/room_corner.h"
#include "view_servo/geometry/homography.h"

#include <gtest/gtest.h>
#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
TEST_F(MatchImagesTest, FindsAHomography)
{
  const ProgramRun outcome = match(reference_, current_);
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("homography"), std::string::npos) << outcome.out;
  EXPECT_LT(cornerError(matchJson(reference_, current_, 0)), 1.0);
}

TEST_F(MatchImagesTest, JsonHasEveryField)
{
  const json result = matchJson(reference_, current_, 0);
  EXPECT_EQ(result.at("success"), true);
  EXPECT_TRUE(result.at("message").is_string());
  EXPECT_EQ(result.at("model"), "homography");
  EXPECT_EQ(result.at("matrix").size(), 9U);
  EXPECT_EQ(result.at("matrix").at(8), 1.0);
  EXPECT_GT(result.at("rms_error").get<double>(), 0.0);
  EXPECT_GT(result.at("elapsed_ms").at("total").get<double>(), 0.0);
  EXPECT_GT(result.at("elapsed_ms").size(), 3U);
  for (const json& time : result.at("elapsed_ms"))
  {
    EXPECT_TRUE(time.is_number());
  }

  int inliers = 0;
  int close_inliers = 0;
  double last_score = INFINITY;
  for (const json& pair : result.at("matches"))
  {
    EXPECT_LE(pair.at("score").get<double>(), last_score) << "best first";
    last_score = pair.at("score");
    ASSERT_EQ(pair.at("reference").size(), 2U);
    ASSERT_EQ(pair.at("current").size(), 2U);
    if (pair.at("inlier").get<bool>())
    {
      const Eigen::Vector2d from(pair["reference"][0], pair["reference"][1]);
      const Eigen::Vector2d to(pair["current"][0], pair["current"][1]);
      close_inliers += (transfer(exampleHomography(), from) - to).norm() < 4.0 ? 1 : 0;
      ++inliers;
    }
  }
  EXPECT_EQ(result.at("inliers"), inliers);
  EXPECT_GT(inliers, 50);
  EXPECT_GT(close_inliers, 0.95 * inliers);
}

TEST_F(MatchImagesTest, AFullDiskIsNoSuccess)
{
  for (const char* more : { "", " --json" })
  {
    const std::string command =
        std::string(MATCH_IMAGES_PATH) + " points " + reference_ + " " + current_ + more + " > /dev/full";
    expectBadInput(runProgram("/bin/sh", { "-c", command }), "standard output");
  }
}

TEST_F(MatchImagesTest, GivesTheSameBytesAgain)
{
  json first = matchJson(reference_, current_, 0);
  json second = matchJson(reference_, current_, 0);
  json one_thread = matchJson(reference_, current_, 0, { "--threads", "1" });
  for (json* result : { &first, &second, &one_thread })
  {
    result->erase("elapsed_ms");
  }
  EXPECT_EQ(first.dump(), second.dump());
  EXPECT_EQ(first.dump(), one_thread.dump());
}

TEST_F(MatchImagesTest, FindsAFundamentalMatrix)
{
  // Two planes at different depths: the lower half moves twice as far as the upper one.
  const cv::Mat scene = texturedPicture(1);
  cv::Mat moved = scene.clone();
  for (int half = 0; half < 2; ++half)
  {
    const cv::Rect rows(0, half * 180, 480, 180);
    const cv::Matx23d shift(1.0, 0.0, half == 0 ? 12.0 : 24.0, 0.0, 1.0, 0.0);
    cv::warpAffine(scene(rows), moved(rows), shift, rows.size(), cv::INTER_LINEAR, cv::BORDER_REFLECT);
  }
  const json result = matchJson(reference_, write("moved.png", moved), 0, { "--model", "fundamental" });
  EXPECT_EQ(result.at("model"), "fundamental");
  double squares = 0.0;
  for (const json& entry : result.at("matrix"))
  {
    squares += entry.get<double>() * entry.get<double>();
  }
  EXPECT_NEAR(squares, 1.0, 1e-9);
}

TEST_F(MatchImagesTest, MatchesAScene)
{
  // All is on one plane here, and it says so.
  const ProgramRun outcome = run({ "scene", reference_, current_, "--json", "--overlay", path("scene.png") });
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(outcome.out);
  EXPECT_EQ(result.at("success"), true);
  EXPECT_EQ(result.at("model"), "homography") << result.at("message");
  EXPECT_EQ(result.at("matrix").size(), 9U);
  EXPECT_GE(result.at("matches").size(), result.at("inliers").get<std::size_t>());
  EXPECT_TRUE(result.at("lines").is_array());
  EXPECT_TRUE(result.at("planes").is_array());
  EXPECT_FALSE(cv::imread(path("scene.png")).empty());

  EXPECT_EQ(run({ "scene", reference_, write("other.png", texturedPicture(9)) }).status, 1);
  EXPECT_EQ(run({ "scene", reference_, current_, "--set", "scene_threshold=1.5" }).status, 0);
  const json plane = json::parse(run({ "scene", reference_, current_, "--model", "homography", "--json" }).out);
  EXPECT_EQ(plane.at("model"), "homography");
  EXPECT_EQ(plane.at("success"), true) << plane.at("message");
}

TEST_F(MatchImagesTest, TellsTheMotionInASceneOfKnownCameras)
{
  const RoomCorner room;
  const std::string reference = write("room.png", room.reference);
  const std::string current = write("moved.png", room.current);
  const std::string camera = path("camera.yaml");
  writeText("camera.yaml",
            "image_width: 640\nimage_height: 480\ncamera_matrix:\n  data: [500, 0, 319.5, 0, 500, 239.5, "
            "0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  data: [0, 0, 0, 0, 0]\n");
  const std::vector<std::string> words = {
    "scene", reference, current, "--camera-ref", camera, "--camera-cur", camera
  };
  std::vector<std::string> in_json = words;
  in_json.emplace_back("--json");
  const ProgramRun outcome = run(in_json);
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(outcome.out);
  EXPECT_EQ(result.at("model"), "fundamental") << result.at("message");
  const json& motion = result.at("motion");
  EXPECT_NEAR(motion.at("rotation").at(1).get<double>(), std::sin(0.5 * 0.15), 0.003);
  EXPECT_NEAR(motion.at("direction").at(0).get<double>(), -0.6 / std::sqrt(0.41), 0.03);
  EXPECT_EQ(motion.at("covariance").size(), 36U);
  EXPECT_EQ(result.at("epipole_current").size(), 2U);
  EXPECT_NEAR(result.at("epipole_current").at(0).get<double>(), 319.5 - 500.0 * 0.6 / 0.2, 150.0);
  EXPECT_NE(run(words).out.find("X_cur = R X_ref + t"), std::string::npos);

  EXPECT_TRUE(json::parse(run({ "scene", reference, current, "--json" }).out).at("motion").is_null());
  expectBadInput(run({ "scene", reference, current, "--camera-ref", camera }), "--camera-cur is missing");
  expectBadInput(run({ "scene", reference, current, "--camera-ref", path("none.yaml"), "--camera-cur", camera }),
                 "none.yaml");
  expectBadInput(run({ "scene", reference_, current, "--camera-ref", camera, "--camera-cur", camera }), "640 x 480");
}

TEST_F(MatchImagesTest, ComparesWithTheTruth)
{
  cv::FileStorage storage(path("truth.xml"), cv::FileStorage::WRITE);
  cv::Mat truth;
  cv::eigen2cv(exampleHomography(), truth);
  storage << "H" << truth;
  storage.release();
  writeText("truth.txt", TRUTH);
  for (const std::string name : { "truth.xml", "truth.txt" })
  {
    const json result = matchJson(reference_, current_, 0, { "--truth", path(name) });
    EXPECT_NEAR(result.at("mean_corner_error").get<double>(), cornerError(result), 1e-6) << name;
  }
  EXPECT_NE(match(reference_, current_, { "--truth", path("truth.txt") }).out.find("mean corner error"),
            std::string::npos);

  writeText("short.txt", "1 0 0 0 1 0");
  expectBadInput(match(reference_, current_, { "--truth", path("short.txt") }), path("short.txt"));
  expectBadInput(match(reference_, current_, { "--truth", path("none.xml") }), path("none.xml"));
  expectBadInput(match(reference_, current_, { "--truth", path("truth.txt"), "--model", "fundamental" }), "--truth");
}

TEST_F(MatchImagesTest, WritesAnOverlay)
{
  const ProgramRun outcome = match(reference_, current_, { "--overlay", path("overlay.png") });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.out.find(path("overlay.png")), std::string::npos);
  const cv::Mat picture = cv::imread(path("overlay.png"));
  EXPECT_GE(picture.cols, 960);
  EXPECT_GT(picture.rows, 360);

  expectBadInput(match(reference_, current_, { "--overlay", path("none/overlay.png") }), path("none/overlay.png"));
  expectBadInput(match(reference_, current_, { "--overlay", path("overlay.xyz") }), path("overlay.xyz"));
  expectBadInput(match(reference_, current_, { "--overlay", path("overlay") }), path("overlay"));
}

TEST_F(MatchImagesTest, TakesParameters)
{
  const json few = matchJson(reference_, current_, 0, { "--set", "max_corners=100", "--set", "guided=false" });
  EXPECT_LE(few.at("matches").size(), 100U);
  const json same = matchJson(reference_, current_, 0, { "--set", "max_corners=100", "guided=false" });
  EXPECT_EQ(few.at("matches"), same.at("matches"));
  EXPECT_EQ(run({ "points", "--set", "max_corners=100", "--json", reference_, current_ }).status, 0);
}

TEST_F(MatchImagesTest, ListsParameters)
{
  const ProgramRun outcome = run({ "--list-parameters" });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.out.find("max_corners (int, default 500, [1, 5000]): "), std::string::npos) << outcome.out;
}

TEST_F(MatchImagesTest, RefusesUnknownParametersAndValues)
{
  expectBadInput(match(reference_, current_, { "--set", "max_cornerz=100" }), "max_cornerz");
  expectBadInput(match(reference_, current_, { "--set", "max_corners=many" }), "max_corners");
  expectBadInput(match(reference_, current_, { "--set", "max_corners=0" }), "max_corners");
  expectBadInput(match(reference_, current_, { "--set", "max_corners=0", "--set", "profile_min_length=-1" }),
                 "max_corners");
  expectBadInput(match(reference_, current_, { "--set", "max_corners" }), "max_corners");
}

TEST_F(MatchImagesTest, RefusesUnknownOptions)
{
  expectBadInput(run({}), "points");
  expectBadInput(run({ "circles", reference_, current_ }), "circles");
  expectBadInput(run({ "points" }), "REF");
  expectBadInput(run({ "points", reference_ }), "CUR");
  expectBadInput(match(reference_, current_, { "--colour" }), "--colour");
  expectBadInput(match(reference_, current_, { "--model", "affine" }), "--model");
  expectBadInput(match(reference_, current_, { "--threads", "-1" }), "--threads");
  expectBadInput(match(reference_, current_, { "--threads", "two" }), "--threads");
  expectBadInput(match(reference_, current_, { "--overlay" }), "--overlay");
}

TEST_F(MatchImagesTest, Helps)
{
  EXPECT_EQ(run({ "--help" }).status, 0);
  const ProgramRun outcome = run({ "points", "--help" });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("--overlay"), std::string::npos);
}

TEST_F(MatchImagesTest, RefusesFilesThatAreNotImages)
{
  const std::string missing = path("missing.png");
  expectBadInput(match(missing, current_), missing);
  expectBadInput(match(reference_, missing), missing);
  expectBadInput(match(path("."), current_), path("."));
  const std::string text = writeText("text.png", "not an image\n");
  expectBadInput(match(reference_, text), text);
  const std::string empty = writeText("empty.png", "");
  expectBadInput(match(reference_, empty), empty);
}

TEST_F(MatchImagesTest, RefusesFilesItMayNotRead)
{
  if (geteuid() == 0)
  {
    GTEST_SKIP() << "root may read everything";
  }
  std::filesystem::permissions(reference_, std::filesystem::perms::none);
  expectBadInput(match(reference_, current_), reference_);
}

TEST_F(MatchImagesTest, RefusesDamagedImages)
{
  // The decoders of these write to standard error on their own.
  for (const std::string ending : { ".png", ".jpg", ".pgm", ".bmp", ".tiff" })
  {
    const std::string file = write("damaged" + ending, texturedPicture(1));
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
    expectBadInput(match(reference_, file), file);
  }
}

TEST_F(MatchImagesTest, RefusesTinyImages)
{
  const std::string tiny = write("tiny.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(7)));
  expectBadInput(match(reference_, tiny), tiny);
  expectBadInput(match(tiny, reference_), tiny);
}

TEST_F(MatchImagesTest, RefusesHugeImages)
{
  const std::string huge = writeText("huge.pgm", "P5 8000 8000 255\n");
  expectBadInput(match(huge, current_), huge);
  const std::string header = write("huge.png", cv::Mat(7200, 7200, CV_8UC1, cv::Scalar(0)));
  expectBadInput(match(reference_, header), header);
}

TEST_F(MatchImagesTest, FindsNothingInConstantImages)
{
  const std::string constant = write("constant.png", cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)));
  for (const json& result :
       { matchJson(constant, current_, 1), matchJson(reference_, constant, 1), matchJson(constant, constant, 1) })
  {
    EXPECT_EQ(result.at("success"), false);
    EXPECT_TRUE(result.at("matrix").is_null());
    EXPECT_EQ(result.at("inliers"), 0);
    EXPECT_TRUE(result.at("rms_error").is_null());
    EXPECT_FALSE(result.at("message").get<std::string>().empty());
  }
}

TEST_F(MatchImagesTest, FindsNothingInUnrelatedImages)
{
  for (const std::string model : { "homography", "fundamental" })
  {
    const json result = matchJson(reference_, write("other.png", texturedPicture(2)), 1, { "--model", model });
    EXPECT_EQ(result.at("success"), false);
    EXPECT_TRUE(result.at("matrix").is_null());
    for (const json& pair : result.at("matches"))
    {
      EXPECT_FALSE(pair.at("inlier").get<bool>());
    }
  }
  EXPECT_EQ(match(reference_, path("other.png"), { "--overlay", path("overlay.png") }).status, 1);
  EXPECT_FALSE(cv::imread(path("overlay.png")).empty()) << "a picture says why";
}

TEST_F(MatchImagesTest, FindsNothingInAMirror)
{
  cv::Mat mirrored;
  cv::flip(texturedPicture(1), mirrored, 1);
  const std::string mirror = write("mirror.png", mirrored);
  EXPECT_EQ(match(reference_, mirror).status, 1);
  EXPECT_EQ(match(reference_, mirror, { "--model", "fundamental" }).status, 1);
}

TEST_F(MatchImagesTest, AcceptsColourDepthAndTransparency)
{
  const cv::Mat grey = texturedPicture(1);
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  cv::Mat transparent;
  cv::cvtColor(grey, transparent, cv::COLOR_GRAY2BGRA);
  cv::Mat deep;
  grey.convertTo(deep, CV_16U, 257.0);
  const json expected = matchJson(reference_, current_, 0);
  for (const std::string& file :
       { write("colour.png", colour), write("transparent.png", transparent), write("deep.png", deep) })
  {
    const json result = matchJson(file, current_, 0);
    EXPECT_EQ(result.at("matrix"), expected.at("matrix")) << file;
  }
}

TEST_F(MatchImagesTest, AcceptsImagesOfTwoSizes)
{
  const json result =
      matchJson(reference_, write("wide.png", warpedPicture(texturedPicture(1), exampleHomography(), { 640, 300 })), 0);
  EXPECT_LT(cornerError(result), 1.5);
}

}  // namespace
}  // namespace test
}  // namespace view_servo
