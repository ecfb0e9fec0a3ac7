// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/Homography.h"
#include "view_servo/SetView.h"
#include "view_servo/control/travelled_way.h"
#include "view_servo/geometry/camera_pose.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/marker_output.h"
#include "view_servo/ros/markers.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_params.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/plane_searcher.h"
#include "view_servo/ros/plane_session.h"
#include "view_servo/ros/session_starter.h"
#include "view_servo/ros/steady_wait.h"
#include "view_servo/ros/timings.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/ros/view_choice.h"
#include "view_servo/tracking/plane_finder.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/tracking/scene_finder.h"
#include "view_servo/tracking/target_tracker.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <image_transport/image_transport.h>
#include <ros/publisher.h>
#include <ros/subscriber.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <std_srvs/Trigger.h>
#include <Eigen/Geometry>
#include <boost/make_shared.hpp>
#include <boost/shared_ptr.hpp>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <variant>

namespace view_servo
{
namespace
{
using Clock = std::chrono::steady_clock;

/** Those of matching have a sub-namespace, as patch_radius and others mean something else in tracking. */
HomographyTrackerNodeParams readTrackerParams(const ros::NodeHandle& private_nh)
{
  HomographyTrackerNodeParams params;
  ParameterReader reader(private_nh);
  reader.read(parameters(params));
  reader.read(parameters(params.matching), "matching");
  reader.addFaults(params.validate());
  reader.addFaults(params.matching.validate(), "matching");
  reader.finish();
  return params;
}

/** What is to be followed. */
struct Task
{
  ChosenView chosen;
  std::uint64_t number = 0;  // counts choices
};

/** The newest image, if the view was not tracked in it. */
struct Unfound
{
  std_msgs::Header header;
  cv::Mat image;  // grey, with distortion
  std::optional<Eigen::Isometry3d> camera_in_odom;
  std::set<TargetTracker::Search> searched;  // kinds of search that have begun in it
};

/** What diagnostics report. */
struct Status
{
  TrackingState state = TrackingState::SEARCHING;
  std::string reason = "no view is followed";
  int points = 0;
  bool scene = false;  // it is followed as one
};

std::string nameOf(TrackingState state)
{
  return state == TrackingState::TRACKING ? "tracking" : state == TrackingState::LOST ? "lost" : "searching";
}

}  // namespace

/**
 * Follows a stored view, of a plane or of a scene with depth, through the images of a moving camera, and publishes its
 * homography, the camera's motion from the view and the plane itself, which is a virtual one for a scene. Private
 * parameters: see HomographyTrackerNodeParams.
 *
 * Subscribes:
 *  - `image_raw`, `camera_info`: see CameraInput; tf;
 *  - `wanted_view` (view_servo/WantedView): the view that a driver wants followed; an empty one ends that.
 *
 * Publishes:
 *  - `~homography` (view_servo/Homography): for each image, with its header, and once more when a search finds the view
 *    in the newest image, in which it was not tracked. Pixels are those of the images as they come, or,
 *    when camera_info has distortion, of rectified ones, with P's K. While images, calibration or tf are lacking, twice
 *    a second, stamped now, with the reason. What cannot be followed (no such view, damaged, of another size than the
 *    images, the camera is not calibrated, or not any more as when it began) is refused, likewise;
 *  - `~camera_pose` (geometry_msgs/PoseWithCovarianceStamped): of the camera in the frame `view_NAME`, where it was at
 *    the view NAME, both as optical frames; while the view is tracked, its distance known and somebody subscribes;
 *  - `~overlay` (sensor_msgs/Image, bgr8): the view's outline and points, and the path of its middle; drawn when
 *    somebody listens;
 *  - `~markers` (visualization_msgs/MarkerArray, latched): plane, view, camera and ways, see markers.h; of each image
 *    while somebody listens, deleted when another view or none is chosen;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, camera and tracking.
 *
 * Services:
 *  - `~start` (view_servo/SetView): follows a view from now on, or as soon as image, calibration and tf are there. What
 *    cannot be followed is refused, and what was followed before goes on;
 *  - `~stop` (std_srvs/Trigger).
 *
 * The newest choice of ~start, ~stop and `wanted_view` counts, see ViewChoice. One thread follows and always takes the
 * newest image; another one looks for the view by its points (PlaneFinder, SceneFinder), for as long as it is not
 * tracked, so that images go on meanwhile.
 */
class HomographyTrackerNode : private NodeBase
{
public:
  HomographyTrackerNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : NodeBase(nh, private_nh),
      params_(readTrackerParams(private_nh)),
      finder_(params_.matching),
      searcher_(finder_, params_.match_period, [this] { onAnswer(); }),
      camera_(nh, private_nh, params_.camera, [this](const CameraFrame& frame) { onFrame(frame); }),
      starter_(nh, params_.sessions, finder_.features(), camera_),
      transport_(private_nh),
      markers_(private_nh)
  {
    homography_publisher_ = private_nh_.advertise<Homography>("homography", 5);
    pose_publisher_ = private_nh_.advertise<geometry_msgs::PoseWithCovarianceStamped>("camera_pose", 5);
    overlay_publisher_ = transport_.advertise("overlay", 1);
    if (!params_.view.empty())
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      choice_.choose(params_.view);
      onChoice(nullptr);
    }
    wanted_subscriber_ = subscribe<WantedView>("wanted_view", 5,
                                               [this](const WantedView::ConstPtr& message) { onWantedView(*message); });
    start_service_ = serve("start", &HomographyTrackerNode::start, this);
    stop_service_ = serve("stop", &HomographyTrackerNode::stop, this);
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    diagnostics_.add("tracking", this, &HomographyTrackerNode::diagnose);
    follower_ = std::thread([this] { follow(); });
  }

  ~HomographyTrackerNode()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stopping_ = true;
    }
    wake_.notify_all();
    follower_.join();
  }

private:
  // ----------------------------------------------------------------------------------------------- what is followed

  void start(const SetView::Request& request, SetView::Response& response)
  {
    SessionStarter::Preparation preparation = starter_.prepare(request.view);
    if (preparation.refused)
    {
      throw std::runtime_error(preparation.reason);
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      choice_.choose(request.view);
      onChoice(std::move(preparation.session));
    }
    response.success = true;
    response.message = "follows view '" + request.view + "'" +
                       (preparation.reason.empty() ? "" : " as soon as it can: " + preparation.reason);
    ROS_INFO_STREAM(response.message);
  }

  void stop(const std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::string view = choice_.chosen().view;
    choice_.choose("");
    onChoice(nullptr);
    response.success = true;
    response.message = view.empty() ? "no view was followed" : "view '" + view + "' is not followed any more";
    ROS_INFO_STREAM(response.message);
  }

  void onWantedView(const WantedView& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (choice_.want(message))
    {
      onChoice(nullptr);
      ROS_INFO_STREAM("wanted: view '" << message.view << "', goal '" << message.goal << "'");
    }
  }

  /** Has the follower turn to the choice just made. The mutex is held. @param session null: not prepared yet. */
  void onChoice(std::unique_ptr<PlaneSession> session)
  {
    prepared_ = std::move(session);
    ++task_number_;
    newest_.reset();
    status_ = Status();
    markers_.clear();
    if (!choice_.chosen().view.empty())
    {
      status_.reason = LOOKS_FOR_IT;
    }
    wake_.notify_all();
  }

  // ------------------------------------------------------------------------------------------------------ following

  void onFrame(const CameraFrame& frame)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      newest_ = frame;
    }
    wake_.notify_all();
  }

  void onAnswer()
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      answered_ = true;
    }
    wake_.notify_all();
  }

  void follow()
  {
    Task task;
    std::unique_lock<std::mutex> lock(mutex_);
    const auto due = [&] {
      return stopping_ || task.number != task_number_ || ((newest_ || answered_) && !task.chosen.view.empty());
    };
    while (!stopping_)
    {
      if (task.chosen.view.empty())
      {
        wake_.wait(lock, due);
      }
      else
      {
        waitSteadily(wake_, lock, REPORT_PERIOD, due);
      }
      if (task.number != task_number_)
      {
        task = { choice_.chosen(), task_number_ };
        session_ = std::move(prepared_);
        last_frame_ = Clock::now();
        unfound_.reset();
        driven_.clear();
        ++era_;
      }
      const std::optional<CameraFrame> frame = std::exchange(newest_, std::nullopt);
      const bool answered = std::exchange(answered_, false);
      lock.unlock();
      if (!task.chosen.view.empty() && !stopping_)
      {
        guarded("following", [&] { step(task, frame, answered); });
      }
      lock.lock();
    }
  }

  /** @param answered whether a search has finished since the last step. */
  void step(const Task& task, const std::optional<CameraFrame>& frame, bool answered)
  {
    if (!session_)
    {
      if (reported_.refused && reported_.number == task.number && Clock::now() < reported_.time + REPORT_PERIOD)
      {
        return;
      }
      SessionStarter::Preparation preparation = starter_.prepare(task.chosen.view);
      if (!preparation.session)
      {
        report(task, preparation.reason, preparation.refused);
        return;
      }
      session_ = std::move(preparation.session);
      last_frame_ = Clock::now();
    }
    if (frame)
    {
      last_frame_ = Clock::now();
      const std::string fault = guarded("an image on '" + camera_.imageTopic() + "'", [&] { process(task, *frame); });
      if (!fault.empty())
      {
        publishHomography(task, PlaneTrack(), frame->image->header, fault, false);
      }
    }
    else if (answered)
    {
      guarded("the answer of a search", [&] { processAnswer(task); });
    }
    else if (unfound_ && unfound_->searched.count(session_->wanted()) == 0 && searcher_.ready())
    {
      search();
    }
    else if (const std::string fault = camera_.fault(); !fault.empty())
    {
      report(task, fault, true);
    }
    else if (Clock::now() > last_frame_ + NO_IMAGE_AFTER)
    {
      const std::string problem = camera_.problem();
      report(task, problem.empty() ? "no image comes on '" + camera_.imageTopic() + "'" : problem, false);
    }
  }

  void process(const Task& task, const CameraFrame& frame)
  {
    const Clock::time_point begin_time = Clock::now();
    const std_msgs::Header& header = frame.image->header;
    if (!session_->checkCalibration(*frame.info))
    {
      const std::string reason = "the camera's calibration has changed";
      ROS_ERROR_STREAM_THROTTLE(10.0, reason << ": view '" << task.chosen.view << "' has to be chosen anew");
      updateStatus(task, PlaneTrack(), reason);
      publishHomography(task, PlaneTrack(), header, reason, true);
      const std::lock_guard<std::mutex> lock(mutex_);
      markers_.clear();
      return;
    }
    const cv::Mat image = toGrey(*frame.image);
    std::string news;
    const StampOrder::Place place = session_->checkTime(header.stamp);
    if (place == StampOrder::LATE || place == StampOrder::FAR_LATE)
    {
      return;  // a newer image has been followed already
    }
    if (place == StampOrder::GONE_BACK)
    {
      ROS_WARN_STREAM("time has gone back in images: the view is looked for anew");
      ++era_;
      driven_.clear();
      news = LOOKS_FOR_IT;
    }
    const std::optional<Eigen::Isometry3d> camera_in_odom =
        starter_.cameraInOdom(header, [this] { return stopping_.load(); });
    if (const std::optional<PlaneSearcher::Search> search = newSearch())
    {
      news = startWhere(task, *search);
    }
    const PlaneTrack& track = session_->add(image, camera_in_odom);
    unfound_.reset();
    if (track.state != TrackingState::TRACKING)
    {
      unfound_ = Unfound{ header, image, camera_in_odom, {} };
      if (searcher_.ready())
      {
        search();
      }
    }
    else if (session_->wanted() == TargetTracker::Search::SCENE && searcher_.ready())
    {
      beginSearch(image, camera_in_odom);
    }
    publish(task, track, header, news);
    draw(task, header, camera_in_odom);
    const std::lock_guard<std::mutex> lock(mutex_);
    timings_.add(1e3 * secondsSince(begin_time));
  }

  /**
   * Looks where a search has found the view in the newest image, which has been looked at in vain: the next one may be
   * far away, in time and in what it shows.
   */
  void processAnswer(const Task& task)
  {
    const std::optional<PlaneSearcher::Search> search = newSearch();
    if (!search)
    {
      return;
    }
    const std::string news = startWhere(task, *search);
    if (!unfound_)
    {
      return;
    }
    const auto* plane = std::get_if<PlaneFinder::Answer>(&search->answer);
    const bool found = plane != nullptr
                           ? plane->h.has_value()
                           : std::get<SceneFinder::Answer>(search->answer).kind == SceneFinder::Kind::SCENE;
    const PlaneTrack track = found ? session_->add(unfound_->image, unfound_->camera_in_odom) : PlaneTrack();
    if (track.state != TrackingState::TRACKING)
    {
      updateStatus(task, track, news);  // that it is not there was published with the image
      return;
    }
    publish(task, track, unfound_->header, news);
    draw(task, unfound_->header, unfound_->camera_in_odom);
    unfound_.reset();
  }

  /** Begins to look for the view in the newest image. */
  void search()
  {
    unfound_->searched.insert(session_->wanted());
    beginSearch(unfound_->image, unfound_->camera_in_odom);
  }

  /** Begins the search that the session wants. */
  void beginSearch(const cv::Mat& image, const std::optional<Eigen::Isometry3d>& camera_in_odom)
  {
    if (session_->wanted() == TargetTracker::Search::SCENE)
    {
      searcher_.begin({ era_, session_->sceneQuestion(image), camera_in_odom, {} });
    }
    else
    {
      searcher_.begin({ era_, session_->question(image), camera_in_odom, {} });
    }
  }

  /** The search that has finished since the last call, if it is about this session. */
  std::optional<PlaneSearcher::Search> newSearch()
  {
    std::optional<PlaneSearcher::Search> search = searcher_.finished();
    return search && search->era == era_ ? std::move(search) : std::nullopt;
  }

  /**
   * Starts the session where a search has found the view.
   * @return the reason if it cannot be tracked then; empty: the reason is the same as before.
   */
  std::string startWhere(const Task& task, const PlaneSearcher::Search& search)
  {
    constexpr const char* NOT_TRACKED = "the view cannot be tracked where it was found";
    if (const auto* plane = std::get_if<PlaneFinder::Answer>(&search.answer))
    {
      session_->start(*plane, search.camera_in_odom);
      return plane->h ? NOT_TRACKED : plane->reason;
    }
    const auto& scene = std::get<SceneFinder::Answer>(search.answer);
    const bool was_scene = session_->followsScene();
    session_->start(scene, search.camera_in_odom);
    const bool is_scene = session_->followsScene();
    if (!was_scene && scene.kind == SceneFinder::Kind::SCENE)
    {
      ROS_INFO_STREAM("view '" << task.chosen.view << "' is followed as a scene: it shows depth");
    }
    else if (was_scene && !is_scene)
    {
      ROS_INFO_STREAM("view '" << task.chosen.view << "' is followed as a plane: " << scene.reason);
    }
    if (scene.kind == SceneFinder::Kind::SCENE)
    {
      return NOT_TRACKED;
    }
    // Where the view may be a plane, what a search for one says counts.
    return params_.sessions.target == Target::SCENE ? scene.reason : "";
  }

  // ----------------------------------------------------------------------------------------------------- publishing

  /** What came of an image. @param news as in updateStatus(). */
  void publish(const Task& task, const PlaneTrack& track, const std_msgs::Header& header, const std::string& news)
  {
    const std::string reason = updateStatus(task, track, news);
    publishHomography(task, track, header, reason, false);
    publishPose(task, header.stamp);
    if (overlay_publisher_.getNumSubscribers() > 0)
    {
      const TrackedHomography& found = track.homography;
      const std::string points =
          std::to_string(found.supporting) + " of " + std::to_string(found.looked_for) + " points";
      const std::string text =
          task.chosen.view + ": " + nameOf(track.state) + (reason.empty() ? ", " + points : ": " + reason);
      overlay_publisher_.publish(boost::make_shared<const sensor_msgs::Image>(
          toImage(session_->overlay(text), sensor_msgs::image_encodings::BGR8, header)));
    }
  }

  /** Publishes what is known as markers, if somebody wants them. */
  void draw(const Task& task, const std_msgs::Header& header, const std::optional<Eigen::Isometry3d>& camera_in_odom)
  {
    if (camera_in_odom)
    {
      driven_.add(camera_in_odom->translation());
    }
    if (!markers_.wanted())
    {
      return;
    }
    PlaneScene scene = session_->scene();
    scene.header = header;
    scene.header.frame_id = withoutSlash(header.frame_id);
    scene.odom_frame = withoutSlash(params_.sessions.odom_frame);
    scene.camera_in_odom = camera_in_odom;
    scene.driven = driven_.places();
    const visualization_msgs::MarkerArray markers = toMarkers(scene);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (task.number == task_number_)  // else another view is followed by now, and these markers are deleted
    {
      markers_.publish(markers);
    }
  }

  /**
   * Updates what diagnostics report, and logs changes.
   * @param news why the view is not tracked; empty: the reason is the same as before.
   * @return why the view is not tracked; empty when it is.
   */
  std::string updateStatus(const Task& task, const PlaneTrack& track, const std::string& news)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (task.number != task_number_)
    {
      return status_.reason;
    }
    const TrackingState before = std::exchange(status_.state, track.state);
    status_.points = track.homography.supporting;
    status_.scene = session_ && session_->followsScene();
    if (track.state == TrackingState::TRACKING)
    {
      status_.reason.clear();
      if (before != TrackingState::TRACKING)
      {
        ROS_INFO_STREAM("view '" << task.chosen.view << "' is tracked by " << status_.points << " points"
                                 << (status_.scene ? " of a scene" : ""));
      }
      return "";
    }
    if (before == TrackingState::TRACKING)
    {
      status_.reason = "the view is not in the image";
      ROS_WARN_STREAM("view '" << task.chosen.view << "' is not in the image: it is looked for");
    }
    if (!news.empty())
    {
      status_.reason = news;
      ROS_INFO_STREAM_THROTTLE(5.0, "view '" << task.chosen.view << "' is not tracked: " << news);
    }
    return status_.reason;
  }

  /** Publishes why a view is not followed: at once when it is another view or refused, else twice a second. */
  void report(const Task& task, const std::string& reason, bool refused)
  {
    const Clock::time_point now = Clock::now();
    if (task.number == reported_.number && refused == reported_.refused && now < reported_.time + REPORT_PERIOD)
    {
      return;
    }
    reported_ = { task.number, refused, now };
    updateStatus(task, PlaneTrack(), reason);
    std_msgs::Header header;
    header.stamp = ros::Time::now();
    publishHomography(task, PlaneTrack(), header, reason, refused);
  }

  void publishHomography(const Task& task, const PlaneTrack& track, const std_msgs::Header& header,
                         const std::string& reason, bool refused)
  {
    const auto message = boost::make_shared<Homography>(toHomography(track, task.chosen.view, header, reason));
    message->goal = task.chosen.goal;
    message->refused = refused;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (task.number == task_number_)  // else another view is followed by now
    {
      homography_publisher_.publish(boost::shared_ptr<const Homography>(message));
    }
  }

  /** Publishes where the camera is by the last image, where that is known and somebody wants it. */
  void publishPose(const Task& task, const ros::Time& stamp)
  {
    const std::optional<CameraPose> pose =
        pose_publisher_.getNumSubscribers() > 0 ? session_->cameraPose() : std::nullopt;
    if (!pose)
    {
      return;
    }
    geometry_msgs::PoseWithCovarianceStamped message;
    message.header.stamp = stamp;
    message.header.frame_id = "view_" + task.chosen.view;
    message.pose = toPoseWithCovariance(*pose);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (task.number == task_number_)
    {
      pose_publisher_.publish(message);
    }
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const ChosenView& chosen = choice_.chosen();
    const bool worrying = !chosen.view.empty() && status_.state != TrackingState::TRACKING;
    const std::string reason = status_.reason.empty() ? "" : ": " + status_.reason;
    status.summary(worrying ? diagnostic_msgs::DiagnosticStatus::WARN : diagnostic_msgs::DiagnosticStatus::OK,
                   chosen.view.empty() ? status_.reason : nameOf(status_.state) + reason);
    status.add("View", chosen.view);
    status.add("Goal", chosen.goal);
    status.add("Points", status_.points);
    status.add("Followed as", status_.scene ? "scene" : "plane");
    timings_.report(status, "Time an image");
  }

  static constexpr std::chrono::milliseconds REPORT_PERIOD{ 500 };
  static constexpr std::chrono::seconds NO_IMAGE_AFTER{ 2 };
  static constexpr const char* LOOKS_FOR_IT = "looks for the view";

  const HomographyTrackerNodeParams params_;
  const PlaneFinder finder_;

  std::mutex mutex_;  // guards what follows; never held while an image is worked on or a view is read
  std::condition_variable wake_;
  ViewChoice choice_;
  std::uint64_t task_number_ = 0;
  std::unique_ptr<PlaneSession> prepared_;  // of the choice, for the follower
  std::optional<CameraFrame> newest_;
  bool answered_ = false;  // a search has finished
  Status status_;
  Timings timings_;  // of images
  std::atomic<bool> stopping_{ false };

  // The follower's own.
  PlaneSearcher searcher_;
  std::unique_ptr<PlaneSession> session_;
  Clock::time_point last_frame_;  // or when the session began
  std::uint64_t era_ = 0;         // counts sessions, and times that time went back
  TravelledWay driven_;           // by the camera since then
  std::optional<Unfound> unfound_;
  struct
  {
    std::uint64_t number = 0;
    bool refused = false;
    Clock::time_point time;
  } reported_;

  CameraInput camera_;
  SessionStarter starter_;
  image_transport::ImageTransport transport_;
  MarkerOutput markers_;
  ros::Publisher homography_publisher_;
  ros::Publisher pose_publisher_;
  image_transport::Publisher overlay_publisher_;
  ros::Subscriber wanted_subscriber_;
  ros::ServiceServer start_service_;
  ros::ServiceServer stop_service_;
  std::thread follower_;
};

const NodeType HOMOGRAPHY_TRACKER = nodeType<HomographyTrackerNode>("homography_tracker");

}  // namespace view_servo
