// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * A parameter, stated once: a table of these is what yaml files, the parameter server and `--set name=value` are read
 * by, what values are checked by, and what docs/parameters.md and the files in config/ are compared with.
 */
struct Parameter
{
  std::string name;  ///< as yaml files and the parameter server have it
  std::string type;  ///< "int", "double", "bool", "string" or the allowed words, joined by '|'
  std::string unit;  ///< such as "px" or "rad/s"; empty: none
  /**
   * The allowed values of a number: "> 0", ">= 1", "[0, 1)", "(0, pi/2)", "4, 6 or 8", "odd, >= 5"; or, by another
   * parameter of the same table, ">= gain". Empty: all finite ones.
   */
  std::string range;
  std::string description;           ///< one line, for people
  std::function<std::string()> get;  ///< the value as text
  /**
   * Parses and stores; returns false, and stores nothing, when the text is not of the type. Ranges are faultsOf()'s to
   * check.
   */
  std::function<bool(const std::string&)> set;
  std::function<double()> number;  ///< the value of an "int" or a "double"; empty for other types
};

/** @file
 * Rows of such tables, bound to `value`, which must outlive them. Texts are parsed alike whatever the locale.
 */
Parameter integer(std::string name, int& value, std::string unit, std::string range, std::string description);
/** A "double", of which only finite numbers are allowed. */
Parameter real(std::string name, double& value, std::string unit, std::string range, std::string description);
/** An "int" that is not negative, such as a seed. */
Parameter natural(std::string name, std::uint64_t& value, std::string description);
Parameter boolean(std::string name, bool& value, std::string description);
Parameter text(std::string name, std::string& value, std::string description);
/** A "string" that names a file or directory. */
Parameter path(std::string name, std::filesystem::path& value, std::string description);

/** A choice among words; booleans are the words true and false. */
template <typename T>
Parameter choice(std::string name, T& value, std::vector<std::pair<std::string, T>> words, std::string description)
{
  std::string type;
  for (const auto& word : words)
  {
    type += (type.empty() ? "" : "|") + word.first;
  }
  const auto get = [&value, words] {
    for (const auto& word : words)
    {
      if (word.second == value)
      {
        return word.first;
      }
    }
    return std::string();
  };
  const auto set = [&value, words](const std::string& text) {
    for (const auto& word : words)
    {
      if (word.first == text)
      {
        value = word.second;
        return true;
      }
    }
    return false;
  };
  return { std::move(name), type, "", "", std::move(description), get, set, nullptr };
}

/** The name in the table that is spelt most like `name`, for messages; empty for an empty table. */
std::string nearestName(const std::vector<Parameter>& table, const std::string& name);

/**
 * Sets one parameter by its name. Ranges are faultsOf()'s to check.
 * @throws std::invalid_argument naming the parameter when it is unknown (with the nearest name) or the value does not
 * parse; nothing is changed then.
 */
void setParameter(const std::vector<Parameter>& table, const std::string& name, const std::string& value);

/** Tables one after the other. */
std::vector<Parameter> joined(std::initializer_list<std::vector<Parameter>> tables);

/**
 * A table whose names begin with `prefix`, also where ranges name other parameters: for two of one kind in one table.
 */
std::vector<Parameter> prefixed(const std::string& prefix, std::vector<Parameter> table);

/**
 * What is wrong with the values, one text for each: numbers that are not finite or out of their range, and choices
 * that are none of the words.
 * @throws std::logic_error when a range cannot be read.
 */
std::vector<std::string> faultsOf(const std::vector<Parameter>& table);

/** Those of the table that `parameters(Params&)` makes, a function beside the type. */
template <typename Params>
std::vector<std::string> faultsOf(Params params)
{
  return faultsOf(parameters(params));
}

}  // namespace view_servo
