// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/parameters/parameter.h"

#include <cmath>
#include <locale>
#include <sstream>

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
Parameter number(std::string name, const char* type, T& value, std::string description)
{
  return { std::move(name), type, std::move(description), [&value] { return print(value); },
           [&value](const std::string& text) {
             return parse(text, value);
           } };
}

}  // namespace

Parameter integer(std::string name, int& value, std::string description)
{
  return number(std::move(name), "int", value, std::move(description));
}

Parameter real(std::string name, double& value, std::string description)
{
  Parameter parameter = number(std::move(name), "double", value, std::move(description));
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
  Parameter parameter = number(std::move(name), "int", value, std::move(description));
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

}  // namespace view_servo
