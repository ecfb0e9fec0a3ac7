// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/calibration_options.h"

#include "tools/ros_program.h"

#include <unistd.h>

#include <filesystem>
#include <stdexcept>

namespace view_servo
{
namespace
{
/** @throws std::runtime_error when a file exists that is not to be replaced. @param option that names it. */
void refuseToReplace(const std::string& path, const std::string& option, bool overwrite)
{
  if (!overwrite && !path.empty() && std::filesystem::exists(path))
  {
    throw std::runtime_error("'" + path + "' exists: say --overwrite, or another file by " + option);
  }
}

/** @throws std::runtime_error when two options name one file, so that the one would be lost. */
void refuseSameFile(const std::string& path, const std::string& option, const std::string& other,
                    const std::string& other_option)
{
  namespace fs = std::filesystem;
  if (!path.empty() && !other.empty() && fs::weakly_canonical(path) == fs::weakly_canonical(other))
  {
    throw std::runtime_error(option + ": '" + path + "' is the file of " + other_option + ", too: name another");
  }
}

/** So that nobody learns after sixteen poses that nothing can be kept. */
void requireWritable(const std::string& path, const std::string& option)
{
  if (path.empty())
  {
    return;
  }
  const std::filesystem::path parent = std::filesystem::path(path).parent_path();
  const std::string directory = parent.empty() ? "." : parent.string();
  if (std::filesystem::is_directory(path))
  {
    throw std::runtime_error(option + ": '" + path + "' is a directory: name a file in it");
  }
  if (!std::filesystem::is_directory(directory))
  {
    throw std::runtime_error(option + ": there is no directory '" + directory + "': make it first");
  }
  if (access(directory.c_str(), W_OK) != 0)
  {
    throw std::runtime_error(option + ": '" + directory + "' cannot be written to");
  }
}

}  // namespace

bool CalibrationOptions::fileIsBag() const
{
  return std::filesystem::path(file).extension() == ".bag";
}

void addSourceOptions(CommandLine& line, CalibrationOptions& options)
{
  HandEyeSources& sources = options.sources;
  line.text("view", sources.view, "stored view of a textured plane, with a region that shows the plane only");
  if (sources.on_base)
  {
    line.text("odom-frame", sources.base_frame, "tf frame of odometry");
    line.text("base", sources.flange_frame, "tf frame of the base");
  }
  else
  {
    line.text("base", sources.base_frame, "tf frame of the arm's base");
    line.text("flange", sources.flange_frame, "tf frame of what the camera is mounted on");
  }
  line.text("camera", sources.camera, "namespace of camera_info");
  line.text("tracker", sources.tracker, "name of the node homography_tracker");
  line.text("views-dir", sources.views_dir, "directory of the stored views; empty: $ROS_HOME/view_servo/views");
  line.number("poses", options.poses, { 8.0, 100.0 }, "poses that have to agree");
}

void addFileOptions(CommandLine& line, CalibrationOptions& options)
{
  line.text("file", options.file,
            "calibrates from what was recorded before: a file of --keep, or a bag (.bag) with tf, camera_info and the "
            "tracker's homographies, for which --view, --camera, --tracker and the options of frames count");
  line.text("keep", options.keep, "file to write the poses to, for --file");
  line.text("out", options.out, "file to write");
  line.flag("overwrite", options.overwrite, "replace files that exist");
}

bool readCalibrationOptions(CommandLine& line, int argc, char** argv, const CalibrationOptions& options)
{
  const auto rest = parseWithoutRosWords(line, argc, argv);
  if (!rest)
  {
    return false;
  }
  if (!rest->empty())
  {
    throw std::runtime_error("'" + rest->front() + "' is not understood: see --help");
  }
  if (options.sources.view.empty() && (options.file.empty() || options.fileIsBag()))
  {
    throw std::runtime_error("say which stored view: --view NAME");
  }
  if (options.out.empty())
  {
    throw std::runtime_error("--out: name the file to write");
  }
  refuseToReplace(options.out, "--out", options.overwrite);
  refuseToReplace(options.keep, "--keep", options.overwrite);
  refuseSameFile(options.keep, "--keep", options.out, "--out");
  refuseSameFile(options.keep, "--keep", options.file, "--file");
  refuseSameFile(options.out, "--out", options.file, "--file");
  requireWritable(options.out, "--out");
  requireWritable(options.keep, "--keep");
  return true;
}

}  // namespace view_servo
