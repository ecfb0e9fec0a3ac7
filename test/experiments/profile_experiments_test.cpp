// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/profile_experiments.h"

#include "experiments/cyclic_order_experiment.h"
#include "experiments/point_pairs.h"
#include "rendered_pairs.h"
#include "support/csv_table.h"
#include "support/temporary_directory.h"
#include "view_servo/geometry/homography.h"

#include <gtest/gtest.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <cmath>
#include <fstream>
#include <functional>
#include <iomanip>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
using test::number;
using test::readTable;
using test::renderedCylinder;
using test::renderedPlane;
using test::Row;
using test::sum;

/** Brightness around a point, of an image that was blurred. */
double brightness(const cv::Mat& image, const Eigen::Vector2d& point)
{
  cv::Mat patch;
  cv::getRectSubPix(image, cv::Size(1, 1), cv::Point2f(static_cast<float>(point.x()), static_cast<float>(point.y())),
                    patch);
  return patch.at<unsigned char>(0, 0);
}

double correlation(const PointPair& pair, const Correspondences& points)
{
  constexpr double BLUR = 2.0;
  cv::Mat reference;
  cv::Mat current;
  cv::GaussianBlur(pair.reference, reference, cv::Size(), BLUR);
  cv::GaussianBlur(pair.current, current, cv::Size(), BLUR);
  cv::Mat values(2, static_cast<int>(points.size()), CV_64F);
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    values.at<double>(0, static_cast<int>(i)) = brightness(reference, points[i].reference);
    values.at<double>(1, static_cast<int>(i)) = brightness(current, points[i].current);
  }
  cv::Mat covariance;
  cv::Mat mean;
  cv::calcCovarMatrix(values, covariance, mean, cv::COVAR_NORMAL | cv::COVAR_COLS);
  return covariance.at<double>(0, 1) / std::sqrt(covariance.at<double>(0, 0) * covariance.at<double>(1, 1));
}

TEST(PointPairs, TheTruthOfARenderedPlaneIsWhatTheImagesShow)
{
  const PointPair pair = renderedPlane();
  const auto h = homographyFromPoints(pair.points);
  ASSERT_TRUE(h);
  Correspondences grid;
  for (double v = 30.0; v < 560.0; v += 20.0)
  {
    for (double u = 30.0; u < 750.0; u += 20.0)
    {
      const Eigen::Vector2d seen = transfer(*h, { u, v });
      if (seen.x() > 5.0 && seen.x() < 760.0 && seen.y() > 5.0 && seen.y() < 570.0)
      {
        grid.push_back({ { u, v }, seen });
        EXPECT_LT(pair.error(grid.back()), 1e-6);
        EXPECT_FALSE(pair.isCorrect({ { u, v }, seen + Eigen::Vector2d(5.0, 0.0) }));
      }
    }
  }
  EXPECT_GT(grid.size(), 500U);
  EXPECT_GT(correlation(pair, grid), 0.9);
  EXPECT_LT(pair.geometryError(GeometryModel::HOMOGRAPHY, *h), 1e-6);
}

TEST(PointPairs, TheTruthOfARenderedCylinderIsWhatTheImagesShow)
{
  const PointPair pair = renderedCylinder();
  EXPECT_GT(pair.points.size(), 100U);
  EXPECT_GT(correlation(pair, pair.points), 0.9);
  EXPECT_EQ(pair.countCorrect(pair.points), static_cast<int>(pair.points.size()));
  // Beside it, there is nothing to match.
  EXPECT_FALSE(pair.isCorrect({ { 3.0, 300.0 }, { 3.0, 300.0 } }));
}

TEST(PointPairs, MissingDataAreNamed)
{
  const test::TemporaryDirectory folder;
  EXPECT_THROW(readOxfordPair(folder.path(), "graf", 3), std::runtime_error);
  EXPECT_THROW(readKusvodPair(folder.path(), "wash"), std::runtime_error);
  EXPECT_THROW(readMertonPoints(folder.path(), 1, 2), std::runtime_error);
}

/** A folder laid out like the real data, with rendered views in it. */
class ProfileExperimentsTest : public ::testing::Test
{
protected:
  void SetUp() override
  {
    const std::filesystem::path oxford = folder_.path() / "oxford_affine" / "graf";
    std::filesystem::create_directories(oxford);
    const PointPair plane = renderedPlane();
    cv::imwrite((oxford / "img1.png").string(), plane.reference);
    cv::imwrite((oxford / "img3.png").string(), plane.current);
    const auto h = homographyFromPoints(plane.points);
    ASSERT_TRUE(h);
    std::ofstream(oxford / "H1to3p") << std::setprecision(17) << -*h;  // as some files have it
    const PointPair cylinder = renderedCylinder();
    for (const std::string name : { "booksh", "wash" })
    {
      test::writeKusvodPair(folder_.path() / "kusvod2", name, cylinder);
    }
    context_.data = folder_.path();
    context_.brief = true;
  }

  test::TemporaryDirectory folder_;
  ExperimentContext context_;
};

TEST_F(ProfileExperimentsTest, MoreFeaturesFindMore)
{
  std::ostringstream csv;
  runProfileParametersExperiment(context_, csv);
  const std::vector<Row> rows = readTable(csv.str());
  // Figures 6.8 and 6.9 with two values and two searches, 6.10 with three N_f and two values of two searches.
  ASSERT_EQ(rows.size(), 2U * (2 * 2 * 2 + 3 * 4));
  for (const Row& row : rows)
  {
    EXPECT_LE(number(row, "correct_matches"), number(row, "matches"));
    EXPECT_LE(number(row, "matches"), number(row, "candidates"));
    EXPECT_EQ(row.at("pair") == "wash", !std::isnan(number(row, "error_px")));
  }
  const auto correct = [&](const std::string& coefficients, const std::string& search, const std::string& value) {
    return sum(rows, "correct_matches", [&](const Row& row) {
      return row.at("figure") == "6.10" && row.at("coefficients") == coefficients && row.at("search") == search &&
             row.at("search_value") == value;
    });
  };
  // What the thesis concludes: more features are better, and the nearest better than a radius that does not suit.
  EXPECT_GT(correct("8", "Kv", "50"), correct("4", "Kv", "50"));
  EXPECT_GT(correct("8", "Kv", "50"), 1.3 * correct("8", "Dv", "0.1"));
  EXPECT_GT(correct("8", "Kv", "50"), 100.0);
}

TEST_F(ProfileExperimentsTest, ViewConsistencyKeepsMoreThatIsCorrect)
{
  std::ostringstream csv;
  runViewConsistencyExperiment(context_, csv);
  const std::vector<Row> rows = readTable(csv.str());
  ASSERT_EQ(rows.size(), 2U);
  for (const Row& row : rows)
  {
    EXPECT_LE(number(row, "kept"), number(row, "candidates"));
    // The constraint keeps a larger share of correct candidates, and costs RANSAC next to none.
    EXPECT_GT(number(row, "kept_correct") / number(row, "kept"),
              number(row, "correct_candidates") / number(row, "candidates"));
    EXPECT_GT(number(row, "samples_solved"), 0.0);
    EXPECT_GT(number(row, "samples_refused"), number(row, "samples_solved"));
    EXPECT_GT(number(row, "within_correct"), 0.9 * number(row, "same_correct"));
    EXPECT_GT(number(row, "within_correct"), 100.0);
    EXPECT_GT(number(row, "factor"), 0.0);
  }
}

TEST(CyclicOrder, IsBetterThanPlainVotes)
{
  ExperimentContext context;
  context.brief = true;
  std::ostringstream csv;
  runCyclicOrderExperiment(context, csv);
  const std::vector<Row> rows = readTable(csv.str());
  ASSERT_EQ(rows.size(), 16U);  // two pictures on two surfaces at two angles, by two orders
  const auto total = [&](const std::string& column, const std::string& series, const std::string& order) {
    return sum(rows, column, [&](const Row& row) { return row.at("series") == series && row.at("order") == order; });
  };
  for (const std::string series : { "plane", "cylinder" })
  {
    EXPECT_GT(total("correct_candidates", series, "cyclic"), total("correct_candidates", series, "plain")) << series;
    EXPECT_GT(total("correct_matches", series, "cyclic"), total("correct_matches", series, "plain")) << series;
    EXPECT_GE(total("solved", series, "cyclic"), total("solved", series, "plain")) << series;
    EXPECT_GE(total("solved", series, "cyclic"), 3.0) << series;
  }
  for (const Row& row : rows)
  {
    if (row.at("solved") == "1")
    {
      EXPECT_GT(number(row, "correct_matches"), 0.8 * number(row, "matches"));
    }
  }
}

}  // namespace
}  // namespace view_servo
