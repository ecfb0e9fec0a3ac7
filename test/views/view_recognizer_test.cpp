// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/view_recognizer.h"

#include "support/room_structure.h"
#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace
{
using view_servo::Camera;
using view_servo::CandidateView;
using view_servo::imageFiles;
using view_servo::PreparedImage;
using view_servo::StoredView;
using view_servo::storedViews;
using view_servo::ViewRecognizer;
using view_servo::ViewRecognizerParams;
using view_servo::ViewStore;
using view_servo::test::disturbed;
using view_servo::test::exampleHomography;
using view_servo::test::readText;
using view_servo::test::roomCamera;
using view_servo::test::RoomCorner;
using view_servo::test::roomStructure;
using view_servo::test::roomView;
using view_servo::test::roomViewFromCurrent;
using view_servo::test::TemporaryDirectory;
using view_servo::test::texturedPicture;
using view_servo::test::warpedPicture;
using view_servo::test::writeText;

constexpr std::size_t ALL = 1000000;

/** A store with views of different scenes. */
class ViewRecognizerTest : public ::testing::Test
{
protected:
  void SetUp() override
  {
    for (std::uint64_t scene = 1; scene <= VIEWS; ++scene)
    {
      save("view" + std::to_string(scene), scene);
    }
  }

  void save(const std::string& name, std::uint64_t scene) const
  {
    StoredView view;
    view.name = name;
    view.image = texturedPicture(scene);
    store_.save(view, true);
  }

  static ViewRecognizerParams params()
  {
    ViewRecognizerParams params;
    params.candidates = 2;
    return params;
  }

  /** The scene from another side, in other light. */
  static PreparedImage seen(const ViewRecognizer& recognizer, std::uint64_t scene)
  {
    const cv::Mat picture = texturedPicture(scene);
    return { disturbed(warpedPicture(picture, exampleHomography(), picture.size()), 0.7, 0.0, 2.0), cv::Rect(),
             recognizer.features() };
  }

  static std::string best(const ViewRecognizer& recognizer, std::uint64_t scene)
  {
    const std::vector<CandidateView> views = recognizer.recognize(seen(recognizer, scene), 1, false);
    return views.empty() ? "" : views.front().name;
  }

  static constexpr std::uint64_t VIEWS = 6;
  TemporaryDirectory directory_;
  ViewStore store_{ directory_.path() / "views" };
};

TEST_F(ViewRecognizerTest, VerifiesTheViewThatTheImageShows)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  EXPECT_TRUE(recognizer.recognize(seen(recognizer, 1), 1, true).empty()) << "nothing is in the index yet";
  const ViewRecognizer::Update update = recognizer.update(ALL);
  EXPECT_EQ(update.added, VIEWS);
  EXPECT_EQ(update.waiting, 0U);
  EXPECT_EQ(recognizer.size(), VIEWS);
  for (const std::uint64_t scene : { 2U, 5U })
  {
    const std::vector<CandidateView> views = recognizer.recognize(seen(recognizer, scene), 2, true);
    ASSERT_FALSE(views.empty());
    EXPECT_EQ(views[0].name, "view" + std::to_string(scene));
    EXPECT_TRUE(views[0].verified);
    EXPECT_GT(views[0].inliers, 20);
    for (std::size_t i = 1; i < views.size(); ++i)
    {
      EXPECT_FALSE(views[i].verified) << views[i].name;
    }
  }
}

TEST_F(ViewRecognizerTest, VerifiesNoViewForAnUnknownScene)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  recognizer.update(ALL);
  for (const CandidateView& view : recognizer.recognize(seen(recognizer, 100), 3, true))
  {
    EXPECT_FALSE(view.verified) << view.name;
    EXPECT_EQ(view.inliers, 0);
  }
  const PreparedImage black(cv::Mat(240, 320, CV_8UC1, cv::Scalar(0)), cv::Rect(), recognizer.features());
  EXPECT_TRUE(recognizer.recognize(black, 3, true).empty());
}

TEST_F(ViewRecognizerTest, TellsWhereTheCameraIsOnceTheViewHasStructure)
{
  const RoomCorner room;
  store_.save(roomView(room), false);
  ViewRecognizer recognizer(storedViews(store_), params());
  recognizer.update(ALL);
  const PreparedImage image(room.current, cv::Rect(), recognizer.features());
  const auto best = [&](const std::optional<Camera>& camera) {
    return recognizer.recognize(image, 1, true, {}, camera).at(0);
  };
  EXPECT_TRUE(best(roomCamera()).verified);
  EXPECT_FALSE(best(roomCamera()).pose) << "nothing has been learnt";
  ASSERT_TRUE(store_.saveStructure("room", store_.revision("room"), roomStructure(4)));
  EXPECT_FALSE(best(std::nullopt).pose) << "the camera is not known";
  const CandidateView view = best(roomCamera());
  ASSERT_TRUE(view.pose);
  EXPECT_LT((view.pose->view_from_current.translation() - roomViewFromCurrent().translation()).norm(), 0.02);
  EXPECT_FALSE(best(Camera()).pose) << "the camera is not calibrated";
  StoredView anew = roomView(room);
  anew.stamp += 1.0;
  store_.save(anew, true);
  ASSERT_TRUE(store_.saveStructure("room", store_.revision("room"), roomStructure(4)));
  EXPECT_FALSE(best(roomCamera()).pose) << "these are depths of another picture than the one that is indexed";
}

TEST_F(ViewRecognizerTest, GivesUpWhenAsked)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  recognizer.update(ALL);
  const std::vector<CandidateView> views = recognizer.recognize(seen(recognizer, 2), 1, true, [] { return true; });
  ASSERT_EQ(views.size(), 1U);
  EXPECT_FALSE(views[0].verified);
}

TEST_F(ViewRecognizerTest, KeepsInStepWithTheStore)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  recognizer.update(ALL);
  EXPECT_EQ(recognizer.update(ALL).added, 0U);
  store_.remove("view3");
  save("view4", 40);
  save("new", 50);
  const ViewRecognizer::Update update = recognizer.update(ALL);
  EXPECT_EQ(update.added, 2U);
  EXPECT_EQ(update.removed, 1U);
  EXPECT_NE(best(recognizer, 3), "view3");
  EXPECT_NE(best(recognizer, 4), "view4");
  EXPECT_EQ(best(recognizer, 40), "view4");
  EXPECT_EQ(best(recognizer, 50), "new");
  // The matcher, too, has the new image.
  EXPECT_TRUE(recognizer.recognize(seen(recognizer, 40), 1, true).front().verified);
}

TEST_F(ViewRecognizerTest, ReadsAFewViewsAtATime)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  const ViewRecognizer::Update update = recognizer.update(3);
  EXPECT_EQ(update.added, 3U);
  EXPECT_EQ(update.waiting, VIEWS - 3);
  EXPECT_EQ(recognizer.update(ALL).added, VIEWS - 3);
}

TEST_F(ViewRecognizerTest, NamesADamagedViewOnceAndUsesTheOthers)
{
  for (const auto& entry : std::filesystem::directory_iterator(store_.directory()))
  {
    if (entry.path().filename().string().rfind("view5.", 0) == 0 && entry.path().extension() == ".png")
    {
      writeText(entry.path(), "damaged");
    }
  }
  ViewRecognizer recognizer(storedViews(store_), params());
  const ViewRecognizer::Update update = recognizer.update(ALL);
  EXPECT_EQ(update.added, VIEWS - 1);
  ASSERT_EQ(update.unreadable.size(), 1U);
  EXPECT_NE(update.unreadable.front().find("view5"), std::string::npos) << update.unreadable.front();
  EXPECT_TRUE(recognizer.update(ALL).unreadable.empty());
  EXPECT_EQ(best(recognizer, 6), "view6");
  save("view5", 55);
  EXPECT_EQ(recognizer.update(ALL).added, 1U);
  EXPECT_EQ(best(recognizer, 55), "view5");
}

TEST_F(ViewRecognizerTest, TriesAViewAgainWhosePictureComesLater)
{
  const auto pictures = [this] {
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(store_.directory()))
    {
      if (entry.path().filename().string().rfind("view5.", 0) == 0 && entry.path().extension() == ".png")
      {
        files.push_back(entry.path());
      }
    }
    return files;
  };
  ASSERT_EQ(pictures().size(), 1U);
  const std::filesystem::path picture = pictures().front();
  const std::filesystem::path aside = directory_.path() / "aside.png";
  std::filesystem::rename(picture, aside);
  ViewRecognizer recognizer(storedViews(store_), params());
  const auto now = std::chrono::steady_clock::now();
  EXPECT_EQ(recognizer.update(ALL, now).unreadable.size(), 1U);
  std::filesystem::rename(aside, picture);
  EXPECT_EQ(recognizer.update(ALL, now + std::chrono::seconds(1)).added, 0U) << "not at each look";
  EXPECT_EQ(recognizer.update(ALL, now + std::chrono::seconds(1)).unusable, 1U);
  const ViewRecognizer::Update later = recognizer.update(ALL, now + std::chrono::seconds(31));
  EXPECT_EQ(later.added, 1U);
  EXPECT_EQ(later.unusable, 0U);

  // Lost once more after it was indexed: the next image that seems to show it finds that out.
  std::filesystem::rename(picture, aside);
  EXPECT_FALSE(recognizer.recognize(seen(recognizer, 5), 1, true).front().verified);
  const ViewRecognizer::Update lost = recognizer.update(ALL, now + std::chrono::seconds(32));
  ASSERT_EQ(lost.unreadable.size(), 1U);
  EXPECT_NE(lost.unreadable.front().find("view5"), std::string::npos);
  EXPECT_TRUE(recognizer.update(ALL, now + std::chrono::seconds(63)).unreadable.empty()) << "it was told";
}

TEST_F(ViewRecognizerTest, ReadsAllThatAreDoubtfulAFewAtATime)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  recognizer.update(ALL);
  for (const auto& entry : std::filesystem::directory_iterator(store_.directory()))
  {
    const std::string name = entry.path().filename().string();
    if ((name.rfind("view4.", 0) == 0 || name.rfind("view5.", 0) == 0) && entry.path().extension() == ".png")
    {
      writeText(entry.path(), "damaged");
    }
  }
  for (const std::uint64_t scene : { 4, 5 })
  {
    EXPECT_FALSE(recognizer.recognize(seen(recognizer, scene), 1, true).front().verified);
  }
  EXPECT_EQ(recognizer.update(1).unusable, 1U);
  EXPECT_EQ(recognizer.update(1).unusable, 2U);
}

TEST_F(ViewRecognizerTest, KeepsItsIndexWhileTheDirectoryIsGone)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  recognizer.update(ALL);
  const std::filesystem::path aside = directory_.path() / "aside";
  std::filesystem::rename(store_.directory(), aside);
  EXPECT_THROW(recognizer.update(ALL), std::runtime_error);
  EXPECT_EQ(recognizer.size(), VIEWS);
  std::filesystem::rename(aside, store_.directory());
  EXPECT_EQ(recognizer.update(ALL).added, 0U);
}

TEST_F(ViewRecognizerTest, ASavedIndexIsTakenOverAndBroughtInStep)
{
  ViewRecognizer first(storedViews(store_), params());
  EXPECT_NE(first.loadIndex(), "");
  first.update(ALL);
  first.saveIndex();
  store_.remove("view1");
  save("new", 50);
  ViewRecognizer second(storedViews(store_), params());
  EXPECT_EQ(second.loadIndex(), "");
  EXPECT_EQ(second.size(), VIEWS);
  const ViewRecognizer::Update update = second.update(ALL);
  EXPECT_EQ(update.added, 1U);
  EXPECT_EQ(update.removed, 1U);
  EXPECT_EQ(best(second, 2), "view2");
  EXPECT_EQ(best(second, 50), "new");
  EXPECT_EQ(store_.list().names.size(), VIEWS);  // the file is no view
  EXPECT_TRUE(store_.list().damaged.empty());
}

TEST_F(ViewRecognizerTest, AnIndexOfNoViewsIsTakenOver)
{
  const ViewStore empty(directory_.path() / "empty");
  std::filesystem::create_directories(empty.directory());
  ViewRecognizer first(storedViews(empty), params());
  EXPECT_EQ(first.update(ALL).added, 0U);
  first.saveIndex();
  EXPECT_EQ(ViewRecognizer(storedViews(empty), params()).loadIndex(), "");
}

TEST_F(ViewRecognizerTest, ADamagedOrOldIndexIsMadeAnew)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  recognizer.update(ALL);
  recognizer.saveIndex();
  const std::string good = readText(recognizer.indexFile());
  std::string flipped = good;
  flipped[good.size() / 2] ^= 1;
  std::string renamed = good;
  renamed.replace(renamed.find("view3"), 5, "view9");
  for (const std::string& bad : { std::string(), good.substr(0, good.size() / 3), good.substr(0, good.size() - 1),
                                  flipped, renamed, "an older " + good })
  {
    writeText(recognizer.indexFile(), bad);
    ViewRecognizer other(storedViews(store_), params());
    EXPECT_NE(other.loadIndex().find("made anew"), std::string::npos);
    EXPECT_EQ(other.size(), 0U);
    EXPECT_EQ(other.update(ALL).added, VIEWS);
  }
  ViewRecognizerParams more = params();
  more.features.max_features = 700;
  recognizer.saveIndex();
  EXPECT_NE(ViewRecognizer(storedViews(store_), more).loadIndex(), "");
  EXPECT_EQ(ViewRecognizer(storedViews(store_), params()).loadIndex(), "");
}

TEST_F(ViewRecognizerTest, AnIndexThatCannotBeWrittenIsNamed)
{
  ViewRecognizer recognizer(storedViews(store_), params());
  std::filesystem::create_directories(recognizer.indexFile() / "occupied");
  try
  {
    recognizer.saveIndex();
    FAIL() << "saved";
  }
  catch (const std::runtime_error& error)
  {
    EXPECT_NE(std::string(error.what()).find(recognizer.indexFile().string()), std::string::npos);
  }
}

TEST_F(ViewRecognizerTest, FindsImageFiles)
{
  const std::filesystem::path folder = directory_.path() / "images";
  std::filesystem::create_directories(folder);
  cv::imwrite((folder / "one.png").string(), texturedPicture(1));
  cv::imwrite((folder / "two.PGM").string(), texturedPicture(2));
  writeText(folder / "notes.txt", "not an image");
  writeText(folder / "bad.png", "not an image either");
  ViewRecognizer recognizer(imageFiles(folder), params());
  const ViewRecognizer::Update update = recognizer.update(ALL);
  EXPECT_EQ(update.added, 2U);
  ASSERT_EQ(update.unreadable.size(), 1U);
  EXPECT_EQ(best(recognizer, 2), "two.PGM");
  EXPECT_THROW(ViewRecognizer(imageFiles(folder / "none"), params()).update(ALL), std::runtime_error);
}

TEST(ViewRecognizer, RefusesBadParameters)
{
  ViewRecognizerParams params;
  params.candidates = 0;
  params.matching.inlier_threshold = -1.0;
  EXPECT_EQ(params.validate().size(), 2U);
  EXPECT_THROW(ViewRecognizer(imageFiles("."), params), std::invalid_argument);
}

}  // namespace
