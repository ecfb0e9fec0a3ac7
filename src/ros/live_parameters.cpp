// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/live_parameters.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
/** Clients group parameters; here all are in one group, which has the name that they expect. */
constexpr const char* GROUP = "Default";

dynamic_reconfigure::GroupState groupState()
{
  dynamic_reconfigure::GroupState state;
  state.name = GROUP;
  state.state = 1;
  return state;
}

}  // namespace

std::vector<LiveNumber> upToNow(const std::vector<Parameter>& table, const std::vector<std::string>& names,
                                double least)
{
  std::vector<LiveNumber> numbers;
  for (const std::string& name : names)
  {
    const auto row = std::find_if(table.begin(), table.end(), [&](const Parameter& each) { return each.name == name; });
    if (row == table.end() || !row->number)
    {
      throw std::invalid_argument("there is no number called " + name);
    }
    const double now = row->number();
    numbers.push_back({ name, row->description + " [" + row->unit + "]", now, std::min(least, now), now });
  }
  return numbers;
}

LiveParameters::LiveParameters(const ros::NodeHandle& private_nh, std::vector<LiveNumber> numbers, Apply apply)
  : numbers_(std::move(numbers)), apply_(std::move(apply)), nh_(private_nh)
{
  descriptions_ = nh_.advertise<dynamic_reconfigure::ConfigDescription>("parameter_descriptions", 1, true);
  updates_ = nh_.advertise<dynamic_reconfigure::Config>("parameter_updates", 1, true);
  descriptions_.publish(description());
  updates_.publish(config(&LiveNumber::value));
  using Service = dynamic_reconfigure::Reconfigure;
  const boost::function<bool(Service::Request&, Service::Response&)> callback = [this](Service::Request& request,
                                                                                       Service::Response& response) {
    const std::lock_guard<std::mutex> lock(mutex_);
    change(request.config);
    response.config = config(&LiveNumber::value);
    updates_.publish(response.config);
    return true;
  };
  service_ = nh_.advertiseService("set_parameters", callback);
}

void LiveParameters::change(const dynamic_reconfigure::Config& wanted)
{
  if (!wanted.bools.empty() || !wanted.ints.empty() || !wanted.strs.empty())
  {
    ROS_WARN_STREAM("what may be changed while " << nh_.getNamespace() << " runs are numbers of type double alone");
  }
  for (const dynamic_reconfigure::DoubleParameter& parameter : wanted.doubles)
  {
    const auto number = std::find_if(numbers_.begin(), numbers_.end(),
                                     [&](const LiveNumber& each) { return each.name == parameter.name; });
    if (number == numbers_.end() || !std::isfinite(parameter.value))
    {
      ROS_WARN_STREAM("'" << parameter.name << "' stays as it is: "
                          << (number == numbers_.end() ? "it cannot be changed while the node runs, or is none of its "
                                                         "parameters"
                                                       : "no finite number was given"));
      continue;
    }
    number->value = std::clamp(parameter.value, number->least, number->most);
    if (number->value != parameter.value)
    {
      ROS_WARN_STREAM(parameter.name << " is " << number->value << " instead of " << parameter.value
                                     << ", which is beyond what the node was started with");
    }
  }
  apply_(numbers_);
}

dynamic_reconfigure::Config LiveParameters::config(double LiveNumber::*value) const
{
  dynamic_reconfigure::Config result;
  for (const LiveNumber& number : numbers_)
  {
    dynamic_reconfigure::DoubleParameter parameter;
    parameter.name = number.name;
    parameter.value = number.*value;
    result.doubles.push_back(parameter);
  }
  result.groups.push_back(groupState());
  return result;
}

dynamic_reconfigure::ConfigDescription LiveParameters::description() const
{
  dynamic_reconfigure::ConfigDescription result;
  dynamic_reconfigure::Group group;
  group.name = GROUP;
  for (const LiveNumber& number : numbers_)
  {
    dynamic_reconfigure::ParamDescription parameter;
    parameter.name = number.name;
    parameter.type = "double";
    parameter.description = number.description;
    group.parameters.push_back(parameter);
  }
  result.groups.push_back(group);
  result.min = config(&LiveNumber::least);
  result.max = config(&LiveNumber::most);
  result.dflt = config(&LiveNumber::value);
  return result;
}

}  // namespace view_servo
