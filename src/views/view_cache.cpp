// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/view_cache.h"

#include <algorithm>
#include <utility>

namespace view_servo
{
ViewCache::ViewCache(ViewStore store, const FeatureParams& params, std::size_t capacity)
  : store_(std::move(store)), params_(params), capacity_(std::max<std::size_t>(capacity, 1))
{
}

CachedView ViewCache::get(const std::string& name)
{
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string revision = store_.revision(name);
  const auto known = std::find_if(entries_.begin(), entries_.end(),
                                  [&](const Entry& entry) { return entry.view.stored.name == name; });
  if (known != entries_.end() && known->revision == revision)
  {
    entries_.splice(entries_.begin(), entries_, known);
    return entries_.front().view;
  }
  if (known != entries_.end())
  {
    entries_.erase(known);
  }
  const StoredView view = store_.load(name);
  entries_.push_front({ { view, std::make_shared<const PreparedImage>(view.image, view.region, params_) }, revision });
  if (entries_.size() > capacity_)
  {
    entries_.pop_back();
  }
  return entries_.front().view;
}

}  // namespace view_servo
