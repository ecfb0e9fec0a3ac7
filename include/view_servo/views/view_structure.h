// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <string>
#include <vector>

namespace view_servo
{
/** A point of a stored view whose depth is known. */
struct StructurePoint
{
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< in the stored image, with the lens's distortion [px]
  double inverse_depth = 0.0;  ///< > 0: 1 / depth along the axis of the view's level camera (planar_motion.h) [1/m]
  /** > 0: 1 / variance of inverse_depth if level points had a standard deviation of 1 [m²]. */
  double information = 0.0;
};

/** What has been learnt of where the things are that a stored view shows. */
struct ViewStructure
{
  std::vector<StructurePoint> points;  ///< in no order; empty: nothing is known
};

/** A header and a line for each point, which structureFromText() reads. */
std::string toText(const ViewStructure& structure);

/** @throws std::runtime_error with what is wrong, in one line, unless toText() may have written it. */
ViewStructure structureFromText(const std::string& text);

}  // namespace view_servo
