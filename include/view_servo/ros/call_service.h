// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>
#include <ros/service_client.h>

#include <string>

namespace view_servo
{
/**
 * Calls a service once. It takes as long as the service does, as roscpp knows no deadline: so it is not for what moves
 * a robot, and where time matters it is called by a thread of its own, as in SimulatedRun.
 *
 * In place of ros::service::call(), which loses a response now and then: the end of its connection, which the server
 * closes after each call, may overtake the response in roscpp (ros_comm issue 1976). That of a persistent client stays.
 * @param name resolved as all names of this node are.
 * @return false when the service is not there, or reports that it failed.
 */
template <typename Request, typename Response>
bool callService(const std::string& name, Request& request, Response& response)
{
  constexpr bool PERSISTENT = true;
  return ros::NodeHandle().serviceClient<Request, Response>(name, PERSISTENT).call(request, response);
}

/** The same with request and response in one. */
template <typename Service>
bool callService(const std::string& name, Service& service)
{
  return callService(name, service.request, service.response);
}

}  // namespace view_servo
