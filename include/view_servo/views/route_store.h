// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/views/route.h"
#include "view_servo/views/view_store.h"

#include <filesystem>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/** Why a route cannot be stored, read, renamed or removed; what() names the route, in one line. */
class RouteStoreError : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

/**
 * Routes, one file `routes/NAME.yaml` each in the directory of their views, with a checksum in its last line. A route
 * is put in place, renamed and removed in one step, and after its views: a crash leaves it as it was or as it should
 * be. Routes do not share files; a damaged one is reported by name and the others stay usable. Several processes may
 * use a directory, as with ViewStore.
 */
class RouteStore
{
public:
  /**
   * @param views_directory the one of the ViewStore that holds the views; it need not exist until something is saved.
   */
  explicit RouteStore(const std::filesystem::path& views_directory);

  /** Where the files of the routes are. */
  const std::filesystem::path& directory() const
  {
    return directory_;
  }
  /** The store of their views. */
  const ViewStore& views() const
  {
    return views_;
  }

  /**
   * Saves a route whose views are stored already. @throws RouteStoreError when it was not saved: for a bad name, one
   * that is in use, stops that cannot be, a view that is not there, or when writing fails, as on a full disk.
   */
  void save(const Route& route) const;

  /** @throws RouteStoreError when there is no such route, it is damaged, or a view that it names is not there. */
  Route load(const std::string& name) const;

  /** Whether there is a file of that name, damaged or not. */
  bool has(const std::string& name) const;

  /** The routes that name a view, sorted; those that cannot be read are left out. @throws RouteStoreError as list(). */
  std::vector<std::string> routesWith(const std::string& view) const;
  /**
   * The name of the route that a view is on. @throws RouteStoreError when it is on none that can be read, or on
   * several.
   */
  std::string routeWith(const std::string& view) const;

  struct Damaged
  {
    std::string name;    ///< of the route
    std::string reason;  ///< why it cannot be used, in one line
  };
  struct Listing
  {
    std::vector<std::string> names;  ///< routes that load() would return, sorted
    std::vector<Damaged> damaged;    ///< sorted by name
  };
  /**
   * Reads all routes, but not the pictures of their views. @throws RouteStoreError when the directory cannot be read.
   */
  Listing list() const;

  /**
   * Gives a route another name; its views keep theirs. @throws RouteStoreError when there is none, or the name is in
   * use.
   */
  void rename(const std::string& from, const std::string& to) const;

  /**
   * The views that remove() would remove, in the route's order: those that no other route names. @throws
   * RouteStoreError when there is no such route, or it or another one is damaged, so that this is not known.
   */
  std::vector<std::string> ownViews(const std::string& name) const;
  /**
   * Removes a route, and then those of its views that no other route names; none while a route is damaged.
   * @return a warning in one line when views were kept; else empty. @throws RouteStoreError when there is no
   * such route.
   */
  std::string remove(const std::string& name) const;

  /**
   * Copies a route with its views, and what has been learnt of them, to another directory of views.
   * @throws RouteStoreError when the route or one of its views cannot be read, or a name is in use there; nothing is
   * left there then.
   */
  void exportTo(const std::string& name, const std::filesystem::path& views_directory) const;

private:
  std::filesystem::path directory_;
  ViewStore views_;
};

}  // namespace view_servo
