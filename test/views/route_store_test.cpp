// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/route_store.h"

#include "support/temporary_directory.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace fs = std::filesystem;
using view_servo::isValidRouteName;
using view_servo::Route;
using view_servo::RouteStore;
using view_servo::RouteStoreError;
using view_servo::StoredView;
using view_servo::viewNameOf;
using view_servo::ViewStructure;
using view_servo::test::TemporaryDirectory;

namespace
{
using Names = std::vector<std::string>;

/** What `action` complains about, as a RouteStoreError in one line. */
std::string errorOf(const std::function<void()>& action)
{
  try
  {
    action();
  }
  catch (const RouteStoreError& error)
  {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "no error";
}

#define EXPECT_ERROR(action, part) \
  EXPECT_NE(errorOf([&] { action; }).find(part), std::string::npos) << errorOf([&] { action; })

std::string readBytes(const fs::path& path)
{
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

/** FNV-1a, 64 bits, as the store writes it. */
std::string fnv1a(const std::string& bytes)
{
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char byte : bytes)
  {
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  }
  char text[17];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(hash));
  return text;
}

class RouteStoreTest : public ::testing::Test
{
protected:
  RouteStoreTest() : store_(directory_.path() / "views")
  {
  }

  void saveView(const std::string& name) const
  {
    StoredView view;
    view.name = name;
    view.image = cv::Mat(48, 64, CV_8UC1);
    cv::RNG(3).fill(view.image, cv::RNG::UNIFORM, 0, 256);
    store_.views().save(view, true);
  }

  /** With its views stored. */
  Route makeRoute(const std::string& name, std::size_t views = 3) const
  {
    Route route;
    route.name = name;
    route.frame = "robot: \"1\"/odom";
    for (std::size_t i = 1; i <= views; ++i)
    {
      const double number = static_cast<double>(i);
      route.stops.push_back({ viewNameOf(name, i), { 0.3 * number, -1.0 / 3.0, 0.1 * number }, 1.7e9 + number / 3.0 });
      saveView(route.stops.back().view);
    }
    return route;
  }

  fs::path file(const std::string& route) const
  {
    return store_.directory() / (route + ".yaml");
  }

  /** A route's file with this text and the checksum that belongs to it. */
  void forge(const std::string& route, const std::string& text) const
  {
    std::ofstream(file(route), std::ios::binary) << text << "checksum: " << fnv1a(text) << "\n";
  }

  /** The text of a route's file without the checksum. */
  std::string textOf(const std::string& route) const
  {
    const std::string text = readBytes(file(route));
    return text.substr(0, text.rfind("checksum: "));
  }

  /** That the route `bad`, and only it, cannot be used. */
  void expectOnlyBadDamaged(const std::string& reason) const
  {
    const RouteStore::Listing listing = store_.list();
    EXPECT_EQ(listing.names, Names{ "good" });
    ASSERT_EQ(listing.damaged.size(), 1U);
    EXPECT_EQ(listing.damaged[0].name, "bad");
    EXPECT_NE(listing.damaged[0].reason.find(reason), std::string::npos) << listing.damaged[0].reason;
    EXPECT_ERROR(store_.load("bad"), "cannot load route 'bad'");
    EXPECT_ERROR(store_.load("bad"), reason);
    EXPECT_EQ(store_.load("good").stops.size(), 3U);
  }

  TemporaryDirectory directory_;
  RouteStore store_;
};

class DamagedRouteTest : public RouteStoreTest
{
protected:
  DamagedRouteTest()
  {
    store_.save(makeRoute("good"));
    store_.save(makeRoute("bad"));
  }
};

}  // namespace

TEST(RouteName, LeavesRoomForTheNumbersOfItsViews)
{
  EXPECT_TRUE(isValidRouteName("Hall-2_b"));
  EXPECT_TRUE(isValidRouteName(std::string(58, 'x')));
  for (const std::string& bad : { std::string(), std::string(59, 'x'), std::string("../a"), std::string("a/b"),
                                  std::string(".a"), std::string("a\n"), std::string("a\0b", 3) })
  {
    EXPECT_FALSE(isValidRouteName(bad)) << bad;
  }
  EXPECT_EQ(viewNameOf("a", 7), "a_007");
  EXPECT_EQ(viewNameOf("a", 1234), "a_1234");
  EXPECT_TRUE(view_servo::isValidViewName(viewNameOf(std::string(58, 'x'), view_servo::MAX_ROUTE_STOPS)));
}

TEST_F(RouteStoreTest, ReturnsWhatWasSaved)
{
  const Route saved = makeRoute("hall");
  store_.save(saved);
  const Route loaded = store_.load("hall");
  EXPECT_EQ(loaded.name, "hall");
  EXPECT_EQ(loaded.frame, saved.frame);
  ASSERT_EQ(loaded.stops.size(), saved.stops.size());
  for (std::size_t i = 0; i < saved.stops.size(); ++i)
  {
    EXPECT_EQ(loaded.stops[i].view, saved.stops[i].view);
    EXPECT_EQ(loaded.stops[i].base.x, saved.stops[i].base.x);
    EXPECT_EQ(loaded.stops[i].base.y, saved.stops[i].base.y);
    EXPECT_EQ(loaded.stops[i].base.yaw, saved.stops[i].base.yaw);
    EXPECT_EQ(loaded.stops[i].stamp, saved.stops[i].stamp);
  }
  EXPECT_NEAR(lengthOf(loaded), 0.6, 1e-12);
  EXPECT_EQ(store_.list().names, Names{ "hall" });
  EXPECT_EQ(store_.views().list().names.size(), 3U) << "routes are no views";
  EXPECT_TRUE(store_.views().list().damaged.empty());
}

TEST_F(RouteStoreTest, HoldsTheLongestRoute)
{
  Route route = makeRoute(std::string(58, 'x'), 2);
  const std::string view = directory_.path() / "views";
  while (route.stops.size() < view_servo::MAX_ROUTE_STOPS)
  {
    route.stops.push_back(route.stops.back());
    route.stops.back().view = viewNameOf(route.name, route.stops.size());
    std::ofstream(view + "/" + route.stops.back().view + ".yaml") << "not read";
  }
  store_.save(route);
  EXPECT_EQ(store_.load(route.name).stops.size(), view_servo::MAX_ROUTE_STOPS);
}

TEST_F(RouteStoreTest, HasNoneBeforeTheFirstIsSaved)
{
  EXPECT_TRUE(store_.list().names.empty());
  EXPECT_FALSE(store_.has("a"));
  EXPECT_ERROR(store_.load("a"), "cannot load route 'a': there is none of that name");
  EXPECT_ERROR(store_.remove("a"), "there is none");
  EXPECT_ERROR(store_.rename("a", "b"), "cannot rename route 'a': there is none");
  EXPECT_FALSE(fs::exists(store_.directory()));
}

TEST_F(RouteStoreTest, FindsTheRouteThatAViewIsOn)
{
  EXPECT_ERROR(store_.routeWith("hall_002"), "view 'hall_002' is on no route");
  store_.save(makeRoute("hall"));
  Route lab = makeRoute("lab");
  lab.stops.push_back(store_.load("hall").stops.front());  // where both begin
  store_.save(lab);
  EXPECT_EQ(store_.routeWith("hall_002"), "hall");
  EXPECT_EQ(store_.routeWith("lab_003"), "lab");
  EXPECT_ERROR(store_.routeWith("hall_001"),
               "view 'hall_001' is on route 'hall' and on route 'lab': name the one to follow");
  EXPECT_EQ(store_.routesWith("hall_001"), (std::vector<std::string>{ "hall", "lab" }));
  EXPECT_EQ(store_.routesWith("lab_003"), std::vector<std::string>{ "lab" });
  EXPECT_EQ(store_.routesWith("none"), std::vector<std::string>());
  store_.rename("lab", "attic");
  EXPECT_EQ(store_.routeWith("lab_003"), "attic") << "views keep their names";
  std::ofstream(file("attic")) << "not a route";
  EXPECT_ERROR(store_.routeWith("lab_003"),
               "view 'lab_003' is on no route, as far as is known: route 'attic' is damaged");
}

TEST_F(RouteStoreTest, RefusesWhatCannotBe)
{
  const Route good = makeRoute("hall");
  const auto refused = [&](const std::function<void(Route&)>& change) {
    Route route = good;
    change(route);
    return errorOf([&] { store_.save(route); });
  };
  const auto says = [](const std::string& text, const std::string& part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  says(refused([](Route& route) { route.name = "../hall"; }), "a route's name is");
  says(refused([](Route& route) { route.name = std::string(5000, 'x'); }), "a route's name is");
  says(refused([](Route& route) { route.stops.resize(1); }), "fewer than 2 views");
  says(refused([](Route& route) { route.stops.resize(20000); }), "more than 10000 views");
  says(refused([](Route& route) { route.frame = std::string(300, 'f'); }), "the name of its frame");
  says(refused([](Route& route) { route.stops[1].view = "../../etc/x"; }), "view 2 has a name");
  says(refused([](Route& route) { route.stops[1].view = route.stops[0].view; }), "twice");
  says(refused([](Route& route) { route.stops[1].view = "other"; }), "view 'other' is not there");
  for (const double number : { std::nan(""), std::numeric_limits<double>::infinity(), 1e7 })
  {
    says(refused([&](Route& route) { route.stops[1].base.x = number; }), "cannot be");
    says(refused([&](Route& route) { route.stops[1].base.yaw = -number; }), "cannot be");
  }
  says(refused([](Route& route) { route.stops[1].stamp = std::nan(""); }), "cannot be");
  EXPECT_TRUE(store_.list().names.empty());
}

TEST_F(RouteStoreTest, ReplacesNone)
{
  store_.save(makeRoute("hall"));
  const std::string before = readBytes(file("hall"));
  EXPECT_ERROR(store_.save(makeRoute("hall", 2)), "there is one of that name");
  EXPECT_EQ(readBytes(file("hall")), before);
}

TEST_F(RouteStoreTest, SaysThatTheDiskIsNotThere)
{
  const Route route = makeRoute("hall");
  std::ofstream(store_.directory()) << "a file where the directory should be";
  EXPECT_ERROR(store_.save(route), "cannot save route 'hall': ");
  EXPECT_ERROR(store_.list(), "cannot list routes");
}

TEST_F(RouteStoreTest, Renames)
{
  store_.save(makeRoute("a"));
  store_.save(makeRoute("b"));
  EXPECT_ERROR(store_.rename("a", "b"), "cannot rename route 'a': there is a route 'b' already");
  EXPECT_ERROR(store_.rename("a", "../c"), "a route's name is");
  store_.rename("a", "c");
  EXPECT_EQ(store_.list().names, (Names{ "b", "c" }));
  EXPECT_EQ(store_.load("c").stops[0].view, "a_001") << "views keep their names";
}

TEST_F(RouteStoreTest, RemovesTheViewsThatNoOtherRouteNeeds)
{
  Route shared = makeRoute("a");
  store_.save(shared);
  saveView("mine");
  shared.name = "b";
  shared.stops.resize(2);
  shared.stops.push_back({ "mine", {}, 0.0 });
  store_.save(shared);
  saveView("bystander");
  EXPECT_EQ(store_.ownViews("a"), Names{ "a_003" });
  EXPECT_EQ(store_.ownViews("b"), Names{ "mine" });
  EXPECT_ERROR(store_.ownViews("c"), "there is none of that name");
  EXPECT_EQ(store_.remove("a"), "");
  EXPECT_EQ(store_.list().names, Names{ "b" });
  EXPECT_EQ(store_.views().list().names, (Names{ "a_001", "a_002", "bystander", "mine" }));
  EXPECT_EQ(store_.remove("b"), "");
  EXPECT_EQ(store_.views().list().names, Names{ "bystander" });
}

TEST_F(RouteStoreTest, ExportsARouteWithItsViews)
{
  store_.save(makeRoute("hall"));
  ViewStructure structure;
  structure.points.push_back({ { 10.0, 20.0 }, 0.5, 2.0 });
  store_.views().saveStructure("hall_002", store_.views().revision("hall_002"), structure);
  const fs::path other = directory_.path() / "other";
  store_.exportTo("hall", other);
  const RouteStore copy(other);
  EXPECT_EQ(copy.load("hall").stops.size(), 3U);
  EXPECT_EQ(copy.views().load("hall_003").image.cols, 64);
  EXPECT_EQ(copy.views().loadStructure("hall_002").points.size(), 1U);
  EXPECT_ERROR(store_.exportTo("hall", other), "there is one of that name in");
}

TEST_F(RouteStoreTest, AnExportThatFailsLeavesNothing)
{
  store_.save(makeRoute("hall"));
  const RouteStore other(directory_.path() / "other");
  StoredView view = store_.views().load("hall_001");
  view.name = "hall_003";
  other.views().save(view, false);
  EXPECT_ERROR(store_.exportTo("hall", directory_.path() / "other"), "there is a view 'hall_003' in");
  EXPECT_EQ(other.views().list().names, Names{ "hall_003" });
  EXPECT_TRUE(other.list().names.empty());
  other.views().remove("hall_003");
  std::ofstream(store_.views().directory() / "hall_003.yaml", std::ios::app) << "damaged\n";
  EXPECT_ERROR(store_.exportTo("hall", directory_.path() / "other"), "hall_003");
  EXPECT_TRUE(other.views().names().empty()) << "the views before it were copied";
  EXPECT_TRUE(other.list().names.empty());
}

TEST_F(DamagedRouteTest, IsReportedForEveryByte)
{
  const std::string good = readBytes(file("bad"));
  for (std::size_t i = 0; i < good.size(); i += 7)
  {
    std::string bytes = good;
    bytes[i] = static_cast<char>(bytes[i] ^ 1);
    std::ofstream(file("bad"), std::ios::binary) << bytes;
    EXPECT_ERROR(store_.load("bad"), "does not agree with the checksum");
  }
  std::ofstream(file("bad"), std::ios::binary) << good.substr(0, good.size() / 2);
  expectOnlyBadDamaged("does not agree with the checksum");
}

TEST_F(DamagedRouteTest, MissesAView)
{
  store_.views().remove("bad_002");
  expectOnlyBadDamaged("its view 'bad_002' is not there");
}

TEST_F(DamagedRouteTest, IsRefusedWithAGoodChecksum)
{
  const std::string good = textOf("bad");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    forge("bad", text);
  };
  with("format: 1", "format: 2");
  expectOnlyBadDamaged("it has format 2, not 1");
  with("bad_002", "../good_001");
  expectOnlyBadDamaged("view 2 has a name that no view can have");
  with("bad_002", "bad_001");
  expectOnlyBadDamaged("twice");
  with("base: [", "base: [.nan, ");
  expectOnlyBadDamaged("a list of 3 numbers has 4");
  std::string bomb = "a: &a [1,1,1,1,1,1,1,1,1,1]\n";
  for (char name = 'b'; name < 'k'; ++name)
  {
    // Each line stands for ten of the one before.
    const std::string before = std::string("*") + static_cast<char>(name - 1);
    bomb += std::string(1, name) + ": &" + name + " [" + before;
    for (int i = 1; i < 10; ++i)
    {
      bomb += "," + before;
    }
    bomb += "]\n";
  }
  forge("bad", bomb + good);
  expectOnlyBadDamaged("more than a million values");
  for (const char* text : { "", "format: 1\n", "- 1\n", "format: 1\nframe: odom\nviews: 7\n", "{[\n", "a: &a *a\n" })
  {
    forge("bad", text);
    expectOnlyBadDamaged("");
  }
}

TEST_F(DamagedRouteTest, IsNoFile)
{
  fs::remove(file("bad"));
  fs::create_directory(file("bad"));
  expectOnlyBadDamaged("");
  EXPECT_ERROR(store_.remove("bad"), "is not a file");
  fs::remove(file("bad"));
  std::ofstream(file("bad"), std::ios::binary) << std::string(5'000'000, 'x');
  expectOnlyBadDamaged("");
}

TEST_F(DamagedRouteTest, IsRemovedWithoutTouchingOthers)
{
  std::ofstream(file("bad")) << "rubbish";
  EXPECT_NE(store_.remove("good").find("its views are kept, as route 'bad' is damaged"), std::string::npos);
  EXPECT_NE(store_.remove("bad").find("its views are kept, as it is damaged"), std::string::npos);
  EXPECT_TRUE(store_.list().names.empty());
  EXPECT_TRUE(store_.list().damaged.empty());
  EXPECT_EQ(store_.views().list().names.size(), 6U) << "what a damaged route names is not known";
}
