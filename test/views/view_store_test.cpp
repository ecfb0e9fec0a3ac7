// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_store_test.h"

#include "support/cameras.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cmath>

namespace view_servo
{
namespace test
{
namespace
{
namespace fs = std::filesystem;

TEST(ViewName, IsAFileNameThatNeedsNoEscaping)
{
  EXPECT_TRUE(isValidViewName("a"));
  EXPECT_TRUE(isValidViewName("7"));
  EXPECT_TRUE(isValidViewName("Desk_2-left"));
  EXPECT_TRUE(isValidViewName(std::string(64, 'x')));
  for (const std::string& bad :
       { std::string(), std::string(65, 'x'), std::string("../desk"), std::string(".."), std::string("a/b"),
         std::string("/desk"), std::string("a.b"), std::string("_a"), std::string("-a"), std::string("a b"),
         std::string("a\n"), std::string("d\xC3\xA9sk"), std::string("a\0b", 3) })
  {
    EXPECT_FALSE(isValidViewName(bad)) << bad;
  }
}

TEST_F(ViewStoreTest, ReturnsWhatWasSaved)
{
  store_.save(fullView("full"), false);
  store_.save(plainView("plain"), false);
  expectSame(store_.load("full"), fullView("full"));
  expectSame(store_.load("plain"), plainView("plain"));
}

TEST_F(ViewStoreTest, ReturnsOtherCombinationsOfFields)
{
  StoredView without_pose = fullView("a");
  without_pose.pose.reset();
  StoredView without_camera = fullView("b");
  without_camera.camera.reset();
  StoredView without_names = fullView("c");
  without_names.frame_id.clear();
  without_names.camera->distortion_model.clear();
  without_names.camera->distortion.clear();
  for (const StoredView& view : { without_pose, without_camera, without_names })
  {
    store_.save(view, false);
    expectSame(store_.load(view.name), view);
  }
}

TEST_F(ViewStoreTest, SurvivesItsOwnEnd)
{
  store_.save(fullView("desk"), false);
  expectSame(ViewStore(store_.directory()).load("desk"), fullView("desk"));
}

TEST_F(ViewStoreTest, IsEmptyWithoutADirectory)
{
  EXPECT_TRUE(store_.list().names.empty());
  EXPECT_TRUE(store_.list().damaged.empty());
  EXPECT_ERROR(store_.load("desk"), "cannot load view 'desk': there is none of that name");
  EXPECT_ERROR(store_.revision("desk"), "'desk'");
  EXPECT_ERROR(store_.remove("desk"), "cannot remove view 'desk': there is none of that name");
}

TEST_F(ViewStoreTest, OverwritesOnlyWhenAllowed)
{
  store_.save(plainView("desk", 1), false);
  EXPECT_ERROR(store_.save(plainView("desk", 2), false),
               "cannot save view 'desk': there is one of that name; overwrite: true replaces it");
  expectSame(store_.load("desk"), plainView("desk", 1));
  store_.save(plainView("desk", 2), true);
  expectSame(store_.load("desk"), plainView("desk", 2));
  EXPECT_EQ(filesIn(store_.directory()).size(), 2U);
}

TEST_F(ViewStoreTest, KeepsAnImageThatIsSavedAgain)
{
  store_.save(plainView("desk"), false);
  StoredView view = plainView("desk");
  view.stamp = 12.5;
  store_.save(view, true);
  expectSame(store_.load("desk"), view);
}

TEST_F(ViewStoreTest, RevisionChangesWithTheView)
{
  store_.save(plainView("desk", 1), false);
  const std::string first = store_.revision("desk");
  EXPECT_EQ(store_.revision("desk"), first);
  store_.save(plainView("desk", 2), true);
  EXPECT_NE(store_.revision("desk"), first);
}

TEST_F(ViewStoreTest, ReturnsTheStructureOfAViewAndForgetsItWithTheView)
{
  const auto learnt = [](double depth) {
    return ViewStructure{ { { { 1.0 / 3.0, 47.0 }, 1.0 / depth, 0.1 / 7.0 }, { { 63.0, 0.0 }, 1e-3, 1e9 } } };
  };
  store_.save(plainView("desk"), false);
  EXPECT_TRUE(store_.loadStructure("desk").points.empty());
  const std::string revision = store_.revision("desk");
  EXPECT_TRUE(store_.saveStructure("desk", revision, learnt(2.0)));
  EXPECT_TRUE(store_.saveStructure("desk", revision, learnt(3.0)));
  const ViewStructure found = store_.loadStructure("desk");
  ASSERT_EQ(found.points.size(), 2U);
  EXPECT_EQ(found.points[0].pixel, learnt(3.0).points[0].pixel);
  EXPECT_EQ(found.points[0].inverse_depth, 1.0 / 3.0);
  EXPECT_EQ(found.points[0].information, 0.1 / 7.0);
  EXPECT_EQ(store_.revision("desk"), revision) << "the view is as it was";
  EXPECT_EQ(filesIn(store_.directory()).size(), 3U);

  store_.save(plainView("desk", 2), true);
  EXPECT_TRUE(store_.loadStructure("desk").points.empty()) << "it was of the view before";
  EXPECT_FALSE(store_.saveStructure("desk", revision, learnt(2.0)));
  EXPECT_EQ(filesIn(store_.directory()).size(), 2U);
  EXPECT_TRUE(store_.saveStructure("desk", store_.revision("desk"), learnt(2.0)));
  store_.remove("desk");
  EXPECT_TRUE(filesIn(store_.directory()).empty());
  EXPECT_ERROR(store_.saveStructure("desk", revision, learnt(2.0)), "there is none of that name");
  EXPECT_ERROR(store_.loadStructure("desk"), "there is none of that name");
}

TEST_F(ViewStoreTest, DamagedStructureLeavesTheViewUsable)
{
  store_.save(plainView("desk"), false);
  const std::string revision = store_.revision("desk");
  store_.saveStructure("desk", revision, { { { { 1.0, 2.0 }, 0.5, 0.1 } } });
  const fs::path file = store_.directory() / ("desk." + revision + ".points");
  std::string text = readText(file);
  text[text.size() / 2] ^= 1;
  writeText(file, text);
  EXPECT_ERROR(store_.loadStructure("desk"), "does not agree with the checksum");
  EXPECT_EQ(store_.load("desk").name, "desk");
  EXPECT_EQ(store_.list().names, std::vector<std::string>{ "desk" });
  EXPECT_TRUE(store_.list().damaged.empty());
}

TEST(ViewStructureText, SaysWhatIsWrong)
{
  const std::string header = toText({});
  EXPECT_TRUE(structureFromText(header).points.empty());
  EXPECT_EQ(structureFromText(header + "1 2 0.5 3\n").points.size(), 1U);
  for (const char* bad : { "1 2 0.5", "1 2 0.5 3 4", "1 2 -0.5 3", "1 2 0.5 0", "nan 2 0.5 3", "a" })
  {
    EXPECT_ERROR(structureFromText(header + "1 2 0.5 3\n" + bad + "\n"), "line 3 is no point") << bad;
  }
  EXPECT_ERROR(structureFromText("another format\n"), "not a structure");
}

TEST_F(ViewStoreTest, ListsSorted)
{
  for (const std::string name : { "window", "Desk", "10", "door-2" })
  {
    store_.save(plainView(name), false);
  }
  EXPECT_EQ(store_.list().names, (std::vector<std::string>{ "10", "Desk", "door-2", "window" }));
}

TEST_F(ViewStoreTest, RemovesOneViewOnly)
{
  store_.save(plainView("desk"), false);
  store_.save(plainView("desk-2"), false);
  store_.remove("desk");
  EXPECT_ERROR(store_.load("desk"), "there is none of that name");
  EXPECT_EQ(store_.list().names, std::vector<std::string>{ "desk-2" });
  EXPECT_EQ(filesIn(store_.directory()).size(), 2U);
}

TEST_F(ViewStoreTest, RefusesNamesThatAreNotFileNames)
{
  writeText(directory_.path() / "outside.yaml", "untouched");
  for (const std::string& name : { std::string("../outside"), std::string("a/b"), std::string(), std::string(65, 'x') })
  {
    StoredView view = plainView(name);
    EXPECT_ERROR(store_.save(view, true), "a name is 1 to 64 letters");
    EXPECT_ERROR(store_.load(name), "a name is 1 to 64 letters");
    EXPECT_ERROR(store_.revision(name), "a name is 1 to 64 letters");
    EXPECT_ERROR(store_.remove(name), "a name is 1 to 64 letters");
  }
  EXPECT_ERROR(store_.load("a\nb"), "'a?b': a name is 1 to 64 letters");
  EXPECT_EQ(readText(directory_.path() / "outside.yaml"), "untouched");
  EXPECT_FALSE(fs::exists(store_.directory()));
}

TEST_F(ViewStoreTest, RefusesViewsItCouldNotReturn)
{
  StoredView view = plainView("desk");
  view.image = cv::Mat();
  EXPECT_ERROR(store_.save(view, false), "not 8-bit grey");
  view.image = cv::Mat(48, 64, CV_8UC3, cv::Scalar());
  EXPECT_ERROR(store_.save(view, false), "not 8-bit grey");
  view.image = randomPicture(1, { 15, 100 });
  EXPECT_ERROR(store_.save(view, false), "too small");

  for (const cv::Rect& region : { cv::Rect(-1, 0, 10, 10), cv::Rect(0, -1, 10, 10), cv::Rect(60, 0, 5, 10),
                                  cv::Rect(0, 40, 10, 9), cv::Rect(1, 1, 2147483647, 10) })
  {
    view = plainView("desk");
    view.region = region;
    EXPECT_ERROR(store_.save(view, false), "region of interest leaves the image");
  }

  view = fullView("desk");
  view.stamp = std::nan("");
  EXPECT_ERROR(store_.save(view, false), "its stamp has numbers that are not finite");
  view = fullView("desk");
  view.camera->distortion[1] = std::numeric_limits<double>::infinity();
  EXPECT_ERROR(store_.save(view, false), "its camera has numbers that are not finite");
  view = fullView("desk");
  view.pose->position.x() = std::nan("");
  EXPECT_ERROR(store_.save(view, false), "its pose has numbers that are not finite");

  EXPECT_TRUE(store_.list().names.empty());
}

TEST_F(ViewStoreTest, SaysWhenItsDirectoryIsNoDirectory)
{
  writeText(store_.directory(), "a file");
  EXPECT_ERROR(store_.save(plainView("desk"), false), "cannot save view 'desk': ");
  EXPECT_ERROR(store_.save(plainView("desk"), false), store_.directory().string());
  EXPECT_ERROR(store_.list(), "cannot list views: ");
}

TEST_F(ViewStoreTest, SaysWhenItsDirectoryIsNotWritable)
{
  store_.save(plainView("desk", 1), false);
  // Not even root can write here.
  const ViewStore proc("/proc/self/views");
  EXPECT_ERROR(proc.save(plainView("desk"), false), "/proc/self/views");
  if (geteuid() == 0)
  {
    GTEST_SKIP() << "root may write everywhere else";
  }
  fs::permissions(store_.directory(), fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_ERROR(store_.save(plainView("desk", 2), true), "ermission denied");
  EXPECT_ERROR(store_.remove("desk"), "ermission denied");
  expectSame(store_.load("desk"), plainView("desk", 1));
  fs::permissions(store_.directory(), fs::perms::owner_all);
}

TEST(CameraOfAView, IsTheOneItWasStoredWith)
{
  StoredView view = plainView("desk");
  const Camera current = pinholeCamera(view.image.size(), 500.0, 500.0, 30.0, 20.0);
  EXPECT_EQ(cameraOf(view, current).k, current.k);  // it was stored without any
  Camera other = current;
  other.width = 640;
  EXPECT_ERROR(cameraOf(view, other), "no calibration, and the camera has 640 x");
  view.camera = current;
  view.camera->k(0, 0) = 700.0;
  EXPECT_EQ(cameraOf(view, other).k(0, 0), 700.0);
  view.camera->height = 17;
  EXPECT_ERROR(cameraOf(view, other), "its calibration is for");
  view.camera->height = current.height;
  view.camera->distortion = { 0.1, 0.2, 0.3 };
  view.camera->distortion_model = "plumb_bob";
  EXPECT_ERROR(cameraOf(view, other), "store it anew: D has 3 coefficients");
}

TEST_F(ViewStoreTest, LeavesFilesOfOthersAlone)
{
  store_.save(plainView("dock"), false);
  const std::set<std::string> others = { "dock.backup.yaml", "dock.photo.png",
                                         "dock.txt",         "dock.0123.png",
                                         "dock.tmp",         "dock2.yaml.tmp",
                                         "dock.png.tmp",     "dock.0123456789ABCDEF.png",
                                         "dock.points",      "dock.0123456789abcdef.points.txt" };
  for (const std::string& other : others)
  {
    writeText(store_.directory() / other, "mine");
  }
  EXPECT_EQ(store_.save(plainView("dock", 2), true), "");
  EXPECT_EQ(store_.remove("dock"), "");
  EXPECT_EQ(filesIn(store_.directory()), others);
}

TEST_F(ViewStoreTest, NeverWaitsForWhatIsNotAFile)
{
  store_.save(plainView("desk"), false);
  ASSERT_EQ(mkfifo((store_.directory() / "pipe.yaml").c_str(), 0600), 0);
  fs::create_symlink("loop.yaml", store_.directory() / "loop.yaml");
  fs::create_symlink("/dev/zero", store_.directory() / "zero.yaml");
  fs::create_directory(store_.directory() / "folder.yaml");
  const ViewStore::Listing listing = store_.list();
  EXPECT_EQ(listing.names, std::vector<std::string>{ "desk" });
  ASSERT_EQ(listing.damaged.size(), 4U);
  for (const ViewStore::Damaged& damaged : listing.damaged)
  {
    EXPECT_NE(damaged.reason, "");
    EXPECT_THROW(store_.load(damaged.name), ViewStoreError);
    EXPECT_THROW(store_.revision(damaged.name), ViewStoreError);
    EXPECT_THROW(store_.save(plainView(damaged.name), false), ViewStoreError);
    EXPECT_THROW(store_.remove(damaged.name), ViewStoreError);
  }
  EXPECT_EQ(filesIn(store_.directory()).size(), 6U);
}

TEST_F(ViewStoreTest, WritesThroughNoLink)
{
  store_.save(plainView("desk", 1), false);
  const TemporaryDirectory elsewhere;
  const fs::path other = elsewhere.path() / "other";
  writeText(other, "mine");
  for (const char* name : { "desk.yaml", "desk.yaml.tmp" })
  {
    fs::remove(store_.directory() / name);
    fs::create_symlink(other, store_.directory() / name);
    EXPECT_EQ(store_.save(plainView("desk", 2), true), "");
    EXPECT_EQ(readText(other), "mine") << name;
    expectSame(store_.load("desk"), plainView("desk", 2));
  }
  fs::remove(store_.directory() / ".lock");
  fs::create_symlink(elsewhere.path() / "made", store_.directory() / ".lock");
  EXPECT_THROW(store_.save(plainView("desk", 3), true), ViewStoreError);
  EXPECT_FALSE(fs::exists(elsewhere.path() / "made"));
  expectSame(store_.load("desk"), plainView("desk", 2));
}

}  // namespace
}  // namespace test
}  // namespace view_servo
