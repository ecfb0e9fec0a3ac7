// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/live_parameters.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <locale>
#include <sstream>
#include <stdexcept>
#include <tuple>
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

/** The named rows as numbers that must stay as they are. */
std::vector<LiveNumber> numbersOf(const std::vector<Parameter>& table, const std::vector<std::string>& names)
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
    numbers.push_back({ name, row->description + (row->unit.empty() ? "" : " [" + row->unit + "]"), now, now, now });
  }
  return numbers;
}

}  // namespace

std::vector<LiveNumber> upToNow(const std::vector<Parameter>& table, const std::vector<std::string>& names,
                                double least)
{
  std::vector<LiveNumber> numbers = numbersOf(table, names);
  for (LiveNumber& number : numbers)
  {
    number.least = std::min(least, number.value);
  }
  return numbers;
}

std::vector<LiveNumber> aroundNow(const std::vector<Parameter>& table, const std::vector<std::string>& names,
                                  const LiveSpan& span)
{
  std::vector<LiveNumber> numbers = numbersOf(table, names);
  for (LiveNumber& number : numbers)
  {
    std::tie(number.least, number.most) = std::minmax({ span.least * number.value, span.most * number.value });
  }
  return numbers;
}

void setNumbers(const std::vector<Parameter>& table, const std::vector<LiveNumber>& numbers)
{
  for (const LiveNumber& number : numbers)
  {
    std::ostringstream text;
    text.imbue(std::locale::classic());
    text.precision(std::numeric_limits<double>::max_digits10);
    text << number.value;
    setParameter(table, number.name, text.str());
  }
}

LiveParameters::LiveParameters(const ros::NodeHandle& private_nh, std::vector<LiveGroup> groups)
  : groups_(std::move(groups)), nh_(private_nh)
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
  std::vector<LiveGroup> changed = groups_;
  for (const dynamic_reconfigure::DoubleParameter& parameter : wanted.doubles)
  {
    LiveNumber* number = find(changed, parameter.name);
    if (number == nullptr || !std::isfinite(parameter.value))
    {
      ROS_WARN_STREAM("'" << parameter.name << "' stays as it is: "
                          << (number == nullptr ? "it cannot be changed while the node runs, or is none of its "
                                                  "parameters"
                                                : "no finite number was given"));
      continue;
    }
    number->value = std::clamp(parameter.value, number->least, number->most);
    if (number->value != parameter.value)
    {
      ROS_WARN_STREAM(parameter.name << " is " << number->value << " instead of " << parameter.value
                                     << ": by what the node was started with, it may be " << number->least << " to "
                                     << number->most);
    }
  }
  for (std::size_t i = 0; i < groups_.size(); ++i)
  {
    const std::string fault = changed[i].fault(changed[i].numbers);
    if (!fault.empty())
    {
      ROS_WARN_STREAM("nothing is changed that goes together with this: " << fault);
      continue;
    }
    groups_[i].numbers = changed[i].numbers;
    groups_[i].apply(groups_[i].numbers);
  }
}

LiveNumber* LiveParameters::find(std::vector<LiveGroup>& groups, const std::string& name)
{
  for (LiveGroup& group : groups)
  {
    for (LiveNumber& number : group.numbers)
    {
      if (number.name == name)
      {
        return &number;
      }
    }
  }
  return nullptr;
}

dynamic_reconfigure::Config LiveParameters::config(double LiveNumber::*value) const
{
  dynamic_reconfigure::Config result;
  for (const LiveGroup& group : groups_)
  {
    for (const LiveNumber& number : group.numbers)
    {
      dynamic_reconfigure::DoubleParameter parameter;
      parameter.name = number.name;
      parameter.value = number.*value;
      result.doubles.push_back(parameter);
    }
  }
  result.groups.push_back(groupState());
  return result;
}

dynamic_reconfigure::ConfigDescription LiveParameters::description() const
{
  dynamic_reconfigure::ConfigDescription result;
  dynamic_reconfigure::Group all;
  all.name = GROUP;
  for (const LiveGroup& group : groups_)
  {
    for (const LiveNumber& number : group.numbers)
    {
      dynamic_reconfigure::ParamDescription parameter;
      parameter.name = number.name;
      parameter.type = "double";
      parameter.description = number.description;
      all.parameters.push_back(parameter);
    }
  }
  result.groups.push_back(all);
  result.min = config(&LiveNumber::least);
  result.max = config(&LiveNumber::most);
  result.dflt = config(&LiveNumber::value);
  return result;
}

}  // namespace view_servo
