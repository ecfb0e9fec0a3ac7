// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/StartRoute.h"
#include "view_servo/control/odometry_history.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/driver_context.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_params.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/odometry_input.h"
#include "view_servo/ros/readiness.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/ros/worker.h"
#include "view_servo/tracking/pair_structure.h"
#include "view_servo/tracking/route_spacing.h"
#include "view_servo/views/route_store.h"

#include <nav_msgs/Odometry.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * Records a route while somebody drives the base: stores a view at the start, whenever the last one is left behind (see
 * RouteSpacing), and at the end. Private parameters: see RouteRecorderParams.
 *
 * Subscribes `image_raw`, `camera_info` (see CameraInput), `odom` (nav_msgs/Odometry), of `~base_frame`, and tf.
 * Services: `~start` (view_servo/StartRoute); `~stop` (std_srvs/Trigger): stores the route, as far as it has come.
 * When that cannot be, the answer says why, and the views that belong to it are removed. Publishes `/diagnostics`.
 */
class RouteRecorderNode : private NodeBase
{
public:
  RouteRecorderNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : NodeBase(nh, private_nh),
      params_(readParams<RouteRecorderParams>(private_nh)),
      base_frame_(withoutSlash(params_.base_frame)),
      routes_(viewsDir(params_.views_dir)),
      transforms_(nh),
      odometry_input_("odometry", "'" + nh_.resolveName("odom") + "'", LONGEST_GAP),
      odometry_(odometry_input_, transforms_, base_frame_, params_.odometry_delay),
      history_(HISTORY),
      worker_("a view of a route", [this](Place&& place) { work(place); }),
      camera_(nh, private_nh, params_.camera, [this](const CameraFrame& frame) { onFrame(frame); })
  {
    odometry_subscriber_ =
        subscribeEvents<nav_msgs::Odometry>("odom", 10, [this](const OdometryReader::Event& e) { onOdometry(e); });
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    diagnostics_.add("recording", this, &RouteRecorderNode::diagnose);
    start_service_ = serve("start", &RouteRecorderNode::start, this);
    stop_service_ = serve("stop", &RouteRecorderNode::stop, this);
    ROS_INFO_STREAM("routes are in " << routes_.directory());
  }

  ~RouteRecorderNode()
  {
    const std::lock_guard<std::mutex> lock(recording_mutex_);
    if (recording_)
    {
      ROS_WARN_STREAM("route '" << recording_->route.name << "' is not stored: the node ends before ~stop");
      discard();
    }
  }

private:
  static constexpr double HISTORY = 5.0;      // of odometry [s]
  static constexpr double LONGEST_GAP = 0.5;  // without odometry [s]

  /** An image, and where the base was. */
  struct Place
  {
    CameraFrame frame;
    PlanarPose base;  ///< in odometry's frame
  };

  /** A view that can be stored. */
  struct NewView
  {
    StoredView stored;
    CameraMount mount;                      // where the camera is on the base
    std::unique_ptr<RouteSpacing> spacing;  // from this view on
  };

  struct Recording
  {
    Route route;
    StoredView before;                      ///< the view before the last
    StoredView last;                        ///< the last view
    CameraMount mount;                      ///< where the camera is on the base
    std::unique_ptr<RouteSpacing> spacing;  ///< from the last view on
    std::string fault;                      ///< why the route cannot be stored any more; empty: it can
  };

  // ------------------------------------------------------------------------------------------------------- inputs

  void onOdometry(const OdometryReader::Event& event)
  {
    const std::lock_guard<std::mutex> lock(input_mutex_);
    const std::optional<OdometryReading> reading = odometry_.read(event);
    if (!odometry_input_.jump().empty())
    {
      jump_ = odometry_input_.jump();
      history_ = OdometryHistory(HISTORY);
      newest_.reset();
    }
    if (reading)
    {
      history_.add(reading->time, reading->pose);
    }
  }

  void onFrame(const CameraFrame& frame)
  {
    const std::lock_guard<std::mutex> lock(input_mutex_);
    constexpr double BEHIND = 0.45;  // of odometry's stamps, as homing bears it [s]
    const std::optional<PlanarPose> base = history_.at(frame.image->header.stamp.toSec(), BEHIND);
    if (base && odometry_input_.fresh())
    {
      newest_ = Place{ frame, *base };
      worker_.put([&](Place& place) { place = *newest_; });
    }
  }

  /**
   * Waits for an image that is taken from now on, with odometry. @throws std::runtime_error saying what does not come.
   */
  Place waitForPlace()
  {
    const ros::Time now = ros::Time::now();
    Place place;
    const std::string missing = waitUntilReady(params_.patience, [&]() -> std::string {
      CameraFrame frame;
      const std::string camera = camera_.missing(frame);
      const std::lock_guard<std::mutex> lock(input_mutex_);
      if (newest_ && newest_->frame.image->header.stamp > now)
      {
        place = *newest_;
        return "";
      }
      if (!camera.empty() || odometry_input_.fresh())
      {
        return camera.empty() ? "no new image has come on '" + camera_.imageTopic() + "'" : camera;
      }
      return odometry_input_.problem().empty() ? "no odometry comes on " + odometry_input_.topics()
                                               : odometry_input_.problem();
    });
    if (!missing.empty())
    {
      throw std::runtime_error(missing);
    }
    return place;
  }

  // ----------------------------------------------------------------------------------------------------- recording

  /**
   * @param replaced views that are removed before there are others. @throws std::runtime_error when there is another
   * view of a name that the route's views may get, as the recording would end at it.
   */
  void requireFreeNames(const std::string& name, const std::vector<std::string>& replaced) const
  {
    for (const std::string& view : routes_.views().names())
    {
      if (std::find(replaced.begin(), replaced.end(), view) == replaced.end() &&
          view.compare(0, name.size() + 1, name + "_") == 0 &&
          view.find_first_not_of("0123456789", name.size() + 1) == std::string::npos)
      {
        throw std::runtime_error("there is a view '" + view + "' already: take another name, or delete it if " +
                                 "'routes list' shows no route that needs it");
      }
    }
  }

  void start(const StartRoute::Request& request, StartRoute::Response& response)
  {
    const std::lock_guard<std::mutex> lock(recording_mutex_);
    const std::string name = request.name;
    const auto refuse = [&](const std::string& reason) {
      throw std::runtime_error("route '" + name.substr(0, LONGEST_NAME) + "' is not recorded: " + reason);
    };
    if (recording_)
    {
      refuse("route '" + recording_->route.name + "' is, call ~stop first");
    }
    if (!isValidRouteName(name))
    {
      refuse("a route's name is 1 to 58 letters, digits, '_' and '-', and starts with a letter or digit");
    }
    const bool replaces = routes_.has(name) && name == params_.overwrite;
    if (routes_.has(name) && !replaces)
    {
      refuse("there is one of that name: delete or rename that first");
    }
    Recording recording;
    recording.route.name = name;
    try
    {
      // All that may be refused comes before the route goes that is replaced.
      requireFreeNames(name, replaces ? routes_.ownViews(name) : std::vector<std::string>());
      const Place place = waitForPlace();
      NewView view = prepare(place, viewNameOf(name, 1));
      if (replaces)
      {
        const std::string warning = routes_.remove(name);
        ROS_INFO_STREAM("deleted route '" << name << "', which is replaced" << (warning.empty() ? "" : "; ")
                                          << warning);
      }
      {
        const std::lock_guard<std::mutex> input_lock(input_mutex_);
        jump_.clear();
        recording.route.frame = odometry_.frame();
      }
      recording_ = std::move(recording);
      add(std::move(view), place.base);
    }
    catch (const std::exception& error)
    {
      recording_ ? discard() : static_cast<void>(0);
      refuse(oneLine(error));
    }
    response.success = true;
    response.message = "route '" + name + "' is recorded from view '" + viewNameOf(name, 1) + "' on, until ~stop";
    ROS_INFO_STREAM(response.message);
  }

  void stop(const std_srvs::Trigger::Request& /*request*/, std_srvs::Trigger::Response& response)
  {
    constexpr double SAME_PLACE = 0.01;  // [m, rad]
    const std::lock_guard<std::mutex> lock(recording_mutex_);
    if (!recording_)
    {
      throw std::runtime_error("no route is recorded: call ~start first");
    }
    Route& route = recording_->route;
    const std::string name = route.name;
    std::string lack;  // why the end is missing, or all after a fault; what was recorded before is not thrown away
    try
    {
      try
      {
        checkGoesOn();
        const Place place = waitForPlace();
        const PlanarPose moved = compose(inverse(route.stops.back().base), place.base);
        if (moved.distance() > SAME_PLACE || std::abs(moved.yaw) > SAME_PLACE)
        {
          addChecked(place);
        }
        checkGoesOn();
      }
      catch (const std::exception& error)
      {
        if (route.stops.size() < 2)
        {
          throw;
        }
        lack = "; it ends there, as " + oneLine(error);
      }
      learnLast();
      if (route.stops.size() < 2)
      {
        throw std::runtime_error("the base has not moved");
      }
      routes_.save(route);
    }
    catch (const std::exception& error)
    {
      discard();
      throw std::runtime_error("route '" + name + "' is not stored, and its views are removed: " + oneLine(error));
    }
    char text[160];
    std::snprintf(text, sizeof(text), "', %zu views over %.2f m", route.stops.size(), lengthOf(route));
    response.message = "stored route '" + name + text + lack;
    response.success = 1;
    recording_.reset();
    if (lack.empty())
    {
      ROS_INFO_STREAM(response.message);
    }
    else
    {
      ROS_WARN_STREAM(response.message);
    }
  }

  /** @throws std::runtime_error saying why the route cannot be stored any more. */
  void checkGoesOn()
  {
    {
      const std::lock_guard<std::mutex> lock(input_mutex_);
      recording_->fault = recording_->fault.empty() ? jump_ : recording_->fault;
    }
    if (!recording_->fault.empty())
    {
      throw std::runtime_error(recording_->fault);
    }
  }

  /** By the worker's thread, with each image that it has time for. */
  void work(const Place& place)
  {
    const std::lock_guard<std::mutex> lock(recording_mutex_);
    if (!recording_ || !recording_->fault.empty())
    {
      return;
    }
    const RouteStop& last = recording_->route.stops.back();
    const bool newer = place.frame.image->header.stamp.toSec() > last.stamp;
    if (newer && recording_->spacing->due(compose(inverse(last.base), place.base)))
    {
      try
      {
        checkGoesOn();
        addChecked(place);
      }
      catch (const std::exception& error)
      {
        recording_->fault = oneLine(error);
        ROS_ERROR_STREAM("route '" << recording_->route.name << "' cannot be stored: " << recording_->fault);
      }
    }
  }

  /** Adds a view there, if the base has not gone too far since the last view, and the route may grow. */
  void addChecked(const Place& place)
  {
    constexpr double MOST = 2.0;  // times the usual distance and turn
    const RouteStop& last = recording_->route.stops.back();
    const PlanarPose moved = compose(inverse(last.base), place.base);
    if (moved.distance() > MOST * params_.spacing.distance || std::abs(moved.yaw) > MOST * params_.spacing.turn)
    {
      char text[160];
      std::snprintf(text, sizeof(text),
                    "the base has gone %.2f m and turned %.0f degrees without a usable image since view '",
                    moved.distance(), std::abs(moved.yaw) * 180.0 / M_PI);
      throw std::runtime_error(text + last.view + "': drive slower");
    }
    if (recording_->route.stops.size() >= MAX_ROUTE_STOPS)
    {
      throw std::runtime_error("it has " + std::to_string(MAX_ROUTE_STOPS) + " views already");
    }
    add(prepare(place, viewNameOf(recording_->route.name, recording_->route.stops.size() + 1)), place.base);
  }

  /** All that a view needs before it is stored. @throws std::exception saying what of it cannot be. */
  NewView prepare(const Place& place, const std::string& name) const
  {
    const std_msgs::Header& header = place.frame.image->header;
    const geometry_msgs::TransformStamped mount =
        transforms_.lookUp(base_frame_, header.frame_id, ros::Time(0), params_.patience);
    NewView view;
    view.stored.name = name;
    view.stored.image = toGrey(*place.frame.image);
    view.stored.camera = toCamera(*place.frame.info);
    view.stored.stamp = header.stamp.toSec();
    view.stored.frame_id = header.frame_id;
    view.mount = CameraMount(toIsometry(mount.transform));
    view.spacing = std::make_unique<RouteSpacing>(params_.spacing, view.stored.image, *view.stored.camera, view.mount);
    return view;
  }

  /** Stores a view, and adds it to the route. @throws ViewStoreError when it cannot be stored. */
  void add(NewView&& view, const PlanarPose& base)
  {
    Route& route = recording_->route;
    if (const std::string warning = routes_.views().save(view.stored, false); !warning.empty())
    {
      ROS_WARN_STREAM(warning);
    }
    route.stops.push_back({ view.stored.name, base, view.stored.stamp });
    recording_->mount = view.mount;
    recording_->spacing = std::move(view.spacing);
    ROS_INFO_STREAM("stored view '" << view.stored.name << "'");
    if (route.stops.size() > 1)
    {
      const PlanarPose moved = compose(inverse(route.stops[route.stops.size() - 2].base), base);
      learn(recording_->last, view.stored, moved);
      recording_->before = std::move(recording_->last);
    }
    recording_->last = std::move(view.stored);
  }

  /** Of the last view, from the one before. */
  void learnLast()
  {
    const std::vector<RouteStop>& stops = recording_->route.stops;
    if (stops.size() > 1)
    {
      learn(recording_->last, recording_->before, compose(inverse(stops.back().base), stops[stops.size() - 2].base));
    }
  }

  /**
   * Stores where the things are that a view shows, so that a follower knows it from the start; that this fails is no
   * fault of the route. @param moved pose of the base at the other view in the base at this one.
   */
  void learn(const StoredView& view, const StoredView& other, const PlanarPose& moved) const
  {
    guarded("learning view '" + view.name + "'", [&] {
      const bool same_camera = view.camera->k == other.camera->k && view.image.size() == other.image.size();
      const ViewStructure structure =
          same_camera ? structureOfPair(view.image, other.image, *view.camera, recording_->mount, moved)
                      : ViewStructure();
      if (!structure.points.empty())
      {
        routes_.views().saveStructure(view.name, routes_.views().revision(view.name), structure);
      }
      ROS_INFO_STREAM("view '" << view.name << "': the depths of " << structure.points.size() << " points are stored");
    });
  }

  /** Ends the recording, and removes its views. */
  void discard()
  {
    // The last first: should there be no time for all, a new recording of the name is refused and says why.
    std::vector<RouteStop>& stops = recording_->route.stops;
    for (; !stops.empty(); stops.pop_back())
    {
      const std::string view = stops.back().view;
      guarded("removing view '" + view + "'", [&] { routes_.views().remove(view); });
    }
    recording_.reset();
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status)
  {
    const std::unique_lock<std::mutex> lock(recording_mutex_, std::try_to_lock);
    if (!lock)
    {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "storing a view");
    }
    else if (!recording_)
    {
      status.summary(diagnostic_msgs::DiagnosticStatus::OK, "no route is recorded");
    }
    else
    {
      const bool good = recording_->fault.empty();
      status.summary(good ? diagnostic_msgs::DiagnosticStatus::OK : diagnostic_msgs::DiagnosticStatus::ERROR,
                     good ? "records route '" + recording_->route.name + "'" : recording_->fault);
      status.add("Views", recording_->route.stops.size());
    }
  }

  static constexpr std::size_t LONGEST_NAME = 64;  // that is told of

  const RouteRecorderParams params_;
  const std::string base_frame_;
  const RouteStore routes_;
  const TransformSource transforms_;

  std::mutex input_mutex_;  // guards what follows; taken after the other one
  DriverInput odometry_input_;
  OdometryReader odometry_;
  OdometryHistory history_;
  std::optional<Place> newest_;
  std::string jump_;  // says so when time has gone back since ~start

  std::mutex recording_mutex_;  // guards what follows; may be held while a view is stored
  std::optional<Recording> recording_;

  Worker<Place> worker_;
  CameraInput camera_;
  ros::Subscriber odometry_subscriber_;
  ros::ServiceServer start_service_;
  ros::ServiceServer stop_service_;
};

const NodeType ROUTE_RECORDER = nodeType<RouteRecorderNode>("route_recorder");

}  // namespace view_servo
