// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "sim/world.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/core/mat.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace view_servo::sim
{
/**
 * The camera of a world. It draws by OpenGL (OSMesa), without a display or a graphics card; textures are mip-mapped and
 * pixels supersampled. The centre of a pixel is at whole coordinates, as K has it. An object must not be used by
 * several threads at once.
 */
class SimulatedCamera
{
public:
  /**
   * @param groups of surfaces to draw besides those without a group.
   * @param seed of the noise; the same calls in the same order give the same images.
   * @throws std::invalid_argument for a group that no surface has or a distortion that cannot be inverted.
   * @throws std::runtime_error when there is no OpenGL.
   */
  SimulatedCamera(const World& world, const std::vector<std::string>& groups, std::uint64_t seed);
  ~SimulatedCamera();
  SimulatedCamera(const SimulatedCamera&) = delete;
  SimulatedCamera& operator=(const SimulatedCamera&) = delete;

  /** Changes the light of the images that follow. */
  void setLight(const Light& light);
  const Light& light() const
  {
    return light_;
  }

  /** An image, 8-bit with one channel, without exposure. @param camera world from optical frame. */
  cv::Mat capture(const Eigen::Isometry3d& camera);
  /**
   * An image that is blurred by motion, 8-bit with one channel: the mean of what is seen from several poses.
   * @param during_exposure world from optical frame, at times spread evenly over the exposure; at least one.
   */
  cv::Mat capture(const std::vector<Eigen::Isometry3d>& during_exposure);

private:
  struct Context;

  /** Radiances [grey levels], 32-bit with one channel, before light and noise. */
  cv::Mat render(const Eigen::Isometry3d& camera);

  ImageQuality quality_;
  Light light_;
  cv::Size size_;
  cv::RNG noise_;
  Eigen::Matrix3d pinhole_;  ///< K of what OpenGL draws, larger than the image where the lens distorts
  cv::Size pinhole_size_;
  cv::Mat map_u_;  ///< u, in what OpenGL draws, of each pixel of the image [px]; empty without distortion
  cv::Mat map_v_;  ///< v likewise
  std::unique_ptr<Context> context_;
};

}  // namespace view_servo::sim
