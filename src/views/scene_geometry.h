// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/corners.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/matching/guided_matching.h"
#include "view_servo/robust/random.h"
#include "view_servo/robust/ransac.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"
#include "view_servo/views/view_match.h"

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <vector>

namespace view_servo
{
/** Homographies on which several matches agree, x_cur ~ H x_ref [px]; what one takes is left out for the next. */
std::vector<Eigen::Matrix3d> planesOf(Correspondences pairs, double threshold, Rng& rng);

/** The geometry of two images of a scene, by matches of several kinds. Each object is for one pair of images. */
class SceneGeometry
{
public:
  /** What was matched without knowing the geometry. */
  struct Candidates
  {
    std::vector<MatchedPoint> intersections;  ///< of line segments
    std::vector<MatchedPoint> corners;
  };

  /** All have to outlive this. */
  SceneGeometry(const PreparedImage& reference, const PreparedImage& current, const SceneMatcherParams& params);

  /**
   * Looks for all corners along the homography of a plane, and keeps it if they are found there and not beside it.
   * @param of_lines the plane's index in the line matcher's result; -1: it came from points.
   */
  void addPlane(const Eigen::Matrix3d& h, int of_lines);

  /** Takes the candidates, after all planes. */
  void collect(const Candidates& candidates);

  /**
   * Looks for the fundamental matrix that the matches support, `other` being one that was found before.
   * @return whether there is one that chance does not explain, also without its best plane.
   */
  bool fit(const std::optional<Eigen::Matrix3d>& other, RansacStatistics& statistics);

  /** Whether what agrees lies for the most part on planes that are found elsewhere nearly as well. */
  bool isRepeated();

  /** -log10 of the false alarms of what was found: by fit(), else of the best plane. */
  double significance() const;

  /** All planes that corners confirm. */
  std::vector<Eigen::Matrix3d> planes() const;

  /** The plane that corners confirm best, when it is beyond doubt and not mirrored. */
  std::optional<Eigen::Matrix3d> plane() const;

  /** Writes what fit() has found. @param lines those that the line matcher has found. */
  void reportFundamental(const std::vector<MatchedLine>& lines, ViewMatch& result);

  /** Writes a plane as what was found. */
  void reportPlane(const Eigen::Matrix3d& h, const std::vector<MatchedLine>& lines, ViewMatch& result);

  /** Moves all candidates to the result, to be called last. */
  void reportCandidates(ViewMatch& result);

private:
  /** A plane that corners confirm. */
  struct Plane
  {
    Eigen::Matrix3d h;
    double significance;
    int of_lines;
  };

  /** A fundamental matrix that may be the answer. */
  struct Choice
  {
    Eigen::Matrix3d f;
    std::size_t support;  ///< matches that agree
    double significance;
    double margin;  ///< how far it is above what is asked for; negative: not enough
  };

  const Plane* bestPlane() const;
  static bool isBeyondDoubt(const Plane* plane);
  std::vector<GuidedMatch> search(const std::vector<Corner>& corners, const Eigen::Matrix3d& h) const;
  void addMatchesNear(const Eigen::Matrix3d& h);
  std::size_t countSeen(const std::vector<Corner>& corners, const Eigen::Matrix3d& h) const;
  double chanceBeside(const Eigen::Matrix3d& h) const;
  bool agrees(const Eigen::Matrix3d& f, const Correspondence& pair) const;
  Correspondences agreeing(const Eigen::Matrix3d& f) const;
  bool liesOn(const Eigen::Matrix3d& h, const Correspondence& pair) const;
  Correspondences onPlane(const Eigen::Matrix3d& h) const;
  Plane bestPlaneOf(const Correspondences& pairs);
  double significanceOf(const Eigen::Matrix3d& f) const;
  void consider(const Eigen::Matrix3d& hypothesis);
  void weigh(const Eigen::Matrix3d& hypothesis, const Plane& plane, double tolerance);
  template <typename Agrees>
  void reportLines(const std::vector<MatchedLine>& lines, const Agrees& agrees, ViewMatch& result) const;
  template <typename SquaredError>
  void report(ViewMatch& result, GeometryModel model, const Eigen::Matrix3d& matrix, const SquaredError& squared_error);

  const PreparedImage& reference_;
  const PreparedImage& current_;
  const SceneMatcherParams& params_;
  const std::vector<Corner>& corners_;
  GuidedParams guidance_;
  Rng rng_;
  std::vector<Plane> planes_;
  std::vector<std::optional<GuidedMatch>> found_;  ///< of each corner, the best along any plane
  std::vector<MatchedPoint> matches_;              ///< of both kinds, the most trustworthy first
  Correspondences pairs_;                          ///< positions of matches_
  std::optional<Choice> best_;                     ///< so far
};

}  // namespace view_servo
