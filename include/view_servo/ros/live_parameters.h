// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/parameter.h"

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/ConfigDescription.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_server.h>

#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace view_servo
{
/** A number among a node's parameters that may be changed while the node runs. */
struct LiveNumber
{
  std::string name;         ///< of the parameter
  std::string description;  ///< one line, for people, with the unit
  double value = 0.0;       ///< in effect now
  double least = 0.0;       ///< smallest value that is allowed
  double most = 0.0;        ///< largest value that is allowed
};

/**
 * The named rows of a table as numbers that may be changed. Each is allowed from `least` up to the value that it has
 * now, so that what the node was started with is the limit. @throws std::invalid_argument for a name that is not one of
 * the table's numbers.
 */
std::vector<LiveNumber> upToNow(const std::vector<Parameter>& table, const std::vector<std::string>& names,
                                double least);

/**
 * Lets people change numbers of a node while it runs, by the clients of dynamic_reconfigure: rqt_reconfigure, or
 * `rosrun dynamic_reconfigure dynparam set NODE NAME VALUE`. Values beyond the limits become the nearest that is allowed;
 * unknown names and values that are no numbers change nothing; both are logged. The parameter server keeps the values
 * that the node was started with.
 *
 * Publishes, latched: `~parameter_descriptions` (dynamic_reconfigure/ConfigDescription), `~parameter_updates`
 * (dynamic_reconfigure/Config). Service: `~set_parameters` (dynamic_reconfigure/Reconfigure), whose response is what is
 * in effect.
 */
class LiveParameters
{
public:
  using Apply = std::function<void(const std::vector<LiveNumber>&)>;

  /** @param apply is called with all numbers after a change, by one thread at a time; it must not wait. */
  LiveParameters(const ros::NodeHandle& private_nh, std::vector<LiveNumber> numbers, Apply apply);

private:
  /** Takes over the numbers in `wanted`, each brought within its limits, and calls apply_. */
  void change(const dynamic_reconfigure::Config& wanted);
  /** The message with one member of each number: what is in effect, or the least or largest values. */
  dynamic_reconfigure::Config config(double LiveNumber::*value) const;
  dynamic_reconfigure::ConfigDescription description() const;

  mutable std::mutex mutex_;
  std::vector<LiveNumber> numbers_;
  const Apply apply_;
  ros::NodeHandle nh_;
  ros::Publisher descriptions_;
  ros::Publisher updates_;
  ros::ServiceServer service_;
};

}  // namespace view_servo
