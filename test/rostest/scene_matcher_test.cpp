// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "matcher_test.h"
#include "support/room_corner.h"

#include "view_servo/MatchScene.h"
#include "view_servo/SceneMatches.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

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
const std::string NODE = "scene_matcher";

class SceneMatcherNodeTest : public StreamingMatcherTest<MatchScene, SceneMatches>
{
protected:
  explicit SceneMatcherNodeTest(const RoomCorner& room = RoomCorner())
    : StreamingMatcherTest(NODE, "scene_matches", room.reference, room.current), room_(room)
  {
  }

  static void TearDownTestSuite()
  {
    removeViews(NODE);
  }

  /** The calibration of the camera that took the pictures of the room. */
  sensor_msgs::CameraInfo info(const cv::Mat& image) const
  {
    sensor_msgs::CameraInfo info = camera_.infoOf(image, ros::Time::now());
    info.K[2] = info.P[2] = 319.5;
    info.K[5] = info.P[6] = 239.5;
    return info;
  }

  void saveView(const std::string& name, const cv::Mat& image) const
  {
    StoredView view = viewOf(name, image);
    view.camera = toCamera(info(image));
    test::saveView(NODE, view);
  }

  void send(const cv::Mat& image)
  {
    StreamingMatcherTest::send(info(image), image);
  }

  template <typename Fields>
  void expectFundamental(const Fields& fields) const
  {
    EXPECT_EQ(fields.found, "fundamental");
    EXPECT_GT(fields.points.size(), 200U);
    EXPECT_FALSE(fields.lines.empty());
    const Eigen::Matrix3d f = toMatrix(fields.model_matrix);
    EXPECT_NEAR(f.norm(), 1.0, 1e-6);
    const Eigen::Matrix3d truth = room_.f.normalized();
    EXPECT_LT(std::min((f - truth).norm(), (f + truth).norm()), 0.01);
    const Eigen::Map<const Eigen::Vector2d> reference(fields.epipole_reference.data());
    const Eigen::Map<const Eigen::Vector2d> current(fields.epipole_current.data());
    EXPECT_LT((f * reference.homogeneous()).norm() / reference.homogeneous().norm(), 1e-6);
    EXPECT_LT((f.transpose() * current.homogeneous()).norm() / current.homogeneous().norm(), 1e-6);
  }

  template <typename Fields>
  void expectMotion(const Fields& fields) const
  {
    const auto& q = fields.rotation;
    const Eigen::Quaterniond turn(q.w, q.x, q.y, q.z);
    const Eigen::Quaterniond true_turn(Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitY()));
    EXPECT_LT(turn.angularDistance(true_turn), 0.01);
    const Eigen::Vector3d direction = toVector(fields.direction);
    EXPECT_NEAR(direction.norm(), 1.0, 1e-9);
    EXPECT_LT(std::acos(direction.dot(Eigen::Vector3d(-0.6, 0.1, 0.2).normalized())), 0.05);
    const Eigen::Map<const Eigen::Matrix<double, 6, 6>> covariance(fields.covariance.data());
    EXPECT_TRUE(covariance.isApprox(covariance.transpose(), 1e-6));
    EXPECT_GT(covariance.topLeftCorner(3, 3).trace(), 0.0);
    EXPECT_GT(covariance.bottomRightCorner(3, 3).trace(), 0.0);
  }

  template <typename Fields>
  static void expectNoMotion(const Fields& fields)
  {
    EXPECT_TRUE(std::isnan(fields.rotation.w));
    EXPECT_TRUE(toVector(fields.direction).array().isNaN().all());
    EXPECT_TRUE(std::isnan(fields.covariance[0]));
  }

  void expectRefusal(const MatchScene::Response& response, const std::string& naming) const override
  {
    expectFailure(response, naming);
    EXPECT_EQ(response.found, "");
    EXPECT_TRUE(toMatrix(response.model_matrix).array().isNaN().all());
    EXPECT_TRUE(std::isnan(response.epipole_reference[0]));
    EXPECT_TRUE(std::isnan(response.epipole_current[1]));
    expectNoMotion(response);
  }

  const RoomCorner room_;
};

TEST_F(SceneMatcherNodeTest, FindsTheFundamentalMatrixOfTwoFiles)
{
  MatchScene::Request request;
  request.reference.path = file("reference.png", picture_);
  request.query.path = file("query.png", seen_);
  request.overlay = true;
  const MatchScene::Response response = call(request);
  EXPECT_TRUE(response.success) << response.message;
  expectFundamental(response);
  expectNoMotion(response);
  EXPECT_GT(response.elapsed_ms, 0.0);
  EXPECT_EQ(response.overlay.encoding, sensor_msgs::image_encodings::BGR8);

  request.model = "relative_pose";
  request.overlay = false;
  const MatchScene::Response uncalibrated = call(request);
  EXPECT_FALSE(uncalibrated.success);
  EXPECT_NE(uncalibrated.message.find("the reference comes without a calibration"), std::string::npos)
      << uncalibrated.message;
  expectFundamental(uncalibrated);
  EXPECT_TRUE(uncalibrated.overlay.data.empty());
}

TEST_F(SceneMatcherNodeTest, TellsTheMotionBetweenStoredViews)
{
  saveView("room", room_.reference);
  saveView("room_seen", room_.current);
  MatchScene::Request request;
  request.reference.view = "room";
  request.query.view = "room_seen";
  request.model = "relative_pose";
  const MatchScene::Response response = call(request);
  EXPECT_TRUE(response.success) << response.message;
  expectFundamental(response);
  expectMotion(response);
}

TEST_F(SceneMatcherNodeTest, FindsAPlane)
{
  MatchScene::Request request = goodRequest();
  request.query.image = toMono8(warpedPicture(room_.reference, exampleHomography()));
  for (const char* model : { "", "homography" })
  {
    SCOPED_TRACE(model);
    request.model = model;
    const MatchScene::Response response = call(request);
    EXPECT_TRUE(response.success) << response.message;
    EXPECT_EQ(response.found, "homography");
    EXPECT_LT(cornerError(toMatrix(response.model_matrix), exampleHomography(), PICTURE_SIZE), 1.0);
    EXPECT_TRUE(std::isnan(response.epipole_reference[0]));
    expectNoMotion(response);
  }
}

TEST_F(SceneMatcherNodeTest, RefusesBadInputAndGoesOn)
{
  const std::vector<BadRequest> requests = {
    { "model", [](MatchScene::Request& request) { request.model = "affine"; }, "model: 'affine'" },
    { "missing file", fileAsQuery("/nowhere/picture.png"), "/nowhere/picture.png" },
    { "unknown view", viewAsReference("nobody"), "nobody" },
    { "unrelated", [](MatchScene::Request& request) { request.query.image = toMono8(texturedPicture(9)); },
      "no geometry found" },
    { "constant",
      [](MatchScene::Request& request) { request.query.image = toMono8(cv::Mat(360, 480, CV_8UC1, cv::Scalar(90))); },
      "too few" },
  };
  expectRefusals(requests);
  EXPECT_TRUE(call(goodRequest()).success);
}

TEST_F(SceneMatcherNodeTest, StreamsGeometryWithTheView)
{
  saveView("room", room_.reference);
  EXPECT_FALSE(setView("nobody").success);
  ASSERT_TRUE(setView("room").success);
  const Recorder<sensor_msgs::Image> overlays("scene_matcher/overlay");
  ASSERT_TRUE(waitUntil([&] { return matches_.last().has_value() && overlays.last().has_value(); },
                        [&] { send(room_.current); }));
  const SceneMatches message = *matches_.last();
  EXPECT_EQ(sent_.count(message.header.stamp), 1U);
  EXPECT_EQ(message.header.frame_id, camera_.frame_id);
  EXPECT_EQ(message.view, "room");
  EXPECT_EQ(message.reason, "");
  expectFundamental(message);
  expectMotion(message);
  EXPECT_EQ(overlays.last()->encoding, sensor_msgs::image_encodings::BGR8);

  // What shows something else is answered, too, with the reason.
  const cv::Mat blank(room_.current.size(), CV_8UC1, cv::Scalar(100));
  ASSERT_TRUE(waitUntil([&] { return !matches_.last()->reason.empty(); }, [&] { send(blank); }));
  EXPECT_EQ(matches_.last()->found, "");
  EXPECT_FALSE(matches_.last()->refused);
  expectNoMotion(*matches_.last());
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "scene_matcher_test");
}
