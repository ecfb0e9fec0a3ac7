// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "support/random_picture.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/thrown_message.h"
#include "view_servo/views/view_store.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** @file Views to store, and what the tests of a store share. */

inline const cv::Size PLAIN_SIZE(64, 48);

/** With what a view must have: a name and an image, another one for each seed. */
inline StoredView plainView(const std::string& name, int seed = 1)
{
  StoredView view;
  view.name = name;
  view.image = randomPicture(seed, PLAIN_SIZE);
  return view;
}

/** With numbers that are equal again only when all their digits are kept. */
inline StoredView fullView(const std::string& name)
{
  StoredView view = plainView(name, 3);
  view.region = cv::Rect(3, 4, 50, 40);
  view.stamp = 1700000000.0 + 1.0 / 3.0;
  view.frame_id = "camera: \"optical\" #1";
  view.camera.emplace();
  view.camera->width = 64;
  view.camera->height = 48;
  view.camera->distortion_model = "plumb_bob";
  view.camera->distortion = { -1.0 / 3.0, 1e-17, 0.1, -0.0, 1e300 };
  view.camera->k << 520.0 / 7.0, 0.0, 31.0 / 3.0, 0.0, 510.0 / 7.0, 24.1, 0.0, 0.0, 1.0;
  view.camera->rectification << 1.0, 1e-3 / 3.0, 0.0, -1e-3 / 3.0, 1.0, 0.0, 0.0, 0.0, 1.0;
  view.camera->projection << 70.0 / 3.0, 0.0, 32.0, -8.0 / 3.0, 0.0, 70.0 / 3.0, 24.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  view.pose.emplace();
  view.pose->frame = "odom";
  view.pose->position << 1.0 / 3.0, -2.0 / 7.0, std::numeric_limits<double>::denorm_min();
  view.pose->orientation = Eigen::Quaterniond(0.1, 0.2, 0.3, 0.4).normalized();
  return view;
}

inline void expectSame(const StoredView& a, const StoredView& b)
{
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(largestDifference(a.image, b.image), 0.0);
  EXPECT_EQ(a.region, b.region);
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_EQ(a.frame_id, b.frame_id);
  ASSERT_EQ(a.camera.has_value(), b.camera.has_value());
  if (a.camera)
  {
    EXPECT_EQ(a.camera->width, b.camera->width);
    EXPECT_EQ(a.camera->height, b.camera->height);
    EXPECT_EQ(a.camera->distortion_model, b.camera->distortion_model);
    EXPECT_EQ(a.camera->distortion, b.camera->distortion);
    EXPECT_EQ(a.camera->k, b.camera->k);
    EXPECT_EQ(a.camera->rectification, b.camera->rectification);
    EXPECT_EQ(a.camera->projection, b.camera->projection);
  }
  ASSERT_EQ(a.pose.has_value(), b.pose.has_value());
  if (a.pose)
  {
    EXPECT_EQ(a.pose->frame, b.pose->frame);
    EXPECT_EQ(a.pose->position, b.pose->position);
    EXPECT_EQ(a.pose->orientation.coeffs(), b.pose->orientation.coeffs());
  }
}

inline std::set<std::string> filesIn(const std::filesystem::path& directory)
{
  std::set<std::string> names;
  for (const std::filesystem::directory_entry& entry : std::filesystem::directory_iterator(directory))
  {
    names.insert(entry.path().filename());
  }
  names.erase(".lock");
  return names;
}

/** What `action` complains about; it must complain in one line. */
template <typename Action>
std::string errorOf(const Action& action)
{
  std::string message = thrownMessage<std::runtime_error>(action);
  EXPECT_EQ(message.find('\n'), std::string::npos) << message;
  return message;
}

/** The store's checksum, FNV-1a of 64 bits, for whoever forges one. */
inline std::string fnv1a(const std::string& bytes)
{
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char byte : bytes)
  {
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  }
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(hash));
  return text.data();
}

#define EXPECT_ERROR(action, part) \
  EXPECT_NE(errorOf([&] { action; }).find(part), std::string::npos) << errorOf([&] { action; })

/** A store in a directory of its own, empty and not yet there. */
class ViewStoreTest : public ::testing::Test
{
protected:
  ViewStoreTest() : store_(directory_.path() / "views")
  {
  }

  /** The one file of the store whose name starts and ends so. */
  std::filesystem::path file(const std::string& prefix, const std::string& suffix) const
  {
    std::filesystem::path found;
    for (const std::string& name : filesIn(store_.directory()))
    {
      const bool starts = name.rfind(prefix, 0) == 0;
      const bool ends = name.size() >= suffix.size() && name.substr(name.size() - suffix.size()) == suffix;
      if (starts && ends)
      {
        EXPECT_TRUE(found.empty()) << name << " and " << found;
        found = store_.directory() / name;
      }
    }
    EXPECT_FALSE(found.empty()) << prefix << "*" << suffix;
    return found;
  }

  /** That the view `bad`, and only it, is reported as damaged, for `reason`, while `good` stays usable. */
  void expectOnlyBadDamaged(const std::string& reason) const
  {
    const ViewStore::Listing listing = store_.list();
    EXPECT_EQ(listing.names, std::vector<std::string>{ "good" });
    ASSERT_EQ(listing.damaged.size(), 1U);
    EXPECT_EQ(listing.damaged[0].name, "bad");
    EXPECT_NE(listing.damaged[0].reason.find(reason), std::string::npos) << listing.damaged[0].reason;
    EXPECT_ERROR(store_.load("bad"), "'bad'");
    EXPECT_ERROR(store_.load("bad"), reason);
    expectSame(store_.load("good"), plainView("good"));
  }

  TemporaryDirectory directory_;
  ViewStore store_;
};

}  // namespace test
}  // namespace view_servo
