// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/node_params.h"

#include "view_servo/parameters/faults.h"

namespace view_servo
{
std::vector<Parameter> parameters(ViewStoreNodeParams& params)
{
  return joined({
      {
          text("fixed_frame", params.fixed_frame,
               "frame in which the camera's pose is stored with a view, where tf knows it; empty: never"),
          real("idle_timeout", params.idle_timeout, "s", ">= 1",
               "the camera's topics are let go of when nothing has been asked of the camera for so long"),
      },
      parameters(params.sources),
      parameters(params.camera),
  });
}

std::vector<std::string> ViewStoreNodeParams::validate() const
{
  return faultsOf(*this);
}

std::vector<Parameter> parameters(HomographyTrackerNodeParams& params)
{
  return joined({
      {
          viewParameter(params.view,
                        "stored view that is followed from the start, without a call of ~start; empty: none"),
          real("match_period", params.match_period, "s", "> 0",
               "time from one search for the view to the next; how it is looked for, by matching points, has the "
               "parameters of "
               "point_matcher under matching, for instance matching: {max_corners: 1000}"),
      },
      parameters(params.camera),
      parameters(params.sessions),
  });
}

std::vector<std::string> HomographyTrackerNodeParams::validate() const
{
  Faults faults;
  faults.add(faultsOf(*this));
  faults.add(viewFaults(view));
  return faults.list();
}

std::vector<Parameter> nodeParameters(ViewRecognizerNodeParams& params)
{
  return joined({
      { real("rate", params.rate, "Hz", ">= 0.001",
             "camera images are recognized at most this often, always the newest") },
      parameters(params.sources),
      parameters(params.camera),
  });
}

std::vector<Parameter> parameters(ViewRecognizerNodeParams& params)
{
  return joined({ nodeParameters(params), parameters(params.recognition) });
}

std::vector<std::string> ViewRecognizerNodeParams::validate() const
{
  ViewRecognizerNodeParams copy = *this;
  Faults faults;
  faults.add(faultsOf(nodeParameters(copy)));
  faults.add(recognition.validate());
  return faults.list();
}

std::vector<Parameter> parameters(RouteRecorderParams& params)
{
  return joined({
      parameters(params.spacing),
      {
          viewsDirParameter(params.views_dir),
          text("base_frame", params.base_frame,
               "the base's frame, whose pose odometry is; tf must know where the camera is in it"),
          real("odometry_delay", params.odometry_delay, "s", "[-2, 2]",
               "how much later than images of the same moment odometry is stamped: it is taken away from odometry's "
               "stamps"),
          real("patience", params.patience, "s", "> 0", "longest wait of ~start and ~stop for an image and odometry"),
          text("overwrite", params.overwrite,
               "name of the route that ~start replaces: it is deleted, with its views, once there is an image to begin "
               "with; empty: none"),
      },
      parameters(params.camera),
  });
}

std::vector<std::string> RouteRecorderParams::validate() const
{
  Faults faults;
  faults.require(!base_frame.empty(), "base_frame must not be empty");
  faults.add(faultsOf(*this));
  return faults.list();
}

}  // namespace view_servo
