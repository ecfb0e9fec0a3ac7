// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/command_line.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/views/route_store.h"

#include <cstdio>
#include <exception>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
constexpr int DONE = 0;
constexpr int CANNOT = 1;
constexpr int MISUSED = 2;

int list(const RouteStore& store)
{
  const RouteStore::Listing listing = store.list();
  for (const std::string& name : listing.names)
  {
    const Route route = store.load(name);
    std::printf("%s: %zu views, %.2f m\n", name.c_str(), route.stops.size(), lengthOf(route));
  }
  for (const RouteStore::Damaged& damaged : listing.damaged)
  {
    std::printf("%s: damaged: %s\n", damaged.name.c_str(), damaged.reason.c_str());
  }
  return DONE;
}

int show(const RouteStore& store, const std::string& name)
{
  const Route route = store.load(name);
  std::printf("poses in '%s': x [m], y [m], yaw [degrees]\n", route.frame.c_str());
  for (const RouteStop& stop : route.stops)
  {
    std::printf("%s %.3f %.3f %.1f\n", stop.view.c_str(), stop.base.x, stop.base.y, stop.base.yaw * 180.0 / M_PI);
  }
  return DONE;
}

int run(const RouteStore& store, const std::vector<std::string>& words)
{
  const auto is = [&](const char* command, std::size_t count) {
    return words[0] == command && words.size() == count + 1;
  };
  if (words.empty())
  {
    throw CommandLineError("what to do is missing: list, show, rename, delete or export");
  }
  if (is("list", 0))
  {
    return list(store);
  }
  if (is("show", 1))
  {
    return show(store, words[1]);
  }
  if (is("rename", 2))
  {
    store.rename(words[1], words[2]);
    return DONE;
  }
  if (is("delete", 1))
  {
    if (const std::string warning = store.remove(words[1]); !warning.empty())
    {
      std::cerr << "routes: " << warning << std::endl;
    }
    return DONE;
  }
  if (is("export", 2))
  {
    store.exportTo(words[1], words[2]);
    return DONE;
  }
  throw CommandLineError("it is called as: list; show NAME; rename NAME NAME; delete NAME; export NAME DIRECTORY");
}

}  // namespace
}  // namespace view_servo

/** Lists, shows, renames, deletes and exports stored routes. Needs no running node. */
int main(int argc, char** argv)
{
  using namespace view_servo;
  try
  {
    std::string directory;
    CommandLine line(
        "routes list | show NAME | rename NAME NAME | delete NAME | export NAME DIRECTORY\n"
        "Stored routes: lists them, shows one, renames it, deletes it with its views, copies it with its views "
        "to another directory of views.",
        "It ends with status 0, 1 when that cannot be, or 2 when the command line is wrong.");
    line.text("views_dir", directory, "directory of the stored views; empty: $ROS_HOME/view_servo/views");
    const std::optional<std::vector<std::string>> words = line.parse(argc, argv);
    const int status = words ? run(RouteStore(viewsDir(directory)), *words) : DONE;
    requireWritten(std::cout);
    return status;
  }
  catch (const CommandLineError& error)
  {
    std::cerr << "routes: " << oneLine(error) << std::endl;
    return MISUSED;
  }
  catch (const std::exception& error)
  {
    std::cerr << "routes: " << oneLine(error) << std::endl;
    return CANNOT;
  }
}
