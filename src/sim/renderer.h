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
 * A camera in a world: OpenGL by OSMesa, without a display or a graphics card. Textures are mip-mapped, pixels
 * supersampled; a pixel's centre is at whole coordinates, as in K. Each object belongs to one thread at a time.
 */
class SimulatedCamera
{
public:
  /**
   * @param groups of surfaces to show besides those without a group.
   * @param seed of the noise; the same calls in the same order give the same images.
   * @throws std::invalid_argument for a group that no surface has or a distortion that cannot be inverted,
   * std::runtime_error when OpenGL cannot be had.
   */
  SimulatedCamera(const World& world, const std::vector<std::string>& groups, std::uint64_t seed);
  ~SimulatedCamera();
  SimulatedCamera(const SimulatedCamera&) = delete;
  SimulatedCamera& operator=(const SimulatedCamera&) = delete;

  void setLight(const Light& light);
  const Light& light() const
  {
    return light_;
  }

  /** What the camera sees, 8-bit with one channel. @param camera world from optical frame. */
  cv::Mat capture(const Eigen::Isometry3d& camera);
  /** The mean of what it sees from several poses, evenly spaced over its exposure. At least one. */
  cv::Mat capture(const std::vector<Eigen::Isometry3d>& during_exposure);

private:
  struct Context;

  /** Radiances [grey levels], 32-bit, before light and noise. */
  cv::Mat render(const Eigen::Isometry3d& camera);

  ImageQuality quality_;
  Light light_;
  cv::Size size_;
  cv::RNG noise_;
  Eigen::Matrix3d pinhole_;  ///< K of what OpenGL draws, larger than the image where the lens distorts
  cv::Size pinhole_size_;
  cv::Mat map_u_;  ///< where in that each pixel looks; empty without distortion
  cv::Mat map_v_;
  std::unique_ptr<Context> context_;
};

}  // namespace view_servo::sim
