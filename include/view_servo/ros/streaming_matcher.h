// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/ImageSource.h"
#include "view_servo/SetView.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/live_parameters.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/steady_wait.h"
#include "view_servo/ros/view_choice.h"
#include "view_servo/views/overlay.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_cache.h"
#include "view_servo/views/view_match.h"

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <diagnostic_updater/DiagnosticStatusWrapper.h>
#include <image_transport/image_transport.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <ros/time.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <std_msgs/Header.h>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace view_servo
{
/** @name Default rates of matching camera images [Hz]; a machine of two cores reaches them while other nodes run, too.
 * @{ */
constexpr double POINTS_RATE = 5.0;
constexpr double LINES_RATE = 10.0;
constexpr double SCENE_RATE = 2.0;
/** @} */

/** Parameters of a StreamingMatcher besides those of its `Matching`. */
struct StreamingMatcherParams
{
  CameraInputParams camera;
  ImageSourceParams sources;
  std::string view;           ///< stored view that camera images are matched with; empty: none
  double rate = POINTS_RATE;  ///< camera images are matched at most this often [Hz]

  /** Each fault in one line, those of nested parameters included; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units, ranges and meanings of these parameters. */
std::vector<Parameter> parameters(StreamingMatcherParams& params);

/** One of two images that are matched. */
struct MatchedImage
{
  std::shared_ptr<const PreparedImage> image;
  std_msgs::Header header;       ///< stamp and camera's frame; empty for a stored view and for a file
  std::optional<Camera> camera;  ///< its calibration; empty where the source has none
};

/** What a message about a view says besides the match. */
struct MatchLabel
{
  std_msgs::Header header;  ///< of the camera image
  ChosenView chosen;        ///< which view the message is about, and for which goal
  bool refused = false;     ///< whether the view cannot be matched, whatever the camera sees
};

/**
 * A node that matches images: two given ones on request, and, when a view is chosen, each camera image with that stored
 * view. Parameters, all private: those of parameters(StreamingMatcherParams&), with the rate Matching::RATE by default,
 * and those of Matching.
 *
 * Subscribes:
 *  - `image_raw` (sensor_msgs/Image), `camera_info` (sensor_msgs/CameraInfo);
 *  - `wanted_view` (view_servo/WantedView): the view that a driver wants matched; an empty one ends that.
 *
 * Publishes:
 *  - `~TOPIC` (Matching::Message): for each image matched, with the image's header; nothing while the camera is not
 *    calibrated;
 *  - `~overlay` (sensor_msgs/Image, bgr8): reference and image side by side; drawn when somebody listens;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, camera and matching.
 *
 * Services:
 *  - `~match` (Matching::Service): matches two images;
 *  - `~set_view` (view_servo/SetView): sets or, with "", unsets the view; refused when it cannot be read.
 *
 * The view is chosen by `~view`, by people with `~set_view`, and by a driver with a message on `wanted_view`
 * (view_servo/WantedView); see ViewChoice. Every message says which view and which driver's goal it is about, and why
 * nothing was found. What cannot be matched at all, because there is no such view or it is damaged, is refused by a
 * message at once, and again at `~rate` while images come.
 *
 * Camera images are matched by a thread of the node's own, which always takes the newest: matching takes longer than
 * the time between two images, and in a subscriber's callback they would queue up and grow old. As matching is costly,
 * nothing is matched while nobody subscribes. The pace is kept by a steady clock, so that neither a paused nor a
 * looping bag changes it.
 *
 * `~rate`, and of the parameters of Matching its thresholds, may be changed while the node runs, see LiveParameters:
 * they count from the next image on. What the features of stored views depend on may not, as all would have to be found
 * anew.
 *
 * `Matching` is the way of matching. It has
 *  - `Service`, whose request has reference, query and overlay, whose response success, message, elapsed_ms and
 *    overlay; `Options`, what else a request may ask for, which by default is what camera images get; `Message`, which
 *    is published on `~TOPIC`; the default `RATE` [Hz];
 *  - `Params`, with their table parameters(Params&) and validate(), a constructor that takes those, and
 *    `FeatureParams features() const`;
 *  - `static std::vector<std::string> thresholds()`: names of parameters of what is accepted as a match, all of them
 *    "double", on which features() do not depend;
 *  - `Result`, a ViewMatch, which may have more than that;
 *  - `static void clear(Service::Response&)`, which sets what a refused request leaves unknown;
 *  - `static Options options(const Service::Request&)`, which throws when the request makes no sense;
 *  - `Result match(const MatchedImage& reference, const MatchedImage& current, const Options&, given_up) const`, which
 *    ends early, if it can, once `given_up()` holds;
 *  - `static void fill(const Result&, Service::Response&)`, for the fields that are the service's own; success and
 *    message are set before, and may be changed;
 *  - `static Message toMessage(const Result&, const MatchLabel&)`, whose reason is the match's message when nothing was
 *    found; its own header, view, goal and refused are set afterwards, from the label.
 */
template <typename Matching>
class StreamingMatcher : private NodeBase
{
public:
  /** @throws std::invalid_argument listing all faults of the parameters. */
  StreamingMatcher(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : StreamingMatcher(nh, private_nh, readParams(private_nh, defaults()))
  {
  }

  ~StreamingMatcher()
  {
    giveUp();
    worker_.join();
  }

  /** What is matched now, and later, has found nothing. */
  void giveUp()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
  }

private:
  using Service = typename Matching::Service;

  struct Params
  {
    StreamingMatcherParams node;
    typename Matching::Params matching;

    std::vector<std::string> validate() const
    {
      std::vector<std::string> faults = node.validate();
      const std::vector<std::string> more = matching.validate();
      faults.insert(faults.end(), more.begin(), more.end());
      return faults;
    }

    friend std::vector<Parameter> parameters(Params& params)
    {
      return joined({ parameters(params.node), parameters(params.matching) });
    }
  };

  static Params defaults()
  {
    Params params;
    params.node.rate = Matching::RATE;
    return params;
  }

  /** What diagnostics report of the last image. */
  struct LastResult
  {
    bool failed = false;                        ///< the image could not be matched: an error
    std::string text = "no image was matched";  ///< what came of it, in one line
  };

  StreamingMatcher(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh, const Params& params)
    : NodeBase(nh, private_nh),
      rate_(params.node.rate),
      matching_(std::make_shared<const Matching>(params.matching)),
      features_(matching_->features()),
      camera_(nh, private_nh, params.node.camera, [this](const CameraFrame& frame) { onFrame(frame); }),
      sources_(params.node.sources, camera_),
      views_(sources_.store(), features_),
      transport_(private_nh)
  {
    matches_publisher_ = private_nh_.advertise<typename Matching::Message>(Matching::TOPIC, 1);
    overlay_publisher_ = transport_.advertise("overlay", 1);
    if (!params.node.view.empty())
    {
      choice_.choose(params.node.view);
      onChoice();
    }
    wanted_subscriber_ = subscribe<WantedView>("wanted_view", 5,
                                               [this](const WantedView::ConstPtr& message) { onWantedView(*message); });
    match_service_ = serve("match", &StreamingMatcher::match, this);
    set_view_service_ = serve("set_view", &StreamingMatcher::setView, this);
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    diagnostics_.add("matching", this, &StreamingMatcher::diagnose);
    ROS_INFO_STREAM("stored views are in " << sources_.store().directory());
    worker_ = std::thread([this] { work(); });
    live_parameters_ = std::make_unique<LiveParameters>(private_nh_, liveNumbers(params));
  }

  /** The parameters that may be changed while the node runs. */
  std::vector<LiveGroup> liveNumbers(const Params& params)
  {
    StreamingMatcherParams node = params.node;
    typename Matching::Params matching = params.matching;
    return {
      liveGroup<StreamingMatcherParams>(node, aroundNow(parameters(node), { "rate" }, LIVE_RATE),
                                        [this](const StreamingMatcherParams& live) { rate_ = live.rate; }),
      liveGroup<typename Matching::Params>(matching,
                                           aroundNow(parameters(matching), Matching::thresholds(), LIVE_THRESHOLD),
                                           [this](const typename Matching::Params& live) {
                                             const auto stricter = std::make_shared<const Matching>(live);
                                             const std::lock_guard<std::mutex> lock(mutex_);
                                             matching_ = stricter;
                                           }),
    };
  }

  /** The way of matching by the present thresholds. */
  std::shared_ptr<const Matching> matching()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return matching_;
  }

  void match(const typename Service::Request& request, typename Service::Response& response)
  {
    Matching::clear(response);
    const typename Matching::Options options = Matching::options(request);
    const MatchedImage reference = prepare(request.reference, "reference");
    const MatchedImage query = prepare(request.query, "query");
    const typename Matching::Result result = matching()->match(reference, query, options, given_up_);

    if (request.overlay)
    {
      response.overlay = overlay(*reference.image, *query.image, result, query.header);
    }
    response.success = result.outcome == MatchOutcome::MATCHED;
    response.message = result.message;
    response.elapsed_ms = result.elapsed_ms;
    Matching::fill(result, response);
  }

  /** The image of a request; a stored view comes from the cache, with what was computed for it before. */
  MatchedImage prepare(const ImageSource& source, const std::string& name)
  {
    const SourceKind kind = kindOf(source, name);
    if (kind == SourceKind::VIEW)
    {
      return viewImage(source.view);
    }
    const SourcedImage image = sources_.read(kind, source, name);
    return { std::make_shared<const PreparedImage>(image.grey, image.region, features_), image.header, image.camera };
  }

  MatchedImage viewImage(const std::string& name)
  {
    const CachedView view = views_.get(name);
    return { view.image, std_msgs::Header(), view.stored.camera };
  }

  static sensor_msgs::Image overlay(const PreparedImage& reference, const PreparedImage& current,
                                    const ViewMatch& result, const std_msgs::Header& header)
  {
    return toImage(drawOverlay(reference, current, result), sensor_msgs::image_encodings::BGR8, header);
  }

  void setView(const SetView::Request& request, SetView::Response& response)
  {
    if (!request.view.empty())
    {
      views_.get(request.view);
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      choice_.choose(request.view);
      onChoice();
    }
    response.success = true;
    response.message = request.view.empty() ? "camera images are not matched"
                                            : "camera images are matched with view '" + request.view + "'";
    ROS_INFO_STREAM(response.message);
  }

  void onWantedView(const WantedView& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (choice_.want(message))
    {
      onChoice();
      ROS_INFO_STREAM("wanted: view '" << message.view << "', goal '" << message.goal << "'");
    }
  }

  /** Has the worker turn to the choice that was just made. The mutex is held. */
  void onChoice()
  {
    newest_.reset();  // it may be old
    last_result_ = LastResult();
    renewed_ = true;
    wake_.notify_all();
  }

  void onFrame(const CameraFrame& frame)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      newest_ = frame;
    }
    wake_.notify_all();
  }

  void work()
  {
    using Clock = std::chrono::steady_clock;
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stopping_)
    {
      wake_.wait(lock, [this] { return stopping_ || renewed_ || (newest_ && !choice_.chosen().view.empty()); });
      if (stopping_)
      {
        break;
      }
      renewed_ = false;
      const ChosenView chosen = choice_.chosen();
      if (chosen.view.empty())
      {
        continue;
      }
      const std::optional<CameraFrame> frame = std::exchange(newest_, std::nullopt);
      const std::chrono::duration<double> period(1.0 / rate_);
      const Clock::time_point next = Clock::now() + std::chrono::duration_cast<Clock::duration>(period);
      lock.unlock();
      LastResult result;
      const std::string fault =
          guarded("matching", [&] { result = frame ? matchFrame(*frame, chosen) : check(chosen); });
      lock.lock();
      if (!renewed_)
      {
        last_result_ = fault.empty() ? result : LastResult{ true, fault };
      }
      if (frame)
      {
        waitSteadily(wake_, lock, next, [this] { return stopping_ || renewed_; });
      }
    }
  }

  /** Whether a view can be matched, as far as is known without an image. */
  LastResult check(const ChosenView& chosen)
  {
    try
    {
      views_.get(chosen.view);
      return LastResult();
    }
    catch (const std::exception& error)
    {
      MatchLabel label{ std_msgs::Header(), chosen, true };
      label.header.stamp = ros::Time::now();
      return publishFailure(label, oneLine(error));
    }
  }

  LastResult matchFrame(const CameraFrame& frame, const ChosenView& chosen)
  {
    MatchLabel label{ frame.image->header, chosen, true };
    try
    {
      const MatchedImage reference = viewImage(chosen.view);
      label.refused = false;
      const bool wants_overlay = overlay_publisher_.getNumSubscribers() > 0;
      if (!wants_overlay && matches_publisher_.getNumSubscribers() == 0)
      {
        return { false, "nobody listens" };
      }
      const cv::Mat grey = toGrey(*frame.image);
      const MatchedImage current{ std::make_shared<const PreparedImage>(grey, cv::Rect(), features_), label.header,
                                  toCamera(*frame.info) };
      const typename Matching::Result result =
          matching()->match(reference, current, typename Matching::Options(), given_up_);
      publish(result, label);
      if (wants_overlay)
      {
        overlay_publisher_.publish(boost::make_shared<const sensor_msgs::Image>(
            overlay(*reference.image, *current.image, result, label.header)));
      }
      return { false, result.message };
    }
    catch (const std::exception& error)
    {
      return publishFailure(label, oneLine(error));
    }
  }

  void publish(const typename Matching::Result& result, const MatchLabel& label)
  {
    const auto message = boost::make_shared<typename Matching::Message>(Matching::toMessage(result, label));
    message->header = label.header;
    message->view = label.chosen.view;
    message->goal = label.chosen.goal;
    message->refused = label.refused;
    matches_publisher_.publish(boost::shared_ptr<const typename Matching::Message>(message));
  }

  LastResult publishFailure(const MatchLabel& label, const std::string& reason)
  {
    typename Matching::Result nothing;
    nothing.message = reason;
    publish(nothing, label);
    ROS_ERROR_STREAM_THROTTLE(10.0, "camera images are not matched: " << reason);
    return { true, reason };
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const ChosenView& chosen = choice_.chosen();
    const unsigned char level =
        last_result_.failed ? diagnostic_msgs::DiagnosticStatus::ERROR : diagnostic_msgs::DiagnosticStatus::OK;
    status.summary(level, chosen.view.empty() ? "no view is set" : last_result_.text);
    status.add("View", chosen.view);
    status.add("Goal", chosen.goal);
  }

  std::atomic<double> rate_;
  std::shared_ptr<const Matching> matching_;  // guarded by the mutex
  const FeatureParams features_;              // do not depend on thresholds

  std::mutex mutex_;  // guards what follows
  std::condition_variable wake_;
  ViewChoice choice_;
  bool renewed_ = false;  // the choice, since the worker has looked
  std::optional<CameraFrame> newest_;
  LastResult last_result_;
  std::atomic<bool> stopping_{ false };
  const std::function<bool()> given_up_ = [this] {
    return stopping_ || !ros::ok();
  };

  CameraInput camera_;
  ImageSourceReader sources_;
  ViewCache views_;
  image_transport::ImageTransport transport_;
  ros::Publisher matches_publisher_;
  image_transport::Publisher overlay_publisher_;
  ros::Subscriber wanted_subscriber_;
  ros::ServiceServer match_service_;
  ros::ServiceServer set_view_service_;
  std::thread worker_;
  std::unique_ptr<LiveParameters> live_parameters_;
};

}  // namespace view_servo
