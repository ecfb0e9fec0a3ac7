// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/streaming_matcher.h"

#include "view_servo/views/view_store.h"

namespace view_servo
{
StreamingMatcherParams StreamingMatcherParams::read(ParameterReader& reader, double default_rate)
{
  StreamingMatcherParams params;
  params.camera = CameraInputParams::read(reader);
  params.sources = ImageSourceParams::read(reader);
  reader.read("view", params.view);
  reader.require(params.view.empty() || isValidViewName(params.view),
                 "~view: '" + params.view + "' is not a view's name");
  params.rate = default_rate;
  reader.read("rate", params.rate);
  reader.require(params.rate >= 0.001, "~rate must be at least 0.001 [Hz]");
  return params;
}

}  // namespace view_servo
