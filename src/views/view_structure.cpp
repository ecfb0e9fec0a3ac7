// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/view_structure.h"

#include <cmath>
#include <cstddef>
#include <iomanip>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr const char* HEADER = "view_servo structure 1: pixel [px], inverse depth [1/m], information [m^2]";
constexpr std::size_t MOST = 100000;  // points

bool isUsable(const StructurePoint& point)
{
  return point.pixel.allFinite() && std::isfinite(point.inverse_depth) && point.inverse_depth > 0.0 &&
         std::isfinite(point.information) && point.information > 0.0;
}

}  // namespace

std::string toText(const ViewStructure& structure)
{
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << std::setprecision(std::numeric_limits<double>::max_digits10) << HEADER << '\n';
  for (const StructurePoint& point : structure.points)
  {
    text << point.pixel.x() << ' ' << point.pixel.y() << ' ' << point.inverse_depth << ' ' << point.information << '\n';
  }
  return text.str();
}

ViewStructure structureFromText(const std::string& text)
{
  std::istringstream lines(text);
  std::string line;
  if (!std::getline(lines, line) || line != HEADER)
  {
    throw std::runtime_error("it is not a structure of this format");
  }
  ViewStructure structure;
  while (std::getline(lines, line))
  {
    std::istringstream numbers(line);
    numbers.imbue(std::locale::classic());
    StructurePoint point;
    std::string rest;
    numbers >> point.pixel.x() >> point.pixel.y() >> point.inverse_depth >> point.information;
    if (!numbers || numbers >> rest || !isUsable(point) || structure.points.size() >= MOST)
    {
      throw std::runtime_error("its line " + std::to_string(structure.points.size() + 2) + " is no point");
    }
    structure.points.push_back(point);
  }
  return structure;
}

}  // namespace view_servo
