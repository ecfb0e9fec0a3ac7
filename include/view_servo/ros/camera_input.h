// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ros/camera_faults.h"
#include "view_servo/ros/camera_image.h"
#include "view_servo/ros/parameters.h"

#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <message_filters/subscriber.h>
#include <message_filters/time_synchronizer.h>
#include <ros/node_handle.h>
#include <ros/steady_timer.h>
#include <sensor_msgs/CameraInfo.h>

#include <chrono>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

namespace view_servo
{
/** An image with its calibration. */
struct CameraFrame
{
  CameraImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
};

/** Options of a node's camera. */
struct CameraInputParams
{
  std::string image_transport = "raw";  ///< how images travel; image_transport itself reads the parameter
  int queue_size = 5;          ///< images that wait for the camera_info with their stamp, and the other way round
  double max_image_age = 1.0;  ///< an image older than this counts as missing [s]
};

/** Names, units, ranges and meanings of these parameters. */
std::vector<Parameter> parameters(CameraInputParams& params);

/**
 * A node's camera: the newest image that comes with a calibration of the same stamp.
 *
 * Subscribes to `image_raw` (sensor_msgs/Image, or what `image_transport` makes of it, see CameraImageSubscriber) and
 * `camera_info` (sensor_msgs/CameraInfo), each of which can be remapped by itself.
 *
 * A frame that cannot be used (camera not calibrated, or calibrated for another size) is dropped, with a throttled
 * error that names both topics. A similar error tells of images and camera_info that never have the same stamp. An
 * image from the future is as bad as an old one: time jumped back, as when a bag loops. A compressed image whose data
 * cannot be decoded is left out, with a throttled error; those before and after it count.
 */
class CameraInput
{
public:
  using Callback = std::function<void(const CameraFrame&)>;

  /**
   * Both functions are called by a spinner's thread, and have to be quick.
   * @param on_frame called with every usable frame. @param on_problem called for every other frame, and for images
   * without calibrations, with what is wrong. @throws std::invalid_argument when there is no such transport.
   */
  CameraInput(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const CameraInputParams& params,
              Callback on_frame = Callback(), std::function<void(const std::string&)> on_problem = {});

  /** @throws ImageError, saying why, when there is no usable frame or it is too old. */
  CameraFrame latest() const;

  /**
   * Sets `frame` to latest(). @param before a frame that does not count, as it was there before.
   * @return why there is no such frame, in one line; empty when there is.
   */
  std::string missing(CameraFrame& frame, const CameraFrame& before = CameraFrame()) const;
  /** Why the newest image is not usable (see above), however old it is; empty when it is, or when none has come. */
  std::string fault() const;
  /** Why no usable frame comes, in one line; empty while nothing is known. */
  std::string problem() const;

  /**
   * For a node that seldom needs an image: the topics are unsubscribed `idle` [s] after the last call of latest(double)
   * or this, and subscribed again by the next call of latest(double).
   */
  void connectWhenAsked(double idle);

  /**
   * Waits for latest(), as a camera may start later than its node. The wait is by a steady clock, and logged. Not to be
   * called by the threads that deliver images.
   * @param patience longest wait [s]. @throws ImageError when there is still no usable frame after that time.
   */
  CameraFrame latest(double patience);

  /** Resolved name of the topic that images come on. */
  std::string imageTopic() const
  {
    return topics_.image;
  }

  /** Fills in a part of `/diagnostics`: whether usable frames come, at which rate, and problem(). */
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

private:
  using Synchronizer = message_filters::TimeSynchronizer<CameraImage, sensor_msgs::CameraInfo>;

  std::unique_ptr<Synchronizer> makeSynchronizer();
  /** Hands a message to the synchronizer by `add`; to a new one when the old one has long found no pair. */
  void pair(const std::function<void(Synchronizer&)>& add);
  void frameCallback(const CameraImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info);
  void onImage(const ros::Time& stamp);
  void onInfo(const ros::Time& stamp);
  /** Remembers that no pairs come, if so. @return what to report. The mutex is held. */
  std::string noteUnpaired(const std::optional<CameraTraffic>& traffic);
  /** Logs a problem and hands it on; nothing when it is empty. The mutex is not held. */
  void reportProblem(const std::string& problem) const;
  void onPair(const CameraImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info);
  void checkInputs();
  /** Subscribes both topics. connection_mutex_ is held. */
  void connect();
  /** Unsubscribes both, and forgets what came, when nobody has asked for long. */
  void letGo();

  const ros::NodeHandle nh_;
  const ros::NodeHandle private_nh_;
  const CameraInputParams params_;
  Callback on_frame_;
  std::function<void(const std::string&)> on_problem_;

  mutable std::mutex connection_mutex_;  // guards what follows, up to the next mutex; taken before the others
  double idle_ = std::numeric_limits<double>::infinity();  // see connectWhenAsked()
  bool connected_ = false;
  int waiting_ = 0;                              // callers that wait for an image
  std::chrono::steady_clock::time_point asked_;  // last

  mutable std::mutex mutex_;  // guards what follows, up to the other mutex
  CameraFrame latest_;
  std::string fault_;    // of the last pair
  std::string problem_;  // why the last frame was not usable, or none came
  PairingWatch pairing_;
  int images_ = 0;     // images that have come since the last check
  int infos_ = 0;      // messages on camera_info that have come since the last check
  int pairs_ = 0;      // images and camera_info with one stamp, since the last check
  double rate_ = 0.0;  // of usable frames [Hz]
  int frames_ = 0;     // usable, since the last diagnosis
  std::chrono::steady_clock::time_point last_diagnosis_;

  std::mutex pairing_mutex_;  // guards what follows, up to the transport; taken before mutex_
  int unpaired_ = 0;          // messages since the last pair
  std::unique_ptr<Synchronizer> synchronizer_;

  CameraImageSubscriber image_subscriber_;
  message_filters::Subscriber<sensor_msgs::CameraInfo> info_subscriber_;
  CameraTopics topics_;  // as resolved at first
  ros::SteadyTimer check_timer_;
  ros::SteadyTimer idle_timer_;
};

}  // namespace view_servo
