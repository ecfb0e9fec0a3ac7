// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"
#include "message.h"

#include "view_servo/Homography.h"
#include "view_servo/ImageSource.h"
#include "view_servo/LineMatches.h"
#include "view_servo/PointMatches.h"
#include "view_servo/control/homing.h"
#include "view_servo/control/joint_guard.h"
#include "view_servo/control/servo_25d.h"
#include "view_servo/images/image_io.h"
#include "view_servo/ros/arm_conversions.h"
#include "view_servo/ros/base_conversions.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/image_source.h"

#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/JointState.h>
#include <std_msgs/Header.h>
#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>

using namespace view_servo;

namespace
{
/** Kinds of records. */
enum Kind
{
  ODOMETRY,
  POINT_MATCHES,
  LINE_MATCHES,
  IMAGE,  // the header of one that shows the view; homing has no use for what image_messages reads
  TRANSFORM,
  HOMOGRAPHY,
  JOINT_STATES,
  IMAGE_SOURCE,
  KINDS
};

constexpr int WIDTH = 64;  // of the images [px]
constexpr int HEIGHT = 48;

Camera smallCamera()
{
  Camera camera;
  camera.width = WIDTH;
  camera.height = HEIGHT;
  camera.k << WIDTH, 0.0, 0.5 * (WIDTH - 1), 0.0, WIDTH, 0.5 * (HEIGHT - 1), 0.0, 0.0, 1.0;
  camera.projection.leftCols<3>() = camera.k;
  camera.distortion_model = "plumb_bob";
  camera.distortion.assign(5, 0.0);
  return camera;
}

cv::Mat viewImage()
{
  cv::Mat image(HEIGHT, WIDTH, CV_8UC1);
  cv::RNG(1).fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

/** A base that homes and an arm that servos by what they are told; the first byte chooses how. */
class Robots
{
public:
  explicit Robots(std::uint8_t choice)
    : arm_({ smallCamera().k, { WIDTH, HEIGHT }, { WIDTH / 2.0, HEIGHT / 2.0 } }, Servo25dParams()),
      joints_({ { "shoulder", { -1.0, 1.0 } }, { "wrist", { 0.0, 3.0 } } }, 0.05, 1.0)
  {
    params_.mode = choice % 2 == 0 ? HomingMode::SERVO : HomingMode::THESIS;
    if (params_.mode == HomingMode::SERVO && choice % 4 == 2)
    {
      params_.approach.base = BaseKind::DIFFERENTIAL;
    }
    target_.image = viewImage();
    target_.camera = target_.view_camera = smallCamera();
  }

  void add(const fuzz::Record& record)
  {
    switch (record.kind % KINDS)
    {
      case ODOMETRY:
        addOdometry(record.as<nav_msgs::Odometry>());
        break;
      case POINT_MATCHES:
        if (const auto message = record.as<PointMatches>())
        {
          homing().addMatches(message->header.stamp.toSec(), toHeadingEvidence(message->matches));
        }
        break;
      case LINE_MATCHES:
        if (const auto message = record.as<LineMatches>())
        {
          homing().addMatches(message->header.stamp.toSec(), toHeadingEvidence(message->points));
        }
        break;
      case IMAGE:
        addImage(record.as<std_msgs::Header>());
        break;
      case TRANSFORM:
        if (const auto message = record.as<geometry_msgs::TransformStamped>())
        {
          fuzz::readOrRefuse<std::invalid_argument>([&] {
            target_.mount = CameraMount(toIsometry(message->transform));
            homing_.reset();
          });
        }
        break;
      case HOMOGRAPHY:
        addHomography(record.as<Homography>());
        break;
      case JOINT_STATES:
        if (const auto message = record.as<sensor_msgs::JointState>())
        {
          joints_.add(time_, message->name, message->position, message->velocity);
          time_ += 0.02;
          joints_.problem(time_);
        }
        break;
      default:
        readSource(record.as<ImageSource>());
        break;
    }
    requireOrders();
  }

private:
  Homing& homing()
  {
    if (!homing_)
    {
      homing_ = makeHoming(params_, target_);
      newest_ = 0.0;
    }
    return *homing_;
  }

  /** As homing's input takes it: within its limit, and at some time. */
  void addOdometry(const std::optional<nav_msgs::Odometry>& message)
  {
    constexpr double FARTHEST = 1e6;  // [m]
    if (!message)
    {
      return;
    }
    const PlanarPose pose = toPlanarPose(*message);
    if (std::hypot(pose.x, pose.y) < FARTHEST && std::isfinite(pose.yaw))
    {
      homing().addOdometry(message->header.stamp.toSec(), pose);
    }
  }

  /** Images that are not newer than all before do not come as far as homing. */
  void addImage(const std::optional<std_msgs::Header>& header)
  {
    if (!header || header->stamp.toSec() <= newest_)
    {
      return;
    }
    homing().addImage(header->stamp.toSec(), target_.image);
    newest_ = header->stamp.toSec();
  }

  void addHomography(const std::optional<Homography>& message)
  {
    if (!message)
    {
      return;
    }
    if (message->valid == 0)
    {
      arm_.addLoss(message->header.stamp.toSec(), "the view is not in the image");
      return;
    }
    fuzz::readOrRefuse<std::runtime_error>([&] {
      const PlaneView view = toPlaneView(*message);
      fuzz::require(view.motion.rotation.allFinite() && view.motion.translation_over_distance.allFinite() &&
                        view.motion.normal.allFinite(),
                    "what is taken of a homography is finite");
      arm_.add(view);
    });
    arm_time_ = std::max(arm_time_, message->header.stamp.toSec());
  }

  static void readSource(const std::optional<ImageSource>& source)
  {
    if (!source)
    {
      return;
    }
    fuzz::readOrRefuse<ImageError>([&] {
      if (kindOf(*source, "source") == SourceKind::IMAGE)
      {
        toGrey(source->image, "source.image");
      }
    });
  }

  /** Whatever has come, what the robots would do are numbers. */
  void requireOrders()
  {
    if (homing_)
    {
      fuzz::require(homing_->command().allFinite(), "a base's velocity is finite");
      fuzz::require(homing_->report().reason.find('\n') == std::string::npos, "a reason is one line");
      for (const HomingLandmark& landmark : homing_->landmarks())
      {
        fuzz::require(landmark.position.allFinite(), "things are somewhere");
      }
    }
    constexpr double LATER = 0.02;  // [s]
    const Twist twist = arm_.command(arm_time_ + LATER);
    fuzz::require(twist.allFinite(), "a camera's velocity is finite");
    arm_.sent(arm_time_ + LATER, twist);
  }

  HomingParams params_;
  HomingTarget target_;
  std::unique_ptr<Homing> homing_;  // made by the first message for it
  double newest_ = 0.0;             // stamp of the newest image [s]
  Servo25d arm_;
  double arm_time_ = 0.0;  // of the newest homography [s]
  JointGuard joints_;
  double time_ = 0.0;  // of the joint states [s]
};
}  // namespace

/** A byte, and records of what drives robots, one after the other, as from the network or from a bag. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  constexpr std::size_t MOST = 64;  // records; more would take too long
  if (size == 0)
  {
    return 0;
  }
  Robots robots(data[0]);
  std::size_t count = 0;
  for (const fuzz::Record& record : fuzz::recordsOf(data + 1, size - 1))
  {
    if (++count > MOST)
    {
      break;
    }
    robots.add(record);
  }
  return 0;
}
