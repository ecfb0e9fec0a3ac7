// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"
#include "support/temporary_directory.h"

#include "view_servo/ImageSource.h"
#include "view_servo/SetView.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/image_encodings.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <functional>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** What the tests of nodes that match share: `Service` is that of NODE/match. */
template <typename Service>
class MatcherTest : public ::testing::Test
{
protected:
  using Request = typename Service::Request;
  using Response = typename Service::Response;

  /** A request that cannot be answered. */
  struct BadRequest
  {
    std::string what;
    std::function<void(Request&)> spoil;  ///< makes it of a good one
    std::string naming;                   ///< what the refusal has to name
  };

  /** @param reference,current two 8-bit pictures that the node can match. */
  MatcherTest(const std::string& node, const cv::Mat& reference, const cv::Mat& current)
    : node_(node), picture_(reference), seen_(current)
  {
  }

  /** Writes a picture. @returns its path. */
  std::string file(const std::string& name, const cv::Mat& image) const
  {
    const std::string path = (directory_.path() / name).string();
    EXPECT_TRUE(cv::imwrite(path, image)) << path;
    return path;
  }

  /** The two pictures, as messages. */
  Request goodRequest() const
  {
    Request request;
    request.reference.image = toMono8(picture_);
    request.query.image = toMono8(seen_);
    return request;
  }

  /** Puts a file in the place of the current picture. */
  static std::function<void(Request&)> fileAsQuery(const std::string& path)
  {
    return [path](Request& request) {
      request.query = ImageSource();
      request.query.path = path;
    };
  }

  /** Puts a stored view in the place of the reference picture. */
  static std::function<void(Request&)> viewAsReference(const std::string& name)
  {
    return [name](Request& request) {
      request.reference = ImageSource();
      request.reference.view = name;
    };
  }

  /** Expects an answer without a result, whose message has the words `naming`. */
  virtual void expectRefusal(const Response& response, const std::string& naming) const = 0;

  void expectRefusals(const std::vector<BadRequest>& requests) const
  {
    for (const BadRequest& bad : requests)
    {
      SCOPED_TRACE(bad.what);
      Request request = goodRequest();
      request.overlay = true;
      bad.spoil(request);
      expectRefusal(call(request), bad.naming);
    }
  }

  /** Calls NODE/match. */
  Response call(const Request& request) const
  {
    return answerOf<Service>(node_ + "/match", request);
  }

  SetView::Response setView(const std::string& view) const
  {
    SetView::Request request;
    request.view = view;
    return answerOf<SetView>(node_ + "/set_view", request);
  }

  void saveView(const std::string& name, const cv::Mat& image) const
  {
    test::saveView(node_, viewOf(name, image));
  }

  const std::string node_;
  const cv::Mat picture_;
  const cv::Mat seen_;
  TemporaryDirectory directory_;
};

/** The same of nodes that answer to the camera's images, too; `Message` is what they publish. */
template <typename Service, typename Message>
class StreamingMatcherTest : public MatcherTest<Service>
{
protected:
  /** @param topic of the node's own that has its answers. */
  StreamingMatcherTest(const std::string& node, const std::string& topic, const cv::Mat& reference,
                       const cv::Mat& current)
    : MatcherTest<Service>(node, reference, current), matches_(node + "/" + topic)
  {
  }

  void SetUp() override
  {
    ASSERT_TRUE(waitForService(this->node_ + "/match"));
    ASSERT_TRUE(waitForService(this->node_ + "/set_view"));
    ASSERT_TRUE(camera_.waitForSubscribers(1));
    ASSERT_TRUE(this->setView("").success);
  }

  /** The camera takes an image now; its stamp is remembered. */
  void send(const sensor_msgs::CameraInfo& calibration, const cv::Mat& image)
  {
    camera_.publish(toImage(image, sensor_msgs::image_encodings::MONO8, calibration.header), calibration);
    sent_.insert(calibration.header.stamp);
  }
  void send(const cv::Mat& image)
  {
    send(camera_.infoOf(image, ros::Time::now()), image);
  }

  FakeCamera camera_{ "camera" };
  Recorder<Message> matches_;
  std::set<ros::Time> sent_;
};

}  // namespace test
}  // namespace view_servo
