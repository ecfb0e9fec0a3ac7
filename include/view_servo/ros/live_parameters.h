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
#include <utility>
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

/** How far people may change a number: from `least` to `most` times the value that a node was started with. */
struct LiveSpan
{
  double least;
  double most;
};
constexpr LiveSpan LIVE_GAIN{ 0.1, 2.0 };
constexpr LiveSpan LIVE_TOLERANCE{ 0.1, 10.0 };
constexpr LiveSpan LIVE_THRESHOLD{ 0.5, 4.0 };  // of what is accepted: lower ones let false answers pass
constexpr LiveSpan LIVE_RATE{ 0.01, 4.0 };

/** The same, but each number is allowed within a span of the value that it has now. */
std::vector<LiveNumber> aroundNow(const std::vector<Parameter>& table, const std::vector<std::string>& names,
                                  const LiveSpan& span);

/**
 * Sets the parameters in a table that are called as the numbers are. @throws std::invalid_argument for unknown names.
 */
void setNumbers(const std::vector<Parameter>& table, const std::vector<LiveNumber>& numbers);

/** Numbers that are checked and taken over together. */
struct LiveGroup
{
  std::vector<LiveNumber> numbers;
  /** What is wrong with the group's numbers, in one line; empty: nothing is. */
  std::function<std::string(const std::vector<LiveNumber>&)> fault;
  /** Takes over the group's numbers after a change; called by one thread at a time; must not wait. */
  std::function<void(const std::vector<LiveNumber>&)> apply;
};

/**
 * Numbers of some parameters, which are checked as at the start of a node.
 * @param apply gets the parameters with the numbers that are in effect then.
 */
template <typename Params>
LiveGroup liveGroup(const Params& params, std::vector<LiveNumber> numbers, std::function<void(const Params&)> apply)
{
  const auto changed = [params](const std::vector<LiveNumber>& live) {
    Params result = params;
    setNumbers(parameters(result), live);
    return result;
  };
  const auto fault = [changed](const std::vector<LiveNumber>& live) {
    std::string text;
    for (const std::string& each : changed(live).validate())
    {
      text += (text.empty() ? "" : "; ") + each;
    }
    return text;
  };
  const auto take = [changed, apply = std::move(apply)](const std::vector<LiveNumber>& live) {
    apply(changed(live));
  };
  return { std::move(numbers), fault, take };
}

/**
 * Lets people change numbers of a node while it runs, by rqt_reconfigure and the other clients of dynamic_reconfigure.
 * Values beyond the limits become the nearest that is allowed; unknown names and values that are no numbers change
 * nothing, and values that do not go together leave their group as it is; all that is logged. The parameter server
 * keeps the values that the node was started with.
 *
 * Publishes, latched: `~parameter_descriptions` (dynamic_reconfigure/ConfigDescription), `~parameter_updates`
 * (dynamic_reconfigure/Config). Service: `~set_parameters` (dynamic_reconfigure/Reconfigure), whose response is what is
 * in effect.
 */
class LiveParameters
{
public:
  /** Names of numbers must be different in all groups. */
  LiveParameters(const ros::NodeHandle& private_nh, std::vector<LiveGroup> groups);

private:
  /** Takes over the numbers in `wanted`, each brought within its limits. */
  void change(const dynamic_reconfigure::Config& wanted);
  /** The number of this name among those of `groups`; null: there is none. */
  static LiveNumber* find(std::vector<LiveGroup>& groups, const std::string& name);
  /** The message with one member of each number: what is in effect, or the least or largest values. */
  dynamic_reconfigure::Config config(double LiveNumber::*value) const;
  dynamic_reconfigure::ConfigDescription description() const;

  mutable std::mutex mutex_;
  std::vector<LiveGroup> groups_;
  ros::NodeHandle nh_;
  ros::Publisher descriptions_;
  ros::Publisher updates_;
  ros::ServiceServer service_;
};

}  // namespace view_servo
