// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/views/route_store.h"

#include <cmath>

using namespace view_servo;

namespace
{
/** A store with the views 'first', 'second' and 'third', and one route. */
class Store
{
public:
  Store() : store_(directory_.path())
  {
    constexpr int SIDE = 32;  // [px]
    for (const char* name : { "first", "second", "third" })
    {
      StoredView view;
      view.name = name;
      view.image = cv::Mat(SIDE, SIDE, CV_8UC1, cv::Scalar(90));
      store_.views().save(view, true);
    }
    std::filesystem::create_directories(store_.directory());
  }

  void read(const std::string& yaml) const
  {
    directory_.write("routes/fuzz.yaml", fuzz::withChecksum(yaml));
    fuzz::readOrRefuse<RouteStoreError>([&] {
      const Route route = store_.load("fuzz");
      fuzz::require(route.stops.size() >= 2 && route.stops.size() <= MAX_ROUTE_STOPS, "a route has 2 stops and more");
      fuzz::require(std::isfinite(lengthOf(route)), "its length is a number");
      saveAgain(route);
    });
    for (const RouteStore::Damaged& damaged : store_.list().damaged)
    {
      fuzz::requireReason(damaged.reason);
    }
  }

private:
  /** What is read can be stored, and is read again as it was. */
  void saveAgain(Route route) const
  {
    const Route first = route;
    route.name = "again";
    std::filesystem::remove(store_.directory() / "again.yaml");
    store_.save(route);
    const Route second = store_.load("again");
    bool same = first.frame == second.frame && first.stops.size() == second.stops.size();
    for (std::size_t i = 0; same && i < first.stops.size(); ++i)
    {
      const RouteStop& a = first.stops[i];
      const RouteStop& b = second.stops[i];
      same = a.view == b.view && a.stamp == b.stamp && a.base.x == b.base.x && a.base.y == b.base.y &&
             a.base.yaw == b.base.yaw;
    }
    fuzz::require(same, "what is written is read as it was");
  }

  fuzz::Directory directory_;
  RouteStore store_;
};
}  // namespace

/** The yaml file of a route, without its checksum. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  static const Store store;
  store.read(fuzz::toString(data, size));
  return 0;
}
