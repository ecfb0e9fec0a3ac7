// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/view_matcher.h"

#include <functional>
#include <string>
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

/** The parameters of matching by points, bound to `params`, which must outlive the table. */
std::vector<Parameter> matcherParameters(ViewMatcherParams& params);

/** The parameters of matching by lines, likewise; which groups to form is chosen for each match instead. */
std::vector<Parameter> matcherParameters(LineMatcherParams& params);

/** The name in the table that is spelt most like `name`, for messages; empty for an empty table. */
std::string nearestName(const std::vector<Parameter>& table, const std::string& name);

/**
 * Sets one parameter by its name.
 * @throws std::invalid_argument naming the parameter when it is unknown (with the nearest name) or the value does not
 * parse; `params` is then unchanged. Ranges are checked by the parameters' validate().
 */
void setParameter(ViewMatcherParams& params, const std::string& name, const std::string& value);
void setParameter(LineMatcherParams& params, const std::string& name, const std::string& value);

}  // namespace view_servo
