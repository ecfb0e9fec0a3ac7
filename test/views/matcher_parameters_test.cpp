// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/parameter.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/scene_matcher.h"
#include "view_servo/views/view_recognizer.h"

#include <gtest/gtest.h>

#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace
{
using view_servo::LineMatcherParams;
using view_servo::Parameter;
using view_servo::PointViewMatcherParams;
using view_servo::SceneMatcherParams;
using view_servo::setParameter;
using view_servo::ViewRecognizerParams;

template <typename Params>
class MatcherParametersTest : public ::testing::Test
{
};

using Matchers = ::testing::Types<PointViewMatcherParams, LineMatcherParams, SceneMatcherParams, ViewRecognizerParams>;
TYPED_TEST_SUITE(MatcherParametersTest, Matchers, );

TYPED_TEST(MatcherParametersTest, HaveUniqueDocumentedNames)
{
  TypeParam params;
  std::set<std::string> names;
  for (const Parameter& parameter : parameters(params))
  {
    EXPECT_TRUE(names.insert(parameter.name).second) << parameter.name;
    EXPECT_FALSE(parameter.description.empty()) << parameter.name;
    EXPECT_FALSE(parameter.type.empty()) << parameter.name;
  }
  EXPECT_GT(names.size(), 30U);
}

TYPED_TEST(MatcherParametersTest, ReadBackWhatTheyPrint)
{
  TypeParam params;
  for (const Parameter& parameter : parameters(params))
  {
    const std::string before = parameter.get();
    EXPECT_TRUE(parameter.set(before)) << parameter.name << " = " << before;
    EXPECT_EQ(parameter.get(), before) << parameter.name;
  }
}

TYPED_TEST(MatcherParametersTest, EachSetsSomethingOfItsOwn)
{
  // Another value for each changes what its name reads, and nothing else.
  TypeParam params;
  const auto table = parameters(params);
  for (const Parameter& parameter : table)
  {
    const std::string before = parameter.get();
    std::string other;
    if (parameter.type == "int" || parameter.type == "double")
    {
      other = before == "3" ? "4" : "3";
    }
    else if (parameter.type == "bool")
    {
      other = before == "true" ? "false" : "true";
    }
    else
    {
      const std::string first = parameter.type.substr(0, parameter.type.find('|'));
      const std::string last = parameter.type.substr(parameter.type.rfind('|') + 1);
      other = before == first ? last : first;
    }
    std::vector<std::string> others;
    for (const Parameter& beside : table)
    {
      others.push_back(beside.get());
    }
    ASSERT_TRUE(parameter.set(other)) << parameter.name;
    EXPECT_EQ(parameter.get(), other);
    for (std::size_t i = 0; i < table.size(); ++i)
    {
      EXPECT_TRUE(table[i].name == parameter.name || table[i].get() == others[i])
          << parameter.name << " changed " << table[i].name;
    }
    parameter.set(before);
  }
}

TEST(SetParameter, SetsNumbersWordsAndSwitches)
{
  PointViewMatcherParams params;
  setParameter(parameters(params), "max_corners", "321");
  setParameter(parameters(params), "inlier_threshold", "2.5");
  setParameter(parameters(params), "cyclic_order", "false");
  setParameter(parameters(params), "search", "radius");
  setParameter(parameters(params), "seed", "12345678901");
  EXPECT_EQ(params.points.corners.max_corners, 321);
  EXPECT_EQ(params.ransac.inlier_threshold, 2.5);
  EXPECT_FALSE(params.points.cyclic_order);
  EXPECT_EQ(params.points.search.search, view_servo::ProfileSearch::RADIUS);
  EXPECT_EQ(params.seed, 12345678901U);
}

TEST(SetParameter, SetsThoseOfLines)
{
  LineMatcherParams params;
  setParameter(parameters(params), "detector", "lsd");
  setParameter(parameters(params), "line_order", "upright");
  setParameter(parameters(params), "segment_min_length", "20.5");
  setParameter(parameters(params), "region_tolerance", "1.5");
  setParameter(parameters(params), "inlier_threshold", "2.5");
  EXPECT_EQ(params.segments.detector, view_servo::SegmentDetector::LSD);
  EXPECT_EQ(params.features.groups.order, view_servo::LineOrder::UPRIGHT);
  EXPECT_EQ(params.segments.min_length, 20.5);
  EXPECT_EQ(params.regions.tolerance, 1.5);
  EXPECT_EQ(params.ransac.inlier_threshold, 2.5);
  EXPECT_THROW(setParameter(parameters(params), "detector", "hough"), std::invalid_argument);
  EXPECT_THROW(setParameter(parameters(params), "max_corners", "100"), std::invalid_argument)
      << "a parameter of points";
}

TEST(MatcherParameterFaults, SayTheNamesOfLineParameters)
{
  for (const auto& [name, value] : std::vector<std::pair<std::string, std::string>>{ { "edge_sigma", "0.1" },
                                                                                     { "edge_low_threshold", "0" },
                                                                                     { "edge_high_threshold", "1" },
                                                                                     { "segment_deviation", "-1" },
                                                                                     { "segment_max_deviation", "0.1" },
                                                                                     { "segment_significance", "-1" },
                                                                                     { "segment_min_length", "0" },
                                                                                     { "max_segments", "0" },
                                                                                     { "group_distance", "0" },
                                                                                     { "group_collinearity", "-1" },
                                                                                     { "group_min_angle_deg", "90" },
                                                                                     { "group_neighbours", "-1" },
                                                                                     { "group_min_weight", "1" },
                                                                                     { "max_grouped", "5001" },
                                                                                     { "neighbours", "5" },
                                                                                     { "neighbour_pairs", "1" },
                                                                                     { "max_candidates", "0" },
                                                                                     { "max_trials", "0" },
                                                                                     { "max_companions", "1" },
                                                                                     { "max_hypotheses", "0" },
                                                                                     { "affine_tolerance", "0" },
                                                                                     { "region_tolerance", "0" },
                                                                                     { "region_max_angle_deg", "45" },
                                                                                     { "region_min_support", "0" },
                                                                                     { "min_correlation", "1" },
                                                                                     { "min_mean_correlation", "-2" },
                                                                                     { "inlier_threshold", "0" },
                                                                                     { "plane_threshold", "0" },
                                                                                     { "min_plane_lines", "4" },
                                                                                     { "max_planes", "0" },
                                                                                     { "min_quality", "1" } })
  {
    LineMatcherParams params;
    setParameter(parameters(params), name, value);
    const std::vector<std::string> faults = params.validate();
    ASSERT_EQ(faults.size(), 1U) << name;
    EXPECT_EQ(faults.front().rfind(name + " ", 0), 0U) << name << ": " << faults.front();
  }
}

TEST(SetParameter, NamesTheNearestWhenAskedForOneThatIsNot)
{
  PointViewMatcherParams params;
  try
  {
    setParameter(parameters(params), "max_corner", "10");
    FAIL() << "an unknown name was accepted";
  }
  catch (const std::invalid_argument& error)
  {
    EXPECT_NE(std::string(error.what()).find("'max_corner'"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("'max_corners'"), std::string::npos);
  }
}

TEST(SetParameter, RefusesValuesOfTheWrongTypeAndLeavesAllAsItWas)
{
  PointViewMatcherParams params;
  for (const auto& [name, value] :
       std::vector<std::pair<std::string, std::string>>{ { "max_corners", "many" },
                                                         { "max_corners", "3.5" },
                                                         { "max_corners", "" },
                                                         { "max_corners", "99999999999999999999" },
                                                         { "inlier_threshold", "nan" },
                                                         { "inlier_threshold", "2,5" },
                                                         { "cyclic_order", "yes" },
                                                         { "search", "both" },
                                                         { "seed", "-1" } })
  {
    EXPECT_THROW(setParameter(parameters(params), name, value), std::invalid_argument)
        << name << " = '" << value << "'";
  }
  PointViewMatcherParams fresh;
  const auto now = parameters(params);
  const auto then = parameters(fresh);
  for (std::size_t i = 0; i < now.size(); ++i)
  {
    EXPECT_EQ(now[i].get(), then[i].get());
  }
}

}  // namespace
