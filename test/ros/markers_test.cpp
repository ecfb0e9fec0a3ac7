// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/markers.h"
#include "view_servo/parameters/numbers.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

Camera pinhole()
{
  Camera camera;
  camera.width = 640;
  camera.height = 480;
  camera.k << 500.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0;
  return camera;
}

/** A camera that looks ahead, 0.8 m above the floor and 0.1 m before the base's middle. */
Eigen::Isometry3d cameraOnBase()
{
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  pose.translation() = Eigen::Vector3d(0.1, 0.0, 0.8);
  return pose;
}

HomingScene homingScene()
{
  HomingScene scene;
  scene.stamp = ros::Time(12.5);
  scene.odom_frame = "odom";
  scene.base_frame = "base_link";
  scene.camera_frame = "camera_optical_frame";
  scene.camera = scene.view_camera = pinhole();
  scene.base_from_camera = cameraOnBase();
  scene.base = { -1.0, 0.5, 0.3 };
  scene.report.heading = 0.4;
  scene.driven = { { -2.0, 0.5, 0.0 }, { -1.0, 0.5, 0.0 } };
  return scene;
}

HomingScene metricScene()
{
  HomingScene scene = homingScene();
  scene.report.goal_in_odom = PlanarPose{ 1.0, 2.0, M_PI_2 };
  scene.landmarks = { { { 0.2, 0.1, 2.0 }, true }, { { -0.3, 0.0, 1.5 }, false } };
  return scene;
}

/** A plane 0.5 m before the view's camera, seen from where the camera has moved by 0.1 m and turned by 0.2 rad. */
PlaneScene planeScene()
{
  PlaneScene scene;
  scene.header.stamp = ros::Time(7.25);
  scene.header.frame_id = "camera_optical_frame";
  scene.odom_frame = "base_link";
  scene.camera = pinhole();
  scene.region = cv::Rect(100, 100, 301, 201);
  PlaneEstimate plane;
  plane.motion.rotation = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()).toRotationMatrix();
  plane.motion.translation_over_distance = Eigen::Vector3d(0.1, -0.05, 0.2) / 0.5;
  plane.motion.normal = Eigen::Vector3d(0.1, -0.2, 1.0).normalized();
  plane.normal_known = true;
  plane.distance = 0.5;
  scene.track.state = TrackingState::TRACKING;
  scene.track.plane = plane;
  scene.points = { { 150.0, 150.0 }, { 200.0, 250.0 } };
  scene.track.homography.points = { scene.points[1] };
  Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();
  camera.linear() = Eigen::AngleAxisd(2.0, Eigen::Vector3d(1.0, 2.0, -1.0).normalized()).toRotationMatrix();
  camera.translation() = Eigen::Vector3d(0.4, -0.2, 0.9);
  scene.camera_in_odom = camera;
  scene.driven = { { 0.3, -0.2, 0.9 }, { 0.4, -0.2, 0.9 } };
  return scene;
}

const Marker& partOf(const MarkerArray& message, const std::string& part)
{
  static const Marker NONE;
  for (const Marker& marker : message.markers)
  {
    if (marker.ns == part)
    {
      return marker;
    }
  }
  ADD_FAILURE() << "there is no " << part;
  return NONE;
}

/** Names of the parts that are added. */
std::set<std::string> added(const MarkerArray& message)
{
  std::set<std::string> parts;
  for (const Marker& marker : message.markers)
  {
    if (marker.action == Marker::ADD)
    {
      parts.insert(marker.ns);
    }
  }
  return parts;
}

std::set<std::string> all(const MarkerArray& message)
{
  std::set<std::string> parts;
  for (const Marker& marker : message.markers)
  {
    EXPECT_TRUE(parts.insert(marker.ns).second) << marker.ns;
    EXPECT_EQ(marker.id, 0);
  }
  return parts;
}

Eigen::Vector3d toVector(const geometry_msgs::Point& point)
{
  return { point.x, point.y, point.z };
}

Eigen::Isometry3d poseOf(const Marker& marker)
{
  const geometry_msgs::Quaternion& q = marker.pose.orientation;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).toRotationMatrix();
  pose.translation() = toVector(marker.pose.position);
  return pose;
}

/** What rviz refuses or warns of. */
void expectWellFormed(const MarkerArray& message)
{
  for (const Marker& marker : message.markers)
  {
    SCOPED_TRACE(marker.ns);
    const geometry_msgs::Quaternion& q = marker.pose.orientation;
    EXPECT_NEAR(std::hypot(std::hypot(q.w, q.x), std::hypot(q.y, q.z)), 1.0, 1e-9);
    EXPECT_TRUE(toVector(marker.pose.position).allFinite());
    EXPECT_TRUE(marker.colors.empty() || marker.colors.size() == marker.points.size());
    if (marker.action != Marker::ADD)
    {
      EXPECT_EQ(marker.action, Marker::DELETE);
      continue;
    }
    EXPECT_FALSE(marker.header.frame_id.empty());
    EXPECT_FALSE(marker.points.empty());
    EXPECT_GT(marker.scale.x, 0.0);
    EXPECT_GT(marker.color.a, 0.0F);
    for (const geometry_msgs::Point& point : marker.points)
    {
      EXPECT_TRUE(toVector(point).allFinite());
    }
    EXPECT_TRUE(marker.type != Marker::LINE_LIST || marker.points.size() % 2 == 0);
    EXPECT_TRUE(marker.type != Marker::TRIANGLE_LIST || marker.points.size() % 3 == 0);
    EXPECT_TRUE(marker.type != Marker::ARROW || marker.points.size() == 2);
  }
}

TEST(MarkersOfHoming, TheViewStandsAtItsPoseInOdometrysFrame)
{
  const HomingScene scene = metricScene();
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  EXPECT_EQ(added(message), (std::set<std::string>{ "camera", "view", "way_driven", "way_to_go", "points" }));
  const Marker& view = partOf(message, "view");
  EXPECT_EQ(view.header.frame_id, "odom");
  EXPECT_EQ(view.header.stamp, scene.stamp);
  EXPECT_EQ(view.type, Marker::LINE_LIST);
  EXPECT_EQ(view.lifetime, ros::Duration(0.0));
  // The base is at (1, 2) and looks along y; its camera is 0.1 m before its middle.
  const Eigen::Isometry3d pose = poseOf(view);
  EXPECT_LT((pose.translation() - Eigen::Vector3d(1.0, 2.1, 0.8)).norm(), 1e-12);
  EXPECT_LT((pose.linear().col(2) - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  EXPECT_LT((pose.linear().col(1) + Eigen::Vector3d::UnitZ()).norm(), 1e-12);
}

TEST(MarkersOfHoming, AFrustumHasTheCamerasAngles)
{
  const MarkerArray message = toMarkers(metricScene());
  const Marker& view = partOf(message, "view");
  EXPECT_EQ(toVector(view.points[0]), Eigen::Vector3d::Zero());
  const Eigen::Vector3d corner = toVector(view.points[1]);
  EXPECT_NEAR(corner.x() / corner.z(), -319.5 / 500.0, 1e-9);
  EXPECT_NEAR(corner.y() / corner.z(), -239.5 / 500.0, 1e-9);
  const Marker& camera = partOf(message, "camera");
  EXPECT_EQ(camera.header.frame_id, "camera_optical_frame");
  EXPECT_GT(camera.lifetime, ros::Duration(0.0));
}

TEST(MarkersOfHoming, TheWayGoesToTheViewByTheEndOfAManoeuvre)
{
  HomingScene scene = metricScene();
  const MarkerArray straight = toMarkers(scene);
  const Marker& way = partOf(straight, "way_to_go");
  ASSERT_EQ(way.points.size(), 2U);
  EXPECT_EQ(toVector(way.points[0]).head<2>(), Eigen::Vector2d(-1.0, 0.5));
  EXPECT_EQ(toVector(way.points[1]).head<2>(), Eigen::Vector2d(1.0, 2.0));
  scene.course.kind = Course::LINE;
  scene.course.end = { 0.0, 3.0, 0.0 };
  const MarkerArray bent = toMarkers(scene);
  ASSERT_EQ(partOf(bent, "way_to_go").points.size(), 3U);
  EXPECT_EQ(toVector(partOf(bent, "way_to_go").points[1]).head<2>(), Eigen::Vector2d(0.0, 3.0));
  EXPECT_EQ(partOf(bent, "way_driven").points.size(), 2U);
  EXPECT_EQ(partOf(bent, "way_driven").points[0].x, -2.0);
}

TEST(MarkersOfHoming, PointsAreColouredByTheirSupport)
{
  HomingScene scene = metricScene();
  scene.landmarks.push_back({ { 0.0, 0.0, NOT_A_NUMBER }, true });
  scene.landmarks.push_back({ { 0.0, 0.0, 1e6 }, true });
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  const Marker& points = partOf(message, "points");
  ASSERT_EQ(points.points.size(), 2U);
  ASSERT_EQ(points.colors.size(), 2U);
  EXPECT_GT(points.colors[0].g, points.colors[0].r);
  EXPECT_GT(points.colors[1].r, points.colors[1].g);
  // 2 m before the view's camera, which looks along y from (1, 2.1, 0.8): 0.2 m to its right, 0.1 m below it.
  EXPECT_LT((poseOf(points) * toVector(points.points[0]) - Eigen::Vector3d(1.2, 4.1, 0.7)).norm(), 1e-12);
}

TEST(MarkersOfHoming, AnArrowShowsTheDirectionWhileNothingIsKnownInMetres)
{
  const MarkerArray message = toMarkers(homingScene());
  expectWellFormed(message);
  EXPECT_EQ(added(message), (std::set<std::string>{ "camera", "direction", "way_driven" }));
  const Marker& direction = partOf(message, "direction");
  EXPECT_EQ(direction.header.frame_id, "base_link");
  EXPECT_EQ(direction.type, Marker::ARROW);
  EXPECT_NEAR(std::atan2(direction.points[1].y, direction.points[1].x), 0.4, 1e-12);
  EXPECT_GT(direction.lifetime, ros::Duration(0.0));
}

TEST(MarkersOfHoming, EachMessageHasAllPartsSoThatNothingOldStays)
{
  const std::set<std::string> parts = all(toMarkers(metricScene()));
  EXPECT_EQ(parts, all(toMarkers(homingScene())));
  EXPECT_EQ(parts.size(), 6U);
  EXPECT_EQ(partOf(toMarkers(metricScene()), "direction").action, Marker::DELETE);
  EXPECT_EQ(partOf(toMarkers(homingScene()), "view").action, Marker::DELETE);
}

TEST(MarkersOfHoming, ARouteIsALineWithItsStops)
{
  HomingScene scene = homingScene();
  EXPECT_EQ(all(toMarkers(scene)).count("route"), 0U) << "no route is followed";
  scene.route.emplace();
  EXPECT_EQ(partOf(toMarkers(scene), "route").action, Marker::DELETE) << "where it is is not known yet";
  EXPECT_EQ(partOf(toMarkers(scene), "stops").action, Marker::DELETE);
  scene.route->stops = { { 0.0, 1.0, 0.0 }, { 1.0, 2.0, 0.1 }, { 2.0, 2.5, 0.2 } };
  scene.route->index = 1;
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  EXPECT_EQ(partOf(message, "route").header.frame_id, "odom");
  EXPECT_EQ(partOf(message, "route").points.size(), 3U);
  const Marker& stops = partOf(message, "stops");
  ASSERT_EQ(stops.points.size(), 3U);
  EXPECT_EQ(toVector(stops.points[2]).head<2>(), Eigen::Vector2d(2.0, 2.5));
  EXPECT_GT(stops.colors[0].r, stops.colors[0].b) << "it has been passed";
  EXPECT_GT(stops.colors[1].b, stops.colors[1].r) << "it is driven to";
}

TEST(MarkersOfHoming, NothingIsDrawnOfWhatIsNotKnown)
{
  HomingScene scene = homingScene();
  scene.report.heading = NOT_A_NUMBER;
  scene.driven.clear();
  EXPECT_EQ(added(toMarkers(scene)), std::set<std::string>{ "camera" });
  scene.camera = Camera();
  EXPECT_TRUE(added(toMarkers(scene)).empty());
  scene = metricScene();
  scene.report.goal_in_odom->x = NOT_A_NUMBER;
  scene.driven[0].x() = std::numeric_limits<double>::infinity();
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  EXPECT_EQ(added(message), std::set<std::string>{ "camera" });
}

TEST(MarkersOfHoming, AFisheyesFrustumIsFinite)
{
  HomingScene scene = metricScene();
  scene.view_camera.distortion_model = "equidistant";
  scene.view_camera.distortion = { 0.0, 0.0, 0.0, 0.0 };
  scene.view_camera.k(0, 0) = scene.view_camera.k(1, 1) = 220.0;  // the corners are 104 degrees from the axis
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  EXPECT_EQ(added(message).count("view"), 1U);
}

TEST(MarkersOfAPlane, TheViewAndItsPlaneStandInOdometrysFrame)
{
  const PlaneScene scene = planeScene();
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  EXPECT_EQ(added(message), (std::set<std::string>{ "camera", "view", "way_driven", "way_to_go", "points", "plane" }));
  Eigen::Isometry3d camera_from_view = Eigen::Isometry3d::Identity();
  camera_from_view.linear() = scene.track.plane->motion.rotation;
  camera_from_view.translation() = Eigen::Vector3d(0.1, -0.05, 0.2);
  const Eigen::Isometry3d view_in_odom = *scene.camera_in_odom * camera_from_view;
  const Marker& view = partOf(message, "view");
  EXPECT_EQ(view.header.frame_id, "base_link");
  EXPECT_EQ(view.header.stamp, scene.header.stamp);
  EXPECT_LT((poseOf(view).matrix() - view_in_odom.matrix()).norm(), 1e-9);
  EXPECT_LT((toVector(partOf(message, "way_to_go").points[1]) - view_in_odom.translation()).norm(), 1e-9);

  const Marker& plane = partOf(message, "plane");
  ASSERT_EQ(plane.points.size(), 6U);
  std::set<std::pair<int, int>> corners;
  for (const geometry_msgs::Point& point : plane.points)
  {
    const Eigen::Vector3d in_view = view_in_odom.inverse() * poseOf(plane) * toVector(point);
    EXPECT_NEAR(scene.track.plane->motion.normal.dot(in_view), 0.5, 1e-9);
    const Eigen::Vector2d pixel = scene.camera.project(in_view);
    corners.insert({ static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y())) });
  }
  EXPECT_EQ(corners, (std::set<std::pair<int, int>>{ { 100, 100 }, { 400, 100 }, { 400, 300 }, { 100, 300 } }));
  const Marker& points = partOf(message, "points");
  ASSERT_EQ(points.colors.size(), 2U);
  EXPECT_GT(points.colors[0].r, points.colors[0].g);
  EXPECT_GT(points.colors[1].g, points.colors[1].r);
}

TEST(MarkersOfAPlane, AnArrowShowsTheDirectionWhileTheDistanceIsNotKnown)
{
  for (const char* unknown : { "distance", "normal", "camera" })
  {
    SCOPED_TRACE(unknown);
    PlaneScene scene = planeScene();
    if (unknown == std::string("distance"))
    {
      scene.track.plane->distance.reset();
    }
    else if (unknown == std::string("normal"))
    {
      scene.track.plane->normal_known = false;
    }
    else
    {
      scene.camera_in_odom.reset();
    }
    const MarkerArray message = toMarkers(scene);
    expectWellFormed(message);
    EXPECT_EQ(all(message), all(toMarkers(planeScene())));
    EXPECT_EQ(added(message), (std::set<std::string>{ "camera", "direction", "way_driven" }));
    const Marker& direction = partOf(message, "direction");
    EXPECT_EQ(direction.header.frame_id, "camera_optical_frame");
    const Eigen::Vector3d wanted = Eigen::Vector3d(0.1, -0.05, 0.2).normalized();
    EXPECT_LT((toVector(direction.points[1]).normalized() - wanted).norm(), 1e-9);
  }
}

TEST(MarkersOfAPlane, WithoutTrackOrFrameOnlyTheCameraIsDrawn)
{
  PlaneScene scene = planeScene();
  scene.track = PlaneTrack();
  scene.odom_frame.clear();
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  EXPECT_EQ(added(message), std::set<std::string>{ "camera" });
}

TEST(MarkersOfAPlane, APlaneThatTheRegionsRaysDoNotMeetIsNotDrawn)
{
  PlaneScene scene = planeScene();
  scene.track.plane->motion.normal = Eigen::Vector3d::UnitX();  // seen from its edge
  const MarkerArray message = toMarkers(scene);
  expectWellFormed(message);
  EXPECT_EQ(added(message).count("plane"), 0U);
  EXPECT_EQ(added(message).count("view"), 1U);
}

TEST(Markers, ADeletionDeletesWhatWasAddedAndNothingElse)
{
  const MarkerArray message = toMarkers(homingScene());
  const MarkerArray deletion = deletionOf(message);
  EXPECT_EQ(all(deletion), added(message));
  EXPECT_TRUE(added(deletion).empty());
  EXPECT_EQ(partOf(deletion, "direction").header.frame_id, "base_link");
  EXPECT_TRUE(deletionOf(deletion).markers.empty());
}

}  // namespace
}  // namespace view_servo
