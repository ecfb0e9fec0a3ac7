// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/parameter.h"

#include <algorithm>
#include <cmath>
#include <locale>
#include <regex>
#include <set>
#include <sstream>
#include <stdexcept>

namespace view_servo
{
namespace
{
/** The whole text as one value; locale-independent. */
template <typename T>
bool parse(const std::string& text, T& value)
{
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  T parsed{};
  if (!(stream >> parsed) || !(stream >> std::ws).eof())
  {
    return false;
  }
  value = parsed;
  return true;
}

template <typename T>
std::string print(const T& value)
{
  std::ostringstream stream;
  stream.imbue(std::locale::classic());
  stream << value;
  return stream.str();
}

template <typename T>
Parameter number(const char* type, std::string name, T& value, std::string unit, std::string range,
                 std::string description)
{
  return { std::move(name),
           type,
           std::move(unit),
           std::move(range),
           std::move(description),
           [&value] { return print(value); },
           [&value](const std::string& text) { return parse(text, value); },
           [&value] {
             return static_cast<double>(value);
           } };
}

/** Of a string or a path. */
template <typename T>
Parameter words(std::string name, T& value, std::string description)
{
  return { std::move(name),
           "string",
           "",
           "",
           std::move(description),
           [&value] { return std::string(value); },
           [&value](const std::string& text) {
             value = text;
             return true;
           },
           nullptr };
}

[[noreturn]] void refuseRange(const Parameter& parameter)
{
  throw std::logic_error("parameter " + parameter.name + ": '" + parameter.range + "' is not a range");
}

/** Reads the ranges of a table's rows. */
class RangeReader
{
public:
  explicit RangeReader(const std::vector<Parameter>& table) : table_(table)
  {
  }

  bool contains(const Parameter& parameter, double value) const
  {
    std::string range = parameter.range;
    const std::string odd = "odd, ";
    if (range.compare(0, odd.size(), odd) == 0)
    {
      if (std::fmod(std::abs(value), 2.0) != 1.0)
      {
        return false;
      }
      range.erase(0, odd.size());
    }
    static const std::regex above(R"((>=|>) (\S+))");
    static const std::regex between(R"(([[(])(\S+), (\S+)([\])]))");
    static const std::regex separator(", | or ");
    std::smatch parts;
    if (std::regex_match(range, parts, above))
    {
      const double bound = numberOf(parameter, parts[2]);
      return parts[1] == ">" ? value > bound : value >= bound;
    }
    if (std::regex_match(range, parts, between))
    {
      const double low = numberOf(parameter, parts[2]);
      const double high = numberOf(parameter, parts[3]);
      return (parts[1] == "[" ? value >= low : value > low) && (parts[4] == "]" ? value <= high : value < high);
    }
    // "4, 6 or 8"
    return std::any_of(std::sregex_token_iterator(range.begin(), range.end(), separator, -1),
                       std::sregex_token_iterator(),
                       [&](const std::string& word) { return value == numberOf(parameter, word); });
  }

private:
  /** A bound: a number, pi, pi/2, or another row's value. */
  double numberOf(const Parameter& parameter, const std::string& text) const
  {
    double number = 0.0;
    if (parse(text, number))
    {
      return number;
    }
    if (text == "pi" || text == "pi/2")
    {
      return text == "pi" ? M_PI : M_PI_2;
    }
    const auto other =
        std::find_if(table_.begin(), table_.end(), [&](const Parameter& row) { return row.name == text; });
    if (other == table_.end() || !other->number)
    {
      refuseRange(parameter);
    }
    return other->number();
  }

  const std::vector<Parameter>& table_;
};

std::size_t editDistance(const std::string& a, const std::string& b)
{
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j)
  {
    row[j] = j;
  }
  for (std::size_t i = 1; i <= a.size(); ++i)
  {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j)
    {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({ replaced, row[j] + 1, row[j - 1] + 1 });
    }
  }
  return row[b.size()];
}

}  // namespace

Parameter integer(std::string name, int& value, std::string unit, std::string range, std::string description)
{
  return number("int", std::move(name), value, std::move(unit), std::move(range), std::move(description));
}

Parameter real(std::string name, double& value, std::string unit, std::string range, std::string description)
{
  Parameter parameter =
      number("double", std::move(name), value, std::move(unit), std::move(range), std::move(description));
  parameter.set = [&value](const std::string& text) {
    double parsed = 0.0;
    if (!parse(text, parsed) || !std::isfinite(parsed))
    {
      return false;
    }
    value = parsed;
    return true;
  };
  return parameter;
}

Parameter natural(std::string name, std::uint64_t& value, std::string description)
{
  Parameter parameter = number("int", std::move(name), value, "", ">= 0", std::move(description));
  parameter.set = [&value](const std::string& text) {
    return text.find('-') == std::string::npos && parse(text, value);  // streams read -1 as the largest number
  };
  return parameter;
}

Parameter boolean(std::string name, bool& value, std::string description)
{
  Parameter parameter =
      choice<bool>(std::move(name), value, { { "true", true }, { "false", false } }, std::move(description));
  parameter.type = "bool";
  return parameter;
}

Parameter text(std::string name, std::string& value, std::string description)
{
  return words(std::move(name), value, std::move(description));
}

Parameter path(std::string name, std::filesystem::path& value, std::string description)
{
  return words(std::move(name), value, std::move(description));
}

std::vector<Parameter> joined(std::initializer_list<std::vector<Parameter>> tables)
{
  std::vector<Parameter> all;
  for (const std::vector<Parameter>& table : tables)
  {
    all.insert(all.end(), table.begin(), table.end());
  }
  return all;
}

std::vector<Parameter> prefixed(const std::string& prefix, std::vector<Parameter> table)
{
  std::set<std::string> names;
  for (const Parameter& parameter : table)
  {
    names.insert(parameter.name);
  }
  for (Parameter& parameter : table)
  {
    parameter.name.insert(0, prefix);
    const std::regex word("[A-Za-z_][A-Za-z_0-9]*");
    std::string range;
    auto rest = parameter.range.cbegin();
    for (std::sregex_iterator found(parameter.range.cbegin(), parameter.range.cend(), word), end; found != end; ++found)
    {
      const std::ssub_match& name = (*found)[0];
      range.append(rest, name.first).append(names.count(name) != 0 ? prefix : "").append(name);
      rest = name.second;
    }
    parameter.range = range.append(rest, parameter.range.cend());
  }
  return table;
}

std::vector<std::string> faultsOf(const std::vector<Parameter>& table)
{
  const RangeReader ranges(table);
  std::vector<std::string> faults;
  for (const Parameter& parameter : table)
  {
    const std::string unit = parameter.unit.empty() ? "" : " " + parameter.unit;
    if (!parameter.number)
    {
      if (parameter.type != "string" && parameter.get().empty())
      {
        faults.push_back(parameter.name + " must be one of " + parameter.type);
      }
    }
    else if (!std::isfinite(parameter.number()))
    {
      faults.push_back(parameter.name + " must be a finite number, not " + parameter.get());
    }
    else if (!parameter.range.empty() && !ranges.contains(parameter, parameter.number()))
    {
      const bool interval = parameter.range[0] == '[' || parameter.range[0] == '(';
      const std::string verb = interval ? " must lie in " : " must be ";
      std::string fault = parameter.name;
      fault.append(verb).append(parameter.range).append(unit).append(", not ").append(parameter.get());
      faults.push_back(fault);
    }
  }
  return faults;
}

std::string nearestName(const std::vector<Parameter>& table, const std::string& name)
{
  const auto nearest = std::min_element(table.begin(), table.end(), [&](const Parameter& a, const Parameter& b) {
    return editDistance(a.name, name) < editDistance(b.name, name);
  });
  return nearest == table.end() ? std::string() : nearest->name;
}

void setParameter(const std::vector<Parameter>& table, const std::string& name, const std::string& value)
{
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const Parameter& parameter) { return parameter.name == name; });
  if (found == table.end())
  {
    throw std::invalid_argument("unknown parameter '" + name + "' (did you mean '" + nearestName(table, name) + "'?)");
  }
  if (!found->set(value))
  {
    throw std::invalid_argument("parameter '" + name + "': '" + value + "' is not of type " + found->type);
  }
}

}  // namespace view_servo
