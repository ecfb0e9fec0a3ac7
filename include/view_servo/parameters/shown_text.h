// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>

namespace view_servo
{
/**
 * A name that came in a message or a file, as a reason shows it, which is one line: '?' for each control character, and
 * cut after 80 bytes.
 */
inline std::string shown(const std::string& name)
{
  constexpr std::size_t LONGEST = 80;
  std::string text = name.size() > LONGEST ? name.substr(0, LONGEST) + "..." : name;
  std::replace_if(
      text.begin(), text.end(), [](unsigned char character) { return character < 0x20 || character == 0x7F; }, '?');
  return text;
}

}  // namespace view_servo
