// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * A parameter by its name, as yaml files, the parameter server and `--set name=value` give it. One table serves all
 * three and the reference in docs/, so a name means the same everywhere.
 */
struct Parameter
{
  std::string name;
  std::string type;         ///< "int", "double", "bool" or the allowed words, joined by '|'
  std::string description;  ///< with unit and range
  std::function<std::string()> get;
  /** Parses and stores; false (and nothing stored) when the text is not of the type. */
  std::function<bool(const std::string&)> set;
};

/** @file
 * Rows of such tables, bound to `value`, which must outlive them. Texts are parsed whatever the locale.
 */
Parameter integer(std::string name, int& value, std::string description);
/** Finite numbers only. */
Parameter real(std::string name, double& value, std::string description);
Parameter natural(std::string name, std::uint64_t& value, std::string description);
Parameter boolean(std::string name, bool& value, std::string description);

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
  return { std::move(name), type, std::move(description), get, set };
}

}  // namespace view_servo
