// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/line_segment.h"
#include "view_servo/matching/line_groups.h"
#include "view_servo/parameters/parameter.h"

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include <array>
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of the data on each image that line matching needs. */
struct LineFeatureParams
{
  LineGroupParams groups;
  int max_grouped = 400;     ///< at most this many segments, the longest, form groups and start regions
  int neighbours = 40;       ///< number of nearest segments that are kept for each grouped one, see neighboursOf()
  int neighbour_pairs = 15;  ///< most segments kept for each whose lines meet its own, the nearest, see meetings()

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(LineFeatureParams& params);

/**
 * The line segments of an image with all that matching needs: their neighbours, where their lines meet, the image
 * beside them, and their groups. Computed once for a stored view. Safe to use from several threads.
 *
 * Segments are kept longest first; input() says which one of those given it was. Memory is bounded by segments x
 * neighbours, and the groups by max_grouped x groups.max_neighbours² / 2, where that is not 0.
 */
class LineFeatures
{
public:
  /** A segment whose line meets that of another. */
  struct Meeting
  {
    int other = 0;                                 ///< index of the other segment
    Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< intersection of the two lines [px]
  };

  /** Sine of the least angle between lines that count as meeting, 0.2 rad. */
  static constexpr double MIN_SINE = 0.198669331;

  /**
   * @param grey 8-bit, one channel.
   * @param segments directed by their contrast, see directedByContrast().
   * @throws std::invalid_argument for another type of image, naming the parameters' faults, or when a segment is not
   * finite or has no length.
   */
  LineFeatures(const cv::Mat& grey, Segments segments, const LineFeatureParams& params);

  const Segments& segments() const
  {
    return segments_;
  }
  const Segment& segment(int i) const
  {
    return segments_[static_cast<std::size_t>(i)];
  }
  /** Unit vector from a segment's start to its end. */
  const Eigen::Vector2d& direction(int i) const
  {
    return directions_[static_cast<std::size_t>(i)];
  }
  /** Only the first groupedCount() segments, the longest, form groups. */
  int groupedCount() const
  {
    return static_cast<int>(near_.size());
  }
  /** Index of a segment among those given to the constructor. */
  int input(int i) const
  {
    return input_[static_cast<std::size_t>(i)];
  }
  /** The image, 8-bit, smoothed by a Gaussian with a standard deviation of 1.5 px. */
  const cv::Mat& smoothed() const
  {
    return smoothed_;
  }
  /** The neighbours of a grouped segment, nearest first. */
  const std::vector<int>& neighboursOf(int i) const
  {
    return near_[static_cast<std::size_t>(i)];
  }
  /**
   * The nearest segments whose lines meet that of a grouped segment within params.groups.max_distance of both segments,
   * nearest first.
   */
  const std::vector<Meeting>& meetings(int i) const
  {
    return meetings_[static_cast<std::size_t>(i)];
  }
  /**
   * The pairs or triplets formed by the first groupedCount() segments, sorted by key, for associateLines();
   * params.groups.groups is not used. Computed when first asked for.
   */
  const LineIndex& index(LineGrouping groups) const;

  /**
   * Puts into `found` all segments that lie within `tolerance` [px] across of a segment and within `max_angle_deg` < 90
   * of its direction, and a few others.
   */
  void alongside(const Segment& segment, double tolerance, double max_angle_deg, std::vector<int>& found) const;

private:
  static constexpr int DIRECTIONS = 36;

  /** Segments of about one direction, ordered across it. */
  struct DirectionBin
  {
    Eigen::Vector2d across;         ///< unit vector at a right angle to the direction; offsets are positions along it
    std::vector<int> segments;      ///< indices, in ascending order of the smaller offset of the segment's two ends
    std::vector<double> low;        ///< that smaller offset of each segment in `segments` [px]
    std::vector<double> high_here;  ///< largest offset of any end of this segment or one before it [px]
  };

  static int directionBin(const Eigen::Vector2d& direction);
  void fillDirectionBins();
  /** Sets near_ and meetings_. */
  void findNeighbours();

  struct Groups
  {
    std::once_flag once;
    LineIndex index;
  };

  LineFeatureParams params_;
  cv::Mat smoothed_;
  Segments segments_;
  std::vector<Eigen::Vector2d> directions_;
  std::vector<int> input_;
  std::vector<std::vector<int>> near_;
  std::vector<std::vector<Meeting>> meetings_;
  std::array<DirectionBin, DIRECTIONS> bins_;
  std::unique_ptr<std::array<Groups, 2>> groups_;
};

}  // namespace view_servo
