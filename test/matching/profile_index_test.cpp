// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/profile_index.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <utility>
#include <vector>

namespace
{
using view_servo::ProfileIndex;
using view_servo::ProfileMatch;
using view_servo::ProfileSearch;
using view_servo::ProfileSearchParams;
using view_servo::ProfileSet;
using view_servo::reversalSign;

ProfileSet randomProfiles(int count, int coefficients, std::uint64_t seed)
{
  cv::RNG rng(seed);
  ProfileSet set;
  set.coefficients = coefficients;
  for (int i = 0; i < count; ++i)
  {
    set.pairs.push_back({ i, i + 1 });
    for (int c = 0; c < coefficients; ++c)
    {
      set.features.push_back(static_cast<float>(rng.gaussian(1.0)));
    }
  }
  return set;
}

float squaredDistance(const ProfileSet& reference, std::size_t r, bool reversed, const ProfileSet& current,
                      std::size_t c)
{
  float sum = 0.0F;
  for (int k = 0; k < reference.coefficients; ++k)
  {
    const float value = reference.feature(r)[k] * (reversed ? reversalSign(k) : 1.0F);
    sum += (value - current.feature(c)[k]) * (value - current.feature(c)[k]);
  }
  return sum;
}

/** All reference profiles in both directions, nearest first. */
std::vector<std::pair<float, std::pair<int, bool>>> allByDistance(const ProfileSet& reference,
                                                                  const ProfileSet& current, std::size_t c)
{
  std::vector<std::pair<float, std::pair<int, bool>>> all;
  for (std::size_t r = 0; r < reference.pairs.size(); ++r)
  {
    for (const bool reversed : { false, true })
    {
      all.push_back({ squaredDistance(reference, r, reversed, current, c), { static_cast<int>(r), reversed } });
    }
  }
  std::sort(all.begin(), all.end());
  return all;
}

TEST(ProfileIndex, FindsAlmostAllNearestWhenExact)
{
  // Profiles that are nearly symmetric are kept in both directions only up to a margin, so a few may be missed.
  for (const int coefficients : { 4, 6, 8 })
  {
    const ProfileSet reference = randomProfiles(800, coefficients, 1);
    const ProfileSet current = randomProfiles(60, coefficients, 2);
    ProfileSearchParams params;
    params.neighbours = 5;
    params.epsilon = 0.0;
    const auto found = ProfileIndex(reference).search(current, params);
    ASSERT_EQ(found.size(), 60U);
    int agreeing = 0;
    for (std::size_t c = 0; c < found.size(); ++c)
    {
      ASSERT_EQ(found[c].size(), 5U);
      const auto all = allByDistance(reference, current, c);
      for (std::size_t k = 0; k < 5; ++k)
      {
        for (const ProfileMatch& match : found[c])
        {
          agreeing += match.reference == all[k].second.first && match.reversed == all[k].second.second ? 1 : 0;
        }
      }
    }
    EXPECT_GT(agreeing, 60 * 5 * 85 / 100) << coefficients << " coefficients";
  }
}

TEST(ProfileIndex, FindsAProfileAgainInEitherDirection)
{
  const ProfileSet reference = randomProfiles(500, 8, 3);
  ProfileSet current = reference;
  for (std::size_t i = 0; i < current.features.size(); i += 2 * 8)  // every other one is read backwards
  {
    for (int c = 0; c < 8; ++c)
    {
      current.features[i + static_cast<std::size_t>(c)] *= reversalSign(c);
    }
  }
  ProfileSearchParams params;
  params.neighbours = 1;
  const auto found = ProfileIndex(reference).search(current, params);
  for (std::size_t i = 0; i < found.size(); ++i)
  {
    ASSERT_EQ(found[i].size(), 1U);
    EXPECT_EQ(found[i][0].reference, static_cast<int>(i));
    EXPECT_EQ(found[i][0].reversed, i % 2 == 0);
  }
}

TEST(ProfileIndex, FindsOnlyWhatLiesWithinTheRadius)
{
  const ProfileSet reference = randomProfiles(2000, 4, 4);
  const ProfileSet current = randomProfiles(50, 4, 5);
  ProfileSearchParams params;
  params.search = ProfileSearch::RADIUS;
  params.radius = 0.5;
  const auto found = ProfileIndex(reference).search(current, params);
  std::size_t total = 0;
  std::size_t expected = 0;
  for (std::size_t c = 0; c < found.size(); ++c)
  {
    total += found[c].size();
    for (const ProfileMatch& match : found[c])
    {
      EXPECT_LE(squaredDistance(reference, static_cast<std::size_t>(match.reference), match.reversed, current, c),
                0.25F);
    }
    for (const auto& candidate : allByDistance(reference, current, c))
    {
      expected += candidate.first <= 0.25F ? 1 : 0;
    }
  }
  EXPECT_EQ(total, expected);  // the radius is not above the margin within which both directions are kept
}

TEST(ProfileIndex, FindsOnlyTheNearestThousandOfARepeatedPattern)
{
  ProfileSet reference = randomProfiles(3000, 4, 4);
  for (float& feature : reference.features)
  {
    feature *= 0.01F;
  }
  ProfileSearchParams params;
  params.search = ProfileSearch::RADIUS;
  params.radius = 0.5;
  const auto found = ProfileIndex(reference).search(reference, params);
  for (std::size_t c = 0; c < found.size(); ++c)
  {
    ASSERT_EQ(found[c].size(), 1000U);
    EXPECT_EQ(found[c][0].reference, static_cast<int>(c));
  }
}

TEST(ProfileIndex, FindsInALeafWhatIsMuchNearerThanOthers)
{
  const ProfileSet reference = randomProfiles(2000, 8, 11);
  ProfileSet current = reference;
  cv::RNG rng(12);
  for (float& value : current.features)
  {
    value += static_cast<float>(rng.gaussian(0.02));
  }
  ProfileSearchParams params;
  params.search = ProfileSearch::LEAF;
  const auto found = ProfileIndex(reference).search(current, params);
  int again = 0;
  for (std::size_t c = 0; c < found.size(); ++c)
  {
    EXPECT_LE(found[c].size(), 12U);
    again += std::any_of(found[c].begin(), found[c].end(), [&](const ProfileMatch& match) {
      return match.reference == static_cast<int>(c) && !match.reversed;
    });
  }
  EXPECT_GT(again, 1800);
}

TEST(ProfileIndex, SearchesForTheShareWithTheLargestFeatures)
{
  const ProfileSet reference = randomProfiles(300, 8, 9);
  const ProfileSet current = randomProfiles(100, 8, 10);
  ProfileSearchParams params;
  params.share = 0.3;
  const auto found = ProfileIndex(reference).search(current, params);
  double smallest_searched = 1e9;
  double largest_left_out = 0.0;
  int searched = 0;
  for (std::size_t i = 0; i < found.size(); ++i)
  {
    double norm = 0.0;
    for (int c = 0; c < 8; ++c)
    {
      norm += std::pow(static_cast<double>(current.feature(i)[c]), 2);
    }
    searched += found[i].empty() ? 0 : 1;
    (found[i].empty() ? largest_left_out : smallest_searched) =
        found[i].empty() ? std::max(largest_left_out, norm) : std::min(smallest_searched, norm);
  }
  EXPECT_EQ(searched, 30);
  EXPECT_GE(smallest_searched, largest_left_out);
}

TEST(ProfileIndex, DoesNotDependOnTheNumberOfThreads)
{
  const ProfileSet reference = randomProfiles(1000, 8, 6);
  const ProfileSet current = randomProfiles(200, 8, 7);
  const ProfileIndex index(reference);
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const auto one = index.search(current, ProfileSearchParams());
  cv::setNumThreads(3);
  const auto three = index.search(current, ProfileSearchParams());
  cv::setNumThreads(threads);
  for (std::size_t i = 0; i < one.size(); ++i)
  {
    ASSERT_EQ(one[i].size(), three[i].size());
    for (std::size_t k = 0; k < one[i].size(); ++k)
    {
      EXPECT_EQ(one[i][k].reference, three[i][k].reference);
      EXPECT_EQ(one[i][k].reversed, three[i][k].reversed);
    }
  }
}

TEST(ProfileIndex, OfFewOrNoProfilesFindsWhatThereIs)
{
  ProfileSet none;
  none.coefficients = 8;
  const ProfileSet three = randomProfiles(3, 8, 8);
  EXPECT_TRUE(ProfileIndex(none).search(three, ProfileSearchParams())[0].empty());
  EXPECT_TRUE(ProfileIndex(three).search(none, ProfileSearchParams()).empty());
  const auto found = ProfileIndex(three).search(three, ProfileSearchParams());
  for (std::size_t i = 0; i < found.size(); ++i)
  {
    EXPECT_GE(found[i].size(), 3U);
    EXPECT_LE(found[i].size(), 6U);
  }
}

TEST(ProfileIndex, RefusesDifferentNumbersOfFeatures)
{
  EXPECT_THROW(ProfileIndex(randomProfiles(10, 8, 1)).search(randomProfiles(10, 6, 1), ProfileSearchParams()),
               std::invalid_argument);
  EXPECT_THROW(ProfileIndex(randomProfiles(10, 5, 1)), std::invalid_argument);
}

TEST(ProfileSearchParams, NameEveryFault)
{
  EXPECT_TRUE(ProfileSearchParams().validate().empty());
  ProfileSearchParams params;
  params.neighbours = 0;
  params.radius = 0.0;
  params.epsilon = -1.0;
  params.share = 0.0;
  EXPECT_EQ(params.validate().size(), 4U);
}

}  // namespace
