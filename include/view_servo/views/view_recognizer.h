// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/binary_features.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/matching/view_index.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"
#include "view_servo/views/structure_pose.h"
#include "view_servo/views/view_store.h"
#include "view_servo/views/view_structure.h"

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of a ViewRecognizer. */
struct ViewRecognizerParams
{
  BinaryFeatureParams features;
  ViewIndexParams index;
  SceneMatcherParams matching;  ///< of the matcher that verifies
  int candidates = 10;          ///< largest number of views that are verified, the most likely ones

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of the index's parameters, as `index_...`, and of the number of candidates. */
std::vector<Parameter> recognitionParameters(ViewRecognizerParams& params);

/** The same with those of the verification. */
std::vector<Parameter> parameters(ViewRecognizerParams& params);

/** Where a recognizer's views come from. All functions may be called from several threads. */
struct ViewSource
{
  std::filesystem::path directory;  ///< where the views are, and the index is kept
  /** All views, each with a text that changes whenever the view does. @throws std::runtime_error. */
  std::function<std::map<std::string, std::string>()> revisions;
  /** @throws std::runtime_error when the view cannot be read. */
  std::function<StoredView(const std::string& name)> load;
  /**
   * What has been learnt of a view; nothing when its text is not `revision` any more. @throws std::runtime_error when it
   * cannot be read.
   */
  std::function<ViewStructure(const std::string& name, const std::string& revision)> structure;
};

/** The views of a store. */
ViewSource storedViews(const ViewStore& store);

/** The image files in a directory (jpg, pgm, png, ppm, tif, bmp), not below it; views are called as the files are. */
ViewSource imageFiles(const std::filesystem::path& directory);

/** A view that an image may show. */
struct CandidateView
{
  std::string name;
  double score = 0.0;             ///< as ScoredView::score
  bool verified = false;          ///< the matcher found the scene of the view in the image
  int inliers = 0;                ///< matches that agree with what it found; 0 unless verified
  double log_significance = 0.0;  ///< as in ViewMatch; 0 unless verified
  /** Where the camera is, seen from the view; empty unless verified, and while too few depths of the view are known. */
  std::optional<StructurePose> pose;
};

/**
 * Says which of many views an image shows: a ViewIndex names the most likely ones, and SceneMatcher verifies them. Safe
 * to use from several threads.
 */
class ViewRecognizer
{
public:
  /** The index is empty until update(). @throws std::invalid_argument with all faults of the parameters. */
  ViewRecognizer(ViewSource source, const ViewRecognizerParams& params);

  const ViewRecognizerParams& params() const
  {
    return params_;
  }
  /** What images for recognize() must have been prepared with. */
  FeatureParams features() const
  {
    return matcher_.features();
  }

  struct Update
  {
    std::size_t added = 0;     ///< views that are new or were changed
    std::size_t removed = 0;   ///< views that are gone
    std::size_t waiting = 0;   ///< views that still have to be added
    std::size_t unusable = 0;  ///< views that cannot be read
    /**
     * Why, one line each of those that are new here or have another reason than before. They are tried again once they
     * change, and now and then.
     */
    std::vector<std::string> unreadable;
  };
  /**
   * Adds the source's new and changed views to the index and removes those that are gone. Takes little time when
   * nothing has changed. @param most views that are read at most. @param now views that could not be read half a minute
   * before are tried again. @throws std::runtime_error when the source cannot be listed.
   */
  Update update(std::size_t most, std::chrono::steady_clock::time_point now = std::chrono::steady_clock::now());

  /** Number of views in the index. */
  std::size_t size() const;

  /**
   * The most likely views: verified ones first, each kind with the largest score first.
   * @param verify whether to match the image with the candidates, until `most` are verified.
   * @param given_up asked now and then; once it is true, no further candidate is verified. May be empty.
   * @param camera that took the image; without it, or where it has a fault, poses are not known.
   */
  std::vector<CandidateView> recognize(const PreparedImage& image, std::size_t most, bool verify,
                                       const std::function<bool()>& given_up = {},
                                       const std::optional<Camera>& camera = std::nullopt) const;

  /** Where saveIndex() and loadIndex() keep the index: beside the views. */
  std::filesystem::path indexFile() const;

  /**
   * Replaces the file in one step, one process at a time. @throws std::runtime_error naming the file when it cannot be
   * written.
   */
  void saveIndex() const;

  /**
   * Takes over the saved index. Views that changed since it was saved are left to update().
   * @return why there is nothing to be taken over, in one line, such as a damaged or missing file; the index is then as
   * it was, and update() makes it anew. Empty: it was taken over.
   */
  std::string loadIndex();

private:
  /** A view that may be matched again. */
  struct Prepared
  {
    Prepared(StoredView&& stored, std::string stored_revision, const FeatureParams& features);

    std::string revision;
    PreparedImage image;
    StoredView view;  ///< without its image
  };

  /** A view that could not be read. */
  struct Unreadable
  {
    std::string revision;
    std::string reason;
    std::chrono::steady_clock::time_point next;  ///< when it is tried again
  };

  std::string header() const;
  /** Null: it was removed meanwhile, or cannot be read. */
  std::shared_ptr<const Prepared> prepared(const std::string& name) const;
  std::optional<StructurePose> poseIn(const Prepared& reference, const ViewMatch& match, const Camera& camera) const;

  ViewRecognizerParams params_;
  ViewSource source_;
  SceneMatcher matcher_;

  std::mutex update_mutex_;   // one update at a time; taken before mutex_
  mutable std::mutex mutex_;  // guards what follows
  ViewIndex index_;
  std::map<std::string, std::string> revisions_;                 // of the views in the index
  std::map<std::string, Unreadable> unreadable_;                 // views that are not
  mutable std::set<std::string> doubtful_;                       // views in it that could not be read since
  mutable std::list<std::shared_ptr<const Prepared>> prepared_;  // views verified last, used last first
};

}  // namespace view_servo
