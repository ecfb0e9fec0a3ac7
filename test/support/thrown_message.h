// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace view_servo
{
namespace test
{
/** What the `Exception` says that `action()` throws; empty when it throws nothing. Other exceptions pass through. */
template <typename Exception, typename Action>
std::string thrownMessage(const Action& action)
{
  try
  {
    action();
  }
  catch (const Exception& exception)
  {
    return exception.what();
  }
  return "";
}

}  // namespace test
}  // namespace view_servo
