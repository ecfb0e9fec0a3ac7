// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "child_process.h"
#include "node_test.h"
#include "sim_ros/robot_messages.h"
#include "support/recorded_bag.h"
#include "support/shipped_files.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"

#include "test_paths.h"
#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SetView.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <rosgraph_msgs/Clock.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** A base that drives up to a wall with a picture, its only plane, and passes the goal on the way. */
const std::string WORLD = R"(
robot: {kind: nomad, camera_height: 1.0}
camera: {width: 480, height: 360, fx: 400, noise: 1}
textures:
  picture: {kind: poster, size: [1024, 512], seed: 5, count: 12}
rectangles:
  - {name: picture, size: [4.5, 2.5], position: [2, 0, 1], facing: [-1, 0, 0], texture: picture}
goal: {x: 0, y: 0}
trajectories:
  way:
    - {time: 0, x: -0.4, y: 0.15}
    - {time: 2, x: 0, y: 0, yaw_deg: 5}
    - {time: 3, x: 0.1, y: 0, yaw_deg: -5}
)";
constexpr double WALL_X = 2.0;  // of the wall [m]

/** Where a camera sees the wall: from (y, z) of the world to pixels. */
Eigen::Matrix3d imageFromWall(const Camera& camera, const Eigen::Isometry3d& pose)
{
  const Eigen::Isometry3d camera_from_world = pose.inverse();
  Eigen::Matrix3d columns;
  columns << camera_from_world.linear().col(1), camera_from_world.linear().col(2),
      camera_from_world * Eigen::Vector3d(WALL_X, 0.0, 0.0);
  return camera.k * columns;
}

/** Plays one bag to the matchers, which know its first image as a view. */
class BagReplayTest : public ::testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    directory_ = std::make_unique<TemporaryDirectory>();
    const std::string world = writeText(directory_->path() / "wall.yaml", WORLD);
    bag_ = directory_->path() / "run.bag";
    recordBag(world, "way", bag_);
    ASSERT_FALSE(HasFatalFailure());

    StoredView first;
    Camera camera;
    std::map<ros::Time, Eigen::Isometry3d> poses;
    const rosbag::Bag bag(bag_);
    for (const rosbag::MessageInstance& instance : rosbag::View(bag))
    {
      if (const auto truth = instance.instantiate<geometry_msgs::PoseStamped>())
      {
        poses[truth->header.stamp] = sim::toIsometry(truth->pose);
      }
      else if (const auto info = instance.instantiate<sensor_msgs::CameraInfo>())
      {
        camera = toCamera(*info);
      }
      else if (const auto image = instance.instantiate<sensor_msgs::Image>())
      {
        first.image = first.image.empty() ? toGrey(*image, "image") : first.image;
      }
    }
    const Eigen::Matrix3d reference = imageFromWall(camera, poses.begin()->second);
    for (const auto& [stamp, pose] : poses)
    {
      truth_[stamp] = imageFromWall(camera, pose) * reference.inverse();
    }
    first.name = "first";
    for (const char* node : { "point_matcher", "line_matcher" })
    {
      ASSERT_TRUE(waitForService(std::string(node) + "/set_view"));
      saveView(node, first);
    }
  }

  static void TearDownTestSuite()
  {
    removeViews("point_matcher");
    removeViews("line_matcher");
    directory_.reset();
  }

  static void setViews(const std::string& view = "first")
  {
    for (const char* node : { "point_matcher", "line_matcher" })
    {
      SetView::Request request;
      request.view = view;
      const SetView::Response response = answerOf<SetView>(std::string(node) + "/set_view", request);
      ASSERT_TRUE(response.success) << response.message;
    }
  }

  /** @param rate of the bag's clock, on a machine that has nothing else to do. */
  static std::vector<std::string> player(const std::vector<std::string>& more, double rate = 1.0)
  {
    std::vector<std::string> command{ "rosbag", "play", "--clock", "--quiet", playRate(rate), bag_ };
    command.insert(command.end(), more.begin(), more.end());
    return command;
  }

  /** Where the wall's points truly go, from the view to the image of that stamp. */
  static Eigen::Matrix3d truthAt(const ros::Time& stamp)
  {
    const auto found = truth_.find(stamp);
    EXPECT_NE(found, truth_.end()) << "the bag has no " << stamp;
    return found != truth_.end() ? found->second : Eigen::Matrix3d(Eigen::Matrix3d::Zero());
  }

  static void expectTrue(const std::vector<PointMatch>& points, const ros::Time& stamp)
  {
    const Eigen::Matrix3d truth = truthAt(stamp);
    std::vector<double> errors;
    for (const PointMatch& point : points)
    {
      if (point.inlier)
      {
        const Eigen::Vector2d expected = transfer(truth, { point.reference_x, point.reference_y });
        errors.push_back((expected - Eigen::Vector2d(point.current_x, point.current_y)).norm());
      }
    }
    ASSERT_GT(errors.size(), 20u) << stamp;
    const auto middle = errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2);
    std::nth_element(errors.begin(), middle, errors.end());
    EXPECT_LT(*middle, 1.0) << stamp;
  }

  static void expectTrue(const Recorder<PointMatches>& answers)
  {
    for (const PointMatches& answer : answers.messages())
    {
      EXPECT_EQ(answer.view, "first");
      EXPECT_EQ(answer.header.frame_id, sim::CAMERA_FRAME);
      ASSERT_TRUE(answer.homography.valid) << answer.header.stamp;
      EXPECT_LT(cornerError(toMatrix(answer.homography.h), truthAt(answer.header.stamp)), 1.5) << answer.header.stamp;
      expectTrue(answer.matches, answer.header.stamp);
    }
  }

  static void expectTrue(const Recorder<LineMatches>& answers)
  {
    for (const LineMatches& answer : answers.messages())
    {
      EXPECT_EQ(answer.view, "first");
      EXPECT_EQ(answer.header.frame_id, sim::CAMERA_FRAME);
      EXPECT_GT(answer.matches.size(), 10u) << answer.header.stamp;
      expectTrue(answer.points, answer.header.stamp);
    }
  }

  /** How often the bag began anew between two answers. */
  template <typename Message>
  static int restarts(const Recorder<Message>& answers)
  {
    int count = 0;
    ros::Time last;
    for (const Message& answer : answers.messages())
    {
      count += answer.header.stamp < last ? 1 : 0;
      last = answer.header.stamp;
    }
    return count;
  }

  static std::unique_ptr<TemporaryDirectory> directory_;
  static std::string bag_;
  static std::map<ros::Time, Eigen::Matrix3d> truth_;
};

std::unique_ptr<TemporaryDirectory> BagReplayTest::directory_;
std::string BagReplayTest::bag_;
std::map<ros::Time, Eigen::Matrix3d> BagReplayTest::truth_;

TEST_F(BagReplayTest, AnswersAgreeWithTheTruth)
{
  setViews();
  const Recorder<PointMatches> points("point_matcher/point_matches");
  const Recorder<LineMatches> lines("line_matcher/line_matches");
  const ChildProcess bag(player({}, 0.5));  // it is played once: with busy processors, too, five images are answered
  EXPECT_TRUE(waitUntil([&] { return points.messages().size() >= 5 && lines.messages().size() >= 5; }));
  EXPECT_EQ(restarts(points) + restarts(lines), 0);
  expectTrue(points);
  expectTrue(lines);
}

TEST_F(BagReplayTest, GoesOnWhenTheBagLoops)
{
  setViews();
  const Recorder<PointMatches> points("point_matcher/point_matches");
  const Recorder<LineMatches> lines("line_matcher/line_matches");
  const ChildProcess bag(player({ "--loop" }));
  EXPECT_TRUE(waitUntil([&] { return restarts(points) >= 2 && restarts(lines) >= 2; }))
      << restarts(points) << " and " << restarts(lines) << " restarts";
  expectTrue(points);
  expectTrue(lines);
}

TEST_F(BagReplayTest, NodesMayStartLate)
{
  const ChildProcess bag(player({ "--loop" }));
  const Recorder<LineMatches> early("line_matcher/line_matches");
  ASSERT_TRUE(waitUntil([&] { return early.last().has_value(); })) << "the bag does not play";

  const auto node = [](const std::string& program, const std::string& name) {
    return std::vector<std::string>{ program,
                                     "__name:=late_" + name,
                                     "_view:=first",
                                     "_rate:=50.0",
                                     "_views_dir:=" + viewsDir(name).string(),
                                     "image_raw:=camera/image_raw",
                                     "camera_info:=camera/camera_info" };
  };
  const ChildProcess point_matcher(node(POINT_MATCHER_PATH, "point_matcher"));
  const ChildProcess line_matcher(node(LINE_MATCHER_PATH, "line_matcher"));
  const Recorder<PointMatches> points("late_point_matcher/point_matches");
  const Recorder<LineMatches> lines("late_line_matcher/line_matches");
  EXPECT_TRUE(waitUntil([&] { return points.messages().size() >= 3 && lines.messages().size() >= 3; }));
  expectTrue(points);
  expectTrue(lines);
}

/** A trajectory of one of the package's worlds. */
struct ShippedRun
{
  const char* world;
  const char* trajectory;
};

/** Shows a run to the matchers, whose view is its last image, image by image. */
class ShippedRunTest : public BagReplayTest, public ::testing::WithParamInterface<ShippedRun>
{
protected:
  /**
   * Those that count as inliers must lie where the camera's true motion lets them.
   *
   * @return whether there are any.
   */
  static bool expectPossible(const std::vector<PointMatch>& points, const TrueGeometry& truth, double limit)
  {
    std::vector<double> errors;
    for (const PointMatch& point : points)
    {
      if (point.inlier)
      {
        errors.push_back(
            truth.error({ { point.reference_x, point.reference_y }, { point.current_x, point.current_y } }));
      }
    }
    EXPECT_TRUE(errors.empty() || medianOf(errors) < limit) << medianOf(errors);
    return !errors.empty();
  }

  /** What a bag's camera has sent, by stamp. */
  static std::map<ros::Time, CameraMessages> imagesOf(const std::string& file)
  {
    const rosbag::Bag bag(file);
    std::map<ros::Time, CameraMessages> images;
    for (const rosbag::MessageInstance& instance : rosbag::View(bag))
    {
      if (const auto image = instance.instantiate<sensor_msgs::Image>())
      {
        images[image->header.stamp].image = *image;
      }
      else if (const auto info = instance.instantiate<sensor_msgs::CameraInfo>())
      {
        images[info->header.stamp].info = *info;
      }
    }
    return images;
  }

  template <typename Message>
  static std::optional<Message> answerTo(const ros::Time& stamp, const Recorder<Message>& answers)
  {
    const std::optional<Message> last = answers.last();
    return last && last->header.stamp == stamp ? last : std::nullopt;
  }

  /**
   * Publishes an image at its time, however long the matchers work on it; again after a while, as the first may come
   * before its time does.
   */
  void show(const CameraMessages& messages)
  {
    const ros::WallDuration patience(2.0 * SLOWDOWN);
    rosgraph_msgs::Clock clock;
    clock.clock = messages.image.header.stamp;
    clock_.publish(clock);
    const ros::WallTime now = ros::WallTime::now();
    if (clock.clock != shown_ || now - shown_at_ > patience)
    {
      camera_.publish(messages.image, messages.info);
      shown_ = clock.clock;
      shown_at_ = now;
    }
  }

  ros::Publisher clock_ = ros::NodeHandle().advertise<rosgraph_msgs::Clock>("/clock", 1);
  FakeCamera camera_{ "camera" };
  ros::Time shown_;
  ros::WallTime shown_at_;
};

TEST_P(ShippedRunTest, EachImageIsAnsweredTrulyOrRefused)
{
  const std::string bag = directory_->path() / (std::string(GetParam().world) + "_" + GetParam().trajectory + ".bag");
  recordBag(worldFile(GetParam().world), GetParam().trajectory, bag, { "--rate", "1" });
  ASSERT_FALSE(HasFatalFailure());
  const std::vector<Frame> frames = framesOf(bag);
  for (const char* node : { "point_matcher", "line_matcher" })
  {
    saveView(node, viewOf("last", frames.back().image));
  }
  setViews("last");
  ASSERT_TRUE(camera_.waitForSubscribers(2));
  const Recorder<PointMatches> points("point_matcher/point_matches");
  const Recorder<LineMatches> lines("line_matcher/line_matches");
  const std::map<ros::Time, CameraMessages> images = imagesOf(bag);
  int answered = 0;
  int answered_by_lines = 0;
  for (const Frame& frame : frames)
  {
    SCOPED_TRACE("at " + std::to_string(frame.time) + " s");
    ASSERT_TRUE(waitUntil([&] { return answerTo(frame.stamp, points) && answerTo(frame.stamp, lines); },
                          [&] { show(images.at(frame.stamp)); }));
    const TrueGeometry truth(frames.back(), frame);
    const std::optional<PointMatches> by_points = answerTo(frame.stamp, points);
    if (by_points->homography.valid)
    {
      ++answered;
      EXPECT_TRUE(expectPossible(by_points->matches, truth, 1.5));
    }
    const std::optional<LineMatches> by_lines = answerTo(frame.stamp, lines);
    const bool supported = expectPossible(by_lines->points, truth, 3.0);  // intersections are less certain than corners
    answered_by_lines += supported ? 1 : 0;
    EXPECT_TRUE(supported || !by_lines->reason.empty());
  }
  EXPECT_GE(answered, 4);
  EXPECT_GE(answered_by_lines, 3);
}

INSTANTIATE_TEST_SUITE_P(Worlds, ShippedRunTest,
                         ::testing::Values(ShippedRun{ "desk", "approach" }, ShippedRun{ "desk", "lose" },
                                           ShippedRun{ "cabinet", "approach" }, ShippedRun{ "corridor", "approach" },
                                           ShippedRun{ "rice", "approach" }, ShippedRun{ "rice", "lose" },
                                           ShippedRun{ "mouse", "approach" }, ShippedRun{ "mouse", "pass" }),
                         [](const ::testing::TestParamInfo<ShippedRun>& run) {
                           return std::string(run.param.world) + "_" + run.param.trajectory;
                         });

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "bag_replay_test");
}
