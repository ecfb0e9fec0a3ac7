// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/essential.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"

#include <opencv2/core/mat.hpp>

#include <functional>
#include <memory>
#include <string>

namespace view_servo
{
/**
 * Finds out by matching points and lines, without a prediction, how a camera has moved from a stored view of a scene
 * with depth. Stateless and safe to use from several threads.
 */
class SceneFinder
{
public:
  struct Question
  {
    std::shared_ptr<const PreparedImage> view;  ///< prepared with features()
    Camera view_camera;                         ///< that took the view, without a fault
    cv::Mat image;                              ///< 8-bit, one channel; not written to afterwards
    Camera camera;                              ///< that took the image, without a fault
  };

  enum class Kind
  {
    NOTHING,  ///< the view was not found
    PLANE,    ///< it was, but nine tenths of what is seen of it lie on one plane, or the camera has only turned
    SCENE     ///< it was, and it has depth
  };

  struct Answer
  {
    Kind kind = Kind::NOTHING;
    RelativePose motion;  ///< of a SCENE: from the view to the image, in the rectified frames of the two cameras
    /** Those of a SCENE that agree with the motion: (x, y) on z = 1 of the rectified frames. */
    Correspondences matches;
    std::string reason;  ///< why it is no SCENE, in one line; empty when it is
  };

  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit SceneFinder(const SceneMatcherParams& params = SceneMatcherParams());

  /** What Question::view has to be prepared with. */
  FeatureParams features() const
  {
    return matcher_.features();
  }

  /**
   * Looks for the view in the image.
   * @param given_up as in SceneMatcher::match(); once it holds, nothing is found.
   * @throws std::invalid_argument when the image has the wrong type or a camera a fault.
   */
  Answer find(const Question& question, const std::function<bool()>& given_up = {}) const;

private:
  SceneMatcher matcher_;
};

}  // namespace view_servo
