// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/ros_graph.h"

#include <ros/master.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <algorithm>

namespace view_servo
{
namespace
{
XmlRpc::XmlRpcValue ask(const std::string& question)
{
  XmlRpc::XmlRpcValue request;
  request[0] = ros::this_node::getName();
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue payload;
  const bool answered = ros::master::execute(question, request, response, payload, false);
  return answered ? payload : XmlRpc::XmlRpcValue();
}

std::map<std::string, std::vector<std::string>> toNodes(XmlRpc::XmlRpcValue& topics)
{
  std::map<std::string, std::vector<std::string>> nodes;
  for (int i = 0; i < topics.size(); ++i)
  {
    for (int k = 0; k < topics[i][1].size(); ++k)
    {
      const std::string node = topics[i][1][k];
      if (node != ros::this_node::getName())
      {
        nodes[topics[i][0]].push_back(node);
      }
    }
  }
  return nodes;
}

std::vector<std::string> nodesOf(const std::map<std::string, std::vector<std::string>>& nodes, const std::string& topic)
{
  const auto found = nodes.find(topic);
  return found == nodes.end() ? std::vector<std::string>() : found->second;
}

}  // namespace

RosGraph::RosGraph()
{
  XmlRpc::XmlRpcValue state = ask("getSystemState");
  if (state.getType() == XmlRpc::XmlRpcValue::TypeArray && state.size() >= 2)
  {
    publishers_ = toNodes(state[0]);
    subscribers_ = toNodes(state[1]);
  }
  XmlRpc::XmlRpcValue types = ask("getTopicTypes");
  for (int i = 0; types.getType() == XmlRpc::XmlRpcValue::TypeArray && i < types.size(); ++i)
  {
    types_[types[i][0]] = std::string(types[i][1]);
  }
}

std::vector<std::string> RosGraph::publishers(const std::string& topic) const
{
  return nodesOf(publishers_, topic);
}

std::vector<std::string> RosGraph::subscribers(const std::string& topic) const
{
  return nodesOf(subscribers_, topic);
}

std::string RosGraph::publisher(const std::string& topic) const
{
  const std::vector<std::string> nodes = publishers(topic);
  return nodes.empty() ? "" : nodes.front();
}

std::vector<std::string> RosGraph::publishedBy(const std::string& node) const
{
  std::vector<std::string> topics;
  for (const auto& [topic, nodes] : publishers_)
  {
    if (std::find(nodes.begin(), nodes.end(), node) != nodes.end())
    {
      topics.push_back(topic);
    }
  }
  return topics;
}

std::string RosGraph::type(const std::string& topic) const
{
  const auto found = types_.find(topic);
  return found == types_.end() ? "" : found->second;
}

}  // namespace view_servo
