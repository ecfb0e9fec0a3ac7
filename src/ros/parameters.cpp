// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/parameters.h"

#include "view_servo/parameters/join.h"

#include <ros/console.h>
#include <ros/param.h>

#include <algorithm>
#include <cstddef>
#include <optional>
#include <sstream>
#include <stdexcept>

namespace view_servo
{
namespace
{
/** Empty for values that are not scalars, and for others than strings where one is wanted. */
std::optional<std::string> toText(XmlRpc::XmlRpcValue value, const std::string& type)
{
  if (type == "string" && value.getType() != XmlRpc::XmlRpcValue::TypeString)
  {
    return std::nullopt;
  }
  switch (value.getType())
  {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      // Yaml reads the bare word `off` as a boolean.
      if (type.find('|') != std::string::npos)
      {
        return static_cast<bool>(value) ? "on" : "off";
      }
      return static_cast<bool>(value) ? "true" : "false";
    case XmlRpc::XmlRpcValue::TypeInt:
      return std::to_string(static_cast<int>(value));
    case XmlRpc::XmlRpcValue::TypeDouble:
    {
      std::ostringstream stream;
      stream.precision(17);
      stream << static_cast<double>(value);
      return stream.str();
    }
    case XmlRpc::XmlRpcValue::TypeString:
      return static_cast<std::string>(value);
    default:
      return std::nullopt;
  }
}

/** "a/b" of "a/b/c"; empty for a name without any. */
std::string namespaceOf(const std::string& name)
{
  const std::size_t slash = name.rfind('/');
  return slash == std::string::npos ? "" : name.substr(0, slash);
}

}  // namespace

ParameterReader::ParameterReader(const ros::NodeHandle& private_nh) : private_nh_(private_nh)
{
}

void ParameterReader::read(const std::vector<Parameter>& table)
{
  read(table, "");
}

void ParameterReader::read(const std::vector<Parameter>& table, const std::string& ns)
{
  for (const Parameter& parameter : table)
  {
    const std::string name = ns.empty() ? parameter.name : ns + "/" + parameter.name;
    expect(name);
    XmlRpc::XmlRpcValue value;
    if (private_nh_.getParam(name, value))
    {
      const std::optional<std::string> text = toText(value, parameter.type);
      if (!text || !parameter.set(*text))
      {
        const bool other = parameter.type == "string";  // what is no string in yaml, though its text would do
        faults_.push_back("~" + name + " must be " +
                          (other ? "a string; quote it where it looks like a number" : parameter.type) +
                          (text ? ", not '" + *text + "'" : ""));
      }
    }
    values_.push_back(name + "=" + parameter.get());
  }
}

void ParameterReader::addFaults(const std::vector<std::string>& faults, const std::string& ns)
{
  const std::string prefix = ns.empty() ? "~" : "~" + ns + "/";
  for (const std::string& fault : faults)
  {
    faults_.push_back(prefix + fault);
  }
}

void ParameterReader::expect(const std::string& name)
{
  known_.push_back({ name, "", "", "", "", nullptr, nullptr, nullptr });
}

void ParameterReader::finish() const
{
  warnOfUnknown();
  if (!faults_.empty())
  {
    throw std::invalid_argument("unusable parameters:\n  " + join(faults_, "\n  "));
  }
  ROS_INFO_STREAM("parameters: " << join(values_, ", "));
}

void ParameterReader::warnOfUnknown() const
{
  std::vector<std::string> keys;
  ros::param::getParamNames(keys);
  const std::string prefix = private_nh_.getNamespace() + "/";
  for (const std::string& key : keys)
  {
    if (key.compare(0, prefix.size(), prefix) != 0)
    {
      continue;
    }
    const std::string name = key.substr(prefix.size());
    const bool known =
        std::any_of(known_.begin(), known_.end(), [&](const Parameter& parameter) { return parameter.name == name; });
    // Names of other namespaces belong to plugins, such as image transports.
    const std::string ns = namespaceOf(name);
    const bool ours = std::any_of(known_.begin(), known_.end(),
                                  [&](const Parameter& parameter) { return namespaceOf(parameter.name) == ns; });
    if (!known && ours)
    {
      ROS_WARN_STREAM("~" << name << " is not a parameter of this node and is ignored (did you mean ~"
                          << nearestName(known_, name) << "?)");
    }
  }
}

}  // namespace view_servo
