// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"

#include <string>
#include <vector>

namespace view_servo
{
/** The parameters of matching by points, bound to `params`, which must outlive the table. */
std::vector<Parameter> matcherParameters(PointViewMatcherParams& params);

/** The parameters of matching by lines, likewise; which groups to form is chosen for each match instead. */
std::vector<Parameter> matcherParameters(LineMatcherParams& params);

/** The name in the table that is spelt most like `name`, for messages; empty for an empty table. */
std::string nearestName(const std::vector<Parameter>& table, const std::string& name);

/**
 * Sets one parameter by its name.
 * @throws std::invalid_argument naming the parameter when it is unknown (with the nearest name) or the value does not
 * parse; `params` is then unchanged. Ranges are checked by the parameters' validate().
 */
void setParameter(PointViewMatcherParams& params, const std::string& name, const std::string& value);
void setParameter(LineMatcherParams& params, const std::string& name, const std::string& value);

}  // namespace view_servo
