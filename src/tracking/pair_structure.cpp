// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/pair_structure.h"

#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/planar_motion.h"
#include "view_servo/tracking/view_tracker.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"

namespace view_servo
{
ViewStructure structureOfPair(const cv::Mat& view, const cv::Mat& other, const Camera& camera, const CameraMount& mount,
                              const PlanarPose& moved)
{
  constexpr double THRESHOLD = 3.0;  // largest error of a match that agrees with the motion [px]
  const PointViewMatcher matcher{ PointViewMatcherParams() };
  FeatureParams features;
  features.points = matcher.params().points;
  const ViewMatch match = matcher.match(PreparedImage(view, cv::Rect(), features),
                                        PreparedImage(other, cv::Rect(), features), GeometryModel::HOMOGRAPHY);
  const PlanarPose view_in_other = mount.ofCamera(inverse(moved));
  const Eigen::Matrix3d essential = essentialMatrix(view_in_other);
  const double threshold = THRESHOLD / camera.k(0, 0);
  Correspondences agreeing;
  for (const MatchedPoint& point : match.matches)
  {
    const Correspondence pair{ mount.level(camera.normalized(point.position.reference)),
                               mount.level(camera.normalized(point.position.current)) };
    if (pair.reference.allFinite() && pair.current.allFinite() &&
        sampsonError(essential, pair) <= threshold * threshold && inverseDepth(pair, view_in_other).value > 0.0)
    {
      agreeing.push_back(pair);
    }
  }
  ViewStructure structure;
  ViewTracker tracker(view, camera, mount, ViewTrackerParams());
  if (!tracker.start(agreeing, view_in_other) || !tracker.depthsKnown())
  {
    return structure;
  }
  for (const ViewTracker::Point& point : tracker.points())
  {
    const Eigen::Vector2d pixel = camera.project(mount.unlevel(point.landmark.reference).homogeneous());
    if (pixel.allFinite() && point.landmark.inverse_depth > 0.0 && point.information > 0.0)
    {
      structure.points.push_back({ pixel, point.landmark.inverse_depth, point.information });
    }
  }
  return structure;
}

}  // namespace view_servo
