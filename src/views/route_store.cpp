// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/route_store.h"

#include "camera_yaml.h"
#include "stored_files.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

constexpr int FORMAT = 1;
constexpr std::size_t MAX_NAME_LENGTH = 58;  // of a view's 64, less "_" and five digits
constexpr const char* NO_SUCH_ROUTE = "there is none of that name";

[[noreturn]] void fail(const std::string& action, const std::string& name, const std::string& reason)
{
  throw RouteStoreError("cannot " + action + " route '" + name + "': " + reason);
}

void requireValidName(const std::string& action, const std::string& name)
{
  if (!isValidRouteName(name))
  {
    fail(action, name.substr(0, MAX_NAME_LENGTH),
         "a route's name is 1 to 58 letters, digits, '_' and '-', and starts with a letter or digit");
  }
}

/** Runs `body`; what it throws is told as a RouteStoreError about the route. */
template <typename Body>
auto about(const std::string& action, const std::string& name, const Body& body)
{
  requireValidName(action, name);
  try
  {
    return body();
  }
  catch (const RouteStoreError&)
  {
    throw;
  }
  catch (const std::exception& error)
  {
    fail(action, name, oneLine(error));
  }
}

/** @throws std::invalid_argument saying what cannot be. */
void check(const Route& route)
{
  constexpr double FARTHEST = 1e6;  // [m]
  constexpr std::size_t LONGEST_FRAME = 256;
  const auto require = [](bool condition, const std::string& fault) {
    if (!condition)
    {
      throw std::invalid_argument(fault);
    }
  };
  require(route.stops.size() >= 2, "it has fewer than 2 views");
  require(route.stops.size() <= MAX_ROUTE_STOPS, "it has more than " + std::to_string(MAX_ROUTE_STOPS) + " views");
  require(route.frame.size() <= LONGEST_FRAME, "the name of its frame is too long");
  std::set<std::string> names;
  for (const RouteStop& stop : route.stops)
  {
    require(isValidViewName(stop.view),
            "view " + std::to_string(names.size() + 1) + " has a name that no view can have");
    require(names.insert(stop.view).second, "it names view '" + stop.view + "' twice");
    const PlanarPose& base = stop.base;
    require(std::abs(base.x) <= FARTHEST && std::abs(base.y) <= FARTHEST && std::abs(base.yaw) <= 2.0 * M_PI &&
                std::isfinite(stop.stamp),
            "the pose or time at view '" + stop.view + "' cannot be");
  }
}

std::string toText(const Route& route)
{
  YAML::Emitter yaml;
  yaml << YAML::BeginMap;
  yaml << YAML::Key << "format" << YAML::Value << FORMAT;
  yaml << YAML::Key << "frame" << YAML::Value << route.frame;
  yaml << YAML::Key << "views" << YAML::Comment("base: x, y [m], yaw [rad] in that frame; stamp [s]") << YAML::Value
       << YAML::BeginSeq;
  for (const RouteStop& stop : route.stops)
  {
    yaml << YAML::Flow << YAML::BeginMap << YAML::Key << "view" << YAML::Value << stop.view << YAML::Key << "base"
         << YAML::Value << YAML::Flow
         << std::vector<std::string>{ exactText(stop.base.x), exactText(stop.base.y), exactText(stop.base.yaw) }
         << YAML::Key << "stamp" << YAML::Value << exactText(stop.stamp) << YAML::EndMap;
  }
  yaml << YAML::EndSeq << YAML::EndMap << YAML::Newline;
  return withChecksum(std::string(yaml.c_str(), yaml.size()));
}

/** @throws Damage, std::invalid_argument, or what yaml-cpp throws; empty when there is no such route. */
std::optional<Route> read(const fs::path& directory, const std::string& name)
{
  constexpr std::uintmax_t LARGEST = 4'000'000;  // more than MAX_ROUTE_STOPS need [bytes]
  const std::optional<std::string> text = readStoredFile(yamlPath(directory, name), LARGEST);
  if (!text)
  {
    return std::nullopt;
  }
  const YAML::Node node = parseYaml(withoutChecksum(*text, "its yaml file"));
  if (const int format = node["format"].as<int>(); format != FORMAT)
  {
    throw Damage("it has format " + std::to_string(format) + ", not " + std::to_string(FORMAT));
  }
  Route route;
  route.name = name;
  route.frame = node["frame"].as<std::string>();
  for (const YAML::Node& entry : node["views"])
  {
    Eigen::Vector3d base;
    fromList(entry["base"], base);
    route.stops.push_back(
        { entry["view"].as<std::string>(), { base.x(), base.y(), base.z() }, entry["stamp"].as<double>() });
  }
  check(route);
  return route;
}

/** Sorted names of the routes that have a file, readable or not. @throws RouteStoreError. */
std::vector<std::string> findNames(const fs::path& directory)
{
  try
  {
    return namesOfYamlFiles(directory);
  }
  catch (const fs::filesystem_error& error)
  {
    throw RouteStoreError(std::string("cannot list routes: ") + oneLine(error));
  }
}

/** The views that a route alone names. */
struct OwnViews
{
  std::vector<std::string> names;  // none while there is a doubt
  std::string doubt;               // why it is not known which they are; empty: it is
};

OwnViews findOwnViews(const fs::path& directory, const std::string& name)
{
  OwnViews own;
  std::set<std::string> needed;  // by other routes
  for (const std::string& route : namesOfYamlFiles(directory))
  {
    try
    {
      const std::optional<Route> found = read(directory, route);
      for (const RouteStop& stop : found ? found->stops : std::vector<RouteStop>())
      {
        route == name ? own.names.push_back(stop.view) : static_cast<void>(needed.insert(stop.view));
      }
    }
    catch (const std::exception&)
    {
      own.doubt = route == name ? "it is damaged and does not say which they are"
                                : "route '" + route + "' is damaged and may need them";
    }
  }
  const auto is_kept = [&](const std::string& view) {
    return !own.doubt.empty() || needed.count(view) > 0;
  };
  own.names.erase(std::remove_if(own.names.begin(), own.names.end(), is_kept), own.names.end());
  return own;
}

/** Copies what has been learnt of a view; what is damaged of it is left out, as it is learnt anew. */
void copyStructure(const ViewStore& from, const ViewStore& to, const std::string& view)
{
  try
  {
    const ViewStructure structure = from.loadStructure(view);
    if (!structure.points.empty())
    {
      to.saveStructure(view, to.revision(view), structure);
    }
  }
  catch (const ViewStoreError&)
  {
    // The view itself is there.
  }
}

/** @throws std::runtime_error naming the first view of a route that is not there. */
void requireViews(const Route& route, const fs::path& views)
{
  for (const RouteStop& stop : route.stops)
  {
    if (!fs::is_regular_file(yamlPath(views, stop.view)))
    {
      throw std::runtime_error("its view '" + stop.view + "' is not there: record the route anew");
    }
  }
}

}  // namespace

bool isValidRouteName(const std::string& name)
{
  return isValidViewName(name) && name.size() <= MAX_NAME_LENGTH;
}

std::string viewNameOf(const std::string& route, std::size_t number)
{
  constexpr std::size_t DIGITS = 3;
  const std::string text = std::to_string(number);
  return route + "_" + std::string(text.size() < DIGITS ? DIGITS - text.size() : 0, '0') + text;
}

double lengthOf(const Route& route)
{
  double length = 0.0;
  for (std::size_t i = 1; i < route.stops.size(); ++i)
  {
    length += compose(inverse(route.stops[i - 1].base), route.stops[i].base).distance();
  }
  return length;
}

RouteStore::RouteStore(const fs::path& views_directory)
  : directory_(views_directory / "routes"), views_(views_directory)
{
}

void RouteStore::save(const Route& route) const
{
  about("save", route.name, [&] {
    check(route);
    requireViews(route, views_.directory());
    fs::create_directories(directory_);
    const DirectoryLock lock(directory_);
    if (has(route.name))
    {
      fail("save", route.name, "there is one of that name: delete or rename that first");
    }
    replaceFile(yamlPath(directory_, route.name), toText(route));
    syncDirectory(directory_);
  });
}

Route RouteStore::load(const std::string& name) const
{
  return about("load", name, [&] {
    std::optional<Route> route = read(directory_, name);
    if (!route)
    {
      fail("load", name, NO_SUCH_ROUTE);
    }
    requireViews(*route, views_.directory());
    return *std::move(route);
  });
}

bool RouteStore::has(const std::string& name) const
{
  std::error_code ignored;  // what cannot be asked for is not there
  return isValidRouteName(name) && fs::exists(fs::symlink_status(yamlPath(directory_, name), ignored));
}

std::vector<std::string> RouteStore::routesWith(const std::string& view) const
{
  std::vector<std::string> found;
  for (const std::string& name : findNames(directory_))
  {
    try
    {
      const std::optional<Route> route = read(directory_, name);
      if (route && std::any_of(route->stops.begin(), route->stops.end(),
                               [&](const RouteStop& stop) { return stop.view == view; }))
      {
        found.push_back(name);
      }
    }
    catch (const std::exception&)
    {
      // It does not say which views it needs.
    }
  }
  return found;
}

std::string RouteStore::routeWith(const std::string& view) const
{
  const std::vector<std::string> found = routesWith(view);
  if (found.size() > 1)
  {
    std::string reason = "view '" + view;
    reason.append("' is on route '").append(found[0]).append("' and on route '").append(found[1]);
    throw RouteStoreError(reason + "': name the one to follow");
  }
  if (found.empty())
  {
    const Listing listing = list();
    const std::string unknown =
        listing.damaged.empty() ? "" : ", as far as is known: route '" + listing.damaged[0].name + "' is damaged";
    throw RouteStoreError("view '" + view + "' is on no route" + unknown);
  }
  return found[0];
}

RouteStore::Listing RouteStore::list() const
{
  Listing listing;
  for (const std::string& name : findNames(directory_))
  {
    try
    {
      if (const std::optional<Route> route = read(directory_, name))  // else it was removed meanwhile
      {
        requireViews(*route, views_.directory());
        listing.names.push_back(name);
      }
    }
    catch (const std::exception& error)
    {
      listing.damaged.push_back({ name, oneLine(error) });
    }
  }
  return listing;
}

void RouteStore::rename(const std::string& from, const std::string& to) const
{
  requireValidName("rename", from);
  about("rename to", to, [&] {
    if (!has(from))
    {
      fail("rename", from, NO_SUCH_ROUTE);
    }
    const DirectoryLock lock(directory_);
    if (has(to))
    {
      fail("rename", from, "there is a route '" + to + "' already");
    }
    fs::rename(yamlPath(directory_, from), yamlPath(directory_, to));
    syncDirectory(directory_);
  });
}

std::vector<std::string> RouteStore::ownViews(const std::string& name) const
{
  return about("replace", name, [&] {
    if (!has(name))
    {
      fail("replace", name, NO_SUCH_ROUTE);
    }
    OwnViews own = findOwnViews(directory_, name);
    if (!own.doubt.empty())
    {
      fail("replace", name, own.doubt);
    }
    return std::move(own.names);
  });
}

std::string RouteStore::remove(const std::string& name) const
{
  return about("remove", name, [&] {
    const fs::path yaml = yamlPath(directory_, name);
    if (!fs::is_regular_file(yaml))
    {
      fail("remove", name, has(name) ? yaml.string() + " is not a file" : NO_SUCH_ROUTE);
    }
    OwnViews own;
    {
      const DirectoryLock lock(directory_);
      own = findOwnViews(directory_, name);
      fs::remove(yaml);
      fs::remove(yaml.string() + ".tmp");
      syncDirectory(directory_);
    }
    std::string warning = own.doubt.empty() ? "" : "its views are kept, as " + own.doubt;
    for (const std::string& view : own.names)
    {
      try
      {
        if (fs::exists(yamlPath(views_.directory(), view)))
        {
          views_.remove(view);
        }
      }
      catch (const ViewStoreError& error)
      {
        warning = oneLine(error);
      }
    }
    return warning;
  });
}

void RouteStore::exportTo(const std::string& name, const fs::path& views_directory) const
{
  about("export", name, [&] {
    const Route route = load(name);
    const RouteStore target(views_directory);
    if (target.has(name))
    {
      fail("export", name, "there is one of that name in " + views_directory.string());
    }
    for (const RouteStop& stop : route.stops)
    {
      if (fs::exists(yamlPath(views_directory, stop.view)))
      {
        fail("export", name, "there is a view '" + stop.view + "' in " + views_directory.string() + " already");
      }
    }
    std::vector<std::string> copied;
    try
    {
      for (const RouteStop& stop : route.stops)
      {
        target.views_.save(views_.load(stop.view), false);
        copied.push_back(stop.view);
        copyStructure(views_, target.views_, stop.view);
      }
      target.save(route);
    }
    catch (...)
    {
      for (const std::string& view : copied)
      {
        try
        {
          target.views_.remove(view);
        }
        catch (const ViewStoreError&)
        {
          // The first error is the one to tell.
        }
      }
      throw;
    }
  });
}

}  // namespace view_servo
