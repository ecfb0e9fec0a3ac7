// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/image_source.h"

#include "view_servo/images/image_io.h"
#include "view_servo/ros/conversions.h"

#include <cstdlib>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
std::filesystem::path defaultViewsDir()
{
  const char* ros_home = std::getenv("ROS_HOME");
  const char* home = std::getenv("HOME");
  const std::filesystem::path root = ros_home != nullptr ? std::filesystem::path(ros_home)
                                                         : std::filesystem::path(home != nullptr ? home : ".") / ".ros";
  return root / "view_servo" / "views";
}

}  // namespace

SourceKind kindOf(const ImageSource& source, const std::string& name)
{
  const sensor_msgs::Image& image = source.image;
  std::vector<std::pair<SourceKind, std::string>> given;
  if (!source.view.empty())
  {
    given.emplace_back(SourceKind::VIEW, "view");
  }
  if (!source.path.empty())
  {
    given.emplace_back(SourceKind::PATH, "path");
  }
  if (!image.data.empty() || !image.encoding.empty() || image.width != 0 || image.height != 0)
  {
    given.emplace_back(SourceKind::IMAGE, "image");
  }
  if (given.size() > 1)
  {
    std::string fields;
    for (const auto& [kind, field] : given)
    {
      fields += (fields.empty() ? "" : " and ") + field;
    }
    throw ImageError(name + ": only one of view, path and image may be set, not " + fields);
  }
  return given.empty() ? SourceKind::CAMERA : given.front().first;
}

Parameter viewsDirParameter(std::filesystem::path& views_dir)
{
  return path("views_dir", views_dir,
              "directory of the stored views; empty: $ROS_HOME/view_servo/views, where ROS_HOME is ~/.ros unless set");
}

Parameter viewParameter(std::string& view, std::string description)
{
  return text("view", view, std::move(description));
}

std::vector<std::string> viewFaults(const std::string& view)
{
  if (view.empty() || isValidViewName(view))
  {
    return {};
  }
  return { "view: '" + view + "' is not a view's name" };
}

std::filesystem::path viewsDir(const std::filesystem::path& views_dir)
{
  return views_dir.empty() ? defaultViewsDir() : views_dir;
}

std::vector<Parameter> parameters(ImageSourceParams& params)
{
  return {
    viewsDirParameter(params.views_dir),
    boolean("allow_paths", params.allow_paths,
            "whether requests may name image files, which are read with the rights of the node"),
    real("image_patience", params.image_patience, "s", ">= 0",
         "how long a request for the camera's image waits when none has come yet"),
  };
}

ImageSourceReader::ImageSourceReader(const ImageSourceParams& params, CameraInput& camera)
  : allow_paths_(params.allow_paths),
    image_patience_(params.image_patience),
    store_(viewsDir(params.views_dir)),
    camera_(camera)
{
}

SourcedImage ImageSourceReader::read(SourceKind kind, const ImageSource& source, const std::string& name) const
{
  SourcedImage result;
  switch (kind)
  {
    case SourceKind::CAMERA:
    {
      const CameraFrame frame = camera_.latest(image_patience_);
      result.grey = toGrey(*frame.image);
      result.header = frame.image->header;
      result.camera = toCamera(*frame.info);
      break;
    }
    case SourceKind::VIEW:
    {
      const StoredView view = store_.load(source.view);
      result.grey = view.image;
      result.region = view.region;
      result.header.stamp = toStamp(view.stamp);
      result.header.frame_id = view.frame_id;
      result.camera = view.camera;
      result.pose = view.pose;
      break;
    }
    case SourceKind::PATH:
      if (!allow_paths_)
      {
        throw ImageError(name + ".path: files are refused, this node's ~allow_paths is false");
      }
      result.grey = readGreyImage(source.path);
      break;
    case SourceKind::IMAGE:
      result.grey = toGrey(source.image, name + ".image");
      result.header = source.image.header;
      break;
  }
  return result;
}

}  // namespace view_servo
