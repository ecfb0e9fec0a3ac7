// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/MatchPoints.h"
#include "view_servo/PointMatches.h"
#include "view_servo/SetView.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/views/overlay.h"
#include "view_servo/views/view_cache.h"
#include "view_servo/views/view_matcher.h"

#include <image_transport/image_transport.h>
#include <sensor_msgs/image_encodings.h>

#include <chrono>
#include <condition_variable>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

namespace view_servo
{
namespace
{
GeometryModel toModel(const std::string& name)
{
  if (name.empty() || name == "homography")
  {
    return GeometryModel::HOMOGRAPHY;
  }
  if (name == "fundamental")
  {
    return GeometryModel::FUNDAMENTAL;
  }
  throw std::invalid_argument("model: '" + name + "' is neither homography nor fundamental");
}

struct PointMatcherNodeParams
{
  CameraInputParams camera;
  ImageSourceParams sources;
  ViewMatcherParams matcher;
  std::string view;
  double rate = 5.0;

  /** @throws std::invalid_argument listing all faults. */
  static PointMatcherNodeParams read(const ros::NodeHandle& private_nh)
  {
    PointMatcherNodeParams params;
    ParameterReader reader(private_nh);
    params.camera = CameraInputParams::read(reader);
    params.sources = ImageSourceParams::read(reader);
    reader.read("view", params.view);
    reader.require(params.view.empty() || isValidViewName(params.view),
                   "~view: '" + params.view + "' is not a view's name");
    reader.read("rate", params.rate);
    reader.require(params.rate >= 0.001, "~rate must be at least 0.001 [Hz]");
    params.matcher = readMatcherParams(reader);
    reader.finish();
    return params;
  }
};

}  // namespace

/**
 * Matches images by the intensity profiles between their corners: two given ones on request, and, when a view is set,
 * each camera image with that stored view.
 *
 * Parameters, all private; config/point_matcher.yaml has them with their ranges:
 *  - `~view` (string, default ""): stored view that camera images are matched with; "" = none;
 *  - `~rate` (double, default 5.0 [Hz], >= 0.001): camera images are matched at most this often;
 *  - `~views_dir`, `~allow_paths`: see ImageSourceReader;
 *  - `~image_transport`, `~queue_size`, `~max_image_age`: see CameraInput;
 *  - those of the matcher, see matcherParameters().
 *
 * Subscribes:
 *  - `image_raw` (sensor_msgs/Image), `camera_info` (sensor_msgs/CameraInfo).
 *
 * Publishes:
 *  - `point_matches` (view_servo/PointMatches): for each image matched, with the image's header; nothing when the view
 *    cannot be read or the camera is not calibrated;
 *  - `overlay` (sensor_msgs/Image, bgr8): reference and image side by side; drawn when somebody listens;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, camera and matching.
 *
 * Services:
 *  - `~match` (view_servo/MatchPoints): matches two images;
 *  - `~set_view` (view_servo/SetView): sets or, with "", unsets the view; refused when it cannot be read.
 *
 * Camera images are matched by a thread of the node's own, which always takes the newest: matching takes longer than
 * the time between two images, and in a subscriber's callback they would queue up and grow old. For the same reason it
 * rests while nobody listens. Its clock is steady, so that neither a paused nor a looping bag changes its pace.
 */
class PointMatcherNode : private NodeBase
{
public:
  PointMatcherNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : NodeBase(nh, private_nh),
      params_(PointMatcherNodeParams::read(private_nh)),
      matcher_(params_.matcher),
      view_(params_.view),
      camera_(nh, params_.camera, [this](const CameraFrame& frame) { take(frame); }),
      sources_(params_.sources, camera_),
      views_(sources_.store(), params_.matcher.points),
      transport_(nh)
  {
    matches_publisher_ = nh_.advertise<PointMatches>("point_matches", 1);
    overlay_publisher_ = transport_.advertise("overlay", 1);
    match_service_ = serve("match", &PointMatcherNode::match, this);
    set_view_service_ = serve("set_view", &PointMatcherNode::setView, this);
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    diagnostics_.add("matching", this, &PointMatcherNode::diagnose);
    ROS_INFO_STREAM("stored views are in " << sources_.store().directory());
    worker_ = std::thread([this] { work(); });
  }

  ~PointMatcherNode()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    worker_.join();
  }

private:
  void match(const MatchPoints::Request& request, MatchPoints::Response& response)
  {
    constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
    copyRowMajor(Eigen::Matrix3d::Constant(NOT_A_NUMBER), response.model_matrix);
    response.rms_error = NOT_A_NUMBER;
    const GeometryModel model = toModel(request.model);
    if (!(request.inlier_threshold >= 0.0 && request.inlier_threshold < std::numeric_limits<double>::infinity()))
    {
      throw std::invalid_argument("inlier_threshold: must be a number of pixels, or 0 for the node's own");
    }
    std_msgs::Header header;
    const std::shared_ptr<const PreparedImage> reference = prepare(request.reference, "reference", header);
    const std::shared_ptr<const PreparedImage> query = prepare(request.query, "query", header);
    const ViewMatch result = matcher_.match(*reference, *query, model, request.inlier_threshold);

    if (request.overlay)
    {
      response.overlay = toImage(drawOverlay(*reference, *query, result), sensor_msgs::image_encodings::BGR8, header);
    }
    response.success = result.outcome == MatchOutcome::MATCHED;
    response.message = result.message;
    response.matches = toPointMatches(result.matches);
    response.elapsed_ms = result.elapsed_ms;
    if (response.success)
    {
      copyRowMajor(result.matrix, response.model_matrix);
      response.inliers = result.inliers;
      response.rms_error = result.rms_error;
    }
  }

  /** The image of a request; a stored view comes from the cache, with what was computed for it before. */
  std::shared_ptr<const PreparedImage> prepare(const ImageSource& source, const std::string& name,
                                               std_msgs::Header& header)
  {
    if (kindOf(source, name) == SourceKind::VIEW)
    {
      header = std_msgs::Header();
      return views_.get(source.view);
    }
    const SourcedImage image = sources_.read(source, name);
    header = image.header;
    return std::make_shared<const PreparedImage>(image.grey, image.region, params_.matcher.points);
  }

  void setView(const SetView::Request& request, SetView::Response& response)
  {
    if (!request.view.empty())
    {
      views_.get(request.view);
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      view_ = request.view;
      last_result_ = Result();
    }
    response.success = true;
    response.message = request.view.empty() ? "camera images are not matched"
                                            : "camera images are matched with view '" + request.view + "'";
    ROS_INFO_STREAM(response.message);
  }

  void take(const CameraFrame& frame)
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
    const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / params_.rate));
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stopping_)
    {
      wake_.wait(lock, [this] { return stopping_ || (newest_.has_value() && !view_.empty()); });
      if (stopping_)
      {
        break;
      }
      const CameraFrame frame = *newest_;
      newest_.reset();
      const std::string view = view_;
      const Clock::time_point next = Clock::now() + period;
      lock.unlock();
      const Result result = matchFrame(frame, view);
      lock.lock();
      if (view == view_)
      {
        last_result_ = result;
      }
      wake_.wait_until(lock, next, [this] { return stopping_; });
    }
  }

  /** What came of an image, for diagnostics. */
  struct Result
  {
    bool failed = false;
    std::string text = "no image was matched";
  };

  Result matchFrame(const CameraFrame& frame, const std::string& view)
  {
    const bool overlay = overlay_publisher_.getNumSubscribers() > 0;
    if (!overlay && matches_publisher_.getNumSubscribers() == 0)
    {
      return { false, "nobody listens" };
    }
    try
    {
      const std::shared_ptr<const PreparedImage> reference = views_.get(view);
      const PreparedImage current(toGrey(*frame.image, camera_.imageTopic()), cv::Rect(), params_.matcher.points);
      const ViewMatch result = matcher_.match(*reference, current, GeometryModel::HOMOGRAPHY);

      PointMatches message;
      message.header = frame.image->header;
      message.view = view;
      message.matches = toPointMatches(result.matches);
      message.homography = toHomography(result, view, frame.image->header);
      matches_publisher_.publish(message);
      if (overlay)
      {
        overlay_publisher_.publish(
            toImage(drawOverlay(*reference, current, result), sensor_msgs::image_encodings::BGR8, frame.image->header));
      }
      return { false, result.message };
    }
    catch (const std::exception& error)
    {
      const std::string text = oneLine(error);
      ROS_ERROR_STREAM_THROTTLE(10.0, text);
      return { true, text };
    }
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const unsigned char level =
        last_result_.failed ? diagnostic_msgs::DiagnosticStatus::ERROR : diagnostic_msgs::DiagnosticStatus::OK;
    status.summary(level, view_.empty() ? "no view is set" : last_result_.text);
    status.add("View", view_);
  }

  const PointMatcherNodeParams params_;
  const ViewMatcher matcher_;

  std::mutex mutex_;  // guards what follows
  std::condition_variable wake_;
  std::string view_;
  std::optional<CameraFrame> newest_;
  Result last_result_;
  bool stopping_ = false;

  CameraInput camera_;
  ImageSourceReader sources_;
  ViewCache views_;
  image_transport::ImageTransport transport_;
  ros::Publisher matches_publisher_;
  image_transport::Publisher overlay_publisher_;
  ros::ServiceServer match_service_;
  ros::ServiceServer set_view_service_;
  std::thread worker_;
};

}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::runNode<view_servo::PointMatcherNode>(argc, argv, "point_matcher");
}
