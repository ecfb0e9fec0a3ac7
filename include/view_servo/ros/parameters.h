// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/views/matcher_parameters.h"

#include <ros/node_handle.h>

#include <string>
#include <vector>

namespace view_servo
{
/**
 * Reads a node's private parameters and collects every fault, so that a user learns of all of them at once.
 *
 *     ParameterReader reader(private_nh);
 *     reader.read("rate", params.rate);
 *     reader.require(params.rate > 0.0, "~rate must be positive [Hz]");
 *     reader.finish();
 */
class ParameterReader
{
public:
  explicit ParameterReader(const ros::NodeHandle& private_nh);

  /** Each read() leaves the value as it is, the default, when the parameter is not set. */
  void read(const std::string& name, bool& value);
  void read(const std::string& name, int& value);
  void read(const std::string& name, double& value);
  void read(const std::string& name, std::string& value);
  void read(const std::vector<Parameter>& table);
  /** The same for parameters in a sub-namespace: `~ns/name`. */
  void read(const std::vector<Parameter>& table, const std::string& ns);

  void require(bool condition, const std::string& fault);
  void addFaults(const std::vector<std::string>& faults);

  /** Declares a parameter that other code reads from the private namespace, so that finish() does not warn of it. */
  void expect(const std::string& name);

  /**
   * Logs all values, and warns of parameters that nobody reads, naming the nearest that exists.
   * @throws std::invalid_argument listing all faults, one a line.
   */
  void finish() const;

private:
  template <typename T>
  void readAs(const std::string& name, const std::string& type, T& value);
  void warnOfUnknown() const;

  ros::NodeHandle private_nh_;
  std::vector<Parameter> known_;
  std::vector<std::string> values_;
  std::vector<std::string> faults_;
};

/**
 * Reads the options of matching by points (views/matcher_parameters.h) and validates them.
 * @param ns sub-namespace of the node that they are in; empty: none.
 */
PointViewMatcherParams readMatcherParams(ParameterReader& reader, const std::string& ns = "");

/** Likewise, of matching by lines. */
LineMatcherParams readLineMatcherParams(ParameterReader& reader);

}  // namespace view_servo
