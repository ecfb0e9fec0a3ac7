// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/Homography.h"
#include "view_servo/MatchPoints.h"
#include "view_servo/SetView.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/rectifier.h"
#include "view_servo/tracking/homography_tracker_parameters.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/views/image_io.h"
#include "view_servo/views/overlay.h"
#include "view_servo/views/view_store.h"

#include <image_transport/image_transport.h>
#include <ros/publisher.h>
#include <ros/service.h>
#include <sensor_msgs/image_encodings.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_listener.h>
#include <Eigen/Geometry>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
using Clock = std::chrono::steady_clock;

struct Params
{
  CameraInputParams camera;
  std::filesystem::path views_dir;
  std::string view;
  std::string odom_frame = "base_link";
  double tf_patience = 0.05;
  std::string point_matcher = "point_matcher";
  double match_period = 0.3;
  PlaneTrackerParams tracker;

  static Params read(const ros::NodeHandle& private_nh)
  {
    Params params;
    ParameterReader reader(private_nh);
    params.camera = CameraInputParams::read(reader);
    params.views_dir = readViewsDir(reader);
    reader.read("view", params.view);
    reader.require(params.view.empty() || isValidViewName(params.view),
                   "~view: '" + params.view + "' is not a view's name");
    reader.read("odom_frame", params.odom_frame);
    reader.read("tf_patience", params.tf_patience);
    reader.require(params.tf_patience >= 0.0, "~tf_patience must not be negative [s]");
    reader.read("point_matcher", params.point_matcher);
    reader.require(!params.point_matcher.empty(), "~point_matcher must not be empty");
    reader.read("match_period", params.match_period);
    reader.require(params.match_period > 0.0, "~match_period must be more than 0 s");
    reader.read(homographyTrackerParameters(params.tracker));
    reader.addFaults(params.tracker.validate());
    reader.finish();
    return params;
  }
};

Eigen::Vector2d middleOf(const cv::Rect& rect)
{
  return { rect.x + 0.5 * (rect.width - 1), rect.y + 0.5 * (rect.height - 1) };
}

/** A view that is followed. Only the thread that follows uses what is not const. */
struct Session
{
  Session(const StoredView& stored, const sensor_msgs::CameraInfo& info, const PlaneTrackerParams& params)
    : view(stored.name),
      raw_region(stored.region.empty() ? cv::Rect(cv::Point(), stored.image.size()) : stored.region),
      rectifier(info),
      reference(rectifier.image(stored.image)),
      region(rectifier.region(raw_region))
  {
    reset(params);
  }

  /** Forgets what was found. */
  void reset(const PlaneTrackerParams& params)
  {
    tracker = std::make_unique<PlaneTracker>(reference, region, rectifier.k(), params);
    last_stamp = ros::Time();
    last_h.reset();
    path.clear();
  }

  /** Where the middle of the region is now. */
  void addToPath()
  {
    constexpr std::size_t LONGEST = 300;
    path.push_back(transfer(*last_h, middleOf(region)));
    if (path.size() > LONGEST)
    {
      path.erase(path.begin());
    }
  }

  const std::string view;
  const cv::Rect raw_region;
  const Rectifier rectifier;
  const cv::Mat reference;  // without distortion, as all that follows
  const cv::Rect region;
  std::unique_ptr<PlaneTracker> tracker;
  ros::Time last_stamp;
  std::optional<Eigen::Matrix3d> last_h;  // where the plane was tracked last
  Points path;                            // of the region's middle, the point that servo_25d leads [px]
};

/** What the point matcher is asked for: where the view is in an image. */
struct Question
{
  std::uint64_t generation;
  std::string view;
  cv::Rect region;
  sensor_msgs::ImageConstPtr image;
  std::optional<Eigen::Isometry3d> camera_in_odom;
  std::optional<Eigen::Matrix3d> last_h;
};

/** What it has answered. */
struct Answer
{
  std::uint64_t generation;
  std::optional<Eigen::Matrix3d> h;  // raw pixels; empty: not found
  Correspondences inliers;           // raw pixels
  std::string reason;                // why it was not found
  std::optional<Eigen::Isometry3d> camera_in_odom;
};

/** The corners of a rectangle of pixels, moved by a homography; NaN beyond the horizon. */
std::array<Eigen::Vector2d, 4> movedCorners(const cv::Rect& rect, const Eigen::Matrix3d& h)
{
  const double right = rect.x + rect.width - 1.0;
  const double bottom = rect.y + rect.height - 1.0;
  return { transfer(h, Eigen::Vector2d(rect.x, rect.y)), transfer(h, Eigen::Vector2d(right, rect.y)),
           transfer(h, Eigen::Vector2d(right, bottom)), transfer(h, Eigen::Vector2d(rect.x, bottom)) };
}

/** Whether two homographies show a region in different places: their middles are apart by half its size. */
bool isElsewhere(const cv::Rect& region, const Eigen::Matrix3d& h, const Eigen::Matrix3d& other)
{
  const Eigen::Vector2d centre = middleOf(region);
  const std::array<Eigen::Vector2d, 4> corners = movedCorners(region, h);
  const double size = 0.5 * ((corners[2] - corners[0]).norm() + (corners[3] - corners[1]).norm());
  return !((transfer(h, centre) - transfer(other, centre)).norm() < 0.25 * size);
}

/** The image with the region painted over where a homography shows it. */
cv::Mat withoutRegion(const cv::Mat& grey, const cv::Rect& region, const Eigen::Matrix3d& h)
{
  std::vector<cv::Point> polygon;
  for (const Eigen::Vector2d& corner : movedCorners(region, h))
  {
    const Eigen::Vector2d at = corner.cwiseMax(-1e4).cwiseMin(1e4);
    polygon.emplace_back(cvRound(at.x()), cvRound(at.y()));
  }
  cv::Mat mask(grey.size(), CV_8UC1, cv::Scalar(0));
  cv::fillConvexPoly(mask, polygon, cv::Scalar(255));
  cv::Mat painted = grey.clone();
  painted.setTo(cv::mean(grey, mask), mask);
  return painted;
}

std::string nameOf(TrackingState state)
{
  return state == TrackingState::TRACKING ? "tracking" : state == TrackingState::LOST ? "lost" : "searching";
}

}  // namespace

/**
 * Follows the plane of a stored view through the images of a moving camera, and tells its homography, the camera's motion
 * from the view and the plane itself. Parameters, all private; config/homography_tracker.yaml has them with their ranges:
 *  - `~view` (string, default ""): stored view that is followed as soon as there are images, without ~start;
 *  - `~views_dir` (string): as in view_store;
 *  - `~odom_frame` (string, default "base_link"): frame that does not jump, which tf knows the camera's frame in; "": none;
 *  - `~tf_patience` (double, default 0.05 [s]): time that an image waits for tf;
 *  - `~point_matcher` (string, default "point_matcher"): node whose `~match` finds the view anew;
 *  - `~match_period` (double, default 0.3 [s]): between two requests to it;
 *  - `~image_transport`, `~queue_size`, `~max_image_age`: see CameraInput;
 *  - those of tracking, see homographyTrackerParameters().
 *
 * Subscribes:
 *  - `image_raw`, `camera_info`: see CameraInput; tf.
 *
 * Publishes:
 *  - `homography` (view_servo/Homography): for each image, with its header. Pixels are those of the images as they come, or,
 *    when camera_info has distortion, of rectified ones, with P's K;
 *  - `overlay` (sensor_msgs/Image, bgr8): the view's outline and points, and the path of its middle; drawn when somebody listens;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, camera and tracking.
 *
 * Services:
 *  - `~start` (view_servo/SetView): follows a view from now on. Refused, and what was followed before goes on, when the view
 *    cannot be read or has another size than the images, the camera is not calibrated, tf does not know it in `~odom_frame`,
 *    or there is no point matcher;
 *  - `~stop` (std_srvs/Trigger).
 *
 * One thread follows and always takes the newest image; another one asks the point matcher, for as long as the plane is
 * not tracked, so that images go on meanwhile. A view that the image shows twice is not followed: nobody knows which is meant.
 */
class HomographyTrackerNode : private NodeBase
{
public:
  HomographyTrackerNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : NodeBase(nh, private_nh),
      params_(Params::read(private_nh)),
      match_service_(nh_.resolveName(params_.point_matcher + "/match")),
      store_(params_.views_dir),
      transforms_(tf_buffer_),
      camera_(nh, params_.camera, [this](const CameraFrame& frame) { take(frame); }),
      transport_(nh)
  {
    homography_publisher_ = nh_.advertise<Homography>("homography", 5);
    overlay_publisher_ = transport_.advertise("overlay", 1);
    start_service_ = serve("start", &HomographyTrackerNode::start, this);
    stop_service_ = serve("stop", &HomographyTrackerNode::stop, this);
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    diagnostics_.add("tracking", this, &HomographyTrackerNode::diagnose);
    if (!params_.view.empty())
    {
      view_timer_ =
          nh_.createWallTimer(ros::WallDuration(0.5), [this](const ros::WallTimerEvent&) { startWithoutBeingTold(); });
    }
    follower_ = std::thread([this] { follow(); });
    asker_ = std::thread([this] { ask(); });
  }

  ~HomographyTrackerNode()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    follower_.join();
    asker_.join();
  }

private:
  // ------------------------------------------------------------------------------------------------------ services

  void start(const SetView::Request& request, SetView::Response& response)
  {
    start(request.view);
    response.success = true;
    response.message = "follows view '" + request.view + "'";
    ROS_INFO_STREAM(response.message);
  }

  void startWithoutBeingTold()
  {
    try
    {
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (generation_ > 0)  // somebody has told
        {
          view_timer_.stop();
          return;
        }
      }
      start(params_.view);
      ROS_INFO_STREAM("follows view '" << params_.view << "'");
    }
    catch (const std::exception& error)
    {
      ROS_WARN_STREAM_THROTTLE(5.0, "view '" << params_.view << "' is not followed: " << oneLine(error));
    }
  }

  void start(const std::string& view)
  {
    const StoredView stored = store_.load(view);
    const CameraFrame frame = awaitFrame();
    if (stored.image.cols != static_cast<int>(frame.image->width) ||
        stored.image.rows != static_cast<int>(frame.image->height))
    {
      throw std::runtime_error("view '" + stored.name + "' has " + std::to_string(stored.image.cols) + " x " +
                               std::to_string(stored.image.rows) + " pixels, the camera " +
                               std::to_string(frame.image->width) + " x " + std::to_string(frame.image->height));
    }
    if (!ros::service::exists(match_service_, false))
    {
      throw std::runtime_error("there is no " + match_service_ + " to find the view by");
    }
    requireOdometry(frame.image->header.frame_id);
    auto session = std::make_shared<Session>(stored, *frame.info, params_.tracker);
    const std::lock_guard<std::mutex> lock(mutex_);
    begin(std::move(session));
  }

  void stop(const std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    response.success = true;
    response.message = session_ ? "view '" + session_->view + "' is not followed any more" : "no view was followed";
    begin(nullptr);
    ROS_INFO_STREAM(response.message);
  }

  /** The latest image; just after the start it may take a moment. @throws ImageError as CameraInput::latest(). */
  CameraFrame awaitFrame() const
  {
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(1.0);
    while (ros::WallTime::now() < deadline)
    {
      try
      {
        return camera_.latest();
      }
      catch (const ImageError&)
      {
        ros::WallDuration(0.02).sleep();
      }
    }
    return camera_.latest();
  }

  /** @throws std::runtime_error when tf does not get to know the camera. */
  void requireOdometry(const std::string& camera_frame) const
  {
    constexpr double PATIENCE = 0.5;  // [s]
    std::string error;
    if (!params_.odom_frame.empty() && !waitForTransform(camera_frame, ros::Time(0), PATIENCE, error))
    {
      throw std::runtime_error("tf does not know the camera's frame '" + camera_frame + "' in ~odom_frame '" +
                               params_.odom_frame + "': " + error);
    }
  }

  /** Follows another view, or none. The mutex is held. */
  void begin(std::shared_ptr<Session> session)
  {
    session_ = std::move(session);
    ++generation_;
    newest_.reset();
    question_.reset();
    answer_.reset();
    next_question_ = Clock::now();
    state_ = TrackingState::SEARCHING;
    reason_ = session_ ? "looks for the view" : "no view is followed";
    points_ = 0;
  }

  // -------------------------------------------------------------------------------------------------------- images

  void take(const CameraFrame& frame)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      newest_ = frame;
    }
    wake_.notify_all();
  }

  void follow()
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stopping_)
    {
      wake_.wait(lock, [this] { return stopping_ || (newest_ && session_); });
      if (stopping_)
      {
        break;
      }
      const CameraFrame frame = *std::exchange(newest_, std::nullopt);
      const std::shared_ptr<Session> session = session_;
      const std::uint64_t generation = generation_;
      std::optional<Answer> answer = std::exchange(answer_, std::nullopt);
      if (answer && answer->generation != generation)
      {
        answer.reset();
      }
      lock.unlock();
      try
      {
        process(*session, frame, answer, generation);
      }
      catch (const std::exception& error)
      {
        ROS_ERROR_STREAM_THROTTLE(10.0, oneLine(error));
      }
      lock.lock();
    }
  }

  void process(Session& session, const CameraFrame& frame, std::optional<Answer> answer, std::uint64_t generation)
  {
    const Clock::time_point begin_time = Clock::now();
    const std_msgs::Header& header = frame.image->header;
    if (!session.rectifier.isOf(*frame.info))
    {
      const std::string reason = "the camera's calibration has changed: call ~start again";
      ROS_ERROR_STREAM_THROTTLE(10.0, reason);
      tell(session, PlaneTrack(), header, generation, reason);
      return;
    }
    const cv::Mat image = session.rectifier.image(toGrey(*frame.image, camera_.imageTopic()));
    const ros::Duration tolerance(0.5);
    if (header.stamp + tolerance < session.last_stamp)
    {
      ROS_WARN_STREAM("time has gone back in images: the view is looked for anew");
      session.reset(params_.tracker);
      answer.reset();
      const std::lock_guard<std::mutex> lock(mutex_);
      if (generation != generation_)
      {
        return;
      }
      generation = ++generation_;  // what is asked is of another time
      state_ = TrackingState::SEARCHING;
      reason_ = "looks for the view";
    }
    session.last_stamp = header.stamp;
    const std::optional<Eigen::Isometry3d> camera_in_odom = cameraInOdom(header);
    if (answer)
    {
      heed(session, *answer);
    }
    const PlaneTrack& track = session.tracker->add(image, camera_in_odom);
    if (track.state == TrackingState::TRACKING)
    {
      session.last_h = track.homography.h;
      session.addToPath();
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (generation != generation_)
      {
        return;
      }
      note(track, answer);
      if (track.state != TrackingState::TRACKING && !asking_ && Clock::now() >= next_question_)
      {
        asking_ = true;
        question_ =
            Question{ generation, session.view, session.raw_region, frame.image, camera_in_odom, session.last_h };
        wake_.notify_all();
      }
    }
    tell(session, track, header, generation, reason());
    draw(session, track, image, header);
    const std::lock_guard<std::mutex> lock(mutex_);
    const double ms = 1e3 * std::chrono::duration<double>(Clock::now() - begin_time).count();
    images_ += 1;
    ms_sum_ += ms;
    ms_max_ = std::max(ms_max_, ms);
  }

  /** Starts tracking where the point matcher has found the view. */
  static void heed(Session& session, const Answer& answer)
  {
    std::optional<Eigen::Matrix3d> h = answer.h;
    if (h && session.rectifier.active())
    {
      Correspondences pairs;
      for (const Correspondence& pair : answer.inliers)
      {
        pairs.push_back({ session.rectifier.point(pair.reference), session.rectifier.point(pair.current) });
      }
      h = homographyFromPoints(pairs);
    }
    if (h)
    {
      session.tracker->start(*h, answer.camera_in_odom);
    }
  }

  /** For logs, diagnostics and messages. The mutex is held. */
  void note(const PlaneTrack& track, const std::optional<Answer>& answer)
  {
    const TrackingState before = std::exchange(state_, track.state);
    points_ = track.homography.supporting;
    if (track.state == TrackingState::TRACKING)
    {
      reason_.clear();
      if (before != TrackingState::TRACKING)
      {
        ROS_INFO_STREAM("view '" << session_->view << "' is tracked by " << points_ << " points");
      }
      return;
    }
    if (before == TrackingState::TRACKING)
    {
      ROS_WARN_STREAM("view '" << session_->view << "' is not in the image: asks " << match_service_);
      reason_ = "the view is not in the image";
    }
    if (answer)
    {
      reason_ = answer->h ? "the view cannot be tracked where it was found" : answer->reason;
      ROS_INFO_STREAM_THROTTLE(5.0, "view '" << session_->view << "' is not found: " << reason_);
    }
  }

  std::string reason()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return reason_;
  }

  void tell(const Session& session, const PlaneTrack& track, const std_msgs::Header& header, std::uint64_t generation,
            const std::string& reason)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (generation == generation_)  // else another view is followed by now
    {
      homography_publisher_.publish(toHomography(track, session.view, header, reason));
    }
  }

  void draw(const Session& session, const PlaneTrack& track, const cv::Mat& image, const std_msgs::Header& header)
  {
    if (overlay_publisher_.getNumSubscribers() == 0)
    {
      return;
    }
    FollowedView view;
    view.region = session.region;
    view.h = track.homography.h;
    view.found = track.homography.points;
    view.path = session.path;
    for (const Eigen::Vector2d& point : session.tracker->points())
    {
      if (std::find(view.found.begin(), view.found.end(), point) == view.found.end())
      {
        view.missing.push_back(point);
      }
    }
    const std::string why = reason();
    view.text = session.view + ": " + nameOf(track.state);
    view.text += why.empty() ? ", " + std::to_string(track.homography.supporting) + " of " +
                                   std::to_string(track.homography.looked_for) + " points"
                             : ": " + why;
    overlay_publisher_.publish(toImage(drawFollowedView(image, view), sensor_msgs::image_encodings::BGR8, header));
  }

  // ------------------------------------------------------------------------------------------------------ odometry

  /** tf2's own timeout is on ROS time and does not end while that stands still. */
  bool waitForTransform(const std::string& camera_frame, const ros::Time& stamp, double patience,
                        std::string& error) const
  {
    const ros::WallTime deadline = ros::WallTime::now() + ros::WallDuration(patience);
    while (!tf_buffer_.canTransform(params_.odom_frame, camera_frame, stamp, &error))
    {
      if (ros::WallTime::now() >= deadline)
      {
        return false;
      }
      ros::WallDuration(0.002).sleep();
      error.clear();
    }
    return true;
  }

  /** Where the camera was when an image was taken; empty where tf does not know. */
  std::optional<Eigen::Isometry3d> cameraInOdom(const std_msgs::Header& header) const
  {
    if (params_.odom_frame.empty())
    {
      return std::nullopt;
    }
    std::string error;
    try
    {
      if (waitForTransform(header.frame_id, header.stamp, params_.tf_patience, error))
      {
        return toIsometry(tf_buffer_.lookupTransform(params_.odom_frame, header.frame_id, header.stamp).transform);
      }
    }
    catch (const tf2::TransformException& exception)
    {
      error = exception.what();
    }
    ROS_WARN_STREAM_THROTTLE(5.0, "tf does not know '"
                                      << header.frame_id << "' in '" << params_.odom_frame
                                      << "' at the image's time; it is followed without odometry: " << error);
    return std::nullopt;
  }

  // ------------------------------------------------------------------------------------------------- point matching

  void ask()
  {
    const auto period =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(params_.match_period));
    std::unique_lock<std::mutex> lock(mutex_);
    while (!stopping_)
    {
      wake_.wait(lock, [this] { return stopping_ || question_; });
      if (stopping_)
      {
        break;
      }
      const Question question = *std::exchange(question_, std::nullopt);
      next_question_ = Clock::now() + period;
      lock.unlock();
      Answer answer = answerOf(question);
      lock.lock();
      asking_ = false;
      answer_ = std::move(answer);
    }
    asking_ = false;
  }

  Answer answerOf(const Question& question) const
  {
    constexpr double RIVALRY = 0.5;  // of the inliers
    Answer answer{ question.generation, std::nullopt, {}, "", question.camera_in_odom };
    try
    {
      const MatchPoints::Response first = match(question.view, *question.image, answer.reason);
      if (first.success == 0)
      {
        return answer;
      }
      const Eigen::Matrix3d h = homographyOf(first);
      const bool expected = question.last_h && !isElsewhere(question.region, h, *question.last_h);
      if (!expected)
      {
        const cv::Mat rest = withoutRegion(toGrey(*question.image, "image"), question.region, h);
        std::string ignored;
        const MatchPoints::Response second =
            match(question.view, toImage(rest, sensor_msgs::image_encodings::MONO8, question.image->header), ignored);
        if (second.success != 0 && second.inliers >= RIVALRY * first.inliers &&
            isElsewhere(question.region, h, homographyOf(second)))
        {
          answer.reason = "the view is seen in two places";
          return answer;
        }
      }
      answer.h = h;
      for (const PointMatch& point : first.matches)
      {
        if (point.inlier != 0)
        {
          answer.inliers.push_back({ { point.reference_x, point.reference_y }, { point.current_x, point.current_y } });
        }
      }
    }
    catch (const std::exception& error)
    {
      answer.reason = oneLine(error);
    }
    return answer;
  }

  static Eigen::Matrix3d homographyOf(const MatchPoints::Response& response)
  {
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(response.model_matrix.data());
  }

  MatchPoints::Response match(const std::string& view, const sensor_msgs::Image& image, std::string& reason) const
  {
    MatchPoints service;
    service.request.reference.view = view;
    service.request.query.image = image;
    if (!ros::service::call(match_service_, service))
    {
      service.response.success = 0;
      service.response.message = match_service_ + " does not answer";
    }
    reason = service.response.message;
    return service.response;
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
    const std::lock_guard<std::mutex> lock(mutex_);
    const bool worrying = session_ && state_ != TrackingState::TRACKING;
    status.summary(worrying ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK,
                   session_ ? nameOf(state_) + (reason_.empty() ? "" : ": " + reason_) : reason_);
    status.add("View", session_ ? session_->view : "");
    status.add("Points", points_);
    status.add("Asks the point matcher", asking_);
    status.add("Time an image, mean [ms]", images_ > 0 ? ms_sum_ / images_ : NOT_A_NUMBER);
    status.add("Time an image, largest [ms]", images_ > 0 ? ms_max_ : NOT_A_NUMBER);
    images_ = 0;
    ms_sum_ = ms_max_ = 0.0;
  }

  const Params params_;
  const std::string match_service_;

  std::mutex mutex_;  // guards what follows; never held while an image is worked on or matched
  std::condition_variable wake_;
  std::shared_ptr<Session> session_;
  std::uint64_t generation_ = 0;  // another one for each start, and when time goes back
  std::optional<CameraFrame> newest_;
  std::optional<Question> question_;
  std::optional<Answer> answer_;
  bool asking_ = false;
  Clock::time_point next_question_;
  TrackingState state_ = TrackingState::SEARCHING;
  std::string reason_ = "no view is followed";
  int points_ = 0;
  int images_ = 0;  // since the last diagnosis
  double ms_sum_ = 0.0;
  double ms_max_ = 0.0;
  bool stopping_ = false;

  const ViewStore store_;
  tf2_ros::Buffer tf_buffer_;
  tf2_ros::TransformListener transforms_;
  CameraInput camera_;
  image_transport::ImageTransport transport_;
  ros::Publisher homography_publisher_;
  image_transport::Publisher overlay_publisher_;
  ros::ServiceServer start_service_;
  ros::ServiceServer stop_service_;
  ros::WallTimer view_timer_;
  std::thread follower_;
  std::thread asker_;
};

}  // namespace view_servo

int main(int argc, char** argv)
{
  return view_servo::runNode<view_servo::HomographyTrackerNode>(argc, argv, "homography_tracker");
}
