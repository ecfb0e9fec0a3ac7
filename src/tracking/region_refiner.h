// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "shift_fit.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <cstddef>
#include <optional>
#include <vector>

namespace view_servo
{
/**
 * Refines a homography that is right to a few pixels by all pixels of a region of the stored view. The region is
 * divided into blocks, each normalised for the light on it. Steps of the inverse compositional method (Baker & Matthews
 * 2004) fit the eight parameters of the homography to all blocks together, and blocks that differ more than the others,
 * as those do that are partly hidden, count less.
 */
class RegionRefiner
{
public:
  /**
   * @param reference 8-bit, one channel. @param region inside it that shows the plane [px].
   * @param min_correlation least correlation of a block with what is seen in its place for the block to count, in [0,
   * 1).
   */
  RegionRefiner(const cv::Mat& reference, const cv::Rect& region, double min_correlation);

  /** Number of blocks; those of hardly any contrast are left out. */
  std::size_t size() const
  {
    return blocks_.size();
  }

  /**
   * @param current 8-bit, one channel. @param h x_cur ~ H x_ref [px].
   * @return the refined homography. It is `h` itself when fewer than 12 blocks are seen, or when a step would move a
   * corner of the region by 10 px or more.
   */
  Eigen::Matrix3d refine(const cv::Mat& current, const Eigen::Matrix3d& h) const;

private:
  static constexpr int RADIUS = 10;            // of a block [px]
  static constexpr int SIDE = 2 * RADIUS + 1;  // of a block [px]

  /** A square of the stored view, small enough to be all of one light, with what its alignment needs. */
  struct Block
  {
    Eigen::Vector2d at;             // its middle [px]
    float norm = 0.0F;              // of its grey values without their mean
    std::vector<float> values;      // zero mean, unit norm
    std::vector<float> gradient_u;  // of these
    std::vector<float> gradient_v;
    Matrix8 information;  // of a change, for grey values
  };

  /** What an image shows in the place of a block. */
  struct SeenBlock
  {
    const Block* block;
    double deviation;  // RMS difference of its pixels from those of the block [grey levels]
    Vector8 right;     // its part in the right side of the normal equations
  };

  /** The block whose upper left pixel is `corner`; empty when it has hardly any contrast. */
  std::optional<Block> makeBlock(const cv::Mat& image, const cv::Point& corner) const;
  /** What a block adds to the matrix of the normal equations. */
  Matrix8 informationOf(const Block& block) const;

  /** The blocks that the current image shows where h sends them, and that correlate enough with it. */
  std::vector<SeenBlock> seenBlocks(const cv::Mat& current, const Eigen::Matrix3d& h) const;
  /** Compares a block with the grey values seen in its place; empty when they correlate too little. */
  std::optional<SeenBlock> compare(const Block& block, const std::vector<float>& values) const;
  /** The change of the homography that fits the blocks best; empty when they do not determine it. */
  std::optional<Eigen::Matrix3d> solve(const std::vector<SeenBlock>& seen) const;
  /** By how much a change moves the corner of the region that it moves most [px]. */
  double largestShift(const Eigen::Matrix3d& change) const;

  float min_correlation_;
  Centring centring_;          // of the region
  std::vector<Block> blocks_;  // side by side over the region
};

}  // namespace view_servo
