// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "change_parameters.h"
#include "node_test.h"
#include "store_from_camera.h"
#include "support/text_file.h"

#include "view_servo/DeleteView.h"
#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SaveView.h"
#include "view_servo/SetView.h"
#include "view_servo/WantedView.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/views/view_store.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** Two robots, each with the nodes of matching.launch in its namespace. */
class StreamingTest : public ::testing::Test
{
protected:
  struct Robot
  {
    explicit Robot(const std::string& ns)
      : name(ns),
        camera(ns + "/camera"),
        matches(ns + "/point_matcher/point_matches"),
        wanted(ros::NodeHandle().advertise<WantedView>(ns + "/wanted_view", 1, true))
    {
    }

    /** What a driver does. */
    void want(const std::string& view, const std::string& goal) const
    {
      wanted.publish(wantedView(view, goal));
    }

    /** Whether the last answer is about a view and a goal. */
    bool answersFor(const std::string& view, const std::string& goal) const
    {
      const std::optional<PointMatches> last = matches.last();
      return last && last->view == view && last->goal == goal;
    }

    /** Waits until the view is refused for a goal; a message says why. */
    void expectRefusal(const std::string& view, const std::string& goal, const std::string& words,
                       const std::function<void()>& step = nullptr) const
    {
      want(view, goal);
      ASSERT_TRUE(waitUntil([&] { return answersFor(view, goal); }, step)) << goal;
      const PointMatches answer = *matches.last();
      EXPECT_TRUE(answer.refused);
      EXPECT_NE(answer.reason.find(words), std::string::npos) << answer.reason;
      EXPECT_TRUE(answer.matches.empty());
      EXPECT_FALSE(answer.homography.valid);
      EXPECT_TRUE(answer.homography.refused);
      EXPECT_EQ(answer.homography.goal, goal);
      EXPECT_EQ(answer.homography.reason, answer.reason);
    }

    /** A frame of the picture now; its stamp is remembered. */
    void send(const cv::Mat& image)
    {
      const ros::Time stamp = ros::Time::now();
      camera.publish(image, stamp);
      sent.insert(stamp);
    }

    template <typename Service>
    typename Service::Response call(const std::string& service, typename Service::Request request) const
    {
      return answerOf<Service>(name + "/" + service, request);
    }

    SetView::Response setView(const std::string& view) const
    {
      SetView::Request request;
      request.view = view;
      return call<SetView>("point_matcher/set_view", request);
    }

    /** Stores `image` from the camera, as a user does; not one that the camera took before. */
    void teach(const std::string& view, const cv::Mat& image)
    {
      storeFromCamera(name + "/view_store", view, [&] { send(image); });
    }

    std::string name;
    FakeCamera camera;
    Recorder<PointMatches> matches;
    ros::Publisher wanted;
    std::set<ros::Time> sent;
  };

  static void TearDownTestSuite()
  {
    removeViews("left/point_matcher");
    removeViews("right/point_matcher");
  }

  void SetUp() override
  {
    for (const Robot* robot : { &left_, &right_ })
    {
      ASSERT_TRUE(waitForService(robot->name + "/point_matcher/set_view"));
      ASSERT_TRUE(waitForService(robot->name + "/view_store/save"));
      ASSERT_TRUE(robot->camera.waitForSubscribers(2));
      ASSERT_TRUE(waitUntil([&] { return robot->wanted.getNumSubscribers() >= 2; }));
      ASSERT_TRUE(robot->setView("").success);
    }
  }

  /** Whether a status came whose name and message contain all these. */
  static bool reported(const Recorder<diagnostic_msgs::DiagnosticArray>& diagnostics, const std::string& node,
                       const std::vector<std::string>& words)
  {
    for (const diagnostic_msgs::DiagnosticArray& array : diagnostics.messages())
    {
      for (const diagnostic_msgs::DiagnosticStatus& status : array.status)
      {
        if (status.level == diagnostic_msgs::DiagnosticStatus::ERROR && status.name.find(node) != std::string::npos &&
            std::all_of(words.begin(), words.end(),
                        [&](const std::string& word) { return status.message.find(word) != std::string::npos; }))
        {
          return true;
        }
      }
    }
    return false;
  }

  Robot left_{ "left" };
  Robot right_{ "right" };
  const cv::Mat picture_ = texturedPicture(1);
  const cv::Mat seen_ = warped(picture_, exampleHomography());
};

TEST_F(StreamingTest, MatchesCameraImagesWithTheView)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  left_.sent.clear();
  ASSERT_TRUE(
      waitUntil([&] { return left_.matches.last() && left_.sent.count(left_.matches.last()->header.stamp) > 0; },
                [&] { left_.send(seen_); }));

  const PointMatches message = *left_.matches.last();
  EXPECT_EQ(message.header.frame_id, left_.camera.frame_id);
  EXPECT_EQ(message.view, "wall");
  EXPECT_EQ(message.homography.header.stamp, message.header.stamp);
  EXPECT_EQ(message.homography.header.frame_id, message.header.frame_id);
  EXPECT_EQ(message.homography.view, "wall");
  EXPECT_TRUE(message.homography.valid);
  EXPECT_EQ(message.homography.state, Homography::TRACKING);
  EXPECT_LT(cornerError(toMatrix(message.homography.h), exampleHomography()), 1.5);
  EXPECT_EQ(message.homography.matches, static_cast<int>(message.matches.size()));
  EXPECT_TRUE(right_.matches.messages().empty()) << "a node answered to the other's camera";
}

TEST_F(StreamingTest, SaysSoWhenTheViewIsNotSeen)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  const cv::Mat other = texturedPicture(5);
  ASSERT_TRUE(waitUntil([&] { return left_.matches.last() && !left_.matches.last()->homography.valid; },
                        [&] { left_.send(other); }));
  EXPECT_EQ(left_.matches.last()->homography.state, Homography::SEARCHING);
  EXPECT_EQ(left_.matches.last()->homography.inliers, 0);
}

TEST_F(StreamingTest, DrawsTheOverlayForThoseWhoListen)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  const Recorder<sensor_msgs::Image> overlays("left/point_matcher/overlay");
  ASSERT_TRUE(waitUntil([&] { return overlays.last().has_value(); }, [&] { left_.send(seen_); }));
  EXPECT_EQ(overlays.last()->encoding, sensor_msgs::image_encodings::BGR8);
  EXPECT_EQ(overlays.last()->header.frame_id, left_.camera.frame_id);
  EXPECT_EQ(left_.sent.count(overlays.last()->header.stamp), 1u);
}

TEST_F(StreamingTest, KeepsTwoNamespacesApart)
{
  left_.teach("wall", picture_);
  right_.teach("floor", seen_);
  ASSERT_TRUE(left_.setView("wall").success);
  ASSERT_TRUE(right_.setView("floor").success);
  const auto matched = [](const Robot& robot, const std::string& view, const Eigen::Matrix3d& h) {
    const std::optional<PointMatches> last = robot.matches.last();
    return last && last->view == view && last->homography.valid && cornerError(toMatrix(last->homography.h), h) < 1.5;
  };
  EXPECT_TRUE(waitUntil(
      [&] {
        return matched(left_, "wall", exampleHomography()) && matched(right_, "floor", exampleHomography().inverse());
      },
      [&] {
        left_.send(seen_);
        right_.send(picture_);
      }));
}

TEST_F(StreamingTest, FollowsSetView)
{
  left_.teach("wall", picture_);
  left_.teach("poster", texturedPicture(3));
  ASSERT_TRUE(left_.setView("wall").success);
  EXPECT_FALSE(left_.setView("nobody").success);
  EXPECT_NE(left_.setView("nobody").message.find("nobody"), std::string::npos);
  EXPECT_FALSE(left_.setView("../wall").success);
  EXPECT_TRUE(waitUntil([&] { return left_.matches.last() && left_.matches.last()->view == "wall"; },
                        [&] { left_.send(seen_); }));
  ASSERT_TRUE(left_.setView("poster").success);
  EXPECT_TRUE(waitUntil([&] { return left_.matches.last()->view == "poster"; }, [&] { left_.send(seen_); }));

  // Without a view nothing is matched but the image that may be under way.
  ASSERT_TRUE(left_.setView("").success);
  const ros::Time unset = ros::Time::now();
  right_.teach("floor", picture_);
  ASSERT_TRUE(right_.setView("floor").success);
  std::size_t images = 0;
  ASSERT_TRUE(waitUntil([&] { return right_.matches.messages().size() >= 5; },
                        [&] {
                          left_.send(seen_);
                          right_.send(picture_);
                          ++images;
                        }));
  EXPECT_GE(images, 5u);
  EXPECT_LE(left_.matches.last()->header.stamp, unset);
}

TEST_F(StreamingTest, PublishesNothingForAnUncalibratedCamera)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  ASSERT_TRUE(waitUntil([&] { return left_.matches.last().has_value(); }, [&] { left_.send(seen_); }));

  left_.camera.calibrated = false;
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  const ros::Time since = ros::Time::now();
  EXPECT_TRUE(waitUntil(
      [&] {
        return reported(diagnostics, "left/point_matcher",
                        { "not calibrated", "/left/camera/image_raw", "/left/camera/camera_info" });
      },
      [&] { left_.send(seen_); }));
  EXPECT_LE(left_.matches.last()->header.stamp, since);

  MatchPoints::Request request;
  request.reference.view = "wall";
  const MatchPoints::Response response = left_.call<MatchPoints>("point_matcher/match", request);
  EXPECT_FALSE(response.success);
  EXPECT_NE(response.message.find("/left/camera/camera_info"), std::string::npos) << response.message;

  SaveView::Request save;
  save.name = "never";
  EXPECT_FALSE(left_.call<SaveView>("view_store/save", save).success);
}

TEST_F(StreamingTest, MatchesTheLatestImageOnRequestUnlessItIsStale)
{
  left_.teach("wall", picture_);
  MatchPoints::Request request;
  request.reference.view = "wall";
  MatchPoints::Response response;
  EXPECT_TRUE(waitUntil(
      [&] {
        response = left_.call<MatchPoints>("point_matcher/match", request);
        return response.success && cornerError(toMatrix(response.model_matrix), exampleHomography()) < 1.5;
      },
      [&] { left_.send(seen_); }))
      << response.message;

  EXPECT_TRUE(waitUntil(
      [&] {
        response = left_.call<MatchPoints>("point_matcher/match", request);
        return !response.success && response.message.find("old") != std::string::npos;
      },
      [&] { left_.camera.publish(seen_, ros::Time::now() - ros::Duration(10.0)); }))
      << response.message;
  EXPECT_NE(response.message.find("max_image_age"), std::string::npos) << response.message;
}

TEST_F(StreamingTest, TakesTheRateAndThresholdsThatPeopleChange)
{
  constexpr double SLOW = 0.5;  // [Hz]
  const auto change = [](const std::map<std::string, double>& wanted) {
    return changeParameters("left/point_matcher", wanted);
  };
  const auto nextMatches = [this] {
    const std::size_t before = left_.matches.messages().size();
    EXPECT_TRUE(waitUntil([&] { return left_.matches.messages().size() > before + 1; }, [&] { left_.send(seen_); }));
    return left_.matches.last()->matches.size();
  };
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  const std::map<std::string, double> started = change({});
  const std::size_t usual = nextMatches();
  EXPECT_EQ(change({ { "patch_correlation", 1.5 } }), started) << "no correlation is as high";
  EXPECT_EQ(change({ { "patch_correlation", 0.999 } })["patch_correlation"], 0.999);
  EXPECT_LT(nextMatches(), usual);
  EXPECT_EQ(change({ { "patch_correlation", started.at("patch_correlation") }, { "rate", SLOW } })["rate"], SLOW);
  nextMatches();
  const std::size_t at = left_.matches.messages().size();
  ASSERT_TRUE(waitUntil([&] { return left_.matches.messages().size() > at; }, [&] { left_.send(seen_); }));
  const auto messages = left_.matches.messages();
  EXPECT_GT((messages[at].header.stamp - messages[at - 1].header.stamp).toSec(), 0.9 / SLOW);
  EXPECT_EQ(messages[at].matches.size(), usual);
  EXPECT_EQ(change({ { "rate", 1e9 } })["rate"], 4.0 * started.at("rate"));
  EXPECT_EQ(change(started), started);
}

TEST_F(StreamingTest, GoesOnWhenTheViewDisappears)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  DeleteView::Request request;
  request.name = "wall";
  ASSERT_TRUE(left_.call<DeleteView>("view_store/delete", request).success);
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  EXPECT_TRUE(
      waitUntil([&] { return reported(diagnostics, "left/point_matcher", { "wall" }); }, [&] { left_.send(seen_); }));

  const ros::Time since = ros::Time::now();
  left_.teach("wall", picture_);
  EXPECT_TRUE(waitUntil([&] { return left_.matches.last() && left_.matches.last()->header.stamp > since; },
                        [&] { left_.send(seen_); }));
}

TEST_F(StreamingTest, MatchesTheViewThatADriverWants)
{
  left_.teach("wall", picture_);
  left_.teach("poster", texturedPicture(3));
  left_.want("wall", "goal 1");
  const auto send = [&] {
    left_.send(seen_);
  };
  ASSERT_TRUE(
      waitUntil([&] { return left_.answersFor("wall", "goal 1") && left_.matches.last()->homography.valid; }, send));
  EXPECT_FALSE(left_.matches.last()->refused);
  EXPECT_EQ(left_.matches.last()->reason, "");
  EXPECT_EQ(left_.matches.last()->homography.goal, "goal 1");
  left_.want("poster", "goal 2");
  ASSERT_TRUE(waitUntil([&] { return left_.answersFor("poster", "goal 2"); }, send));
  EXPECT_FALSE(left_.matches.last()->refused);
  EXPECT_NE(left_.matches.last()->reason, "");
  ASSERT_TRUE(left_.setView("wall").success);
  ASSERT_TRUE(waitUntil([&] { return left_.answersFor("wall", ""); }, send));
  left_.want("wall", "goal 3");
  ASSERT_TRUE(waitUntil([&] { return left_.answersFor("wall", "goal 3"); }, send));

  // None, from a driver, ends what a driver wanted.
  left_.want("", "goal 3");
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  const auto ended = [&] {
    for (const diagnostic_msgs::DiagnosticArray& array : diagnostics.messages())
    {
      for (const diagnostic_msgs::DiagnosticStatus& status : array.status)
      {
        if (status.name.find("left/point_matcher") != std::string::npos && status.message == "no view is set")
        {
          return true;
        }
      }
    }
    return false;
  };
  EXPECT_TRUE(waitUntil(ended, send));
}

TEST_F(StreamingTest, NoneFromADriverLeavesAPersonsViewAlone)
{
  left_.teach("wall", picture_);
  ASSERT_TRUE(left_.setView("wall").success);
  left_.want("", "an old goal");
  const std::size_t before = left_.matches.messages().size();
  EXPECT_TRUE(waitUntil([&] { return left_.matches.messages().size() >= before + 20; }, [&] { left_.send(seen_); }));
  EXPECT_TRUE(left_.answersFor("wall", ""));
}

TEST_F(StreamingTest, RefusesAViewThatCannotBeMatched)
{
  const std::filesystem::path views = viewsDir("left/point_matcher");
  left_.expectRefusal("nobody", "missing", "nobody");  // without any image
  EXPECT_EQ(left_.matches.last()->header.frame_id, "");
  EXPECT_LT(std::abs((ros::Time::now() - left_.matches.last()->header.stamp).toSec()), 10.0);
  left_.expectRefusal("../wall", "name", "../wall");
  left_.teach("broken", picture_);
  writeText(views / "broken.yaml", "image: [");
  left_.expectRefusal("broken", "damaged", "broken");
  const auto send = [&] {
    left_.send(seen_);
  };

  // Who listens later learns of it, too.
  const Recorder<PointMatches> late("left/point_matcher/point_matches");
  EXPECT_TRUE(waitUntil([&] { return late.last() && late.last()->refused && late.last()->goal == "damaged"; }, send));
  left_.teach("wall", picture_);
  left_.want("wall", "good");
  EXPECT_TRUE(
      waitUntil([&] { return left_.answersFor("wall", "good") && left_.matches.last()->homography.valid; }, send));
}

TEST_F(StreamingTest, MatchesAViewOfAnotherSize)
{
  cv::Mat larger;
  cv::resize(picture_, larger, cv::Size(), 1.3, 1.3, cv::INTER_CUBIC);
  left_.teach("larger", larger);
  left_.want("larger", "size");
  EXPECT_TRUE(waitUntil([&] { return left_.answersFor("larger", "size") && left_.matches.last()->homography.valid; },
                        [&] { left_.send(seen_); }));
}

TEST_F(StreamingTest, OutlivesWhatACameraShouldNotSend)
{
  left_.teach("wall", picture_);
  left_.want("wall", "goal");
  const auto goes_on = [&] {
    const ros::Time since = ros::Time::now();
    return waitUntil(
        [&] {
          const std::optional<PointMatches> last = left_.matches.last();
          return last && last->header.stamp >= since && last->header.stamp < since + ros::Duration(DEADLINE) &&
                 last->homography.valid;
        },
        [&] { left_.send(seen_); });
  };
  ASSERT_TRUE(goes_on());
  for (const CameraMessages& odd : oddMessages(left_.camera, seen_))
  {
    SCOPED_TRACE(odd.name);
    left_.camera.publish(odd.image, odd.info);
    ASSERT_TRUE(goes_on());
  }

  // What is wrong with an image is said.
  CameraMessages torn{ "", toMono8(seen_), left_.camera.infoOf(seen_, ros::Time::now()) };
  torn.image.data.resize(10);
  EXPECT_TRUE(waitUntil(
      [&] {
        const std::optional<PointMatches> last = left_.matches.last();
        return last && !last->refused && last->goal == "goal" && last->reason.find("bytes") != std::string::npos;
      },
      [&] {
        torn.image.header = torn.info.header = left_.camera.infoOf(seen_, ros::Time::now()).header;
        left_.camera.publish(torn.image, torn.info);
      }))
      << left_.matches.last()->reason;
}

TEST_F(StreamingTest, NamesBothTopicsWhenTheirStampsDifferOrOneIsSilent)
{
  ros::NodeHandle nh;
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  ros::Publisher images = nh.advertise<sensor_msgs::Image>("right/camera/image_raw", 1);
  ros::Publisher infos = nh.advertise<sensor_msgs::CameraInfo>("right/camera/camera_info", 1);
  const auto told = [&](const std::string& words) {
    return [&diagnostics, words] {
      return reported(diagnostics, "right/point_matcher",
                      { words, "/right/camera/image_raw", "/right/camera/camera_info" });
    };
  };
  const auto send_image = [&] {
    sensor_msgs::Image image = toMono8(picture_);
    image.header.stamp = ros::Time::now();
    images.publish(image);
  };
  const auto send_info = [&] {
    infos.publish(FakeCamera("none").infoOf(picture_, ros::Time::now() - ros::Duration(1.0)));
  };
  EXPECT_TRUE(waitUntil(told("no camera_info comes on"), send_image));
  EXPECT_TRUE(waitUntil(told("no image comes on"), send_info));
  EXPECT_TRUE(waitUntil(told("same stamp"), [&] {
    send_image();
    send_info();
  }));
}

TEST_F(StreamingTest, CalibrationsThatAreHeardAfterAllTheirImagesAreNotMissing)
{
  constexpr std::size_t WAITING = 5;
  // Nothing is heard of what comes to this queue before the test asks it.
  ros::CallbackQueue queue;
  ros::NodeHandle nh("busy");
  nh.setCallbackQueue(&queue);
  std::size_t frames = 0;
  std::vector<std::string> problems;
  const CameraInput input(
      nh, ros::NodeHandle("~"), CameraInputParams(), [&](const CameraFrame&) { ++frames; },
      [&](const std::string& problem) { problems.push_back(problem); });
  const Recorder<sensor_msgs::Image> images("busy/image_raw");
  const Recorder<sensor_msgs::CameraInfo> infos("busy/camera_info");
  const ros::Publisher image_publisher = ros::NodeHandle().advertise<sensor_msgs::Image>("busy/image_raw", WAITING);
  const ros::Publisher info_publisher =
      ros::NodeHandle().advertise<sensor_msgs::CameraInfo>("busy/camera_info", WAITING);
  ASSERT_TRUE(
      waitUntil([&] { return image_publisher.getNumSubscribers() > 0 && info_publisher.getNumSubscribers() > 0; }));
  std::vector<sensor_msgs::CameraInfo> waiting;
  for (std::size_t i = 0; i < WAITING; ++i)
  {
    waiting.push_back(FakeCamera("none").infoOf(picture_, ros::Time(100.0 + 0.03 * static_cast<double>(i))));
    image_publisher.publish(toImage(picture_, sensor_msgs::image_encodings::MONO8, waiting.back().header));
  }
  ASSERT_TRUE(waitUntil([&] { return images.messages().size() == WAITING; }));
  for (const sensor_msgs::CameraInfo& info : waiting)
  {
    info_publisher.publish(info);
  }
  ASSERT_TRUE(waitUntil([&] { return infos.messages().size() == WAITING; }));
  queue.callAvailable();
  EXPECT_EQ(frames, WAITING);
  EXPECT_TRUE(problems.empty()) << problems.front();
  EXPECT_EQ(input.problem(), "");
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::test::runTests(argc, argv, "streaming_test");
}
