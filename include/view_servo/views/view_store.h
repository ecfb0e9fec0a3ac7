// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/camera.h"
#include "view_servo/views/view_structure.h"

#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/** A pose as tf gives it: maps points of the view's frame into `frame`. Metres. */
struct ViewPose
{
  std::string frame;                                                ///< the frame that the pose is in
  Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< origin of the view's frame [m]
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< turns vectors of the view's frame into `frame`
};

/** A picture of where the camera should be, with all that was known when it was taken. */
struct StoredView
{
  std::string name;              ///< see isValidViewName()
  cv::Mat image;                 ///< 8-bit grey, as the camera took it, with the lens's distortion
  cv::Rect region;               ///< region of interest [px]; empty = the whole image
  std::optional<Camera> camera;  ///< its calibration; empty: not known
  double stamp = 0.0;            ///< when the image was taken, as its header says [s]
  std::string frame_id;          ///< optical frame of the camera, may be empty
  std::optional<ViewPose> pose;  ///< pose of the frame `frame_id`; empty where tf did not know it
};

/** Why a view cannot be stored, read or removed; what() names the view, in one line. */
class ViewStoreError : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

/** Whether a name matches [A-Za-z0-9][A-Za-z0-9_-]{0,63}: it becomes part of a file's name. */
bool isValidViewName(const std::string& name);

/**
 * The camera that a view was taken with. For one that was stored without a calibration this is `current`, the camera
 * that is there now. @throws std::runtime_error when its image is of neither, and when its calibration cannot be used.
 */
Camera cameraOf(const StoredView& view, const Camera& current);

/**
 * Stored views in a directory, one `NAME.yaml` each beside its image `NAME.HASH.png` and, where something has been
 * learnt of it, its structure `NAME.REVISION.points`.
 *
 * A view exists when its yaml file does: it names the image, its size and checksum, and is put in place by rename(2)
 * after image and yaml were written and synced. So a crash leaves either the old view or the new one, and at most an
 * unreferenced file, which the next save or removal of that name deletes. No other file is touched. Views do not share
 * files: a damaged one is reported by name and the others stay usable. Several processes may use a directory; those
 * that change it take turns by a file `.lock` in it, and of two that save one name the last one wins.
 */
class ViewStore
{
public:
  /** The directory need not exist until something is saved. */
  explicit ViewStore(std::filesystem::path directory);

  /** The directory that the views are in. */
  const std::filesystem::path& directory() const
  {
    return directory_;
  }

  /**
   * Saves a view.
   * @return a warning in one line when a step failed after the view had been saved; else empty.
   * @throws ViewStoreError when it was not saved: for a bad name, image or region, for a name in use unless
   * `overwrite`, or when writing fails, as on a full disk.
   */
  std::string save(const StoredView& view, bool overwrite) const;

  /** @throws ViewStoreError when there is no such view or it is damaged. */
  StoredView load(const std::string& name) const;

  /** A text that changes whenever the view is saved anew. Does not read the image. @throws ViewStoreError as load(). */
  std::string revision(const std::string& name) const;

  /**
   * Stores what has been learnt of a view, instead of what was known before.
   * @param revision that it belongs to: of a view that has been saved anew meanwhile, nothing is stored.
   * @return whether it was stored. @throws ViewStoreError when there is no such view, or when writing fails; the view
   * is as it was then.
   */
  bool saveStructure(const std::string& name, const std::string& revision, const ViewStructure& structure) const;

  /**
   * What has been learnt of a view since it was saved; without points when that is nothing. @throws ViewStoreError when
   * there is no such view, or what has been learnt is damaged.
   */
  ViewStructure loadStructure(const std::string& name) const;

  /**
   * The revision() of each view. Reads no image, and views whose yaml files are damaged are left out. @throws
   * ViewStoreError when the directory cannot be read.
   */
  std::map<std::string, std::string> revisions() const;
  /** Names that are in use, by damaged views, too; sorted. @throws ViewStoreError when the directory cannot be read. */
  std::vector<std::string> names() const;

  struct Damaged
  {
    std::string name;    ///< of the view
    std::string reason;  ///< why it cannot be read, in one line
  };
  struct Listing
  {
    std::vector<std::string> names;  ///< readable views, sorted
    std::vector<Damaged> damaged;    ///< sorted by name
  };
  /** Checks every view's yaml and image. An image that was decoded by the last call is not decoded again. */
  Listing list() const;

  /** @return as save(). @throws ViewStoreError when there is no such view; damaged views can be removed. */
  std::string remove(const std::string& name) const;

private:
  /** What list() has decoded: sizes of images, by the names of their files, which have checksums in them. */
  struct Decoded
  {
    std::mutex mutex;
    std::map<std::string, cv::Size> sizes;
  };

  std::filesystem::path directory_;
  std::shared_ptr<Decoded> decoded_ = std::make_shared<Decoded>();  // copies of a store share it
};

}  // namespace view_servo
