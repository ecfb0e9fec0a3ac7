// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace view_servo
{
/** The texts one after the other, with the separator between them; empty for no texts. */
inline std::string join(const std::vector<std::string>& texts, const std::string& separator)
{
  std::string all;
  for (std::size_t i = 0; i < texts.size(); ++i)
  {
    all += (i == 0 ? "" : separator) + texts[i];
  }
  return all;
}

}  // namespace view_servo
