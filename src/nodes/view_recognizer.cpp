// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/RecognizeView.h"
#include "view_servo/RecognizedViews.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/live_parameters.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_params.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/steady_wait.h"
#include "view_servo/ros/worker.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_recognizer.h"

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/publisher.h>
#include <ros/service_server.h>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace view_servo
{
namespace
{
using Clock = std::chrono::steady_clock;

constexpr std::size_t READ_AT_ONCE = 5;           // views, after which others may use the index
constexpr std::chrono::milliseconds PAUSE(1000);  // from one look at the store to the next
constexpr std::chrono::milliseconds TURN(5);      // in which others may use the index while it is made

std::vector<RecognizedView> toMessages(const std::vector<CandidateView>& views)
{
  std::vector<RecognizedView> messages;
  for (const CandidateView& view : views)
  {
    RecognizedView message;
    message.view = view.name;
    message.score = view.score;
    message.verified = view.verified;
    message.inliers = view.inliers;
    message.has_pose = static_cast<std::uint8_t>(view.pose.has_value());
    if (view.pose)
    {
      message.pose = toPoseWithCovariance(*view.pose);
    }
    messages.push_back(message);
  }
  return messages;
}

/**
 * What was found, in one line. @param indexed number of views among which the image was looked for.
 * @param behind whether others are still to be indexed, or cannot be read.
 */
std::string describe(const std::vector<CandidateView>& views, std::size_t indexed, bool verified, bool behind)
{
  const std::string among = " among " + std::to_string(indexed) + (indexed == 1 ? " view" : " views");
  if (views.empty())
  {
    return indexed == 0 ? (behind ? "no view is indexed yet" : "there are no stored views")
                        : "nothing in the image is like anything" + among;
  }
  const CandidateView& best = views.front();
  if (best.verified)
  {
    return "view '" + best.name + "'" + among + ", " + std::to_string(best.inliers) + " inliers";
  }
  return (verified ? "no view is verified" + among + "; the most likely is '" : "most likely" + among + ": '") +
         best.name + "'";
}

}  // namespace

/**
 * Says which of the stored views an image shows: an image of a request, and each camera image.
 *
 * Its private parameters: see ViewRecognizerNodeParams; config/view_recognizer.yaml has them with their ranges.
 *
 * Subscribes:
 *  - `image_raw` (sensor_msgs/Image), `camera_info` (sensor_msgs/CameraInfo).
 *
 * Publishes:
 *  - `~recognized` (view_servo/RecognizedViews): for camera images, at most at `~rate` and while somebody subscribes;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, camera and index.
 *
 * Services:
 *  - `~recognize` (view_servo/RecognizeView).
 *
 * `~rate` may be changed while the node runs, see LiveParameters.
 *
 * A thread of its own keeps the index in step with the store, and saves it beside the views, so that it is there at
 * once when the node starts again. Views that were saved a moment ago are indexed before a request is answered.
 */
class ViewRecognizerNode : private NodeBase
{
public:
  ViewRecognizerNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : NodeBase(nh, private_nh),
      params_(readParams<ViewRecognizerNodeParams>(private_nh)),
      camera_(nh, private_nh, params_.camera, [this](const CameraFrame& frame) { onFrame(frame); }),
      sources_(params_.sources, camera_),
      recognizer_(storedViews(sources_.store()), params_.recognition),
      worker_("recognition", [this](std::optional<CameraFrame>&& frame) { recognizeFrame(*frame); })
  {
    publisher_ = private_nh_.advertise<RecognizedViews>("recognized", 1);
    service_ = serve("recognize", &ViewRecognizerNode::recognize, this);
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    diagnostics_.add("index", this, &ViewRecognizerNode::diagnose);
    const std::string anew = recognizer_.loadIndex();
    ROS_INFO_STREAM("stored views are in "
                    << sources_.store().directory() << "; "
                    << (anew.empty() ? std::to_string(recognizer_.size()) + " are in the index" : anew));
    live_parameters_ = std::make_unique<LiveParameters>(private_nh_, liveNumbers());
    indexer_ = std::thread([this] { keepInStep(); });
  }

  ~ViewRecognizerNode()
  {
    giveUp();
    indexer_.join();
  }

  /** What is looked at now, and later, is not verified. */
  void giveUp()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
  }

private:
  /** The parameters that may be changed while the node runs. */
  std::vector<LiveGroup> liveNumbers()
  {
    ViewRecognizerNodeParams started = params_;
    return { liveGroup<ViewRecognizerNodeParams>(started, aroundNow(nodeParameters(started), { "rate" }, LIVE_RATE),
                                                 [this](const ViewRecognizerNodeParams& live) {
                                                   const std::lock_guard<std::mutex> lock(mutex_);
                                                   rate_ = live.rate;
                                                   next_frame_ = Clock::time_point();
                                                 }) };
  }

  void recognize(const RecognizeView::Request& request, RecognizeView::Response& response)
  {
    if (request.max_results < 0)
    {
      throw std::invalid_argument("max_results: " + std::to_string(request.max_results) + " is negative");
    }
    const SourcedImage source = sources_.read(kindOf(request.image, "image"), request.image, "image");
    update(READ_AT_ONCE);
    const std::string behind = whatIsMissing();
    const auto begin = Clock::now();
    const PreparedImage image(source.grey, source.region, recognizer_.features());
    const auto most = static_cast<std::size_t>(std::max(1, request.max_results));
    const std::vector<CandidateView> views =
        recognizer_.recognize(image, most, request.verify, given_up_, source.camera);
    response.elapsed_ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
    response.success = !views.empty() && (views.front().verified || !request.verify);
    response.message = describe(views, recognizer_.size(), request.verify, !behind.empty()) + behind;
    response.views = toMessages(views);
  }

  void onFrame(const CameraFrame& frame)
  {
    if (publisher_.getNumSubscribers() == 0)
    {
      return;
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const Clock::time_point now = Clock::now();
      if (now < next_frame_)
      {
        return;
      }
      next_frame_ = now + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / rate_));
    }
    worker_.put([&frame](std::optional<CameraFrame>& newest) { newest = frame; });
  }

  void recognizeFrame(const CameraFrame& frame)
  {
    RecognizedViews message;
    message.header = frame.image->header;
    std::string text;
    const std::string fault = guarded("a camera image", [&] {
      const PreparedImage image(toGrey(*frame.image), cv::Rect(), recognizer_.features());
      const std::vector<CandidateView> views = recognizer_.recognize(image, 1, true, given_up_, toCamera(*frame.info));
      const std::string behind = whatIsMissing();
      message.views = toMessages(views);
      text = describe(views, recognizer_.size(), true, !behind.empty()) + behind;
      message.reason = !views.empty() && views.front().verified ? "" : text;
    });
    if (given_up_())
    {
      return;
    }
    if (!fault.empty())
    {
      message.views.clear();
      message.reason = text = fault;
    }
    publisher_.publish(message);
    const std::lock_guard<std::mutex> lock(mutex_);
    last_ = text;
  }

  /** What the index lacks, to be appended to a message; empty when it lacks nothing. */
  std::string whatIsMissing()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return (waiting_ == 0 ? "" : "; " + std::to_string(waiting_) + " views are still to be indexed") +
           (unreadable_ == 0 ? "" : "; " + std::to_string(unreadable_) + " cannot be read, see the log") +
           (fault_.empty() ? "" : "; " + fault_);
  }

  /** Brings the index in step with the store, by so many views at most. */
  void update(std::size_t most)
  {
    const ViewRecognizer::Update update = recognizer_.update(most);
    for (const std::string& reason : update.unreadable)
    {
      ROS_WARN_STREAM("a view is not recognized: " << reason);
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    unsaved_ = unsaved_ || update.added > 0 || update.removed > 0;
    waiting_ = update.waiting;
    unreadable_ = update.unusable;
    fault_.clear();
  }

  void keepInStep()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stopping_)
    {
      lock.unlock();
      const std::string fault = guarded("indexing the stored views", [this] { update(READ_AT_ONCE); });
      lock.lock();
      if (!fault.empty())
      {
        fault_ = fault;
      }
      if (fault.empty() && waiting_ > 0)
      {
        waitSteadily(wake_, lock, TURN, [this] { return stopping_.load(); });  // so that requests get their turn
        continue;
      }
      if (unsaved_ && fault.empty())
      {
        unsaved_ = false;  // where it cannot be written, it is tried again after the next change
        lock.unlock();
        const std::string unwritten = guarded("saving the index", [this] { recognizer_.saveIndex(); });
        lock.lock();
        save_fault_ = unwritten;
      }
      waitSteadily(wake_, lock, PAUSE, [this] { return stopping_.load(); });
    }
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::size_t indexed = recognizer_.size();
    const std::lock_guard<std::mutex> lock(mutex_);
    status.summary(diagnostic_msgs::DiagnosticStatus::OK, std::to_string(indexed) + " views are indexed");
    if (unreadable_ > 0)
    {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN,
                          std::to_string(unreadable_) + " cannot be read, see the log");
    }
    if (!save_fault_.empty())
    {
      status.mergeSummary(diagnostic_msgs::DiagnosticStatus::WARN, save_fault_);
    }
    if (!fault_.empty())
    {
      status.summary(diagnostic_msgs::DiagnosticStatus::ERROR, fault_);
    }
    status.add("Views to be indexed", waiting_);
    status.add("Views that cannot be read", unreadable_);
    status.add("Last image", last_);
  }

  const ViewRecognizerNodeParams params_;  // as the node was started

  std::mutex mutex_;  // guards what follows
  double rate_ = params_.rate;
  std::condition_variable wake_;
  Clock::time_point next_frame_;  // before it, camera images are left out
  bool unsaved_ = false;          // the index has changed since it was saved
  std::size_t waiting_ = 0;       // views that are not in the index yet
  std::size_t unreadable_ = 0;    // views that cannot be read
  std::string save_fault_;        // why the index is not saved
  std::string fault_;             // why the store cannot be read
  std::string last_ = "no image was looked at";
  std::atomic<bool> stopping_{ false };
  const std::function<bool()> given_up_ = [this] {
    return stopping_ || !ros::ok();
  };

  CameraInput camera_;
  ImageSourceReader sources_;
  ViewRecognizer recognizer_;
  ros::Publisher publisher_;
  ros::ServiceServer service_;
  Worker<std::optional<CameraFrame>> worker_;
  std::unique_ptr<LiveParameters> live_parameters_;
  std::thread indexer_;
};

const NodeType VIEW_RECOGNIZER = nodeType<ViewRecognizerNode>("view_recognizer");

}  // namespace view_servo
