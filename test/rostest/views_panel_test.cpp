// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file The widget of rviz's panel stores a region, drives a simulated base, stops it, and is never held up. */
#include "node_test.h"

#include "rviz_panel/robot_light.h"
#include "rviz_panel/views_widget.h"
#include "view_servo/ServoStatus.h"
#include "view_servo/SetPose.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/Twist.h>
#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/spinner.h>
#include <std_srvs/SetBool.h>
#include <QtGui/QImage>
#include <QtGui/QMouseEvent>
#include <QtWidgets/QApplication>
#include <QtWidgets/QLabel>
#include <QtWidgets/QLineEdit>
#include <QtWidgets/QListWidget>
#include <QtWidgets/QPushButton>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>

namespace view_servo
{
namespace test
{
namespace
{
using Clock = std::chrono::steady_clock;

class ViewsPanelTest : public ::testing::Test
{
protected:
  void show(const std::string& robot_namespace)
  {
    RobotNames names = widget_->names();
    names.robot_namespace = robot_namespace;
    widget_->setNames(names);
    widget_->resize(900, 700);
    widget_->show();
    widget_->start();
  }

  template <typename Widget>
  Widget& find(const char* name) const
  {
    auto* found = widget_->findChild<Widget*>(name);
    if (found == nullptr)
    {
      throw std::runtime_error(std::string("the panel has no ") + name);
    }
    return *found;
  }

  std::string text(const char* label) const
  {
    return find<QLabel>(label).text().toStdString();
  }

  void press(const char* button) const
  {
    find<QPushButton>(button).click();
  }

  /** Lets Qt work until the predicate holds; notes how long it was held up at most. */
  bool waitForWidget(const std::function<bool()>& predicate)
  {
    return waitUntil(predicate, [this] {
      const Clock::time_point begin = Clock::now();
      QApplication::processEvents();
      longest_ = std::max(longest_, secondsSince(begin));
    });
  }

  bool waitForText(const char* label, const std::string& part)
  {
    return waitForWidget([&] { return text(label).find(part) != std::string::npos; });
  }

  static void mouse(QWidget& widget, QEvent::Type type, const QPointF& place)
  {
    const bool is_up = type == QEvent::MouseButtonRelease;
    QMouseEvent event(type, place, widget.mapToGlobal(place.toPoint()),
                      type == QEvent::MouseMove ? Qt::NoButton : Qt::LeftButton, is_up ? Qt::NoButton : Qt::LeftButton,
                      Qt::NoModifier);
    QApplication::sendEvent(&widget, &event);
  }

  /** Drags over a part of the picture, from its middle to both sides, once it is shown. */
  void drag(const sensor_msgs::Image& image, double part_of_width, double part_of_height)
  {
    auto& picture = find<QWidget>("picture");
    // A cursor for dragging is there.
    ASSERT_TRUE(waitForWidget([&] { return picture.cursor().shape() == Qt::CrossCursor; }));
    const double scale = std::min(picture.width() / static_cast<double>(image.width),
                                  picture.height() / static_cast<double>(image.height));
    const QPointF middle(0.5 * picture.width(), 0.5 * picture.height());
    const QPointF half(0.5 * part_of_width * scale * image.width, 0.5 * part_of_height * scale * image.height);
    mouse(picture, QEvent::MouseButtonPress, middle - half);
    mouse(picture, QEvent::MouseMove, middle);
    mouse(picture, QEvent::MouseButtonRelease, middle + half);
    EXPECT_NE(text("region").find(" corners"), std::string::npos) << text("region");
  }

  /** Stores what was dragged, and selects it. */
  void store(const char* name)
  {
    auto& views = find<QListWidget>("views");
    find<QLineEdit>("name").setText(name);
    ASSERT_TRUE(waitForWidget([&] { return find<QPushButton>("store").isEnabled(); }));
    press("store");
    ASSERT_TRUE(waitForWidget([&] { return views.count() == 1; })) << text("words");
    EXPECT_EQ(views.item(0)->text().toStdString().rfind(name, 0), 0U);
    views.setCurrentRow(0);
    ASSERT_TRUE(waitForWidget([&] { return find<QPushButton>("go").isEnabled(); }));
  }

  std::unique_ptr<ViewsWidget> widget_ = std::make_unique<ViewsWidget>();
  double longest_ = 0.0;  // [s]
};

TEST_F(ViewsPanelTest, StoresADraggedRegionDrivesAndStops)
{
  Recorder<ServoStatus> status("status");
  Recorder<geometry_msgs::Twist> commands("cmd_vel");
  Recorder<sensor_msgs::Image> images("camera/image_raw");
  ASSERT_TRUE(waitForService("view_store/save"));
  ASSERT_TRUE(waitForService("homing/enable"));
  ASSERT_TRUE(waitUntil([&] { return images.last().has_value(); }));
  show("");
  // The words tell that nothing is missing, and the light that the driver is there.
  ASSERT_TRUE(waitForText("state", "homing: disabled")) << text("state");
  ASSERT_EQ(find<QListWidget>("views").count(), 0);

  const double width = images.last()->width;
  const double height = images.last()->height;
  drag(*images.last(), 0.5, 0.6);
  store("dragged");
  const cv::Rect region = ViewStore(viewsDir("view_store")).load("dragged").region;
  EXPECT_NEAR(region.x, 0.25 * width, 3.0);
  EXPECT_NEAR(region.y, 0.2 * height, 3.0);
  EXPECT_NEAR(region.width, 0.5 * width, 5.0);
  EXPECT_NEAR(region.height, 0.6 * height, 5.0);

  // Once more: it is not replaced unasked.
  press("store");
  EXPECT_TRUE(waitForText("words", "'Replace' ticked")) << text("words");

  SetPose away;
  away.request.pose.position.x = -0.7;
  away.request.pose.position.y = 0.3;
  away.request.pose.orientation.w = 1.0;
  ASSERT_TRUE(callService("nomad_sim/set_pose", away) && away.response.success) << away.response.message;
  press("go");
  EXPECT_TRUE(waitForText("words", "press Enable, then Go")) << text("words");
  press("enable");
  ASSERT_TRUE(waitForText("words", "homing is enabled")) << text("words");
  press("go");
  ASSERT_TRUE(waitForWidget([&] {
    return status.last() && status.last()->state == ServoStatus::SERVOING && commands.last() &&
           std::hypot(commands.last()->linear.x, commands.last()->linear.y) > 0.02;
  })) << text("state")
      << ", " << text("words");
  EXPECT_TRUE(waitForText("state", "homing: servoing")) << text("state");

  press("stop");
  // Whichever comes first ends the goal: its cancellation, or the closed gate.
  EXPECT_TRUE(waitForWidget(
      [&] { return status.last()->state == ServoStatus::DISABLED || status.last()->state == ServoStatus::ABORTED; }));
  EXPECT_TRUE(waitForText("words", "Stop: homing is disabled")) << text("words");
  EXPECT_TRUE(waitForWidget([&] {
    const geometry_msgs::Twist last = *commands.last();
    return last.linear.x == 0.0 && last.linear.y == 0.0 && last.angular.z == 0.0;
  }));
  EXPECT_TRUE(waitForText("state", "homing: disabled")) << text("state");

  // Delete asks by its button, and forgets it where nobody presses it again.
  auto& views = find<QListWidget>("views");
  auto& deletes = find<QPushButton>("delete");
  press("delete");
  EXPECT_EQ(deletes.text(), "Really delete?");
  EXPECT_TRUE(waitForWidget([&] { return deletes.text() == "Delete"; }));
  EXPECT_EQ(views.count(), 1);
  press("delete");
  press("delete");
  EXPECT_TRUE(waitForWidget([&] { return views.count() == 0 && !deletes.isEnabled(); })) << text("words");
  EXPECT_THROW(ViewStore(viewsDir("view_store")).load("dragged"), ViewStoreError);
  EXPECT_LT(longest_, 0.5 * SLOWDOWN);
}

TEST_F(ViewsPanelTest, DrivesAnArmToItsViewAndStopsIt)
{
  Recorder<geometry_msgs::TwistStamped> commands("arm/cmd_vel");
  Recorder<sensor_msgs::Image> images("arm/camera/image_raw");
  ASSERT_TRUE(waitForService("arm/view_store/save"));
  ASSERT_TRUE(waitForService("arm/servo_25d/enable"));
  ASSERT_TRUE(waitUntil([&] { return images.last().has_value(); }));
  const auto is_moving = [&] {
    return commands.last() && std::abs(commands.last()->twist.linear.x) + std::abs(commands.last()->twist.linear.y) +
                                      std::abs(commands.last()->twist.linear.z) >
                                  0.005;
  };
  show("arm");
  ASSERT_TRUE(waitForText("state", "servo_25d: disabled")) << text("state");
  drag(*images.last(), 0.44, 0.85);
  store("shelf");
  press("enable");
  ASSERT_TRUE(waitForText("words", "servo_25d is enabled")) << text("words");

  SetPose away;
  away.request.pose.position.x = 0.42;
  away.request.pose.position.y = 0.06;
  away.request.pose.position.z = 0.77;
  away.request.pose.orientation.x = away.request.pose.orientation.z = -0.5;  // along the world's x axis, upright
  away.request.pose.orientation.y = away.request.pose.orientation.w = 0.5;
  ASSERT_TRUE(callService("arm/puma_sim/set_pose", away) && away.response.success) << away.response.message;
  press("go");
  EXPECT_TRUE(waitForWidget(is_moving)) << text("state") << ", " << text("words");
  EXPECT_TRUE(waitForText("state", "the camera sees view 'shelf' as one plane")) << text("state");
  EXPECT_TRUE(waitForText("words", "Arrived: ")) << text("words");
  EXPECT_TRUE(waitForText("state", "servo_25d: arrived")) << text("state");

  ASSERT_TRUE(callService("arm/puma_sim/set_pose", away) && away.response.success) << away.response.message;
  press("go");
  ASSERT_TRUE(waitForWidget(is_moving)) << text("state") << ", " << text("words");
  press("stop");
  EXPECT_TRUE(waitForText("words", "Stop: servo_25d is disabled")) << text("words");
  EXPECT_TRUE(waitForWidget([&] {
    const geometry_msgs::Twist last = commands.last()->twist;
    return last.linear.x == 0.0 && last.linear.y == 0.0 && last.linear.z == 0.0 && last.angular.x == 0.0 &&
           last.angular.y == 0.0 && last.angular.z == 0.0;
  }));
  EXPECT_TRUE(waitForText("state", "servo_25d: disabled")) << text("state");
  EXPECT_LT(longest_, 0.5 * SLOWDOWN);
  removeViews("arm/view_store");
}

TEST_F(ViewsPanelTest, SaysThatNothingIsThere)
{
  show("nowhere");
  auto& views = find<QListWidget>("views");
  const QString fault = "No views: there is no service /nowhere/view_store/list";
  EXPECT_TRUE(waitForWidget([&] { return views.count() == 1 && views.item(0)->text().startsWith(fault); }));
  EXPECT_EQ(text("state"), "no driver");
  press("enable");
  EXPECT_TRUE(waitForText("words", "No driver runs in 'nowhere'")) << text("words");
  press("stop");
  EXPECT_TRUE(waitForText("words", "Stop: no driver is known in 'nowhere'")) << text("words");
  EXPECT_TRUE(waitForWidget([&] { return !find<QPushButton>("store").isEnabled(); }));
}

TEST_F(ViewsPanelTest, IsNotHeldUpByServicesThatHang)
{
  // A driver's gate that does not answer before the test ends.
  ros::CallbackQueue queue;
  std::mutex mutex;
  std::condition_variable changed;
  bool called = false;
  bool released = false;
  ros::NodeHandle nh("hanging");
  nh.setCallbackQueue(&queue);
  ros::ServiceServer gate = nh.advertiseService<std_srvs::SetBool::Request, std_srvs::SetBool::Response>(
      "homing/enable", boost::function<bool(std_srvs::SetBool::Request&, std_srvs::SetBool::Response&)>(
                           [&](std_srvs::SetBool::Request& /*request*/, std_srvs::SetBool::Response& response) {
                             std::unique_lock<std::mutex> lock(mutex);
                             called = true;
                             changed.wait(lock, [&] { return released; });
                             response.success = 1;
                             return true;
                           }));
  ros::AsyncSpinner spinner(1, &queue);
  spinner.start();

  show("hanging");
  press("stop");
  ASSERT_TRUE(waitForWidget([&] {
    const std::lock_guard<std::mutex> lock(mutex);
    return called;
  }));
  EXPECT_TRUE(waitForText("words", "/hanging/homing/enable has not answered within 2 s")) << text("words");
  press("stop");  // its call hangs, too, when the panel is closed
  EXPECT_LT(longest_, 0.5 * SLOWDOWN);
  const Clock::time_point begin = Clock::now();
  widget_.reset();
  EXPECT_LT(secondsSince(begin), 2.0 * SLOWDOWN);
  {
    const std::lock_guard<std::mutex> lock(mutex);
    released = true;
  }
  changed.notify_all();
}

TEST(RobotLight, TellsTheWorstOfTheDriversThatAreThere)
{
  RobotSnapshot robot;
  EXPECT_EQ(judgeRobot(robot).colour, RobotLight::GREY);
  DriverState& driver = robot.drivers[0];
  driver.kind = "homing";
  driver.is_there = true;
  driver.enabled = true;
  driver.status = ServoStatus();
  driver.status->state = ServoStatus::SERVOING;
  EXPECT_EQ(judgeRobot(robot).colour, RobotLight::GREEN);
  driver.status->state = ServoStatus::ACQUIRING;
  EXPECT_EQ(judgeRobot(robot).colour, RobotLight::AMBER);
  driver.status->state = ServoStatus::ABORTED;
  EXPECT_EQ(judgeRobot(robot).colour, RobotLight::RED);
  driver.status->state = ServoStatus::CONVERGED;
  driver.enabled = false;
  EXPECT_EQ(judgeRobot(robot).colour, RobotLight::AMBER);
  driver.status->state = ServoStatus::DISABLED;
  driver.status->reason = "does not drive until ~enable is called; the last goal: the view is lost";
  EXPECT_EQ(judgeRobot(robot).text, "homing: disabled, does not drive until Enable; the last goal: the view is lost");
  driver.status->state = ServoStatus::CONVERGED;
  driver.enabled = true;
  driver.silence = 5.0;
  EXPECT_EQ(judgeRobot(robot).colour, RobotLight::RED);
  EXPECT_EQ(judgeRobot(robot).text, "homing: silent for 5 s");
  robot.followed = "the camera sees view 'dock' as one plane";
  EXPECT_EQ(judgeRobot(robot).text, "homing: silent for 5 s; the camera sees view 'dock' as one plane");
}

}  // namespace
}  // namespace test
}  // namespace view_servo

int main(int argc, char** argv)
{
  QApplication application(argc, argv);
  return view_servo::test::runTests(argc, argv, "views_panel_test");
}
