// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"
#include "message.h"

#include "tools/hand_eye_bag.h"
#include "view_servo/Homography.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/views/hand_eye_file.h"
#include "view_servo/views/view_store.h"

#include <console_bridge/console.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2_msgs/TFMessage.h>
#include <boost/make_shared.hpp>

#include <optional>
#include <stdexcept>

using namespace view_servo;

namespace
{
constexpr int SIDE = 32;  // of the view [px]

Camera viewCamera()
{
  Camera camera;
  camera.width = camera.height = SIDE;
  camera.k << SIDE, 0.0, 0.5 * (SIDE - 1), 0.0, SIDE, 0.5 * (SIDE - 1), 0.0, 0.0, 1.0;
  camera.projection.leftCols<3>() = camera.k;
  camera.distortion_model = "plumb_bob";
  camera.distortion.assign(5, 0.0);
  return camera;
}

/** A store with the view 'view'. */
class Calibration
{
public:
  Calibration()
  {
    StoredView view;
    view.name = sources_.view = "view";
    view.image = cv::Mat(SIDE, SIDE, CV_8UC1, cv::Scalar(90));
    view.camera = viewCamera();
    sources_.views_dir = directory_.path() / "views";
    ViewStore(sources_.views_dir).save(view, true);
    sources_.base_frame = "base";
    sources_.flange_frame = "flange";
    sources_.camera = "camera";
    sources_.tracker = "tracker";
  }

  /** @param choice whether there is a calibration to begin with, and the camera is on a mobile base. */
  void read(std::uint8_t choice, const std::vector<fuzz::Record>& records) const
  {
    HandEyeRecording recording;
    if (choice % 2 == 0)
    {
      recording.info = boost::make_shared<sensor_msgs::CameraInfo>(toCameraInfo(viewCamera(), {}));
    }
    HandEyeSources sources = sources_;
    sources.on_base = choice / 2 % 2 == 1;
    fuzz::readOrRefuse<std::runtime_error>([&] {
      for (const fuzz::Record& record : records)
      {
        add(recording, record);
      }
      requirePoses(posesIn(recording, sources));
    });
  }

private:
  /** Homographies come several times, one after the other, as an arm has to stand still. */
  static void add(HandEyeRecording& recording, const fuzz::Record& record)
  {
    constexpr int KINDS = 4;
    constexpr int MOST_TIMES = 8;
    constexpr std::size_t MOST_HOMOGRAPHIES = 200;
    const ros::Duration period(0.2);
    switch (record.kind % KINDS)
    {
      case 0:
      case 1:
        if (const auto message = record.as<tf2_msgs::TFMessage>())
        {
          recording.addTransforms(*message, record.kind % KINDS == 1);
        }
        break;
      case 2:
        if (const auto message = record.as<sensor_msgs::CameraInfo>(); message && !recording.info)
        {
          recording.info = boost::make_shared<sensor_msgs::CameraInfo>(*message);
        }
        break;
      default:
        if (auto message = record.as<Homography>())
        {
          const ros::Time last = ros::TIME_MAX - ros::Duration(MOST_TIMES * period.toSec());
          for (int i = 0; i <= record.kind / KINDS % MOST_TIMES && recording.homographies.size() < MOST_HOMOGRAPHIES;
               ++i)
          {
            recording.homographies.push_back(boost::make_shared<Homography>(*message));
            message->header.stamp = message->header.stamp < last ? message->header.stamp + period : last;
          }
        }
        break;
    }
  }

  void requirePoses(const HandEyePosesFile& file) const
  {
    for (const HandEyePose& pose : file.poses)
    {
      fuzz::require(pose.flange_in_base.matrix().allFinite() && pose.h.allFinite(), "poses are finite");
    }
    if (!file.poses.empty() && !file.camera_frame.empty())
    {
      const std::string again = (directory_.path() / "again.yaml").string();
      writeHandEyePosesFile(file, again);
      fuzz::require(readHandEyePosesFile(again).poses.size() == file.poses.size(), "what is written is read again");
    }
  }

  fuzz::Directory directory_;
  HandEyeSources sources_;
};
}  // namespace

/** A byte, and records of what is in a bag for calibrate_hand_eye: transforms, calibrations, homographies. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  static const Calibration calibration;
  console_bridge::setLogLevel(console_bridge::CONSOLE_BRIDGE_LOG_NONE);
  if (size > 0)
  {
    calibration.read(data[0], fuzz::recordsOf(data + 1, size - 1));
  }
  return 0;
}
