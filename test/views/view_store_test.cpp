// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/view_store.h"

#include "support/temporary_directory.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <sys/ptrace.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <limits>
#include <set>
#include <stdexcept>
#include <thread>

namespace fs = std::filesystem;
using view_servo::Camera;
using view_servo::isValidViewName;
using view_servo::StoredView;
using view_servo::structureFromText;
using view_servo::toText;
using view_servo::ViewPose;
using view_servo::ViewStore;
using view_servo::ViewStoreError;
using view_servo::ViewStructure;
using view_servo::test::TemporaryDirectory;

namespace
{
cv::Mat randomImage(int seed, const cv::Size& size = cv::Size(64, 48))
{
  cv::Mat image(size, CV_8UC1);
  cv::RNG(static_cast<std::uint64_t>(seed)).fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

StoredView plainView(const std::string& name, int seed = 1)
{
  StoredView view;
  view.name = name;
  view.image = randomImage(seed);
  return view;
}

/** With numbers that are equal again only when all their digits are kept. */
StoredView fullView(const std::string& name)
{
  StoredView view = plainView(name, 3);
  view.region = cv::Rect(3, 4, 50, 40);
  view.stamp = 1700000000.0 + 1.0 / 3.0;
  view.frame_id = "camera: \"optical\" #1";
  view.camera.emplace();
  view.camera->width = 64;
  view.camera->height = 48;
  view.camera->distortion_model = "plumb_bob";
  view.camera->distortion = { -1.0 / 3.0, 1e-17, 0.1, -0.0, 1e300 };
  view.camera->k << 520.0 / 7.0, 0.0, 31.0 / 3.0, 0.0, 510.0 / 7.0, 24.1, 0.0, 0.0, 1.0;
  view.camera->rectification << 1.0, 1e-3 / 3.0, 0.0, -1e-3 / 3.0, 1.0, 0.0, 0.0, 0.0, 1.0;
  view.camera->projection << 70.0 / 3.0, 0.0, 32.0, -8.0 / 3.0, 0.0, 70.0 / 3.0, 24.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  view.pose.emplace();
  view.pose->frame = "odom";
  view.pose->position << 1.0 / 3.0, -2.0 / 7.0, std::numeric_limits<double>::denorm_min();
  view.pose->orientation = Eigen::Quaterniond(0.1, 0.2, 0.3, 0.4).normalized();
  return view;
}

bool sameImage(const cv::Mat& a, const cv::Mat& b)
{
  return a.type() == b.type() && a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0.0;
}

void expectSame(const StoredView& a, const StoredView& b)
{
  EXPECT_EQ(a.name, b.name);
  EXPECT_TRUE(sameImage(a.image, b.image));
  EXPECT_EQ(a.region, b.region);
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_EQ(a.frame_id, b.frame_id);
  ASSERT_EQ(a.camera.has_value(), b.camera.has_value());
  if (a.camera)
  {
    EXPECT_EQ(a.camera->width, b.camera->width);
    EXPECT_EQ(a.camera->height, b.camera->height);
    EXPECT_EQ(a.camera->distortion_model, b.camera->distortion_model);
    EXPECT_EQ(a.camera->distortion, b.camera->distortion);
    EXPECT_EQ(a.camera->k, b.camera->k);
    EXPECT_EQ(a.camera->rectification, b.camera->rectification);
    EXPECT_EQ(a.camera->projection, b.camera->projection);
  }
  ASSERT_EQ(a.pose.has_value(), b.pose.has_value());
  if (a.pose)
  {
    EXPECT_EQ(a.pose->frame, b.pose->frame);
    EXPECT_EQ(a.pose->position, b.pose->position);
    EXPECT_EQ(a.pose->orientation.coeffs(), b.pose->orientation.coeffs());
  }
}

std::string readBytes(const fs::path& path)
{
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

void writeBytes(const fs::path& path, const std::string& bytes)
{
  std::ofstream(path, std::ios::binary) << bytes;
}

std::set<std::string> filesIn(const fs::path& directory)
{
  std::set<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory))
  {
    names.insert(entry.path().filename());
  }
  names.erase(".lock");
  return names;
}

/** What `action` complains about; it must complain in one line. */
template <typename Action>
std::string errorOf(const Action& action)
{
  try
  {
    action();
  }
  catch (const std::runtime_error& error)
  {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
    return error.what();
  }
  return "no error";
}

/** The store's checksum, for whoever forges one. */
std::string fnv1a(const std::string& bytes)
{
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char byte : bytes)
  {
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  }
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(hash));
  return text.data();
}

#define EXPECT_ERROR(action, part) \
  EXPECT_NE(errorOf([&] { action; }).find(part), std::string::npos) << errorOf([&] { action; })

class ViewStoreTest : public ::testing::Test
{
protected:
  ViewStoreTest() : store_(directory_.path() / "views")
  {
  }

  /** The one file of the store whose name starts and ends so. */
  fs::path file(const std::string& prefix, const std::string& suffix) const
  {
    fs::path found;
    for (const std::string& name : filesIn(store_.directory()))
    {
      const bool starts = name.rfind(prefix, 0) == 0;
      const bool ends = name.size() >= suffix.size() && name.substr(name.size() - suffix.size()) == suffix;
      if (starts && ends)
      {
        EXPECT_TRUE(found.empty()) << name << " and " << found;
        found = store_.directory() / name;
      }
    }
    EXPECT_FALSE(found.empty()) << prefix << "*" << suffix;
    return found;
  }

  /** That the view `bad`, and only it, is reported as damaged, for `reason`, while `good` stays usable. */
  void expectOnlyBadDamaged(const std::string& reason) const
  {
    const ViewStore::Listing listing = store_.list();
    EXPECT_EQ(listing.names, std::vector<std::string>{ "good" });
    ASSERT_EQ(listing.damaged.size(), 1U);
    EXPECT_EQ(listing.damaged[0].name, "bad");
    EXPECT_NE(listing.damaged[0].reason.find(reason), std::string::npos) << listing.damaged[0].reason;
    EXPECT_ERROR(store_.load("bad"), "'bad'");
    EXPECT_ERROR(store_.load("bad"), reason);
    expectSame(store_.load("good"), plainView("good"));
  }

  TemporaryDirectory directory_;
  ViewStore store_;
};

class DamagedViewTest : public ViewStoreTest
{
protected:
  DamagedViewTest()
  {
    store_.save(plainView("good"), false);
    store_.save(fullView("bad"), false);
  }
};

}  // namespace

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
  std::string text = readBytes(file);
  text[text.size() / 2] ^= 1;
  writeBytes(file, text);
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
  writeBytes(directory_.path() / "outside.yaml", "untouched");
  for (const std::string& name : { std::string("../outside"), std::string("a/b"), std::string(), std::string(65, 'x') })
  {
    StoredView view = plainView(name);
    EXPECT_ERROR(store_.save(view, true), "a name is 1 to 64 letters");
    EXPECT_ERROR(store_.load(name), "a name is 1 to 64 letters");
    EXPECT_ERROR(store_.revision(name), "a name is 1 to 64 letters");
    EXPECT_ERROR(store_.remove(name), "a name is 1 to 64 letters");
  }
  EXPECT_EQ(readBytes(directory_.path() / "outside.yaml"), "untouched");
  EXPECT_FALSE(fs::exists(store_.directory()));
}

TEST_F(ViewStoreTest, RefusesViewsItCouldNotReturn)
{
  StoredView view = plainView("desk");
  view.image = cv::Mat();
  EXPECT_ERROR(store_.save(view, false), "not 8-bit grey");
  view.image = cv::Mat(48, 64, CV_8UC3, cv::Scalar());
  EXPECT_ERROR(store_.save(view, false), "not 8-bit grey");
  view.image = randomImage(1, { 15, 100 });
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
  writeBytes(store_.directory(), "a file");
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

TEST_F(DamagedViewTest, ChangedYaml)
{
  const std::string text = readBytes(file("bad.", ".yaml"));
  for (std::size_t i = 0; i < text.size(); i += 7)
  {
    std::string changed = text;
    changed[i] = static_cast<char>(changed[i] ^ 1);
    writeBytes(file("bad.", ".yaml"), changed);
    EXPECT_ERROR(store_.load("bad"), "checksum");
    EXPECT_ERROR(store_.revision("bad"), "checksum");
  }
  expectOnlyBadDamaged("checksum");
}

TEST_F(DamagedViewTest, TruncatedYaml)
{
  const std::string text = readBytes(file("bad.", ".yaml"));
  for (const std::size_t length : { std::size_t(0), std::size_t(1), text.size() / 2, text.size() - 1 })
  {
    writeBytes(file("bad.", ".yaml"), text.substr(0, length));
    expectOnlyBadDamaged("checksum");
  }
}

TEST_F(DamagedViewTest, SomethingElseInTheYaml)
{
  for (const std::string text : { "\x01\xFF\n", "[", "hello", "a: {", "checksum: cbf29ce484222325\n" })
  {
    writeBytes(file("bad.", ".yaml"), text);
    expectOnlyBadDamaged("");
  }
}

TEST_F(DamagedViewTest, TruncatedImage)
{
  const fs::path image = file("bad.", ".png");
  fs::resize_file(image, fs::file_size(image) - 10);
  expectOnlyBadDamaged("does not agree with the checksum");
}

TEST_F(DamagedViewTest, ChangedImage)
{
  std::string bytes = readBytes(file("bad.", ".png"));
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 0x10);
  writeBytes(file("bad.", ".png"), bytes);
  expectOnlyBadDamaged("does not agree with the checksum");
}

TEST_F(DamagedViewTest, AnotherViewsImage)
{
  fs::copy_file(file("good.", ".png"), file("bad.", ".png"), fs::copy_options::overwrite_existing);
  expectOnlyBadDamaged("does not agree with the checksum");
}

/** A few bytes that decode to a gigabyte, with all checksums right: only the size in the header gives them away. */
TEST_F(DamagedViewTest, ImageWithABombsHeader)
{
  using namespace std::string_literals;
  const fs::path image = file("bad.", ".png");
  const fs::path yaml = file("bad.", ".yaml");
  const std::string bytes = readBytes(image).replace(16, 8, "\0\0\x7D\0\0\0\x7D\0"s);
  const std::string old_name = image.filename().string();
  const std::string new_name = "bad." + fnv1a(bytes) + ".png";
  fs::remove(image);
  writeBytes(image.parent_path() / new_name, bytes);
  std::string text = readBytes(yaml);
  text.replace(text.find(old_name), old_name.size(), new_name);
  text.resize(text.find("checksum: "));
  writeBytes(yaml, text + "checksum: " + fnv1a(text) + "\n");
  expectOnlyBadDamaged("32000 x 32000 pixels");
}

TEST_F(DamagedViewTest, MissingImage)
{
  fs::remove(file("bad.", ".png"));
  expectOnlyBadDamaged("is missing");
}

TEST_F(DamagedViewTest, CanBeRemoved)
{
  writeBytes(file("bad.", ".yaml"), "nonsense");
  store_.remove("bad");
  EXPECT_TRUE(store_.list().damaged.empty());
  EXPECT_EQ(filesIn(store_.directory()).size(), 2U);
}

TEST_F(DamagedViewTest, CanBeOverwritten)
{
  fs::remove(file("bad.", ".png"));
  EXPECT_ERROR(store_.save(plainView("bad"), false), "there is one of that name");
  store_.save(plainView("bad"), true);
  expectSame(store_.load("bad"), plainView("bad"));
}

TEST_F(ViewStoreTest, IgnoresAndClearsWhatACrashLeft)
{
  store_.save(plainView("desk", 1), false);
  store_.save(plainView("desk-2", 1), false);
  // A new image in place, the yaml file that names it not yet.
  writeBytes(store_.directory() / "desk.0123456789abcdef.png", "half an image");
  writeBytes(store_.directory() / "desk.0123456789abcdef.png.tmp", "half");
  writeBytes(store_.directory() / "desk.yaml.tmp", "format: 1\n");
  writeBytes(store_.directory() / "new.yaml.tmp", "format: 1\n");

  EXPECT_EQ(store_.list().names, (std::vector<std::string>{ "desk", "desk-2" }));
  EXPECT_TRUE(store_.list().damaged.empty());
  expectSame(store_.load("desk"), plainView("desk", 1));

  store_.save(plainView("desk", 2), true);
  store_.save(plainView("new", 3), false);
  expectSame(store_.load("desk"), plainView("desk", 2));
  expectSame(store_.load("new"), plainView("new", 3));
  EXPECT_EQ(filesIn(store_.directory()).size(), 6U);
}

namespace
{
/**
 * Runs `action` in a child process that is killed when it enters its system call number `calls`.
 * @return whether the child came so far; false: it had ended before. Empty when this machine allows no tracing.
 */
template <typename Action>
std::optional<bool> killAtSystemCall(int calls, const Action& action)
{
  constexpr int DONE = 0;
  constexpr int NO_TRACING = 77;
  const pid_t child = fork();
  if (child == 0)
  {
    if (ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0)
    {
      _exit(NO_TRACING);
    }
    raise(SIGSTOP);
    action();
    _exit(DONE);
  }
  int status = 0;
  waitpid(child, &status, 0);
  // Each system call stops the child twice, when it enters and when it leaves the kernel.
  for (int stops = 0; WIFSTOPPED(status) && stops < 2 * calls - 1; ++stops)
  {
    ptrace(PTRACE_SYSCALL, child, nullptr, nullptr);
    waitpid(child, &status, 0);
  }
  if (WIFEXITED(status))
  {
    return WEXITSTATUS(status) == NO_TRACING ? std::nullopt : std::optional<bool>(false);
  }
  kill(child, SIGKILL);
  waitpid(child, &status, 0);
  return true;
}

}  // namespace

TEST_F(ViewStoreTest, HoldsTheOldOrTheNewViewWhereverSavingIsKilled)
{
  const StoredView before = plainView("desk", 1);
  StoredView after = fullView("desk");
  after.image = randomImage(2);

  int seen_before = 0;
  int seen_after = 0;
  bool killed = true;
  for (int calls = 1; killed; ++calls)
  {
    store_.save(before, true);
    const std::optional<bool> result = killAtSystemCall(calls, [&] { store_.save(after, true); });
    if (!result)
    {
      GTEST_SKIP() << "tracing is not permitted here";
    }
    killed = *result;

    EXPECT_TRUE(store_.list().damaged.empty());
    const StoredView view = store_.load("desk");
    const bool is_after = view.stamp == after.stamp;
    (is_after ? seen_after : seen_before) += 1;
    expectSame(view, is_after ? after : before);
  }
  EXPECT_GT(seen_before, 5);
  EXPECT_GT(seen_after, 5);
}

TEST(CameraOfAView, IsTheOneItWasStoredWith)
{
  StoredView view = plainView("desk");
  Camera current;
  current.width = view.image.cols;
  current.height = view.image.rows;
  current.k << 500.0, 0.0, 30.0, 0.0, 500.0, 20.0, 0.0, 0.0, 1.0;
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
    writeBytes(store_.directory() / other, "mine");
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

TEST_F(ViewStoreTest, TwoProcessesSaveOneName)
{
  constexpr int TIMES = 60;
  const auto save_often = [this](int seed) {
    for (int i = 0; i < TIMES; ++i)
    {
      store_.save(plainView("dock", seed), true);
    }
  };
  store_.save(plainView("dock", 1), false);
  const pid_t child = fork();
  if (child == 0)
  {
    try
    {
      save_often(2);
      _exit(0);
    }
    catch (const std::exception&)
    {
      _exit(1);
    }
  }
  std::atomic<bool> done{ false };
  std::thread reader([&] {
    while (!done)
    {
      EXPECT_NO_THROW(store_.load("dock"));
    }
  });
  EXPECT_NO_THROW(save_often(3));
  int status = -1;
  waitpid(child, &status, 0);
  done = true;
  reader.join();
  EXPECT_EQ(status, 0);
  EXPECT_EQ(filesIn(store_.directory()).size(), 2U);
}

TEST_F(ViewStoreTest, ReadersSeeTheOldOrTheNewViewWhileItIsSaved)
{
  // Stamp and image tell the same number, so that a mixture would show.
  const auto numbered = [](int number) {
    StoredView view = plainView("desk");
    view.image.setTo(number);
    view.stamp = number;
    return view;
  };
  store_.save(numbered(0), false);

  std::atomic<bool> done{ false };
  std::thread writer([&] {
    for (int number = 1; number <= 100; ++number)
    {
      store_.save(numbered(number), true);
    }
    done = true;
  });
  int last = 0;
  while (!done)
  {
    EXPECT_NO_THROW({
      const StoredView view = store_.load("desk");
      const int number = static_cast<int>(view.stamp);
      EXPECT_GE(number, last);
      last = number;
      EXPECT_TRUE(sameImage(view.image, numbered(number).image)) << number;
    });
  }
  writer.join();
  EXPECT_EQ(store_.load("desk").stamp, 100.0);
}
