// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_store.h"

#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <string>

namespace view_servo
{
/** A stored view, and its image with features. */
struct CachedView
{
  StoredView stored;
  std::shared_ptr<const PreparedImage> image;
};

/**
 * Keeps the stored views used last, with their features, so that a view is read and indexed once however many images
 * are matched with it. A view that was saved anew is read again. Safe to use from several threads.
 */
class ViewCache
{
public:
  /** @param capacity views kept, >= 1. */
  ViewCache(ViewStore store, const FeatureParams& params, std::size_t capacity = 4);

  /** The stored view with its features. @throws ViewStoreError as ViewStore::load(). */
  CachedView get(const std::string& name);

private:
  struct Entry
  {
    CachedView view;
    std::string revision;  // ViewStore::revision() of it
  };

  ViewStore store_;
  FeatureParams params_;
  std::size_t capacity_;
  std::mutex mutex_;
  std::list<Entry> entries_;  // used last first
};

}  // namespace view_servo
