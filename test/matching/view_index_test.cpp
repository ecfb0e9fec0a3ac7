// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/view_index.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace
{
using view_servo::BinaryFeature;
using view_servo::BinaryWord;
using view_servo::hammingDistance;
using view_servo::ScoredView;
using view_servo::ViewIndex;
using view_servo::ViewIndexParams;
using Features = std::vector<BinaryFeature>;

/** Features that have nothing in common with those of other seeds. */
Features drawFeatures(unsigned seed, std::size_t count = 200)
{
  std::mt19937_64 rng(seed);
  Features features(count);
  for (BinaryFeature& feature : features)
  {
    for (std::uint64_t& part : feature.word)
    {
      part = rng();
    }
    feature.angle = static_cast<std::uint8_t>(rng());
  }
  return features;
}

/** Other images of the same corners: turned, and with some bits changed. */
Features seenAgain(Features features, unsigned seed, int changed_bits, int turn)
{
  std::mt19937_64 rng(seed);
  for (BinaryFeature& feature : features)
  {
    for (int i = 0; i < changed_bits; ++i)
    {
      const std::uint64_t bit = rng() % 256;
      feature.word[bit / 64] ^= std::uint64_t{ 1 } << (bit % 64);
    }
    feature.angle = static_cast<std::uint8_t>(feature.angle + turn);
  }
  return features;
}

std::string nameOf(unsigned number)
{
  return "view" + std::to_string(number);
}

ViewIndex indexOf(unsigned views)
{
  ViewIndex index;
  for (unsigned i = 0; i < views; ++i)
  {
    index.add(nameOf(i), drawFeatures(i));
  }
  return index;
}

void expectSame(const std::vector<ScoredView>& a, const std::vector<ScoredView>& b)
{
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    EXPECT_EQ(a[i].name, b[i].name);
    EXPECT_EQ(a[i].score, b[i].score);
  }
}

std::string saved(const ViewIndex& index)
{
  std::ostringstream stream;
  index.save(stream);
  return stream.str();
}

void load(ViewIndex& index, const std::string& bytes)
{
  std::istringstream stream(bytes);
  index.load(stream);
}

TEST(HammingDistance, CountsTheBitsThatDiffer)
{
  std::mt19937_64 rng(1);
  for (int trial = 0; trial < 100; ++trial)
  {
    BinaryWord a{};
    BinaryWord b{};
    int expected = 0;
    for (int bit = 0; bit < 256; ++bit)
    {
      const std::uint64_t mask = std::uint64_t{ 1 } << (bit % 64);
      a[bit / 64] |= rng() % 2 == 0 ? mask : 0;
      const bool differs = static_cast<int>(rng() % 100) <= trial;  // 100 %: all bits, at the end
      b[bit / 64] |= (a[bit / 64] & mask) ^ (differs ? mask : 0);
      expected += differs ? 1 : 0;
    }
    ASSERT_EQ(hammingDistance(a, b), expected);
  }
  EXPECT_EQ(hammingDistance({}, { ~0ULL, ~0ULL, ~0ULL, ~0ULL }), 256);
}

TEST(ViewIndex, FindsTheViewWhoseCornersAreSeenAgain)
{
  const ViewIndex index = indexOf(60);
  for (unsigned i = 0; i < 60; ++i)
  {
    const std::vector<ScoredView> found = index.query(seenAgain(drawFeatures(i), 1000 + i, 30, 50), 3);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found.front().name, nameOf(i));
  }
}

TEST(ViewIndex, FindsNothingForCornersThatNoViewHas)
{
  EXPECT_TRUE(indexOf(20).query(drawFeatures(99), 10).empty());
  EXPECT_TRUE(indexOf(20).query({}, 10).empty());
  EXPECT_TRUE(ViewIndex().query(drawFeatures(1), 10).empty());
}

TEST(ViewIndex, OrdersViewsByWhatTheyShare)
{
  ViewIndex index = indexOf(10);
  const Features scene = drawFeatures(77);
  for (const std::size_t percent : { 20U, 60U, 40U })
  {
    Features features = drawFeatures(200 + static_cast<unsigned>(percent));
    std::copy_n(scene.begin(), scene.size() * percent / 100, features.begin());
    index.add("shares" + std::to_string(percent), features);
  }
  const std::vector<ScoredView> found = index.query(scene, 10);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].name, "shares60");
  EXPECT_EQ(found[1].name, "shares40");
  EXPECT_EQ(found[2].name, "shares20");
  EXPECT_EQ(index.query(scene, 2).size(), 2U);
}

/** What a query gives for each view when each word is compared with all words, and scores as the header says. */
std::map<std::string, double> scoresByAllWords(const std::map<std::string, Features>& views, const Features& query,
                                               int max_distance)
{
  std::map<std::string, std::array<float, 16>> votes;
  for (const BinaryFeature& feature : query)
  {
    std::map<std::string, const BinaryFeature*> similar;
    for (const auto& [name, features] : views)
    {
      const auto distance = [&](const BinaryFeature& other) {
        return hammingDistance(feature.word, other.word);
      };
      const auto nearest =
          std::min_element(features.begin(), features.end(),
                           [&](const BinaryFeature& a, const BinaryFeature& b) { return distance(a) < distance(b); });
      if (nearest != features.end() && distance(*nearest) <= max_distance)
      {
        similar[name] = &*nearest;
      }
    }
    const double rarity =
        std::log(1.0 + static_cast<double>(views.size()) / (1.0 + static_cast<double>(similar.size())));
    for (const auto& [name, nearest] : similar)
    {
      const double ratio = hammingDistance(feature.word, nearest->word) / (max_distance / 3.0);
      const auto turn = static_cast<std::uint8_t>(nearest->angle - feature.angle);
      votes[name][turn / 16U] += static_cast<float>(rarity * rarity * std::exp(-0.5 * ratio * ratio));
    }
  }
  std::map<std::string, double> scores;
  for (const auto& [name, own] : votes)
  {
    float most = 0.0F;
    for (std::size_t i = 0; i < own.size(); ++i)
    {
      most = std::max(most, own[i] + own[(i + 1) % own.size()] + own[(i + 2) % own.size()]);
    }
    scores[name] = most / std::sqrt(static_cast<double>(views.at(name).size()));
  }
  return scores;
}

TEST(ViewIndex, ScoresAreThoseOfAComparisonWithAllWordsWhenAllAreChecked)
{
  ViewIndexParams params;
  params.checked_words = 1000000;
  params.leaf_words = 8;  // a deep tree
  ViewIndex index(params);
  std::map<std::string, Features> views;
  for (unsigned i = 0; i < 40; ++i)
  {
    Features& features = views[nameOf(i)] = drawFeatures(i, 50 + i);
    // Each view has some words of each of the three before, so that words are in one to four views.
    for (unsigned before = 1; before <= std::min(i, 3U); ++before)
    {
      const Features again = seenAgain(views.at(nameOf(i - before)), i, static_cast<int>(10 * before), 40);
      std::copy_n(again.begin(), 10, features.end() - 10 * before);
    }
    index.add(nameOf(i), features);
  }
  for (const std::size_t count : { 1U, 7U, 8U, 9U, 61U })
  {
    Features query = seenAgain(views.at(nameOf(20)), 99, 15, 100);
    query.resize(count);
    const std::map<std::string, double> expected = scoresByAllWords(views, query, params.max_distance);
    const std::vector<ScoredView> found = index.query(query, 100);
    ASSERT_EQ(found.size(), expected.size()) << count << " features";
    for (const ScoredView& view : found)
    {
      ASSERT_EQ(expected.count(view.name), 1U) << view.name;
      EXPECT_EQ(view.score, expected.at(view.name)) << view.name << " by " << count << " features";
    }
  }
}

TEST(ViewIndex, PrefersAViewOnWhoseTurnTheVotesAgree)
{
  ViewIndex index = indexOf(5);
  const Features scene = drawFeatures(77);
  Features scattered = scene;
  std::mt19937 rng(5);
  for (BinaryFeature& feature : scattered)
  {
    feature.angle = static_cast<std::uint8_t>(rng());
  }
  index.add("a_scattered", scattered);
  index.add("b_turned", seenAgain(scene, 1, 0, 200));
  const std::vector<ScoredView> found = index.query(scene, 2);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].name, "b_turned");
  EXPECT_GT(found[0].score, 3.0 * found[1].score);
}

TEST(ViewIndex, ARemovedViewIsNotFoundAndOthersAreAsBefore)
{
  ViewIndex index = indexOf(30);
  EXPECT_FALSE(index.remove("nobody"));
  EXPECT_TRUE(index.remove(nameOf(7)));
  EXPECT_FALSE(index.remove(nameOf(7)));
  EXPECT_FALSE(index.contains(nameOf(7)));
  EXPECT_EQ(index.size(), 29U);
  EXPECT_TRUE(index.query(drawFeatures(7), 3).empty());
  EXPECT_EQ(index.query(drawFeatures(8), 3).front().name, nameOf(8));
  index.add("new", drawFeatures(500));  // takes the free place
  EXPECT_TRUE(index.query(drawFeatures(7), 3).empty());
  EXPECT_EQ(index.query(drawFeatures(500), 3).front().name, "new");
}

TEST(ViewIndex, AViewAddedAgainIsReplaced)
{
  ViewIndex index = indexOf(10);
  index.add(nameOf(3), drawFeatures(300));
  EXPECT_EQ(index.size(), 10U);
  EXPECT_TRUE(index.query(drawFeatures(3), 3).empty());
  EXPECT_EQ(index.query(drawFeatures(300), 3).front().name, nameOf(3));
}

TEST(ViewIndex, AViewWithoutFeaturesDoesNoHarm)
{
  ViewIndex index = indexOf(3);
  index.add("black", {});
  EXPECT_TRUE(index.contains("black"));
  EXPECT_EQ(index.query(drawFeatures(1), 5).size(), 1U);
}

TEST(ViewIndex, EqualScoresAreOrderedByName)
{
  ViewIndex index;
  for (const char* name : { "c", "a", "b" })
  {
    index.add(name, drawFeatures(1));
  }
  const std::vector<ScoredView> found = index.query(drawFeatures(1), 3);
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].name + found[1].name + found[2].name, "abc");
}

TEST(ViewIndex, ManyEqualWordsNeedNoDivision)
{
  ViewIndex index;
  const Features one(3000, drawFeatures(1).front());
  index.add("wall", one);
  index.add("other", drawFeatures(2));
  EXPECT_EQ(index.query({ one.front() }, 2).front().name, "wall");
  EXPECT_EQ(index.query(drawFeatures(2), 2).front().name, "other");
}

TEST(ViewIndex, TheSameCallsGiveTheSame)
{
  const Features scene = seenAgain(drawFeatures(5), 1, 40, 3);
  EXPECT_EQ(saved(indexOf(40)), saved(indexOf(40)));
  expectSame(indexOf(40).query(scene, 40), indexOf(40).query(scene, 40));
}

TEST(ViewIndex, TakesAtMost30KilobytesAView)
{
  ViewIndex index;
  for (unsigned i = 0; i < 200; ++i)
  {
    index.add(nameOf(i), drawFeatures(i, 500));
  }
  EXPECT_LT(static_cast<double>(index.memory()), 30e3 * 200);
}

TEST(ViewIndex, IsReadAsItWasSaved)
{
  ViewIndex index = indexOf(40);
  index.remove(nameOf(4));
  ViewIndex again;
  load(again, saved(index));
  EXPECT_EQ(again.names(), index.names());
  const Features scene = seenAgain(drawFeatures(5), 1, 40, 3);
  expectSame(again.query(scene, 40), index.query(scene, 40));
  index.add("late", drawFeatures(50));
  again.add("late", drawFeatures(50));
  EXPECT_EQ(saved(again), saved(index));
}

TEST(ViewIndex, RefusesADamagedFileAndKeepsWhatItHolds)
{
  const std::string good = saved(indexOf(10));
  ViewIndex index;
  index.add("kept", drawFeatures(100));
  const auto expectRefused = [&](const std::string& bytes, const std::string& what) {
    EXPECT_THROW(load(index, bytes), std::runtime_error) << what;
    EXPECT_EQ(index.names(), std::vector<std::string>{ "kept" }) << what;
  };
  std::mt19937 rng(1);
  for (int trial = 0; trial < 300; ++trial)
  {
    // Half of the trials damage the beginning, where numbers of things are.
    const std::size_t at = rng() % (trial % 2 == 0 ? good.size() : 400);
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ (1 << (rng() % 8)));
    expectRefused(bad, "byte " + std::to_string(at));
    expectRefused(good.substr(0, at), "ends at " + std::to_string(at));
  }
  ViewIndexParams other;
  other.branches = 8;
  expectRefused(saved(ViewIndex(other)), "other parameters");
  EXPECT_EQ(index.query(drawFeatures(100), 1).front().name, "kept");
}

TEST(ViewIndex, RefusesBadParameters)
{
  ViewIndexParams params;
  params.branches = 1;
  params.max_distance = 0;
  try
  {
    ViewIndex index(params);
    FAIL() << "accepted";
  }
  catch (const std::invalid_argument& error)
  {
    EXPECT_NE(std::string(error.what()).find("branches"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("max_distance"), std::string::npos);
  }
}

}  // namespace
