// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/streaming_matcher.h"

#include "view_servo/parameters/faults.h"

namespace view_servo
{
std::vector<Parameter> parameters(StreamingMatcherParams& params)
{
  return joined({
      {
          viewParameter(params.view,
                        "stored view that camera images are matched with; empty: none, until one is named"),
          real("rate", params.rate, "Hz", ">= 0.001",
               "camera images are matched at most this often, always the newest"),
      },
      parameters(params.sources),
      parameters(params.camera),
  });
}

std::vector<std::string> StreamingMatcherParams::validate() const
{
  Faults faults;
  faults.add(faultsOf(*this));
  faults.add(viewFaults(view));
  return faults.list();
}

}  // namespace view_servo
