// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/hypothesis_experiments.h"

#include "rendered_pairs.h"
#include "support/csv_table.h"
#include "support/temporary_directory.h"

#include <gtest/gtest.h>

#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
using test::number;
using test::readTable;
using test::Row;

const Row& rowOf(const std::vector<Row>& rows, const std::string& algorithm, double sigma)
{
  for (const Row& row : rows)
  {
    if (row.at("algorithm") == algorithm && number(row, "sigma") == sigma)
    {
      return row;
    }
  }
  throw std::runtime_error("no row of " + algorithm);
}

}  // namespace

TEST(MultiHypothesisExperiment, TellsTheAlgorithmsApartAsTheThesisDoes)
{
  ExperimentContext context;
  context.brief = true;
  std::ostringstream csv;
  runMultiHypothesisExperiment(context, csv);
  const std::vector<Row> rows = readTable(csv.str());
  for (const double sigma : { 0.25, 0.31 })
  {
    const double modified = number(rowOf(rows, "modified", sigma), "correct");
    const double one_candidate = number(rowOf(rows, "ransac", sigma), "correct");
    EXPECT_GE(modified, (sigma > 0.3 ? 1.35 : 0.99) * one_candidate) << sigma;
    EXPECT_LT(number(rowOf(rows, "modified", sigma), "wrong"), 10.0) << sigma;
    // 2000 iterations are far too few for importance sampling.
    EXPECT_LT(number(rowOf(rows, "importance", sigma), "correct"), 0.6 * one_candidate) << sigma;
    for (const Row& row : rows)
    {
      EXPECT_LE(number(row, "correct"), 500.0);
      EXPECT_GT(number(row, "ms"), 0.0);
    }
  }
  // Table 9.1: 16 and 314 entries over 1, 11375 and 26691 over 0.5.
  EXPECT_NEAR(number(rowOf(rows, "modified", 0.25), "entries_over_1"), 16.0, 8.0);
  EXPECT_NEAR(number(rowOf(rows, "modified", 0.31), "entries_over_1"), 314.0, 40.0);
  EXPECT_NEAR(number(rowOf(rows, "modified", 0.25), "entries_over_half"), 11375.0, 300.0);
  EXPECT_NEAR(number(rowOf(rows, "modified", 0.31), "entries_over_half"), 26691.0, 400.0);
}

TEST(RealPairsExperiment, FindsTheGeometryOfRenderedPairs)
{
  const test::TemporaryDirectory folder;
  test::writeKusvodPair(folder.path() / "kusvod2", "booksh", test::renderedCylinder());

  ExperimentContext context;
  context.data = folder.path();
  context.brief = true;
  std::ostringstream csv;
  runRealPairsExperiment(context, csv);
  const std::vector<Row> rows = readTable(csv.str());
  ASSERT_GE(rows.size(), 4U);
  double one_candidate = 0.0;
  double several = 0.0;
  for (const Row& row : rows)
  {
    EXPECT_EQ(row.at("pair"), "kusvod2/booksh");
    EXPECT_EQ(row.at("model"), "F");
    EXPECT_LE(number(row, "correct"), number(row, "matches"));
    if (row.at("algorithm") != "importance")
    {
      EXPECT_LT(number(row, "error_px"), 3.0) << row.at("algorithm");
    }
    one_candidate = row.at("algorithm") == "ransac" ? number(row, "correct") : one_candidate;
    several = row.at("algorithm") == "weighted" ? number(row, "correct") : several;
  }
  EXPECT_GT(one_candidate, 100.0);
  EXPECT_GE(several, one_candidate);
}

}  // namespace view_servo
