// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/Homography.h"
#include "view_servo/control/still_pose.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/hand_eye.h"
#include "view_servo/views/view_store.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <vector>

namespace view_servo
{
/**
 * The corners of a stored view's region in images without distortion, as homography_tracker has them.
 * @throws std::runtime_error when this camera cannot show the view.
 */
HandEyeView handEyeViewOf(const StoredView& stored, const Camera& camera);

/** x_cur ~ H x_view, as a message has it [px]. */
Eigen::Matrix3d homographyOf(const Homography& message);

/**
 * Picks, out of what an arm and a tracker say while the arm is brought from pose to pose, the poses at which both stand
 * still.
 */
class HandEyeCollector
{
public:
  explicit HandEyeCollector(HandEyeView view = {});

  /**
   * Where the view was followed in an image. @param stamp of the image [s]. @param h x_cur ~ H x_view [px].
   * @return whether a pose was added: one beside another that was added before tells little, and is not.
   */
  bool add(double stamp, const Eigen::Matrix3d& h, const Eigen::Isometry3d& flange_in_base);
  /** The view is not followed in an image. */
  void clear();

  /** Whether the arm stands where a pose has been taken already. */
  bool atKnownPose() const
  {
    return at_known_pose_;
  }
  const HandEyeView& view() const
  {
    return view_;
  }
  const std::vector<HandEyePose>& poses() const
  {
    return poses_;
  }

private:
  bool isNew(const HandEyePose& pose) const;

  HandEyeView view_;
  StillPose still_;
  std::vector<HandEyePose> poses_;
  bool at_known_pose_ = false;
};

}  // namespace view_servo
