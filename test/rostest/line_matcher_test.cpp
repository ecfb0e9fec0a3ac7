// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "matcher_test.h"

#include "view_servo/LineMatches.h"
#include "view_servo/MatchLines.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
const std::string NODE = "line_matcher";

/** Whether the current segment lies within 2 px of where `h` sends the line of the reference, and beside it. */
bool isRight(const LineMatch& match, const Eigen::Matrix3d& h)
{
  const auto send = [&](double u, double v) {
    return Eigen::Vector2d((h * Eigen::Vector3d(u, v, 1.0)).hnormalized());
  };
  const Eigen::Vector2d start = send(match.reference.x1, match.reference.y1);
  const Eigen::Vector2d end = send(match.reference.x2, match.reference.y2);
  const double length = (end - start).norm();
  const Eigen::Vector2d along = (end - start) / length;
  const auto across = [&](double u, double v) {
    return std::abs(along.x() * (v - start.y()) - along.y() * (u - start.x()));
  };
  const auto place = [&](double u, double v) {
    return along.dot(Eigen::Vector2d(u, v) - start);
  };
  const LineSegment& current = match.current;
  return across(current.x1, current.y1) < 2.0 && across(current.x2, current.y2) < 2.0 &&
         place(current.x1, current.y1) < length && place(current.x2, current.y2) > 0.0;
}

class LineMatcherNodeTest : public StreamingMatcherTest<MatchLines, LineMatches>
{
protected:
  LineMatcherNodeTest()
    : StreamingMatcherTest(NODE, "line_matches", texturedPicture(1), warped(texturedPicture(1), exampleHomography()))
  {
  }

  static void TearDownTestSuite()
  {
    removeViews(NODE);
  }

  static void expectLines(const std::vector<LineMatch>& matches, const Eigen::Matrix3d& h = exampleHomography())
  {
    int right = 0;
    for (const LineMatch& match : matches)
    {
      right += isRight(match, h) ? 1 : 0;
    }
    EXPECT_GE(matches.size(), 40u);
    EXPECT_GE(right, 0.9 * static_cast<double>(matches.size()));
  }

  static void expectPlane(const MatchLines::Response& response, const Eigen::Matrix3d& h = exampleHomography())
  {
    EXPECT_TRUE(response.success) << response.message;
    expectLines(response.matches, h);
    ASSERT_GE(response.plane_homographies.size(), 9u);
    EXPECT_EQ(response.plane_homographies.size() % 9, 0u);
    EXPECT_DOUBLE_EQ(response.plane_homographies[8], 1.0);
    EXPECT_LT(cornerError(toMatrix(response.plane_homographies), h), 1.5);
    EXPECT_GT(response.elapsed_ms, 0.0);
  }

  void expectRefusal(const MatchLines::Response& response, const std::string& naming) const override
  {
    expectFailure(response, naming);
    EXPECT_TRUE(response.plane_homographies.empty());
    EXPECT_TRUE(toMatrix(response.fundamental).array().isNaN().all());
  }
};

TEST_F(LineMatcherNodeTest, FindsThePlaneOfTwoFiles)
{
  MatchLines::Request request;
  request.reference.path = file("reference.png", picture_);
  request.query.path = file("query.png", seen_);
  for (const char* groups : { "", "triplets", "pairs" })
  {
    SCOPED_TRACE(groups);
    request.groups = groups;
    const MatchLines::Response response = call(request);
    expectPlane(response);
    EXPECT_TRUE(response.overlay.data.empty());
    for (std::size_t i = 1; i < response.matches.size(); ++i)
    {
      EXPECT_LE(response.matches[i].score, response.matches[i - 1].score);
    }

    int inliers = 0;
    int right = 0;
    for (const PointMatch& point : response.points)
    {
      const Eigen::Vector2d sent =
          (exampleHomography() * Eigen::Vector3d(point.reference_x, point.reference_y, 1.0)).hnormalized();
      inliers += point.inlier ? 1 : 0;
      right += point.inlier && (sent - Eigen::Vector2d(point.current_x, point.current_y)).norm() < 4.0 ? 1 : 0;
    }
    EXPECT_GE(inliers, 40);
    EXPECT_GE(right, 0.95 * inliers);
  }
}

TEST_F(LineMatcherNodeTest, MatchesAnImageWithItself)
{
  MatchLines::Request request = goodRequest();
  request.query = request.reference;
  const MatchLines::Response response = call(request);
  expectPlane(response, Eigen::Matrix3d::Identity());
  for (const LineMatch& match : response.matches)
  {
    EXPECT_EQ(match.reference, match.current);
  }
}

TEST_F(LineMatcherNodeTest, IsRepeatable)
{
  const MatchLines::Response first = call(goodRequest());
  const MatchLines::Response second = call(goodRequest());
  EXPECT_EQ(first.matches, second.matches);
  EXPECT_EQ(first.points, second.points);
  EXPECT_EQ(first.plane_homographies, second.plane_homographies);
}

TEST_F(LineMatcherNodeTest, TellsPlanesApart)
{
  // Two planes at different depths, above and below the middle; the camera moved sideways.
  const auto shift = [](double u) {
    return (Eigen::Matrix3d() << 1, 0, u, 0, 1, 0, 0, 0, 1).finished();
  };
  cv::Mat seen = warped(picture_, shift(40.0));
  const cv::Rect below(0, picture_.rows / 2, picture_.cols, picture_.rows / 2);
  warped(picture_, shift(12.0))(below).copyTo(seen(below));

  MatchLines::Request request = goodRequest();
  request.query.image = toMono8(seen);
  const MatchLines::Response response = call(request);
  ASSERT_TRUE(response.success) << response.message;
  ASSERT_GE(response.plane_homographies.size(), 18u);
  std::set<int> planes;
  for (const LineMatch& match : response.matches)
  {
    planes.insert(match.plane);
    EXPECT_GE(match.plane, -1);
    EXPECT_LT(9 * match.plane, static_cast<int>(response.plane_homographies.size()));
  }
  EXPECT_EQ(planes.count(0) + planes.count(1), 2u);

  // Epipolar lines are the image's rows.
  const Eigen::Matrix3d f = toMatrix(response.fundamental);
  EXPECT_NEAR(f.norm(), 1.0, 1e-6);
  const Eigen::Vector3d line = f * Eigen::Vector3d(200.0, 100.0, 1.0);
  EXPECT_LT(std::abs(line.x()), 0.05 * std::abs(line.y()));
  EXPECT_NEAR(-(200.0 * line.x() + line.z()) / line.y(), 100.0, 3.0);
}

TEST_F(LineMatcherNodeTest, DrawsAnOverlayWhenAsked)
{
  MatchLines::Request request = goodRequest();
  request.query.image.header.frame_id = "camera_optical_frame";
  request.query.image.header.stamp = ros::Time(12.5);
  request.overlay = true;
  const MatchLines::Response response = call(request);
  expectPlane(response);
  EXPECT_EQ(response.overlay.encoding, sensor_msgs::image_encodings::BGR8);
  EXPECT_EQ(response.overlay.header.frame_id, "camera_optical_frame");
  EXPECT_EQ(response.overlay.header.stamp, ros::Time(12.5));
  EXPECT_GE(response.overlay.width, 2u * static_cast<unsigned>(picture_.cols));
}

TEST_F(LineMatcherNodeTest, MatchesStoredViews)
{
  saveView("wall", picture_);
  saveView("wall_seen", seen_);
  MatchLines::Request request;
  request.reference.view = "wall";
  request.query.view = "wall_seen";
  expectPlane(call(request));

  // The node keeps views in memory; one that is saved anew counts all the same.
  saveView("wall", texturedPicture(2));
  EXPECT_FALSE(call(request).success);
  saveView("wall", picture_);
  expectPlane(call(request));
}

TEST_F(LineMatcherNodeTest, FindsNoPlaneInUnrelatedImages)
{
  MatchLines::Request request = goodRequest();
  request.query.image = toMono8(texturedPicture(7));
  const MatchLines::Response response = call(request);
  EXPECT_FALSE(response.success) << response.message;
  EXPECT_TRUE(response.plane_homographies.empty());
  EXPECT_LT(response.matches.size(), 20u);
}

TEST_F(LineMatcherNodeTest, RefusesBadInputAndGoesOn)
{
  const std::string good = file("reference.png", picture_);
  const std::vector<BadRequest> requests = {
    { "groups", [](MatchLines::Request& request) { request.groups = "quadruplets"; }, "groups: 'quadruplets'" },
    { "missing file", fileAsQuery("/nowhere/picture.png"), "/nowhere/picture.png" },
    { "not an image", fileAsQuery(directory_.path().string()), directory_.path().string() },
    { "1x1", fileAsQuery(file("dot.png", cv::Mat(1, 1, CV_8UC1, cv::Scalar(9)))), "dot.png" },
    { "constant", fileAsQuery(file("constant.png", cv::Mat(360, 480, CV_8UC1, cv::Scalar(90)))),
      "0 in the current image" },
    { "small", fileAsQuery(file("small.png", cv::Mat(3, 2, CV_8UC1, cv::Scalar(90)))), "" },
    { "two fields", [&](MatchLines::Request& request) { request.query.path = good; }, "path and image" },
    { "no field and no camera", [](MatchLines::Request& request) { request.query = ImageSource(); }, "camera" },
    { "unknown encoding", [](MatchLines::Request& request) { request.query.image.encoding = "h264"; }, "h264" },
    { "unknown view", viewAsReference("nobody"), "nobody" },
    { "name with ../", viewAsReference("../wall"), "../wall" },
    { "name with /", viewAsReference("a/b"), "a/b" },
    { "name with a null", viewAsReference(std::string("wall\0/x", 7)), "wall" },
    { "long name", viewAsReference(std::string(5000, 'a')), "" },
  };
  expectRefusals(requests);
  expectPlane(call(goodRequest()));
}

TEST_F(LineMatcherNodeTest, StreamsMatchesWithTheView)
{
  saveView("wall", picture_);
  EXPECT_FALSE(setView("nobody").success);
  EXPECT_FALSE(setView("../wall").success);
  ASSERT_TRUE(setView("wall").success);
  const Recorder<sensor_msgs::Image> overlays("line_matcher/overlay");
  ASSERT_TRUE(
      waitUntil([&] { return matches_.last().has_value() && overlays.last().has_value(); }, [&] { send(seen_); }));

  const LineMatches message = *matches_.last();
  EXPECT_EQ(sent_.count(message.header.stamp), 1u);
  EXPECT_EQ(message.header.frame_id, camera_.frame_id);
  EXPECT_EQ(message.view, "wall");
  expectLines(message.matches);
  EXPECT_GE(message.points.size(), 40u);
  EXPECT_EQ(sent_.count(overlays.last()->header.stamp), 1u);
  EXPECT_EQ(overlays.last()->encoding, sensor_msgs::image_encodings::BGR8);

  // What shows something else is answered, too, and has no matches.
  const cv::Mat blank(seen_.size(), CV_8UC1, cv::Scalar(100));
  EXPECT_TRUE(waitUntil([&] { return matches_.last()->matches.empty(); }, [&] { send(blank); }));
}

TEST_F(LineMatcherNodeTest, PublishesNothingForAnUncalibratedCamera)
{
  saveView("wall", picture_);
  ASSERT_TRUE(setView("wall").success);
  ASSERT_TRUE(waitUntil([&] { return matches_.last().has_value(); }, [&] { send(seen_); }));

  camera_.calibrated = false;
  const ros::Time since = ros::Time::now();
  MatchLines::Request request;
  request.reference.view = "wall";
  MatchLines::Response response;
  EXPECT_TRUE(waitUntil(
      [&] {
        response = call(request);
        return response.message.find("not calibrated") != std::string::npos;
      },
      [&] { send(seen_); }))
      << response.message;
  expectRefusal(response, "/camera/camera_info");
  EXPECT_LE(matches_.last()->header.stamp, since);

  camera_.calibrated = true;
  EXPECT_TRUE(waitUntil([&] { return matches_.last()->header.stamp > since; }, [&] { send(seen_); }));
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "line_matcher_test");
}
