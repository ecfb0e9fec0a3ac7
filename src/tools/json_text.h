// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nlohmann/json.hpp>

#include <string>

namespace view_servo
{
/**
 * As text, in which what is not UTF-8, as names of files may be, is replaced by U+FFFD. @param indent of its lines; less
 * than 0: it is one line.
 */
inline std::string jsonText(const nlohmann::json& json, int indent = -1)
{
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace view_servo
