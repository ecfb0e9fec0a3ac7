// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"

#include <ros/node_handle.h>

#include <string>
#include <vector>

namespace view_servo
{
/**
 * Reads a node's private parameters and collects every fault, so that a user learns of all of them at once.
 *
 *     ParameterReader reader(private_nh);
 *     reader.read(parameters(params));
 *     reader.read(parameters(more), "group");
 *     reader.addFaults(params.validate());
 *     reader.finish();
 */
class ParameterReader
{
public:
  explicit ParameterReader(const ros::NodeHandle& private_nh);

  /** Leaves the values of parameters that are not set as they are, which are the defaults. */
  void read(const std::vector<Parameter>& table);
  /** The same for parameters in a sub-namespace: `~ns/name`. */
  void read(const std::vector<Parameter>& table, const std::string& ns);

  /** Faults, each of which begins with a parameter's name. @param ns the sub-namespace that it is in; empty: none. */
  void addFaults(const std::vector<std::string>& faults, const std::string& ns = "");

  /**
   * Logs all values, and warns of parameters that nobody reads, naming the nearest that exists.
   * @throws std::invalid_argument listing all faults, one a line.
   */
  void finish() const;

private:
  void expect(const std::string& name);
  void warnOfUnknown() const;

  ros::NodeHandle private_nh_;
  std::vector<Parameter> known_;
  std::vector<std::string> values_;
  std::vector<std::string> faults_;
};

/**
 * Reads and checks all parameters of a node: those of the table `parameters(params)`, and of `params.validate()`.
 * @throws std::invalid_argument listing all faults, one a line.
 */
template <typename Params>
Params readParams(const ros::NodeHandle& private_nh, Params params = Params())
{
  ParameterReader reader(private_nh);
  reader.read(parameters(params));
  reader.addFaults(params.validate());
  reader.finish();
  return params;
}

}  // namespace view_servo
