// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"

#include "view_servo/GetView.h"
#include "view_servo/SaveView.h"
#include "view_servo/ros/call_service.h"

#include <gtest/gtest.h>
#include <ros/time.h>

#include <functional>
#include <string>

namespace view_servo
{
namespace test
{
/**
 * Stores what the camera sees as a view, as a user does: an image that is sent from now on, not one from before.
 * @param view_store name of the node. @param send lets the camera take an image.
 */
inline void storeFromCamera(const std::string& view_store, const std::string& view, const std::function<void()>& send)
{
  SaveView::Request save;
  save.name = view;
  save.overwrite = true;
  GetView::Request get;
  get.name = view;
  SaveView::Response saved;
  const ros::Time start = ros::Time::now();
  EXPECT_TRUE(waitUntil(
      [&] {
        GetView::Response stored;
        EXPECT_TRUE(callService(view_store + "/save", save, saved)) << view_store << " did not answer";
        return saved.success && callService(view_store + "/get", get, stored) && stored.image.header.stamp > start;
      },
      send))
      << saved.message;
}

}  // namespace test
}  // namespace view_servo
