// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "nodes/nodes.h"

#include "view_servo/DeleteView.h"
#include "view_servo/GetView.h"
#include "view_servo/ListViews.h"
#include "view_servo/SaveView.h"
#include "view_servo/WantedView.h"
#include "view_servo/images/image_io.h"
#include "view_servo/ros/camera_input.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/node_params.h"
#include "view_servo/ros/node_type_of.h"
#include "view_servo/ros/parameters.h"
#include "view_servo/ros/transform_source.h"
#include "view_servo/views/route_store.h"
#include "view_servo/views/self_repetition.h"
#include "view_servo/views/view_store.h"

#include <sensor_msgs/image_encodings.h>
#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/**
 * Keeps stored views on disk: an image, with the camera's calibration, the region of interest, stamp, frame and pose.
 *
 * Its private parameters: see ViewStoreNodeParams.
 *
 * Subscribes:
 *  - `image_raw` (sensor_msgs/Image), `camera_info` (sensor_msgs/CameraInfo), for a minute from its start and from each
 *    request on that needs them; `/tf`, `/tf_static`.
 *
 * Publishes:
 *  - `learn_view` (view_servo/WantedView): a view that was saved to be learnt, for homing;
 *  - `/diagnostics` (diagnostic_msgs/DiagnosticArray): 1 Hz, camera.
 *
 * Services:
 *  - `~save` (view_servo/SaveView): stores a view;
 *  - `~list` (view_servo/ListViews): names the readable views and the damaged ones;
 *  - `~delete` (view_servo/DeleteView), `~get` (view_servo/GetView).
 * A view that a route needs is neither replaced nor deleted.
 *
 * Other nodes read views from the directory themselves, not through this node: they go on without it, and see a view
 * as soon as it is saved because the store is safe for several processes as long as one of them writes.
 */
class ViewStoreNode : private NodeBase
{
public:
  ViewStoreNode(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh)
    : NodeBase(nh, private_nh),
      params_(readParams<ViewStoreNodeParams>(private_nh)),
      transforms_(nh),
      camera_(nh, private_nh, params_.camera),
      sources_(params_.sources, camera_),
      store_(sources_.store()),
      routes_(store_.directory())
  {
    camera_.connectWhenAsked(params_.idle_timeout);
    learn_publisher_ = nh_.advertise<WantedView>("learn_view", 1);
    save_service_ = serve("save", &ViewStoreNode::save, this);
    list_service_ = serve("list", &ViewStoreNode::list, this);
    delete_service_ = serve("delete", &ViewStoreNode::remove, this);
    get_service_ = serve("get", &ViewStoreNode::get, this);
    diagnostics_.add("camera", &camera_, &CameraInput::diagnose);
    ROS_INFO_STREAM("stored views are in " << store_.directory());
  }

private:
  void save(const SaveView::Request& request, SaveView::Response& response)
  {
    const SourcedImage source = sources_.read(kindOf(request.source, "source"), request.source, "source");
    StoredView view;
    view.name = request.name;
    view.image = source.grey;
    const cv::Rect region = toRect(request.roi, source.grey.size());
    view.region = region.empty() ? source.region : region;
    view.camera = source.camera;
    view.stamp = source.header.stamp.toSec();
    view.frame_id = source.header.frame_id;
    view.pose = source.pose ? source.pose : lookUpPose(source.header);
    const std::string warning = [&] {
      const std::lock_guard<std::mutex> lock(write_mutex_);
      if (request.overwrite)
      {
        requireOnNoRoute("replace", view.name);
      }
      return store_.save(view, request.overwrite);
    }();
    const std::string lack = lackOfLight(view.region.empty() ? view.image : view.image(view.region));
    const std::optional<Eigen::Vector2d> other = otherPlaceInPicture(view.image, view.region);
    response.success = true;
    response.message = "saved view '" + view.name + "', " + std::to_string(view.image.cols) + " x " +
                       std::to_string(view.image.rows) + (view.camera ? "" : ", without a calibration") +
                       (view.pose ? ", with its pose in " + view.pose->frame : ", without a pose") +
                       (lack.empty() ? "" : "; but the picture is " + lack) +
                       (other ? "; but what it shows repeats itself " + std::to_string(std::lround(other->norm())) +
                                    " px away: it may be found there"
                              : "") +
                       (warning.empty() ? "" : "; " + warning);
    if (request.learn)
    {
      WantedView wanted;
      wanted.header.stamp = ros::Time::now();
      wanted.view = view.name;
      learn_publisher_.publish(wanted);
      response.message += learn_publisher_.getNumSubscribers() > 0
                              ? "; it is learnt while the base moves by 0.3 m"
                              : "; but it is not learnt: no homing listens to '" + learn_publisher_.getTopic() + "'";
    }
    ROS_INFO_STREAM(response.message);
  }

  void list(const ListViews::Request& /*request*/, ListViews::Response& response)
  {
    const ViewStore::Listing listing = store_.list();
    response.names = listing.names;
    for (const ViewStore::Damaged& damaged : listing.damaged)
    {
      DamagedView message;
      message.name = damaged.name;
      message.reason = damaged.reason;
      response.damaged.push_back(message);
    }
    response.success = true;
    response.message = std::to_string(listing.names.size()) + " views and " + std::to_string(listing.damaged.size()) +
                       " damaged ones in " + store_.directory().string();
  }

  void remove(const DeleteView::Request& request, DeleteView::Response& response)
  {
    const std::string warning = [&] {
      const std::lock_guard<std::mutex> lock(write_mutex_);
      requireOnNoRoute("remove", request.name);
      return store_.remove(request.name);
    }();
    response.success = true;
    response.message = "deleted view '" + request.name + "'" + (warning.empty() ? "" : "; " + warning);
    ROS_INFO_STREAM(response.message);
  }

  void get(const GetView::Request& request, GetView::Response& response)
  {
    const StoredView view = store_.load(request.name);
    std_msgs::Header header;
    header.stamp = toStamp(view.stamp);
    header.frame_id = view.frame_id;
    response.image = toImage(view.image, sensor_msgs::image_encodings::MONO8, header);
    response.camera_info = toCameraInfo(view.camera.value_or(Camera()), header);
    response.roi = toRegionOfInterest(view.region);
    response.has_pose = view.pose.has_value();
    if (view.pose)
    {
      response.pose = toPoseStamped(*view.pose, header.stamp);
    }
    response.success = true;
  }

  /** @throws ViewStoreError when a view is there and a route needs it: that could not be followed any more. */
  void requireOnNoRoute(const std::string& action, const std::string& view) const
  {
    const std::vector<std::string> routes = routes_.routesWith(view);
    const std::vector<std::string> names = store_.names();
    if (!routes.empty() && std::binary_search(names.begin(), names.end(), view))
    {
      throw ViewStoreError("cannot " + action + " view '" + view + "': route '" + routes[0] +
                           "' needs it as it is; delete the route first: rosrun view_servo routes delete " + routes[0]);
    }
  }

  /** The pose of an image's frame when the image was taken, where tf knows it or learns it within a moment. */
  std::optional<ViewPose> lookUpPose(const std_msgs::Header& header) const
  {
    if (header.frame_id.empty() || header.stamp.isZero() || params_.fixed_frame.empty())
    {
      return std::nullopt;
    }
    constexpr double PATIENCE = 0.25;  // [s]
    try
    {
      return toViewPose(transforms_.lookUp(params_.fixed_frame, header.frame_id, header.stamp, PATIENCE));
    }
    catch (const std::runtime_error& error)
    {
      ROS_INFO_STREAM("stored without a pose: " << error.what());
      return std::nullopt;
    }
  }

  const ViewStoreNodeParams params_;
  const TransformSource transforms_;
  CameraInput camera_;
  ImageSourceReader sources_;
  const ViewStore& store_;
  const RouteStore routes_;
  std::mutex write_mutex_;  // one writer at a time
  ros::Publisher learn_publisher_;
  ros::ServiceServer save_service_;
  ros::ServiceServer list_service_;
  ros::ServiceServer delete_service_;
  ros::ServiceServer get_service_;
};

const NodeType VIEW_STORE = nodeType<ViewStoreNode>("view_store");

}  // namespace view_servo
