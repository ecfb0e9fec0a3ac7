// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"
#include "store_from_camera.h"

#include "view_servo/PointMatches.h"
#include "view_servo/SetView.h"
#include "view_servo/WantedView.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
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

}  // namespace test
}  // namespace view_servo
