// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/views/hand_eye_file.h"

#include <cmath>
#include <stdexcept>

using namespace view_servo;

namespace
{
void requireMotion(const Eigen::Isometry3d& motion)
{
  constexpr double ACCURACY = 1e-9;
  fuzz::require(motion.matrix().allFinite(), "a motion is finite");
  fuzz::require(std::abs(motion.linear().determinant() - 1.0) < ACCURACY, "its rotation is one");
}
}  // namespace

/** A hand-eye calibration, and the poses that one is computed from: the same bytes by both readers. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  static const fuzz::Directory directory;
  const std::string path = directory.write("hand_eye.yaml", fuzz::toString(data, size));
  fuzz::readOrRefuse<std::runtime_error>([&] {
    const HandEyeFile file = readHandEyeFile(path);
    fuzz::require(!file.base_frame.empty() && !file.flange_frame.empty() && !file.camera_frame.empty(),
                  "frames have names");
    requireMotion(file.camera_in_flange);
    const std::string again = (directory.path() / "again.yaml").string();
    writeHandEyeFile(file, again);
    requireMotion(readHandEyeFile(again).camera_in_flange);
  });
  fuzz::readOrRefuse<std::runtime_error>([&] {
    const HandEyePosesFile file = readHandEyePosesFile(path);
    for (const HandEyePose& pose : file.poses)
    {
      requireMotion(pose.flange_in_base);
    }
    const std::string again = (directory.path() / "again.yaml").string();
    writeHandEyePosesFile(file, again);
    fuzz::require(readHandEyePosesFile(again).poses.size() == file.poses.size(), "what is written is read again");
  });
  return 0;
}
