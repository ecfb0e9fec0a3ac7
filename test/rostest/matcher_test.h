// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"
#include "support/temporary_directory.h"

#include "view_servo/SetView.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <string>

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

  /** Calls NODE/match. */
  Response call(const Request& request) const
  {
    return answer<Service>(node_ + "/match", request);
  }

  SetView::Response setView(const std::string& view) const
  {
    SetView::Request request;
    request.view = view;
    return answer<SetView>(node_ + "/set_view", request);
  }

  void save(const StoredView& view) const
  {
    ViewStore(viewsDir(node_)).save(view, true);
  }

  void saveView(const std::string& name, const cv::Mat& image) const
  {
    StoredView view;
    view.name = name;
    view.image = image;
    save(view);
  }

  /** Success is denied in one line that holds `naming`. */
  static void expectFailure(const Response& response, const std::string& naming)
  {
    EXPECT_FALSE(response.success);
    EXPECT_NE(response.message.find(naming), std::string::npos) << response.message << "\ndoes not name " << naming;
    EXPECT_EQ(response.message.find('\n'), std::string::npos) << response.message;
  }

  template <typename Called>
  static typename Called::Response answer(const std::string& service, typename Called::Request request)
  {
    typename Called::Response response;
    EXPECT_TRUE(callService(service, request, response)) << "the node did not answer";
    return response;
  }

  const std::string node_;
  const cv::Mat picture_;
  const cv::Mat seen_;
  TemporaryDirectory directory_;
};

}  // namespace test
}  // namespace view_servo
