// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <filesystem>
#include <vector>

namespace view_servo
{
/** An image of the board, and where the arm held the camera. */
struct ArmView
{
  Eigen::Isometry3d hand_in_base;    ///< pose of the hand by the joints [m]
  Eigen::Isometry3d camera_in_base;  ///< pose of the camera by the joints and ArmData::camera_in_hand [m]
  Points corners;                    ///< of the board [px], in the order of board()
};

/** What eyeinhand_franka_visp holds: a chessboard, seen by a camera on the hand of a real arm. */
struct ArmData
{
  static constexpr int ROWS = 6;     ///< rows of the board's corners, which are in the order of rows
  static constexpr int COLUMNS = 9;  ///< corners in a row
  static constexpr std::size_t CORNERS = ROWS * COLUMNS;  ///< number of corners
  static constexpr double SQUARE = 0.0236;                ///< side of the board's squares [m]

  Camera camera;
  Eigen::Isometry3d camera_in_hand = Eigen::Isometry3d::Identity();  ///< as the data have it [m]
  std::vector<ArmView> views;

  /** The corners in the board's own frame [m]. */
  static std::vector<Eigen::Vector3d> board();
};

/** @param folder of the data. @throws std::runtime_error naming what is missing or cannot be read. */
ArmData readArmData(const std::filesystem::path& folder);

/**
 * Takes the distortion that the camera's file leaves out from the corners: radial, from the squares of the board alone.
 * @return the root mean square distance of the corners from where the board is seen then [px].
 */
double removeDistortion(ArmData& data);

}  // namespace view_servo
