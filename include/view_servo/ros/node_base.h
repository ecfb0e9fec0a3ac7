// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/parameters/error_text.h"

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <ros/spinner.h>
#include <ros/steady_timer.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <ros/transport_hints.h>
#include <boost/function.hpp>
#include <boost/shared_ptr.hpp>

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <optional>
#include <string>
#include <thread>

namespace view_servo
{
/** A time [s] as a text for people. */
std::string seconds(double value);

/** Time from one stamp to another [s]. Never throws, as the difference of two ros::Time does beyond 68 years. */
double secondsBetween(const ros::Time& from, const ros::Time& to);

/** Age of a stamp by ROS' clock [s]; negative when it lies in the future. */
double ageOf(const ros::Time& stamp);

/**
 * To be appended to the fault of a message of this age [s]: what to do when the age shows that the message comes from a
 * bag while ROS' clock is not the bag's; else empty.
 */
std::string remedyOfAge(double age);

/**
 * The order of the stamps of one input. A message may overtake another one, and is late then; but when one after the
 * other is far behind, time itself has gone back, as when a bag loops or a simulation begins anew.
 */
class StampOrder
{
public:
  enum Place
  {
    NEWEST,    ///< newer than all before
    REPEATED,  ///< the newest stamp again
    LATE,      ///< before the newest
    FAR_LATE,  ///< so long before the newest that it belongs to nothing that is known
    GONE_BACK  ///< time has gone back: what was before is to be forgotten, and this stamp is the newest
  };

  /** Takes the stamp of the next message and says where it is in the order of those before it. */
  Place check(const ros::Time& stamp);

  /** The newest stamp; zero without any. */
  const ros::Time& newest() const
  {
    return newest_;
  }
  /** How far the last stamp was behind the newest one before it [s]. */
  double behind() const
  {
    return behind_;
  }

private:
  ros::Time newest_;
  double behind_ = 0.0;
  int far_late_ = 0;  // in a row
};

/**
 * Runs `body` and catches and logs what it throws, so that no message, timer or thread ends the node.
 * @param what is run, in words, for the log.
 * @return the text of what was thrown, in one line; empty when nothing was.
 */
template <typename Body>
std::string guarded(const std::string& what, const Body& body)
{
  std::string fault;
  try
  {
    body();
    return "";
  }
  catch (const std::exception& error)
  {
    fault = oneLine(error);
  }
  catch (...)
  {
    fault = "unknown exception";
  }
  ROS_ERROR_STREAM_THROTTLE(5.0, what << " failed: " << fault);
  return fault;
}

/**
 * Makes the process keep memory that it frees, instead of returning it to the system. Each image is allocated anew, and
 * asking the system for its memory costs a third of the time that the work on it takes. Does nothing unless the C
 * library is glibc.
 */
void keepFreedMemory();

/**
 * Kills the process when it is still there a while after it was asked to end: neither a long computation nor ROS, which
 * may wait for a peer that does not answer, can keep a node alive. By then robots have been sent zero, and no file is
 * left half written because files are put in place in one step.
 */
class ExitDeadline
{
public:
  /** @param asked returns whether the process has been asked to end. @param status its exit status when it is killed. */
  explicit ExitDeadline(std::function<bool()> asked, int status = 0);
  ~ExitDeadline();
  ExitDeadline(const ExitDeadline&) = delete;
  ExitDeadline& operator=(const ExitDeadline&) = delete;

private:
  void watch(const std::function<bool()>& asked);

  const int status_;
  std::atomic<bool> over_{ false };
  std::thread thread_;
};

/**
 * What all nodes share: handles, services that answer also when they fail, and `/diagnostics` once a second of wall
 * time, which goes on while the clock of a bag stands still.
 */
class NodeBase
{
public:
  NodeBase(const NodeBase&) = delete;
  NodeBase& operator=(const NodeBase&) = delete;

protected:
  NodeBase(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh);
  ~NodeBase() = default;

  /**
   * Offers a private service. When `method` throws, the response has success = false and the exception's text as
   * message.
   * @return the handle, which keeps the service alive.
   */
  template <typename Node, typename Request, typename Response>
  ros::ServiceServer serve(const std::string& name, void (Node::*method)(const Request&, Response&), Node* node)
  {
    const boost::function<bool(Request&, Response&)> callback = [method, node](Request& request, Response& response) {
      try
      {
        (node->*method)(request, response);
      }
      catch (const std::exception& error)
      {
        response.success = false;
        response.message = oneLine(error);
        ROS_WARN_STREAM(response.message);
      }
      catch (...)
      {
        response.success = false;
        response.message = "unknown exception";
        ROS_WARN_STREAM(response.message);
      }
      return true;
    };
    return private_nh_.advertiseService(name, callback);
  }

  /** Subscribes; what `handler` throws is logged. @param handler is called with a const Message::ConstPtr&. */
  template <typename Message, typename Handler>
  ros::Subscriber subscribe(const std::string& topic, std::uint32_t queue_size, Handler handler,
                            const ros::TransportHints& hints = ros::TransportHints())
  {
    return subscribeEvents<Message>(
        topic, queue_size,
        [handler](const ros::MessageEvent<const Message>& event) { handler(event.getConstMessage()); }, hints);
  }

  /** Likewise. @param handler is called with a const ros::MessageEvent<const Message>&, which names the publisher. */
  template <typename Message, typename Handler>
  ros::Subscriber subscribeEvents(const std::string& topic, std::uint32_t queue_size, Handler handler,
                                  const ros::TransportHints& hints = ros::TransportHints())
  {
    using Event = ros::MessageEvent<const Message>;
    const boost::function<void(const Event&)> callback = [topic, handler](const Event& event) {
      guarded("a message on '" + topic + "'", [&] { handler(event); });
    };
    return nh_.subscribe<Message>(topic, queue_size, callback, ros::VoidConstPtr(), hints);
  }

  /**
   * Calls `body` every `period` [s] of a steady clock, whatever happens to the system's or to ROS'; what it throws is
   * logged.
   */
  template <typename Body>
  ros::SteadyTimer every(double period, const std::string& what, Body body)
  {
    return nh_.createSteadyTimer(ros::WallDuration(period),
                                 [what, body](const ros::SteadyTimerEvent&) { guarded(what, body); });
  }

  ros::NodeHandle nh_;
  ros::NodeHandle private_nh_;
  diagnostic_updater::Updater diagnostics_;

private:
  ros::SteadyTimer diagnostics_timer_;
};

/** Threads that call a node's callbacks but for requests. */
constexpr std::uint32_t NODE_THREADS = 3;

/**
 * Threads that answer the requests to a node, and do nothing else: however many callers wait for slow answers, images
 * and odometry go on arriving, and what a request waits for comes.
 */
class RequestThreads
{
public:
  /** @param private_nh of the node, which is made with it next: it offers its services by this handle. */
  explicit RequestThreads(ros::NodeHandle& private_nh) : spinner_(COUNT, &queue_)
  {
    private_nh.setCallbackQueue(&queue_);
  }

  /** Begins to answer. To be called once the node has been made. */
  void start()
  {
    spinner_.start();
  }
  /** Waits for requests that are being worked on, and answers no more. To be called before the node's end. */
  void stop()
  {
    spinner_.stop();
  }

private:
  static constexpr std::uint32_t COUNT = 3;

  ros::CallbackQueue queue_;
  ros::AsyncSpinner spinner_;
};

/**
 * Answers a node's command line without a master when it asks for help, or has words that are none of ROS, as _rate=5.
 * @return the exit status: 0 when help has been printed, 2 when a word is not understood; nothing when the node may run.
 */
std::optional<int> answerCommandLine(int argc, char** argv, const std::string& name);

/**
 * A node's main(): spins on NODE_THREADS and RequestThreads.
 * @return 1 when the node refuses to start; else as answerCommandLine().
 */
template <typename Node>
int runNode(int argc, char** argv, const std::string& name)
{
  if (const std::optional<int> status = answerCommandLine(argc, argv, name))
  {
    return *status;
  }
  keepFreedMemory();
  ros::init(argc, argv, name);
  const ExitDeadline exit_deadline(&ros::isShuttingDown);
  const ros::NodeHandle nh;  // outlives the node: without any handle, ROS ends and the last messages are lost
  try
  {
    ros::NodeHandle private_nh("~");
    RequestThreads requests(private_nh);
    Node node(nh, private_nh);
    requests.start();
    ros::MultiThreadedSpinner(NODE_THREADS).spin();
    requests.stop();
    return 0;
  }
  catch (const std::exception& error)
  {
    ROS_FATAL_STREAM(error.what());
    return 1;
  }
}

}  // namespace view_servo
