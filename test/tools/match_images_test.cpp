// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Runs the program itself, as a shell would.
#include "support/corner_error.h"
#include "support/room_corner.h"
#include "support/temporary_directory.h"
#include "support/textured_plane.h"
#include "test_paths.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

using nlohmann::json;
using view_servo::test::exampleHomography;
using view_servo::test::TemporaryDirectory;
using view_servo::test::texturedPicture;
using view_servo::test::warpedPicture;

namespace
{
/** Blotches of several sizes, as unlike from place to place as a printed poster. */
cv::Mat texture(int seed, const cv::Size& size = cv::Size(480, 360))
{
  cv::RNG rng(static_cast<std::uint64_t>(seed));
  cv::Mat sum = cv::Mat::zeros(size, CV_32FC1);
  for (const double sigma : { 2.0, 5.0, 12.0 })
  {
    cv::Mat noise(size, CV_32FC1);
    rng.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
    cv::GaussianBlur(noise, noise, cv::Size(), sigma);
    cv::normalize(noise, noise, 0.0, 1.0, cv::NORM_MINMAX);
    sum += noise;
  }
  cv::Mat grey;
  cv::normalize(sum, sum, 0.0, 255.0, cv::NORM_MINMAX);
  sum.convertTo(grey, CV_8U);
  return grey;
}

/** Reference -> current: a plane seen from another side. */
const cv::Matx33d TRUE_HOMOGRAPHY(0.85, -0.15, 60.0, 0.12, 0.9, 5.0, 2e-4, 1e-4, 1.0);

cv::Mat warped(const cv::Mat& image, const cv::Size& size = cv::Size(480, 360))
{
  cv::Mat result;
  cv::warpPerspective(image, result, TRUE_HOMOGRAPHY, size, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(128));
  return result;
}

struct Outcome
{
  int status;
  std::string out;
  std::string err;
};

class MatchImages : public ::testing::Test
{
protected:
  MatchImages()
  {
    reference_ = write("reference.png", texture(1));
    current_ = write("current.png", warped(texture(1)));
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
    std::ofstream(path(name), std::ios::binary) << text;
    return path(name);
  }

  Outcome run(const std::vector<std::string>& arguments) const
  {
    std::string command = "'" MATCH_IMAGES_PATH "'";
    for (const std::string& argument : arguments)
    {
      command += " '" + argument + "'";
    }
    command += " > '" + path("out") + "' 2> '" + path("err") + "' < /dev/null";
    const int status = std::system(command.c_str());
    return { WIFEXITED(status) ? WEXITSTATUS(status) : -1, readText("out"), readText("err") };
  }

  Outcome match(const std::string& reference, const std::string& current,
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
    const Outcome outcome = match(reference, current, more);
    EXPECT_EQ(outcome.status, expected_status) << outcome.out;
    EXPECT_EQ(outcome.err, "");
    return json::parse(outcome.out);
  }

  /** Status 2, and nothing but one line, which names `culprit`. */
  static void expectBadInput(const Outcome& outcome, const std::string& culprit)
  {
    EXPECT_EQ(outcome.status, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_NE(outcome.err.find(culprit), std::string::npos) << outcome.err;
  }

  std::string reference_;
  std::string current_;

private:
  std::string readText(const std::string& name) const
  {
    std::ifstream file(path(name), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  }

  TemporaryDirectory directory_;
};

/** Mean distance of the corners of an image under a result's matrix and the truth [px]. */
double cornerError(const json& result, const cv::Size& size = cv::Size(480, 360))
{
  cv::Matx33d h;
  for (int i = 0; i < 9; ++i)
  {
    h.val[i] = result.at("matrix").at(static_cast<std::size_t>(i)).get<double>();
  }
  const double right = size.width - 1.0;
  const double bottom = size.height - 1.0;
  std::vector<cv::Point2d> corners{ { 0.0, 0.0 }, { right, 0.0 }, { right, bottom }, { 0.0, bottom } };
  std::vector<cv::Point2d> found;
  std::vector<cv::Point2d> wanted;
  cv::perspectiveTransform(corners, found, h);
  cv::perspectiveTransform(corners, wanted, TRUE_HOMOGRAPHY);
  double sum = 0.0;
  for (std::size_t i = 0; i < corners.size(); ++i)
  {
    sum += cv::norm(found[i] - wanted[i]);
  }
  return sum / static_cast<double>(corners.size());
}

}  // namespace

TEST_F(MatchImages, FindsAHomography)
{
  const Outcome outcome = match(reference_, current_);
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("homography"), std::string::npos) << outcome.out;
  EXPECT_LT(cornerError(matchJson(reference_, current_, 0)), 1.0);
}

TEST_F(MatchImages, JsonHasEveryField)
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
      const std::vector<cv::Point2d> from{ { pair["reference"][0], pair["reference"][1] } };
      const cv::Point2d to(pair["current"][0], pair["current"][1]);
      std::vector<cv::Point2d> mapped;
      cv::perspectiveTransform(from, mapped, TRUE_HOMOGRAPHY);
      close_inliers += cv::norm(mapped[0] - to) < 4.0 ? 1 : 0;
      ++inliers;
    }
  }
  EXPECT_EQ(result.at("inliers"), inliers);
  EXPECT_GT(inliers, 50);
  EXPECT_GT(close_inliers, 0.95 * inliers);
}

TEST_F(MatchImages, GivesTheSameBytesAgain)
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

/** A folder of the views, and what a camera sees of one of them. */
class FindView : public MatchImages
{
protected:
  FindView()
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

TEST_F(FindView, NamesTheImageFileThatShowsTheScene)
{
  const Outcome outcome = run({ "find", path("views"), path("now.png"), "--json", "--max", "2" });
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
  const Outcome text = run({ "find", path("views"), path("now.png"), "--max", "1" });
  EXPECT_EQ(text.status, 0);
  EXPECT_EQ(text.out.rfind("scene3.png: score ", 0), 0U) << text.out;
}

TEST_F(FindView, FindsStoredViewsAndLeavesTheFolderAsItIs)
{
  const view_servo::ViewStore store(path("stored"));
  for (const std::uint64_t scene : { 3U, 4U })
  {
    view_servo::StoredView view;
    view.name = "place" + std::to_string(scene);
    view.image = texturedPicture(scene);
    store.save(view, false);
  }
  const Outcome outcome = run({ "find", path("stored"), path("now.png"), "--max", "1" });
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out.rfind("place3: ", 0), 0U) << outcome.out;
  EXPECT_FALSE(std::filesystem::exists(path("stored/views.index")));
}

TEST_F(FindView, FindsNoneForAnUnknownScene)
{
  const Outcome outcome = run({ "find", path("views"), path("elsewhere.png"), "--json" });
  EXPECT_EQ(outcome.status, 1) << outcome.err;
  const json result = json::parse(outcome.out);
  EXPECT_FALSE(result["success"].get<bool>());
  for (const json& view : result["views"])
  {
    EXPECT_FALSE(view["verified"].get<bool>());
  }
}

TEST_F(FindView, NamesFilesThatItLeavesOut)
{
  writeText("views/bad.png", "no image");
  const Outcome outcome = run({ "find", path("views"), path("now.png") });
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("bad.png"), std::string::npos) << outcome.out;
}

TEST_F(FindView, RefusesBadInputInOneLine)
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
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.status, 2) << named;
    EXPECT_NE(outcome.err.find(named), std::string::npos) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST_F(MatchImages, FindsAFundamentalMatrix)
{
  // Two planes at different depths: the lower half moves twice as far as the upper one.
  const cv::Mat scene = texture(1);
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

TEST_F(MatchImages, MatchesAScene)
{
  // All is on one plane here, and it says so.
  const Outcome outcome = run({ "scene", reference_, current_, "--json", "--overlay", path("scene.png") });
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const json result = json::parse(outcome.out);
  EXPECT_EQ(result.at("success"), true);
  EXPECT_EQ(result.at("model"), "homography") << result.at("message");
  EXPECT_EQ(result.at("matrix").size(), 9U);
  EXPECT_GE(result.at("matches").size(), result.at("inliers").get<std::size_t>());
  EXPECT_TRUE(result.at("lines").is_array());
  EXPECT_TRUE(result.at("planes").is_array());
  EXPECT_FALSE(cv::imread(path("scene.png")).empty());

  EXPECT_EQ(run({ "scene", reference_, write("other.png", texture(9)) }).status, 1);
  EXPECT_EQ(run({ "scene", reference_, current_, "--set", "scene_threshold=1.5" }).status, 0);
  const json plane = json::parse(run({ "scene", reference_, current_, "--model", "homography", "--json" }).out);
  EXPECT_EQ(plane.at("model"), "homography");
  EXPECT_EQ(plane.at("success"), true) << plane.at("message");
}

TEST_F(MatchImages, TellsTheMotionInASceneOfKnownCameras)
{
  const view_servo::test::RoomCorner room;
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
  const Outcome outcome = run(in_json);
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

TEST_F(MatchImages, ComparesWithTheTruth)
{
  cv::FileStorage storage(path("truth.xml"), cv::FileStorage::WRITE);
  storage << "H" << cv::Mat(TRUE_HOMOGRAPHY);
  storage.release();
  writeText("truth.txt", "0.85 -0.15 60\n0.12 0.9 5\n2e-4 1e-4 1\n");
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

TEST_F(MatchImages, WritesAnOverlay)
{
  const Outcome outcome = match(reference_, current_, { "--overlay", path("overlay.png") });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.out.find(path("overlay.png")), std::string::npos);
  const cv::Mat picture = cv::imread(path("overlay.png"));
  EXPECT_GE(picture.cols, 960);
  EXPECT_GT(picture.rows, 360);

  expectBadInput(match(reference_, current_, { "--overlay", path("none/overlay.png") }), path("none/overlay.png"));
  expectBadInput(match(reference_, current_, { "--overlay", path("overlay.xyz") }), path("overlay.xyz"));
  expectBadInput(match(reference_, current_, { "--overlay", path("overlay") }), path("overlay"));
}

TEST_F(MatchImages, TakesParameters)
{
  const json few = matchJson(reference_, current_, 0, { "--set", "max_corners=100", "--set", "guided=false" });
  EXPECT_LE(few.at("matches").size(), 100U);
  const json same = matchJson(reference_, current_, 0, { "--set", "max_corners=100", "guided=false" });
  EXPECT_EQ(few.at("matches"), same.at("matches"));
  EXPECT_EQ(run({ "points", "--set", "max_corners=100", "--json", reference_, current_ }).status, 0);
}

TEST_F(MatchImages, ListsParameters)
{
  const Outcome outcome = run({ "--list-parameters" });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.out.find("max_corners (int, default 500, [1, 5000]): "), std::string::npos) << outcome.out;
}

TEST_F(MatchImages, RefusesUnknownParametersAndValues)
{
  expectBadInput(match(reference_, current_, { "--set", "max_cornerz=100" }), "max_cornerz");
  expectBadInput(match(reference_, current_, { "--set", "max_corners=many" }), "max_corners");
  expectBadInput(match(reference_, current_, { "--set", "max_corners=0" }), "max_corners");
  expectBadInput(match(reference_, current_, { "--set", "max_corners=0", "--set", "profile_min_length=-1" }),
                 "max_corners");
  expectBadInput(match(reference_, current_, { "--set", "max_corners" }), "max_corners");
}

TEST_F(MatchImages, RefusesUnknownOptions)
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

TEST_F(MatchImages, Helps)
{
  EXPECT_EQ(run({ "--help" }).status, 0);
  const Outcome outcome = run({ "points", "--help" });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("--overlay"), std::string::npos);
}

TEST_F(MatchImages, RefusesFilesThatAreNotImages)
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

TEST_F(MatchImages, RefusesFilesItMayNotRead)
{
  if (geteuid() == 0)
  {
    GTEST_SKIP() << "root may read everything";
  }
  std::filesystem::permissions(reference_, std::filesystem::perms::none);
  expectBadInput(match(reference_, current_), reference_);
}

TEST_F(MatchImages, RefusesDamagedImages)
{
  // The decoders of these write to standard error on their own.
  for (const std::string ending : { ".png", ".jpg", ".pgm", ".bmp", ".tiff" })
  {
    const std::string file = write("damaged" + ending, texture(1));
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
    expectBadInput(match(reference_, file), file);
  }
}

TEST_F(MatchImages, RefusesTinyImages)
{
  const std::string tiny = write("tiny.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(7)));
  expectBadInput(match(reference_, tiny), tiny);
  expectBadInput(match(tiny, reference_), tiny);
}

TEST_F(MatchImages, RefusesHugeImages)
{
  const std::string huge = writeText("huge.pgm", "P5 8000 8000 255\n");
  expectBadInput(match(huge, current_), huge);
  const std::string header = write("huge.png", cv::Mat(7200, 7200, CV_8UC1, cv::Scalar(0)));
  expectBadInput(match(reference_, header), header);
}

TEST_F(MatchImages, FindsNothingInConstantImages)
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

TEST_F(MatchImages, FindsNothingInUnrelatedImages)
{
  for (const std::string model : { "homography", "fundamental" })
  {
    const json result = matchJson(reference_, write("other.png", texture(2)), 1, { "--model", model });
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

TEST_F(MatchImages, FindsNothingInAMirror)
{
  cv::Mat mirrored;
  cv::flip(texture(1), mirrored, 1);
  const std::string mirror = write("mirror.png", mirrored);
  EXPECT_EQ(match(reference_, mirror).status, 1);
  EXPECT_EQ(match(reference_, mirror, { "--model", "fundamental" }).status, 1);
}

TEST_F(MatchImages, AcceptsColourDepthAndTransparency)
{
  const cv::Mat grey = texture(1);
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

TEST_F(MatchImages, AcceptsImagesOfTwoSizes)
{
  const json result = matchJson(reference_, write("wide.png", warped(texture(1), { 640, 300 })), 0);
  EXPECT_LT(cornerError(result), 1.5);
}

namespace
{
/** A plane full of straight edges, from two sides. */
class MatchLines : public MatchImages
{
protected:
  MatchLines()
  {
    const cv::Mat picture = texturedPicture(1);
    reference_ = write("lines_reference.png", picture);
    current_ = write("lines_current.png", warpedPicture(picture, exampleHomography(), picture.size()));
  }

  Outcome matchLines(const std::vector<std::string>& more = {}) const
  {
    std::vector<std::string> arguments{ "lines", reference_, current_ };
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }

  json linesJson(int expected_status, std::vector<std::string> more = {}) const
  {
    more.emplace_back("--json");
    const Outcome outcome = matchLines(more);
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
  cv::Mat h;
  cv::eigen2cv(exampleHomography(), h);
  std::vector<cv::Point2d> ends{ { segment[0], segment[1] }, { segment[2], segment[3] } };
  cv::perspectiveTransform(ends, ends, h);
  return ends;
}

Eigen::Matrix3d matrixOf(const json& numbers)
{
  Eigen::Matrix3d matrix;
  for (int i = 0; i < 9; ++i)
  {
    matrix(i / 3, i % 3) = numbers.at(static_cast<std::size_t>(i));
  }
  return matrix;
}

bool isEitherWay(const json& reported, const json& written)
{
  const json reversed{ written[2], written[3], written[0], written[1] };
  return reported == written || reported == reversed;
}

}  // namespace

TEST_F(MatchLines, FindsAPlane)
{
  const Outcome outcome = matchLines();
  EXPECT_EQ(outcome.status, 0) << outcome.out;
  EXPECT_EQ(outcome.err, "");
  EXPECT_NE(outcome.out.find("homography"), std::string::npos) << outcome.out;
  const json pairs = linesJson(0, { "--groups", "pairs" });
  EXPECT_LT(view_servo::test::cornerError(matrixOf(pairs.at("matrix")), exampleHomography(), { 480, 360 }), 2.0);
}

TEST_F(MatchLines, JsonHasEveryField)
{
  const json result = linesJson(0);
  EXPECT_EQ(result.at("success"), true);
  EXPECT_TRUE(result.at("message").is_string());
  EXPECT_EQ(result.at("model"), "homography");
  EXPECT_LT(view_servo::test::cornerError(matrixOf(result.at("matrix")), exampleHomography(), { 480, 360 }), 2.0);
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

TEST_F(MatchLines, GivesTheSameBytesAgain)
{
  json first = linesJson(0);
  json one_thread = linesJson(0, { "--threads", "1" });
  first.erase("elapsed_ms");
  one_thread.erase("elapsed_ms");
  EXPECT_EQ(first.dump(), one_thread.dump());
}

TEST_F(MatchLines, ListsLinesWhenTheyLeaveTheModelOpen)
{
  const json result = linesJson(1, { "--model", "fundamental" });
  EXPECT_EQ(result.at("success"), false);
  EXPECT_EQ(result.at("model"), "fundamental");
  EXPECT_TRUE(result.at("matrix").is_null());
  EXPECT_GT(result.at("matches").size(), 30U);
  EXPECT_FALSE(result.at("message").get<std::string>().empty());
}

TEST_F(MatchLines, TakesSegmentsFromFiles)
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
  EXPECT_LT(view_servo::test::cornerError(matrixOf(both.at("matrix")), exampleHomography(), { 480, 360 }), 2.0);

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

TEST_F(MatchLines, CountsSegmentsNotLinesOfTheFile)
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

TEST_F(MatchLines, NamesFaultsInSegmentFiles)
{
  const std::string missing = path("none.txt");
  for (const std::string option : { "--segments-ref", "--segments-cur" })
  {
    expectBadInput(matchLines({ option, missing }), missing);
    expectBadInput(matchLines({ option, path(".") }), path("."));
    for (const std::string bad : { "1 2 3", "1 2 3 4 5", "1 2 3 x", "nan 2 3 4", "1 2 3 inf", "7 8 7 8", "1 2 3 1e9" })
    {
      const std::string file = writeText("bad.txt", "10 10 50 50\n\n" + bad + "\n");
      const Outcome outcome = matchLines({ option, file });
      expectBadInput(outcome, file);
      expectBadInput(outcome, "line 3 ");
    }
  }
}

TEST_F(MatchLines, FindsNothingWithFewSegments)
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

TEST_F(MatchLines, AnswersForManyRandomSegments)
{
  const json result =
      linesJson(1, { "--segments-ref", randomSegments("many.txt", 5000), "--segments-cur", path("many.txt") });
  EXPECT_EQ(result.at("success"), false);
}

TEST_F(MatchLines, SurvivesSegmentsFarOutside)
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

TEST_F(MatchLines, WritesAnOverlay)
{
  const Outcome outcome = matchLines({ "--overlay", path("overlay.png") });
  EXPECT_EQ(outcome.status, 0);
  EXPECT_NE(outcome.out.find(path("overlay.png")), std::string::npos);
  const cv::Mat picture = cv::imread(path("overlay.png"));
  EXPECT_GE(picture.cols, 960);
  EXPECT_GT(picture.rows, 360);
  expectBadInput(matchLines({ "--overlay", path("none/overlay.png") }), path("none/overlay.png"));
}

TEST_F(MatchLines, ComparesWithTheTruth)
{
  writeText("truth.txt", "0.87 -0.12 50\n0.09 0.93 -5\n-2e-4 1e-4 1\n");
  const json result = linesJson(0, { "--truth", path("truth.txt") });
  EXPECT_NEAR(result.at("mean_corner_error").get<double>(),
              view_servo::test::cornerError(matrixOf(result.at("matrix")), exampleHomography(), { 480, 360 }), 1e-6);
}

TEST_F(MatchLines, TakesParameters)
{
  const json few = linesJson(0, { "--set", "max_segments=150", "segment_min_length=20" });
  for (const json& line : few.at("matches"))
  {
    EXPECT_LT(line.at("reference_index").get<int>(), 150);
    const json& at = line.at("reference");
    EXPECT_GE(std::hypot(at[2].get<double>() - at[0].get<double>(), at[3].get<double>() - at[1].get<double>()), 20.0);
  }
  const Outcome outcome = run({ "--list-parameters" });
  EXPECT_NE(outcome.out.find("line_order (contrast|upright, default contrast): "), std::string::npos) << outcome.out;

  expectBadInput(matchLines({ "--set", "max_corners=100" }), "max_corners");
  expectBadInput(matchLines({ "--set", "detector=hough" }), "detector");
  expectBadInput(matchLines({ "--set", "edge_sigma=0" }), "edge_sigma");
  expectBadInput(matchLines({ "--set", "min_plane_lines=1" }), "min_plane_lines");
}

TEST_F(MatchLines, RefusesUnknownOptions)
{
  expectBadInput(run({ "lines" }), "REF");
  expectBadInput(matchLines({ "--groups", "quartets" }), "--groups");
  expectBadInput(matchLines({ "--model", "affine" }), "--model");
  expectBadInput(matchLines({ "--segments-ref" }), "--segments-ref");
  expectBadInput(run({ "points", reference_, current_, "--groups", "pairs" }), "--groups");
  EXPECT_NE(run({ "lines", "--help" }).out.find("--segments-cur"), std::string::npos);
}

TEST_F(MatchLines, RefusesFilesThatAreNotImages)
{
  const std::string text = writeText("text.png", "not an image\n");
  expectBadInput(run({ "lines", reference_, text }), text);
  expectBadInput(run({ "lines", text, current_ }), text);
}

TEST_F(MatchLines, FindsNothingInUnrelatedOrConstantImages)
{
  const std::string constant = write("constant.png", cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)));
  const std::string other = write("other.png", texturedPicture(2));
  for (const std::string& file : { constant, other })
  {
    const Outcome outcome = run({ "lines", reference_, file, "--overlay", path("overlay.png") });
    EXPECT_EQ(outcome.status, 1) << outcome.out;
    EXPECT_EQ(outcome.err, "");
    EXPECT_FALSE(cv::imread(path("overlay.png")).empty()) << "a picture says why";
  }
}
