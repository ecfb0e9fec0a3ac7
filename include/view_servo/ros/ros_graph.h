// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <vector>

namespace view_servo
{
/** Which nodes publish and subscribe to which topics, as the master has it; this node is left out. */
class RosGraph
{
public:
  /** Asks the master. Nothing is known when it does not answer. */
  RosGraph();

  /** Names of the nodes that publish a topic; none when nobody does. @param topic fully resolved, here and below. */
  std::vector<std::string> publishers(const std::string& topic) const;
  /** Names of the nodes that subscribe to a topic; none when nobody does. */
  std::vector<std::string> subscribers(const std::string& topic) const;
  /** One of the nodes that publish a topic; empty: there is none. */
  std::string publisher(const std::string& topic) const;
  /** Topics that a node publishes. */
  std::vector<std::string> publishedBy(const std::string& node) const;
  /** Type of a topic's messages; empty: the master does not know. */
  std::string type(const std::string& topic) const;

private:
  using Nodes = std::map<std::string, std::vector<std::string>>;

  Nodes publishers_;
  Nodes subscribers_;
  std::map<std::string, std::string> types_;
};

}  // namespace view_servo
