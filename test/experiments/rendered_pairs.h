// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "experiments/point_pairs.h"
#include "sim/textures.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <string>

namespace view_servo
{
namespace test
{
/** @file Pairs of rendered images in place of the photographs that the experiments read. */

/** @param size of the picture on the surface [px]. */
inline cv::Mat posterOf(const cv::Size& size)
{
  return sim::drawTexture("poster", size, 128.0, 20, 5);
}

inline PointPair renderedPlane()
{
  return renderPair(Surface::PLANE, posterOf(cv::Size(900, 720)), 0.9, 1);
}

inline PointPair renderedCylinder()
{
  return renderPair(Surface::CYLINDER, posterOf(cv::Size(2500, 560)), 0.7, 1);
}

/** Adds a pair, with every seventh of its points, to a folder laid out like the data set kusvod2, which this makes. */
inline void writeKusvodPair(const std::filesystem::path& folder, const std::string& name, const PointPair& pair)
{
  std::filesystem::create_directories(folder);
  EXPECT_TRUE(cv::imwrite((folder / (name + "A.png")).string(), pair.reference));
  EXPECT_TRUE(cv::imwrite((folder / (name + "B.png")).string(), pair.current));
  std::ofstream points(folder / (name + "_vpts.txt"));
  points << std::setprecision(17);
  for (std::size_t i = 0; i < pair.points.size(); i += 7)
  {
    points << pair.points[i].reference.transpose() << ' ' << pair.points[i].current.transpose() << '\n';
  }
  points.close();
  EXPECT_TRUE(points) << folder;
}

}  // namespace test
}  // namespace view_servo
