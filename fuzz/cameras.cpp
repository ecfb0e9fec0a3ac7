// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/views/camera_file.h"

#include <stdexcept>

using namespace view_servo;

/** A calibration in a file. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  static const fuzz::Directory directory;
  fuzz::readOrRefuse<std::runtime_error>([&] {
    const Camera camera = readCameraFile(directory.write("camera.yaml", fuzz::toString(data, size)));
    fuzz::require(camera.fault().empty(), "a camera that is given can be used");
    const Eigen::Vector2d middle(0.5 * camera.width, 0.5 * camera.height);
    const Eigen::Vector2d point = camera.normalized(middle);
    if (point.allFinite() && point.norm() < 1e3)
    {
      camera.distorted(Points{ point });
    }
  });
  return 0;
}
