// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/hand_eye_experiments.h"

#include "support/csv_table.h"

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
TEST(HandEyeExperiments, FindTheCameraOfTheSimulatedArm)
{
  ExperimentContext context;
  context.brief = true;
  std::ostringstream csv;
  runHandEyeExperiment(context, csv);
  const std::vector<test::Row> rows = test::readTable(csv.str());
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_NE(rows[0].at("world"), rows[1].at("world"));
  for (const test::Row& row : rows)
  {
    const std::string& world = row.at("world");
    EXPECT_EQ(row.at("found"), "1") << world;
    EXPECT_EQ(row.at("poses"), "12") << world;
    EXPECT_GE(test::number(row, "used"), 10.0) << world;
    EXPECT_LT(test::number(row, "translation_error_mm"), 0.5) << world;
    EXPECT_LT(test::number(row, "rotation_error_deg"), 0.1) << world;
    EXPECT_GT(test::number(row, "translation_sigma_mm"), 0.01) << world;
  }
}

}  // namespace view_servo
