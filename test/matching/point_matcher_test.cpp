// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/point_matcher.h"

#include "support/textured_plane.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <vector>

namespace
{
using view_servo::AssignmentMethod;
using view_servo::associatePoints;
using view_servo::Association;
using view_servo::AssociationMatrix;
using view_servo::candidateMatches;
using view_servo::extractPointFeatures;
using view_servo::PointFeatures;
using view_servo::PointMatcherParams;
using view_servo::ProfileIndex;
using view_servo::test::exampleHomography;
using view_servo::test::texturedPicture;

class PointMatcherTest : public ::testing::Test
{
protected:
  PointMatcherTest()
  {
    params_.corners.max_corners = 200;
    params_.profiles.neighbours = 30;
  }

  /** Share of the candidates that lie within 2 px of where the homography sends them. */
  double correct(const cv::Mat& reference, const cv::Mat& current, const Eigen::Matrix3d& h) const
  {
    const PointFeatures from = extractPointFeatures(reference, params_);
    const PointFeatures to = extractPointFeatures(current, params_);
    const AssociationMatrix association = associatePoints(from, ProfileIndex(from.profiles), to, params_);
    const std::vector<Association> candidates = candidateMatches(association, params_.assignment);
    int right = 0;
    for (const Association& candidate : candidates)
    {
      const Eigen::Vector2d predicted =
          (h * from.corners[static_cast<std::size_t>(candidate.row)].position.homogeneous()).hnormalized();
      right += (predicted - to.corners[static_cast<std::size_t>(candidate.column)].position).norm() < 2.0 ? 1 : 0;
    }
    return candidates.empty() ? 0.0 : static_cast<double>(right) / static_cast<double>(candidates.size());
  }

  PointMatcherParams params_;
  cv::Mat picture_ = texturedPicture(1);
  cv::Mat warped_ = view_servo::test::warpedPicture(picture_, exampleHomography(), picture_.size());
};

TEST_F(PointMatcherTest, MatchesAnImageWithItself)
{
  EXPECT_GT(correct(picture_, picture_, Eigen::Matrix3d::Identity()), 0.97);
}

TEST_F(PointMatcherTest, MatchesAPlaneSeenFromAnotherSideUnderAnotherLight)
{
  EXPECT_GT(correct(picture_, view_servo::test::disturbed(warped_, 0.8, 10.0, 2.0), exampleHomography()), 0.45);
}

TEST_F(PointMatcherTest, CyclicOrderFindsMoreThanVotesAlone)
{
  const double with = correct(picture_, warped_, exampleHomography());
  params_.cyclic_order = false;
  EXPECT_GT(with, correct(picture_, warped_, exampleHomography()));
}

TEST_F(PointMatcherTest, MatchesInAllVariants)
{
  for (const auto selection : { view_servo::PairSelection::NEAREST, view_servo::PairSelection::RADIUS })
  {
    for (const auto search : { view_servo::ProfileSearch::NEAREST, view_servo::ProfileSearch::RADIUS })
    {
      for (const auto assignment : { AssignmentMethod::EXACT, AssignmentMethod::GREEDY })
      {
        for (const int coefficients : { 4, 6, 8 })
        {
          for (const bool cyclic : { true, false })
          {
            params_.profiles.selection = selection;
            params_.profiles.max_length = 80.0;
            params_.profiles.coefficients = coefficients;
            params_.search.search = search;
            params_.assignment = assignment;
            params_.cyclic_order = cyclic;
            const double share = correct(picture_, warped_, exampleHomography());
            EXPECT_GT(share, 0.25) << "radius pairs " << (selection == view_servo::PairSelection::RADIUS)
                                   << ", radius search " << (search == view_servo::ProfileSearch::RADIUS) << ", greedy "
                                   << (assignment == AssignmentMethod::GREEDY) << ", N_f " << coefficients
                                   << ", cyclic " << cyclic;
          }
        }
      }
    }
  }
}

TEST_F(PointMatcherTest, TakesNoMoreEntriesThanThereAre)
{
  params_.cyclic_entries = 0;  // all
  const double all = correct(picture_, warped_, exampleHomography());
  params_.cyclic_entries = 2147483647;
  EXPECT_EQ(correct(picture_, warped_, exampleHomography()), all);
}

TEST_F(PointMatcherTest, AVoteWeighsOneOverTheNumberOfSimilarProfiles)
{
  params_.cyclic_order = false;
  const PointFeatures features = extractPointFeatures(picture_, params_);
  const AssociationMatrix association = associatePoints(features, ProfileIndex(features.profiles), features, params_);
  double total = 0.0;
  for (const Association& entry : association.entries())
  {
    total += entry.weight;
  }
  // Each profile gives one vote in all for its start and one for its end.
  EXPECT_NEAR(total, 2.0 * static_cast<double>(features.profiles.pairs.size()), 0.01 * total);
}

TEST_F(PointMatcherTest, AnAlignmentIsAtMostOneForEachProfileOfACorner)
{
  const PointFeatures features = extractPointFeatures(picture_, params_);
  std::vector<int> degree(features.corners.size(), 0);
  for (const auto& pair : features.profiles.pairs)
  {
    ++degree[static_cast<std::size_t>(pair.start)];
    ++degree[static_cast<std::size_t>(pair.end)];
  }
  const AssociationMatrix association = associatePoints(features, ProfileIndex(features.profiles), features, params_);
  for (const Association& entry : association.entries())
  {
    EXPECT_LE(entry.weight, 1e-3 + std::min(degree[static_cast<std::size_t>(entry.row)],
                                            degree[static_cast<std::size_t>(entry.column)]));
  }
}

TEST_F(PointMatcherTest, DoesNotDependOnTheNumberOfThreads)
{
  const PointFeatures from = extractPointFeatures(picture_, params_);
  const PointFeatures to = extractPointFeatures(warped_, params_);
  const ProfileIndex index(from.profiles);
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const AssociationMatrix one = associatePoints(from, index, to, params_);
  cv::setNumThreads(3);
  const AssociationMatrix three = associatePoints(from, index, to, params_);
  cv::setNumThreads(threads);
  ASSERT_EQ(one.entries().size(), three.entries().size());
  for (std::size_t i = 0; i < one.entries().size(); ++i)
  {
    EXPECT_EQ(one.entries()[i].weight, three.entries()[i].weight);
  }
}

TEST_F(PointMatcherTest, OfAnEmptySceneFindsNothing)
{
  const cv::Mat flat(200, 200, CV_8UC1, cv::Scalar(80));
  const PointFeatures none = extractPointFeatures(flat, params_);
  const PointFeatures some = extractPointFeatures(picture_, params_);
  EXPECT_TRUE(associatePoints(none, ProfileIndex(none.profiles), some, params_).entries().empty());
  EXPECT_TRUE(associatePoints(some, ProfileIndex(some.profiles), none, params_).entries().empty());
}

TEST(PointMatcherParams, NameTheFaultsOfAllParts)
{
  EXPECT_TRUE(PointMatcherParams().validate().empty());
  PointMatcherParams params;
  params.corners.max_corners = 6000;
  params.profiles.coefficients = 7;
  params.search.radius = -1.0;
  params.min_correlation = 1.0;
  params.cyclic_entries = -1;
  EXPECT_EQ(params.validate().size(), 5U);
}

}  // namespace
