// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
/** A line of a table by the names of its columns. */
using Row = std::map<std::string, std::string>;

inline std::vector<std::string> fields(const std::string& line)
{
  std::vector<std::string> result;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');)
  {
    result.push_back(field);
  }
  return result;
}

/** The rows of a table; a row with another number of fields than the header has fails the test. */
inline std::vector<Row> readTable(const std::string& csv)
{
  std::istringstream stream(csv);
  std::string line;
  std::getline(stream, line);
  const std::vector<std::string> names = fields(line);
  std::vector<Row> rows;
  while (std::getline(stream, line))
  {
    const std::vector<std::string> values = fields(line);
    EXPECT_EQ(values.size(), names.size()) << line;
    rows.emplace_back();
    for (std::size_t i = 0; i < std::min(values.size(), names.size()); ++i)
    {
      rows.back()[names[i]] = values[i];
    }
  }
  return rows;
}

inline double number(const Row& row, const std::string& name)
{
  return std::stod(row.at(name));
}

/** Sum of a column over some rows. */
inline double sum(const std::vector<Row>& rows, const std::string& name, const std::function<bool(const Row&)>& wanted)
{
  double total = 0.0;
  for (const Row& row : rows)
  {
    total += wanted(row) ? number(row, name) : 0.0;
  }
  return total;
}

}  // namespace test
}  // namespace view_servo
