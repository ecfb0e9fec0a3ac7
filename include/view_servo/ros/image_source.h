// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ImageSource.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/views/view_store.h"

#include <std_msgs/Header.h>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <filesystem>
#include <optional>
#include <string>

namespace view_servo
{
/** Where an image comes from. */
enum class SourceKind
{
  CAMERA,  ///< the latest image of the node's camera
  VIEW,    ///< a stored view
  PATH,    ///< a file
  IMAGE    ///< the message itself
};

/**
 * Which field of `source` is set; CAMERA when none is.
 * @param name of the source in error texts, e.g. the request's field that holds it.
 * @throws ImageError naming the fields when several are set.
 */
SourceKind kindOf(const ImageSource& source, const std::string& name);

/** An image with what its source says about it. */
struct SourcedImage
{
  cv::Mat grey;                  ///< 8-bit, one channel
  cv::Rect region;               ///< region of interest [px]; empty = the whole image
  std_msgs::Header header;       ///< stamp and camera's frame; empty for a file
  std::optional<Camera> camera;  ///< its calibration; empty where the source has none
  std::optional<ViewPose> pose;  ///< the camera's pose, of a stored view that has one; else empty
};

/** The parameter `~views_dir`: where stored views are. */
Parameter viewsDirParameter(std::filesystem::path& views_dir);

/** The parameter `~view`, the name of a stored view. */
Parameter viewParameter(std::string& view, std::string description);

/** One fault when `view` is neither empty nor a name that a stored view can have; else none. */
std::vector<std::string> viewFaults(const std::string& view);

/** The directory that an empty `~views_dir` stands for, or the one given. */
std::filesystem::path viewsDir(const std::filesystem::path& views_dir);

/** Options of ImageSourceReader. */
struct ImageSourceParams
{
  std::filesystem::path views_dir;  ///< where stored views are; empty: as viewsDir() says
  bool allow_paths = true;          ///< whether requests may name files
  double image_patience = 5.0;      ///< longest wait for an image of the camera when none has come yet [s]
};

/** Names, units, ranges and meanings of these parameters. */
std::vector<Parameter> parameters(ImageSourceParams& params);

/**
 * Turns the ImageSource of a request into an image. Parameters: see parameters(ImageSourceParams&). Where
 * `~allow_paths` is on, requests may name files, which are read with the node's rights: turn it off where requests come
 * from strangers.
 */
class ImageSourceReader
{
public:
  /** `camera` must outlive the reader. */
  ImageSourceReader(const ImageSourceParams& params, CameraInput& camera);

  /**
   * Reads the image that a source names. CAMERA: blocks for up to image_patience until there is a usable image, as
   * CameraInput::latest(patience) does; another thread has to receive images.
   * @param kind what kindOf() returns for the source. @param name as in kindOf().
   * @throws ImageError or ViewStoreError, naming what is wrong in one line.
   */
  SourcedImage read(SourceKind kind, const ImageSource& source, const std::string& name) const;

  const ViewStore& store() const
  {
    return store_;
  }

private:
  bool allow_paths_;
  double image_patience_;
  ViewStore store_;
  CameraInput& camera_;
};

}  // namespace view_servo
