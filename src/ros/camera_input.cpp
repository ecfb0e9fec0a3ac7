// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/camera_input.h"

#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/readiness.h"

#include <ros/console.h>
#include <ros/time.h>

#include <chrono>
#include <cstdint>
#include <exception>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double CHECK_PERIOD = 5.0;   // [s]
constexpr double IDLE_PERIOD = 1.0;    // from one look at whether somebody has asked to the next [s]
constexpr double ERROR_PERIOD = 10.0;  // [s]

double steadySeconds()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

std::vector<Parameter> parameters(CameraInputParams& params)
{
  return {
    text("image_transport", params.image_transport,
         "how camera images travel: raw, compressed, or another image transport that is installed"),
    integer("queue_size", params.queue_size, "", ">= 1",
            "images that wait for the camera_info of their stamp, and the other way round"),
    real("max_image_age", params.max_image_age, "s", "> 0",
         "an image older than this is not the camera's present view"),
  };
}

CameraInput::CameraInput(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const CameraInputParams& params,
                         Callback on_frame, std::function<void(const std::string&)> on_problem)
  : nh_(nh),
    private_nh_(private_nh),
    params_(params),
    on_frame_(std::move(on_frame)),
    on_problem_(std::move(on_problem)),
    pairing_(params.queue_size),
    last_diagnosis_(std::chrono::steady_clock::now()),
    synchronizer_(makeSynchronizer())
{
  image_subscriber_.registerCallback([this](const CameraImageConstPtr& image) {
    pair([&](Synchronizer& synchronizer) { synchronizer.add0(image); });
    onImage(image->header.stamp);
  });
  info_subscriber_.registerCallback([this](const sensor_msgs::CameraInfoConstPtr& info) {
    pair([&](Synchronizer& synchronizer) { synchronizer.add1(info); });
    onInfo(info->header.stamp);
  });
  {
    const std::lock_guard<std::mutex> lock(connection_mutex_);
    connect();
  }
  topics_ = { image_subscriber_.getTopic(), info_subscriber_.getTopic() };
  check_timer_ =
      nh.createSteadyTimer(ros::WallDuration(CHECK_PERIOD), [this](const ros::SteadyTimerEvent&) { checkInputs(); });
}

void CameraInput::connect()
{
  ros::NodeHandle nh(nh_);
  image_subscriber_.subscribe(nh_, private_nh_, "image_raw", params_.image_transport, params_.queue_size);
  info_subscriber_.subscribe(nh, "camera_info", static_cast<std::uint32_t>(params_.queue_size));
  connected_ = true;
}

void CameraInput::connectWhenAsked(double idle)
{
  const std::lock_guard<std::mutex> lock(connection_mutex_);
  idle_ = idle;
  idle_timer_ = ros::NodeHandle(nh_).createSteadyTimer(ros::WallDuration(IDLE_PERIOD),
                                                       [this](const ros::SteadyTimerEvent&) { letGo(); });
  asked_ = std::chrono::steady_clock::now();
}

void CameraInput::letGo()
{
  const std::lock_guard<std::mutex> lock(connection_mutex_);
  if (!connected_ || waiting_ > 0 || secondsSince(asked_) < idle_)
  {
    return;
  }
  image_subscriber_.shutdown();  // waits for what it calls
  info_subscriber_.unsubscribe();
  connected_ = false;
  {
    const std::lock_guard<std::mutex> pairing_lock(pairing_mutex_);
    synchronizer_ = makeSynchronizer();
    unpaired_ = 0;
  }
  const std::lock_guard<std::mutex> input_lock(mutex_);
  latest_ = CameraFrame();
  pairing_ = PairingWatch(params_.queue_size);
  images_ = infos_ = pairs_ = 0;
  fault_.clear();
  problem_.clear();
}

std::unique_ptr<CameraInput::Synchronizer> CameraInput::makeSynchronizer()
{
  auto synchronizer = std::make_unique<Synchronizer>(static_cast<std::uint32_t>(params_.queue_size));
  synchronizer->registerCallback(&CameraInput::frameCallback, this);
  return synchronizer;
}

void CameraInput::pair(const std::function<void(Synchronizer&)>& add)
{
  const std::lock_guard<std::mutex> lock(pairing_mutex_);
  // What was left without a partner before time went back is newer than all that comes, and would be kept instead of it.
  if (++unpaired_ > 4 * params_.queue_size)
  {
    synchronizer_ = makeSynchronizer();
    unpaired_ = 1;
  }
  add(*synchronizer_);
}

std::string CameraInput::fault() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return fault_;
}

std::string CameraInput::problem() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return problem_;
}

void CameraInput::onImage(const ros::Time& stamp)
{
  std::string problem;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++images_;
    problem = noteUnpaired(pairing_.addImage(steadySeconds(), stamp));
  }
  reportProblem(problem);
}

void CameraInput::onInfo(const ros::Time& stamp)
{
  std::string problem;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++infos_;
    problem = noteUnpaired(pairing_.addInfo(steadySeconds(), stamp));
  }
  reportProblem(problem);
}

std::string CameraInput::noteUnpaired(const std::optional<CameraTraffic>& traffic)
{
  return traffic ? problem_ = faultOf(*traffic, topics_) : "";
}

CameraFrame CameraInput::latest() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!latest_.image)
  {
    throw ImageError("no image from the camera: " + (problem_.empty() ? "none came on " + topics_.both() : problem_));
  }
  const std::string fault = faultOfAge(latest_.image->header.stamp, topics_.image, params_.max_image_age);
  if (!fault.empty())
  {
    // What has come since then could not be used.
    throw ImageError(problem_.empty() ? fault : "no usable image from the camera: " + problem_);
  }
  return latest_;
}

std::string CameraInput::missing(CameraFrame& frame, const CameraFrame& before) const
{
  try
  {
    frame = latest();
    return frame.image == before.image ? "no further image has come on '" + imageTopic() + "'" : "";
  }
  catch (const ImageError& error)
  {
    return oneLine(error);
  }
}

CameraFrame CameraInput::latest(double patience)
{
  {
    const std::lock_guard<std::mutex> lock(connection_mutex_);
    if (!connected_)
    {
      connect();
    }
    ++waiting_;
  }
  CameraFrame frame;
  const std::string lacking = waitUntilReady(patience, [&] { return missing(frame); });
  {
    const std::lock_guard<std::mutex> lock(connection_mutex_);
    --waiting_;
    asked_ = std::chrono::steady_clock::now();
  }
  if (!lacking.empty())
  {
    throw ImageError(lacking);
  }
  return frame;
}

void CameraInput::diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
{
  const bool connected = [this] {
    const std::lock_guard<std::mutex> lock(connection_mutex_);
    return connected_;
  }();
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  const double period = std::chrono::duration<double>(now - last_diagnosis_).count();
  rate_ = period > 0.0 ? frames_ / period : 0.0;
  frames_ = 0;
  last_diagnosis_ = now;

  if (!problem_.empty())
  {
    status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, problem_);
  }
  else if (!connected)
  {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "images are subscribed when somebody asks for one");
  }
  else if (rate_ > 0.0)
  {
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, "images arrive");
  }
  else
  {
    status.summary(diagnostic_msgs::DiagnosticStatus::WARN, "no image in the last " + seconds(period));
  }
  status.add("Image topic", topics_.image);
  status.add("Camera info topic", topics_.info);
  status.add("Rate [Hz]", rate_);
}

void CameraInput::frameCallback(const CameraImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info)
{
  unpaired_ = 0;  // pair() holds the mutex
  guarded("an image on '" + imageTopic() + "'", [&] { onPair(image, info); });
}

void CameraInput::onPair(const CameraImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info)
{
  if (!image->fault.empty())
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++pairs_;
      pairing_.addPair();
      problem_ = image->fault;
    }
    reportProblem(image->fault + "; it is left out");
    return;
  }
  const std::string fault = faultOf(*image, *info, topics_);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++pairs_;
    pairing_.addPair();
    fault_ = problem_ = fault;
    latest_ = fault.empty() ? CameraFrame{ image, info } : CameraFrame{};
    frames_ += fault.empty() ? 1 : 0;
  }
  if (!fault.empty())
  {
    ROS_ERROR_STREAM_THROTTLE(ERROR_PERIOD, fault << "; its images are not used");
    if (on_problem_)
    {
      on_problem_(fault);
    }
  }
  else if (on_frame_)
  {
    on_frame_({ image, info });
  }
}

void CameraInput::checkInputs()
{
  std::string problem;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    // Images alone are told of by onImage(), as a calibration may come after its image.
    const CameraTraffic traffic{ images_, infos_, pairs_, CHECK_PERIOD, pairing_.imagesAhead() };
    problem = infos_ > 0 ? faultOf(traffic, topics_) : "";
    const bool silent = images_ + infos_ + pairs_ == 0;
    problem_ = !problem.empty() ? problem : silent && latest_.image ? "" : problem_;
    images_ = infos_ = pairs_ = 0;
  }
  reportProblem(problem);
}

void CameraInput::reportProblem(const std::string& problem) const
{
  if (problem.empty())
  {
    return;
  }
  ROS_ERROR_STREAM_THROTTLE(ERROR_PERIOD, problem);
  if (on_problem_)
  {
    on_problem_(problem);
  }
}

}  // namespace view_servo
