// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/markers.h"

#include "view_servo/ros/conversions.h"

#include <geometry_msgs/Point.h>
#include <std_msgs/ColorRGBA.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <utility>

namespace view_servo
{
namespace
{
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;
using Places = std::vector<Eigen::Vector3d>;

constexpr double LIFETIME = 2.0;        // of what holds for a moment only [s]
constexpr double ABOVE_FLOOR = 0.02;    // of lines on the floor, so that a grid does not hide them [m]
constexpr double MOST_DISTANCE = 30.0;  // of what is drawn from the camera that sees it [m]

/** How large the parts of a drawing are. */
struct Sizes
{
  double frustum;  ///< from a camera to the rectangle that stands for its image [m]
  double line;     ///< width of lines [m]
  double arrow;    ///< length of arrows [m]
  double point;    ///< side of points [m]
};
constexpr double STOP = 0.08;  // diameter of a route's stops [m]
constexpr Sizes OF_BASE{ 0.3, 0.012, 0.8, 0.03 };
constexpr Sizes OF_ARM{ 0.08, 0.003, 0.15, 0.006 };

std_msgs::ColorRGBA colour(float red, float green, float blue, float alpha = 1.0F)
{
  std_msgs::ColorRGBA result;
  result.r = red;
  result.g = green;
  result.b = blue;
  result.a = alpha;
  return result;
}
const std_msgs::ColorRGBA OF_VIEW = colour(0.3F, 0.7F, 1.0F);  // blue: where to go
const std_msgs::ColorRGBA OF_NOW = colour(1.0F, 0.6F, 0.1F);   // orange: where the robot is and was
const std_msgs::ColorRGBA SUPPORTS = colour(0.2F, 0.9F, 0.3F);
const std_msgs::ColorRGBA MISSING = colour(0.95F, 0.25F, 0.2F);
const std_msgs::ColorRGBA OF_ROUTE = colour(0.6F, 0.6F, 0.6F);
const std_msgs::ColorRGBA OF_PLANE = colour(0.3F, 0.7F, 1.0F, 0.3F);

geometry_msgs::Point toPoint(const Eigen::Vector3d& place)
{
  geometry_msgs::Point point;
  point.x = place.x();
  point.y = place.y();
  point.z = place.z();
  return point;
}

/** A marker that deletes what has its namespace and id. */
Marker deletion(const std_msgs::Header& header, const std::string& part)
{
  Marker marker;
  marker.header = header;
  marker.ns = part;
  marker.action = Marker::DELETE;
  marker.pose.orientation.w = 1.0;
  return marker;
}

/** A marker of points in the header's frame; it deletes unless there are at least `least` points, all finite. */
Marker markerOf(const std_msgs::Header& header, const std::string& part, int type, double width,
                const std_msgs::ColorRGBA& its_colour, const Places& places, std::size_t least = 2)
{
  Marker marker = deletion(header, part);
  const bool finite =
      std::all_of(places.begin(), places.end(), [](const Eigen::Vector3d& place) { return place.allFinite(); });
  if (places.size() < least || !finite || header.frame_id.empty())
  {
    return marker;
  }
  marker.action = Marker::ADD;
  marker.type = type;
  marker.scale.x = width;
  marker.color = its_colour;
  marker.points.reserve(places.size());
  for (const Eigen::Vector3d& place : places)
  {
    marker.points.push_back(toPoint(place));
  }
  return marker;
}

Marker forAMoment(Marker marker)
{
  marker.lifetime = ros::Duration(LIFETIME);
  return marker;
}

/** Places a marker whose points are in another frame's coordinates. */
Marker at(const Eigen::Isometry3d& pose, Marker marker)
{
  if (!pose.matrix().allFinite())
  {
    return deletion(marker.header, marker.ns);
  }
  marker.pose.position = toPoint(pose.translation());
  marker.pose.orientation = toMessage(Eigen::Quaterniond(pose.linear()).normalized());
  return marker;
}

/**
 * The image's corners on the plane z = 1, beginning at the upper left, clockwise. Where the lens has no rays, a
 * pinhole's.
 */
Places cornersOf(const Camera& camera)
{
  constexpr double FARTHEST = 3.0;  // 72 degrees from the axis
  Places result;
  for (const auto& [u, v] : std::initializer_list<std::pair<int, int>>{ { 0, 0 }, { 1, 0 }, { 1, 1 }, { 0, 1 } })
  {
    const Eigen::Vector2d pixel(u * (camera.width - 1.0), v * (camera.height - 1.0));
    Eigen::Vector2d point = camera.normalized(pixel);
    if (!(point.norm() <= FARTHEST))
    {
      point = { (pixel.x() - camera.k(0, 2)) / camera.k(0, 0), (pixel.y() - camera.k(1, 2)) / camera.k(1, 1) };
    }
    result.push_back(point.homogeneous());
  }
  return result;
}

/** Edges of a camera's frustum in its optical frame, with a triangle above the image's upper edge. */
Places frustumOf(const Camera& camera, double depth)
{
  if (!camera.calibrated())
  {
    return {};
  }
  Places corners = cornersOf(camera);
  for (Eigen::Vector3d& corner : corners)
  {
    corner *= depth;
  }
  const Eigen::Vector3d apex = Eigen::Vector3d::Zero();
  const Eigen::Vector3d along = corners[1] - corners[0];
  const Eigen::Vector3d left = corners[0] + 0.3 * along;
  const Eigen::Vector3d right = corners[0] + 0.7 * along;
  const Eigen::Vector3d top = corners[0] + 0.5 * along + 0.2 * (corners[0] - corners[3]);
  Places lines;
  for (std::size_t i = 0; i < corners.size(); ++i)
  {
    const Eigen::Vector3d& next = corners[(i + 1) % corners.size()];
    lines.insert(lines.end(), { apex, corners[i], corners[i], next });
  }
  lines.insert(lines.end(), { left, top, top, right });
  return lines;
}

Marker frustum(const std_msgs::Header& header, const std::string& part, const Camera& camera, const Sizes& sizes,
               const std_msgs::ColorRGBA& its_colour)
{
  return markerOf(header, part, Marker::LINE_LIST, 0.5 * sizes.line, its_colour, frustumOf(camera, sizes.frustum));
}

/** An arrow from the header's frame in a direction; it deletes when that is not finite or zero. */
Marker arrow(const std_msgs::Header& header, const Eigen::Vector3d& direction, const Sizes& sizes)
{
  const Eigen::Vector3d end = sizes.arrow * direction / direction.norm();
  Marker marker =
      markerOf(header, "direction", Marker::ARROW, 2.0 * sizes.line, OF_VIEW, { Eigen::Vector3d::Zero(), end });
  marker.scale.y = 5.0 * sizes.line;   // of the head
  marker.scale.z = 10.0 * sizes.line;  // its length
  return forAMoment(marker);
}

/** Points with their support. @param supports of each. */
Marker points(const std_msgs::Header& header, const Places& places, const std::vector<bool>& supports,
              const Sizes& sizes)
{
  Marker marker = markerOf(header, "points", Marker::POINTS, sizes.point, SUPPORTS, places, 1);
  marker.scale.y = sizes.point;
  for (std::size_t i = 0; i < marker.points.size(); ++i)
  {
    marker.colors.push_back(supports[i] ? SUPPORTS : MISSING);
  }
  return marker;
}

/** The floor's pose of a base in odometry's frame. */
Eigen::Isometry3d inSpace(const PlanarPose& pose)
{
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.translation() = Eigen::Vector3d(pose.x, pose.y, 0.0);
  result.linear() = Eigen::AngleAxisd(pose.yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return result;
}

Eigen::Vector3d onFloor(const PlanarPose& pose)
{
  return { pose.x, pose.y, ABOVE_FLOOR };
}

/** The way from the base to the view's pose: by the end of a manoeuvre, where there is one. */
Places wayToGo(const HomingScene& scene)
{
  Places way{ onFloor(scene.base) };
  if (scene.course.kind == Course::LINE)
  {
    way.push_back(onFloor(scene.course.end));
  }
  way.push_back(onFloor(*scene.report.goal_in_odom));
  return way;
}

/** The route's line and its stops, blue from the one that is driven to on. */
void addRoute(const std_msgs::Header& odom, const RoutePlaces& route, std::vector<Marker>& markers)
{
  Places places;
  for (const PlanarPose& stop : route.stops)
  {
    places.push_back(onFloor(stop));
  }
  markers.push_back(markerOf(odom, "route", Marker::LINE_STRIP, OF_BASE.line, OF_ROUTE, places));
  Marker stops = markerOf(odom, "stops", Marker::SPHERE_LIST, STOP, OF_VIEW, places, 1);
  stops.scale.y = stops.scale.z = STOP;
  for (std::size_t i = 0; i < stops.points.size(); ++i)
  {
    stops.colors.push_back(i < route.index ? OF_NOW : OF_VIEW);
  }
  markers.push_back(stops);
}

/** Where the rays of pixels meet a plane nᵀ X = d, in the camera's frame; NaN where they do not, or too far away. */
Places onPlane(const Points& pixels, const Camera& camera, const Eigen::Vector3d& normal, double distance)
{
  const Eigen::Matrix3d inverse = camera.k.inverse();
  Places result;
  for (const Eigen::Vector2d& pixel : pixels)
  {
    const Eigen::Vector3d ray = inverse * pixel.homogeneous();
    const double depth = distance / normal.dot(ray);
    const bool seen = depth > 0.0 && depth * ray.norm() <= MOST_DISTANCE;
    result.push_back(seen ? Eigen::Vector3d(depth * ray) : Eigen::Vector3d::Constant(std::nan("")));
  }
  return result;
}

/** Two triangles that fill the quadrilateral of four corners. */
Places filled(const Places& corners)
{
  return { corners[0], corners[1], corners[2], corners[0], corners[2], corners[3] };
}

Points cornersOf(const cv::Rect& region)
{
  const double left = region.x;
  const double top = region.y;
  const double right = left + region.width - 1.0;
  const double bottom = top + region.height - 1.0;
  return { { left, top }, { right, top }, { right, bottom }, { left, bottom } };
}

}  // namespace

MarkerArray toMarkers(const HomingScene& scene)
{
  std_msgs::Header odom;
  odom.stamp = scene.stamp;
  odom.frame_id = scene.odom_frame;
  std_msgs::Header base = odom;
  base.frame_id = scene.base_frame;
  std_msgs::Header camera = odom;
  camera.frame_id = scene.camera_frame;
  const std::optional<PlanarPose>& goal = scene.report.goal_in_odom;

  MarkerArray message;
  std::vector<Marker>& markers = message.markers;
  markers.push_back(forAMoment(frustum(camera, "camera", scene.camera, OF_BASE, OF_NOW)));
  Places driven = scene.driven;
  for (Eigen::Vector3d& place : driven)
  {
    place.z() = ABOVE_FLOOR;
  }
  markers.push_back(markerOf(odom, "way_driven", Marker::LINE_STRIP, OF_BASE.line, OF_NOW, driven));
  if (scene.route)
  {
    addRoute(odom, *scene.route, markers);
  }
  if (!goal)
  {
    const double heading = scene.report.heading;
    markers.push_back(arrow(base, { std::cos(heading), std::sin(heading), 0.0 }, OF_BASE));
    for (const char* part : { "view", "way_to_go", "points" })
    {
      markers.push_back(deletion(odom, part));
    }
    return message;
  }
  const Eigen::Isometry3d view_in_odom = inSpace(*goal) * scene.base_from_camera;
  markers.push_back(deletion(base, "direction"));
  markers.push_back(at(view_in_odom, frustum(odom, "view", scene.view_camera, OF_BASE, OF_VIEW)));
  markers.push_back(forAMoment(markerOf(odom, "way_to_go", Marker::LINE_STRIP, OF_BASE.line, OF_VIEW, wayToGo(scene))));
  Places places;
  std::vector<bool> supports;
  for (const HomingLandmark& landmark : scene.landmarks)
  {
    if (landmark.position.norm() <= MOST_DISTANCE)
    {
      places.push_back(landmark.position);
      supports.push_back(landmark.supporting);
    }
  }
  markers.push_back(at(view_in_odom, points(odom, places, supports, OF_BASE)));
  return message;
}

MarkerArray toMarkers(const PlaneScene& scene)
{
  std_msgs::Header odom = scene.header;
  odom.frame_id = scene.odom_frame;
  const std::optional<PlaneEstimate>& plane = scene.track.plane;
  const bool metric = plane && plane->distance && plane->normal_known && scene.camera_in_odom;

  MarkerArray message;
  std::vector<Marker>& markers = message.markers;
  markers.push_back(forAMoment(frustum(scene.header, "camera", scene.camera, OF_ARM, OF_NOW)));
  markers.push_back(markerOf(odom, "way_driven", Marker::LINE_STRIP, OF_ARM.line, OF_NOW, scene.driven));
  if (!metric)
  {
    const Eigen::Vector3d direction =
        plane ? plane->motion.translation_over_distance : Eigen::Vector3d(Eigen::Vector3d::Zero());
    markers.push_back(arrow(scene.header, direction, OF_ARM));
    for (const char* part : { "view", "way_to_go", "points", "plane" })
    {
      markers.push_back(deletion(odom, part));
    }
    return message;
  }
  const double distance = *plane->distance;
  Eigen::Isometry3d camera_from_view = Eigen::Isometry3d::Identity();
  camera_from_view.linear() = plane->motion.rotation;
  camera_from_view.translation() = distance * plane->motion.translation_over_distance;
  const Eigen::Isometry3d view_in_odom = *scene.camera_in_odom * camera_from_view;
  markers.push_back(deletion(scene.header, "direction"));
  markers.push_back(at(view_in_odom, frustum(odom, "view", scene.camera, OF_ARM, OF_VIEW)));
  markers.push_back(forAMoment(markerOf(odom, "way_to_go", Marker::LINE_STRIP, OF_ARM.line, OF_VIEW,
                                        { scene.camera_in_odom->translation(), view_in_odom.translation() })));
  const Eigen::Vector3d& normal = plane->motion.normal;
  Marker patch = markerOf(odom, "plane", Marker::TRIANGLE_LIST, 1.0, OF_PLANE,
                          filled(onPlane(cornersOf(scene.region), scene.camera, normal, distance)));
  patch.scale.y = patch.scale.z = 1.0;
  patch.colors.assign(patch.points.size(), OF_PLANE);  // then rviz does not shade it, so that its back is not black
  markers.push_back(at(view_in_odom, patch));

  const Points& found = scene.track.homography.points;
  Places places;
  std::vector<bool> supports;
  const Places on_plane = onPlane(scene.points, scene.camera, normal, distance);
  for (std::size_t i = 0; i < on_plane.size(); ++i)
  {
    if (on_plane[i].allFinite())
    {
      places.push_back(on_plane[i]);
      supports.push_back(std::find(found.begin(), found.end(), scene.points[i]) != found.end());
    }
  }
  markers.push_back(at(view_in_odom, points(odom, places, supports, OF_ARM)));
  return message;
}

MarkerArray deletionOf(const MarkerArray& message)
{
  MarkerArray result;
  for (const Marker& marker : message.markers)
  {
    if (marker.action == Marker::ADD)
    {
      result.markers.push_back(deletion(marker.header, marker.ns));
    }
  }
  return result;
}

}  // namespace view_servo
