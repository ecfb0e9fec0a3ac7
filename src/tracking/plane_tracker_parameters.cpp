// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/plane_tracker_parameters.h"

namespace view_servo
{
std::vector<Parameter> planeTrackerParameters(PlaneTrackerParams& params)
{
  HomographyAlignerParams& tracker = params.tracker;
  PlaneFilterParams& filter = params.filter;
  return {
    integer("max_points", tracker.max_points, "corners of the view that are looked for, >= 12"),
    integer("patch_radius", tracker.patch_radius, "of the patches that are compared [px], 2 to 20"),
    integer("levels", tracker.levels, "of the image pyramid, the image among them, 1 to 6"),
    real("min_correlation", tracker.min_correlation, "of a patch that is found again, [0, 1)"),
    real("max_residual", tracker.max_residual, "of a point that supports the homography [px], > 0"),
    integer("min_supporting", tracker.min_supporting, "points that make a homography, >= 5"),
    real("min_support", tracker.min_support, "part of the points in sight that makes one, (0, 1]"),
    boolean("refine", tracker.refine, "all pixels of the view's region have the last word"),
    real("window", filter.window, "way of the camera whose measurements are averaged [m], > 0"),
    integer("max_measurements", filter.max_measurements, "averaged at most, >= 2"),
    real("decision", filter.decision, "times by which the wrong plane's normal must scatter more, > 1"),
    integer("lost_after", params.lost_after, "images in a row without the plane, >= 1"),
  };
}

}  // namespace view_servo
