// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/plane_session.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/tracking/target_tracker.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_cache.h"

#include <std_msgs/Header.h>
#include <Eigen/Geometry>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of SessionStarter, explained there. */
struct SessionStarterParams
{
  std::filesystem::path views_dir;       ///< where stored views are; empty: as viewsDir() says
  std::string odom_frame = "base_link";  ///< frame that does not jump; empty: none
  double tf_patience = 0.05;             ///< longest wait of an image for tf [s]
  Target target = Target::PLANE;         ///< what views are taken to show
  PlaneTrackerParams tracker;
};

/** Names, units, ranges and meanings of these parameters. */
std::vector<Parameter> parameters(SessionStarterParams& params);

/**
 * Makes a PlaneSession for a view once everything is there that it needs: the stored view, images with a calibration,
 * and tf. Safe to use from several threads. Its parameters are `~views_dir`, `~odom_frame`, `~tf_patience`, `~target`
 * and those of tracking, see parameters(HomographyTrackerNodeParams&).
 */
class SessionStarter
{
public:
  struct Preparation
  {
    std::unique_ptr<PlaneSession> session;  ///< empty: not now
    bool refused = false;                   ///< it cannot be made later, either, unless somebody changes something
    std::string reason;                     ///< why there is no session; empty when there is
  };

  /** @param nh for tf. @param features that views are prepared with. @param camera must outlive this. */
  SessionStarter(const ros::NodeHandle& nh, const SessionStarterParams& params, const FeatureParams& features,
                 const CameraInput& camera);

  /** A session for a view, or the reason why there is none. Does not wait for what is missing. */
  Preparation prepare(const std::string& view);

  /**
   * The camera's pose when an image was taken; empty when tf does not know it. @param given_up as in waitUntilReady().
   */
  std::optional<Eigen::Isometry3d> cameraInOdom(const std_msgs::Header& image,
                                                const std::function<bool()>& given_up) const;

private:
  SessionStarterParams params_;
  const CameraInput& camera_;
  ViewCache views_;
  TransformSource transforms_;
};

}  // namespace view_servo
