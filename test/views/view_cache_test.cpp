// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/view_cache.h"

#include "support/temporary_directory.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <memory>
#include <string>

namespace view_servo
{
namespace
{
class ViewCacheTest : public ::testing::Test
{
protected:
  void save(const std::string& name, int grey) const
  {
    StoredView view;
    view.name = name;
    view.image = cv::Mat(64, 64, CV_8UC1, cv::Scalar(grey));
    view.region = cv::Rect(8, 8, 32, 32);
    ViewStore(directory_.path()).save(view, true);
  }

  test::TemporaryDirectory directory_;
};

TEST_F(ViewCacheTest, ReadsAViewOnce)
{
  save("desk", 10);
  ViewCache cache{ ViewStore(directory_.path()), PointMatcherParams() };
  const std::shared_ptr<const PreparedImage> first = cache.get("desk").image;
  EXPECT_EQ(first->grey().at<uchar>(0, 0), 10);
  EXPECT_EQ(first->region(), cv::Rect(8, 8, 32, 32));
  EXPECT_EQ(cache.get("desk").image, first);
}

TEST_F(ViewCacheTest, PreparesViewsAsTold)
{
  StoredView view;
  view.name = "wall";
  view.image = test::texturedPicture(1);
  ViewStore(directory_.path()).save(view, true);
  LineSegmentParams segments;
  segments.max_segments = 7;
  ViewCache cache{ ViewStore(directory_.path()), { segments, LineFeatureParams() } };
  EXPECT_EQ(cache.get("wall").image->lines().segments().size(), 7U);
}

TEST_F(ViewCacheTest, ReadsAViewAgainThatWasSavedAnew)
{
  save("desk", 10);
  ViewCache cache{ ViewStore(directory_.path()), PointMatcherParams() };
  const std::shared_ptr<const PreparedImage> first = cache.get("desk").image;
  save("desk", 20);
  EXPECT_EQ(cache.get("desk").image->grey().at<uchar>(0, 0), 20);
  EXPECT_EQ(first->grey().at<uchar>(0, 0), 10);
}

TEST_F(ViewCacheTest, ForgetsTheViewUsedLongestAgo)
{
  save("a", 1);
  save("b", 2);
  save("c", 3);
  ViewCache cache{ ViewStore(directory_.path()), PointMatcherParams(), 2 };
  const std::shared_ptr<const PreparedImage> a = cache.get("a").image;
  const std::shared_ptr<const PreparedImage> b = cache.get("b").image;
  cache.get("a");
  cache.get("c");
  EXPECT_EQ(cache.get("a").image, a);
  EXPECT_NE(cache.get("b").image, b);
}

TEST_F(ViewCacheTest, DoesNotServeAViewThatIsGone)
{
  save("desk", 10);
  ViewCache cache{ ViewStore(directory_.path()), PointMatcherParams() };
  cache.get("desk");
  ViewStore(directory_.path()).remove("desk");
  EXPECT_THROW(cache.get("desk"), ViewStoreError);
  EXPECT_THROW(cache.get("../desk"), ViewStoreError);
}

}  // namespace
}  // namespace view_servo
