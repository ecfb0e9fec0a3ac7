// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "node_test.h"

#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>

#include <map>
#include <string>

namespace view_servo
{
namespace test
{
/** Asks a node to change parameters while it runs. @return all that can be changed, with the values in effect then. */
inline std::map<std::string, double> changeParameters(const std::string& node,
                                                      const std::map<std::string, double>& wanted)
{
  dynamic_reconfigure::Reconfigure call;
  for (const auto& [name, value] : wanted)
  {
    call.request.config.doubles.emplace_back();
    call.request.config.doubles.back().name = name;
    call.request.config.doubles.back().value = value;
  }
  EXPECT_TRUE(callService(node + "/set_parameters", call.request, call.response));
  std::map<std::string, double> result;
  for (const dynamic_reconfigure::DoubleParameter& parameter : call.response.config.doubles)
  {
    result[parameter.name] = parameter.value;
  }
  return result;
}

}  // namespace test
}  // namespace view_servo
