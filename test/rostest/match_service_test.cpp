// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "matcher_test.h"
#include "support/text_file.h"

#include "view_servo/MatchPoints.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
namespace enc = sensor_msgs::image_encodings;

/** The nodes of match_service.test: one that has everything, one with ~allow_paths false. */
const std::string NODE = "open/point_matcher";
const std::string MATCH_WITHOUT_PATHS = "strict/point_matcher/match";

class MatchServiceTest : public MatcherTest<MatchPoints>
{
protected:
  static void SetUpTestSuite()
  {
    ASSERT_TRUE(waitForService(NODE + "/match"));
    ASSERT_TRUE(waitForService(MATCH_WITHOUT_PATHS));
  }

  static void TearDownTestSuite()
  {
    removeViews(NODE);
  }

  MatchServiceTest() : MatcherTest(NODE, texturedPicture(1), warped(texturedPicture(1), exampleHomography()))
  {
  }

  std::string textFile(const std::string& name, const std::string& text) const
  {
    return writeText(directory_.path() / name, text);
  }

  static void expectHomography(const MatchPoints::Response& response)
  {
    EXPECT_TRUE(response.success) << response.message;
    EXPECT_LT(cornerError(toMatrix(response.model_matrix), exampleHomography()), 1.5);
    EXPECT_DOUBLE_EQ(response.model_matrix[8], 1.0);
    EXPECT_GE(response.inliers, 50);
    EXPECT_LT(response.rms_error, 2.0);
    EXPECT_GT(response.elapsed_ms, 0.0);
  }

  void expectRefusal(const MatchPoints::Response& response, const std::string& naming) const override
  {
    expectFailure(response, naming);
    EXPECT_TRUE(std::isnan(response.model_matrix[0]));
    EXPECT_TRUE(std::isnan(response.rms_error));
    EXPECT_EQ(response.inliers, 0);
  }
};

TEST_F(MatchServiceTest, FindsTheHomographyOfTwoFiles)
{
  MatchPoints::Request request;
  request.reference.path = file("reference.png", picture_);
  request.query.path = file("query.png", seen_);
  const MatchPoints::Response response = call(request);
  expectHomography(response);
  EXPECT_TRUE(response.overlay.data.empty());

  ASSERT_GE(response.matches.size(), static_cast<std::size_t>(response.inliers));
  int inliers = 0;
  int right = 0;
  for (const PointMatch& match : response.matches)
  {
    const Eigen::Vector3d mapped = exampleHomography() * Eigen::Vector3d(match.reference_x, match.reference_y, 1.0);
    const Eigen::Vector2d current(match.current_x, match.current_y);
    inliers += match.inlier ? 1 : 0;
    right += match.inlier && (mapped.head<2>() / mapped.z() - current).norm() < 4.0 ? 1 : 0;
  }
  EXPECT_EQ(inliers, response.inliers);
  EXPECT_GE(right, 95 * inliers / 100);
}

TEST_F(MatchServiceTest, DrawsAnOverlayWhenAsked)
{
  MatchPoints::Request request = goodRequest();
  request.query.image.header.frame_id = "camera_optical_frame";
  request.query.image.header.stamp = ros::Time(12.5);
  request.overlay = true;
  const MatchPoints::Response response = call(request);
  expectHomography(response);
  EXPECT_EQ(response.overlay.encoding, enc::BGR8);
  EXPECT_EQ(response.overlay.header.frame_id, "camera_optical_frame");
  EXPECT_EQ(response.overlay.header.stamp, ros::Time(12.5));
  EXPECT_GE(response.overlay.width, 2u * static_cast<unsigned>(picture_.cols));
  EXPECT_GE(response.overlay.height, static_cast<unsigned>(picture_.rows));
}

TEST_F(MatchServiceTest, IsRepeatable)
{
  const MatchPoints::Response first = call(goodRequest());
  const MatchPoints::Response second = call(goodRequest());
  EXPECT_EQ(first.model_matrix, second.model_matrix);
  EXPECT_EQ(first.matches, second.matches);
}

TEST_F(MatchServiceTest, AcceptsImagesOfTwoSizes)
{
  MatchPoints::Request request = goodRequest();
  request.query.image = toMono8(seen_(cv::Rect(0, 0, 430, 340)).clone());
  expectHomography(call(request));
}

TEST_F(MatchServiceTest, EstimatesTheFundamentalMatrix)
{
  // Two planes at different depths, above and below the middle.
  const Eigen::Matrix3d near = (Eigen::Matrix3d() << 1.0, 0.0, 40.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0).finished();
  const Eigen::Matrix3d far = (Eigen::Matrix3d() << 1.0, 0.0, 12.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0).finished();
  cv::Mat seen = warped(picture_, near);
  const cv::Rect below(0, picture_.rows / 2, picture_.cols, picture_.rows / 2);
  warped(picture_, far)(below).copyTo(seen(below));

  MatchPoints::Request request = goodRequest();
  request.query.image = toMono8(seen);
  request.model = "fundamental";
  const MatchPoints::Response response = call(request);
  ASSERT_TRUE(response.success) << response.message;
  const Eigen::Matrix3d f = toMatrix(response.model_matrix);
  EXPECT_NEAR(f.norm(), 1.0, 1e-6);
  // The camera moved sideways: epipolar lines are the image's rows.
  const Eigen::Vector3d line = f * Eigen::Vector3d(200.0, 100.0, 1.0);
  EXPECT_LT(std::abs(line.x()), 0.05 * std::abs(line.y()));
  EXPECT_NEAR(-line.z() / line.y(), 100.0, 3.0);
}

TEST_F(MatchServiceTest, AcceptsColourDeepAndTransparentFiles)
{
  cv::Mat colour;
  cv::cvtColor(seen_, colour, cv::COLOR_GRAY2BGR);
  cv::Mat transparent;
  cv::cvtColor(seen_, transparent, cv::COLOR_GRAY2BGRA);
  cv::Mat deep;
  seen_.convertTo(deep, CV_16U, 257.0);
  MatchPoints::Request request;
  request.reference.path = file("reference.png", picture_);
  for (const auto& [name, image] : { std::pair("colour.png", colour), std::pair("transparent.png", transparent),
                                     std::pair("deep.png", deep), std::pair("lossy.jpg", seen_) })
  {
    SCOPED_TRACE(name);
    request.query.path = file(name, image);
    expectHomography(call(request));
  }
}

TEST_F(MatchServiceTest, AcceptsTheEncodingsOfCameras)
{
  cv::Mat rgb;
  cv::cvtColor(seen_, rgb, cv::COLOR_GRAY2RGB);
  cv::Mat bgra;
  cv::cvtColor(seen_, bgra, cv::COLOR_GRAY2BGRA);
  cv::Mat deep;
  seen_.convertTo(deep, CV_16U, 257.0);
  MatchPoints::Request request = goodRequest();
  for (const auto& [encoding, image] :
       { std::pair(enc::RGB8, rgb), std::pair(enc::BGR8, rgb), std::pair(enc::BGRA8, bgra), std::pair(enc::RGBA8, bgra),
         std::pair(enc::MONO16, deep), std::pair(enc::BAYER_RGGB8, seen_) })
  {
    SCOPED_TRACE(encoding);
    request.query.image = toImage(image, encoding, std_msgs::Header());
    expectHomography(call(request));
  }
}

TEST_F(MatchServiceTest, MatchesStoredViews)
{
  saveView("wall", picture_);
  saveView("wall_seen", seen_);
  MatchPoints::Request request;
  request.reference.view = "wall";
  request.query.view = "wall_seen";
  expectHomography(call(request));
  expectHomography(answerOf<MatchPoints>(MATCH_WITHOUT_PATHS, request));

  // The node keeps views in memory; one that is saved anew counts all the same.
  saveView("wall", texturedPicture(2));
  EXPECT_FALSE(call(request).success);
  saveView("wall", picture_);
  expectHomography(call(request));
}

TEST_F(MatchServiceTest, RefusesBadInputAndGoesOn)
{
  const std::string good = file("reference.png", picture_);
  textFile("half.png", readText(good).substr(0, 2000));
  const std::string mirrored = [&] {
    cv::Mat image;
    cv::flip(picture_, image, 1);
    return file("mirrored.png", image);
  }();
  const std::string large = textFile("large.pgm", "P5\n10000 6000\n255\n");

  const double not_a_number = std::numeric_limits<double>::quiet_NaN();
  const std::vector<BadRequest> requests = {
    { "missing file", fileAsQuery("/nowhere/picture.png"), "/nowhere/picture.png" },
    { "a directory", fileAsQuery(directory_.path().string()), directory_.path().string() },
    { "not an image", fileAsQuery(textFile("text.png", "hello")), "text.png" },
    { "empty file", fileAsQuery(textFile("empty.png", "")), "empty.png" },
    { "cut short", fileAsQuery((directory_.path() / "half.png").string()), "half.png" },
    { "1x1", fileAsQuery(file("dot.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(9)))), "dot.png" },
    { "too large", fileAsQuery(large), "large.pgm" },
    { "constant", fileAsQuery(file("constant.png", cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)))), "" },
    { "unrelated", fileAsQuery(file("unrelated.png", texturedPicture(7))), "" },
    { "mirrored", fileAsQuery(mirrored), "" },
    { "unknown view", viewAsReference("nobody"), "nobody" },
    { "name with ../", viewAsReference("../wall"), "../wall" },
    { "name with /", viewAsReference("a/b"), "a/b" },
    { "two fields", [&](MatchPoints::Request& request) { request.query.path = good; }, "path and image" },
    { "no field and no camera", [](MatchPoints::Request& request) { request.query = ImageSource(); },
      "/open/image_raw" },
    { "model", [](MatchPoints::Request& request) { request.model = "affine"; }, "affine" },
    { "threshold", [](MatchPoints::Request& request) { request.inlier_threshold = -1.0; }, "inlier_threshold" },
    { "threshold NaN", [=](MatchPoints::Request& request) { request.inlier_threshold = not_a_number; },
      "inlier_threshold" },
    { "unknown encoding", [](MatchPoints::Request& request) { request.query.image.encoding = "h264"; }, "h264" },
    { "data missing", [](MatchPoints::Request& request) { request.query.image.data.resize(100); }, "query.image" },
    { "data only",
      [](MatchPoints::Request& request) {
        request.query.image = sensor_msgs::Image();
        request.query.image.data.resize(100);
      },
      "query.image" },
  };
  expectRefusals(requests);
  expectHomography(call(goodRequest()));
}

TEST_F(MatchServiceTest, RefusesFilesWhenPathsAreNotAllowed)
{
  MatchPoints::Request request = goodRequest();
  request.reference = ImageSource();
  request.reference.path = file("reference.png", picture_);
  expectRefusal(answerOf<MatchPoints>(MATCH_WITHOUT_PATHS, request), "~allow_paths");
  expectHomography(answerOf<MatchPoints>(MATCH_WITHOUT_PATHS, goodRequest()));
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "match_service_test");
}
