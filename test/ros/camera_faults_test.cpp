// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/camera_faults.h"

#include <gtest/gtest.h>
#include <ros/time.h>

#include <algorithm>
#include <deque>
#include <map>
#include <string>

namespace view_servo
{
namespace
{
constexpr int QUEUE_SIZE = 5;
constexpr double PERIOD = 1.0 / 30.0;  // of the camera [s]

/** A camera whose messages may come late or with stamps that are apart, and the queues of a node that pairs them. */
class FakeCamera
{
public:
  /** Messages of some seconds. @return when the first fault was told, after the beginning [s]; negative: none. */
  double play(double duration)
  {
    double told = -1.0;
    const double begin = time_;
    for (; time_ < begin + duration; time_ += PERIOD)
    {
      const double stamp = time_ + 100.0;
      if (images)
      {
        images_.way.push_back({ time_ + image_delay, stamp + image_offset });
      }
      if (infos)
      {
        infos_.way.push_back({ time_ + info_delay, stamp });
      }
      for (const bool image : { true, false })
      {
        Kind& own = image ? images_ : infos_;
        for (; !own.way.empty() && own.way.front().due <= time_ + 1e-9; own.way.pop_front())
        {
          const bool tells = receive(image, own.way.front().stamp);
          told = tells && told < 0.0 ? time_ - begin : told;
        }
      }
    }
    return told;
  }

  bool images = true;
  bool infos = true;
  double image_offset = 0.0;  // of the images' stamps [s]
  double image_delay = 0.0;   // until they come [s]
  double info_delay = 0.0;
  std::string fault;  // the last that was told

private:
  struct Sent
  {
    double due;  // when it comes [s]
    double stamp;
  };
  struct Kind
  {
    std::deque<Sent> way;        // sent, and not there yet
    std::deque<double> waiting;  // stamps, for one of the other kind
  };

  bool receive(bool image, double stamp)
  {
    const auto traffic = image ? watch_.addImage(time_, ros::Time(stamp)) : watch_.addInfo(time_, ros::Time(stamp));
    if (traffic)
    {
      fault = faultOf(*traffic, { "/image_raw", "/camera_info" });
    }
    pair(stamp, (image ? images_ : infos_).waiting, (image ? infos_ : images_).waiting);
    return traffic.has_value();
  }

  /** As message_filters::TimeSynchronizer does it: a message waits until too many have come after it. */
  void pair(double stamp, std::deque<double>& own, std::deque<double>& other)
  {
    const auto partner = std::find(other.begin(), other.end(), stamp);
    if (partner != other.end())
    {
      other.erase(other.begin(), partner + 1);
      own.clear();
      watch_.addPair();
      return;
    }
    own.push_back(stamp);
    if (own.size() > QUEUE_SIZE)
    {
      own.pop_front();
    }
  }

  PairingWatch watch_{ QUEUE_SIZE };
  double time_ = 0.0;
  Kind images_;
  Kind infos_;
};

TEST(PairingWatch, IsQuietWhileMessagesPair)
{
  EXPECT_LT(FakeCamera().play(5.0), 0.0);
  for (const double delay : { 0.03, 0.1, 0.15 })
  {
    FakeCamera late_images;
    late_images.image_delay = delay;
    EXPECT_LT(late_images.play(5.0), 0.0) << delay << ": " << late_images.fault;
  }
  FakeCamera late_infos;
  late_infos.info_delay = 0.1;
  EXPECT_LT(late_infos.play(5.0), 0.0) << late_infos.fault;
}

TEST(PairingWatch, TellsStampsThatAreApartFromTheBeginning)
{
  const std::map<double, std::string> offsets = {
    { -10.0, "10 s before" }, { -0.5, "0.5 s before" }, { 0.003, "0.003 s after" }, { 0.5, "0.5 s after" }
  };
  for (const auto& [offset, by] : offsets)
  {
    FakeCamera camera;
    camera.image_offset = offset;
    const double told = camera.play(1.0);
    EXPECT_GE(told, 0.0) << offset;
    EXPECT_LE(told, 0.25) << offset;
    EXPECT_EQ(camera.fault.rfind("no image and camera_info with the same stamp: ", 0), 0U) << camera.fault;
    EXPECT_NE(camera.fault.find("on '/image_raw' and '/camera_info', the newest image is stamped "), std::string::npos)
        << camera.fault;
    EXPECT_NE(camera.fault.find(by + " the newest camera_info"), std::string::npos) << camera.fault;
  }
}

TEST(PairingWatch, TellsStampsThatComeApart)
{
  FakeCamera camera;
  EXPECT_LT(camera.play(2.0), 0.0);
  camera.image_offset = 10.0;
  const double told = camera.play(1.0);
  EXPECT_GE(told, 0.0);
  EXPECT_LE(told, 0.25);
  EXPECT_NE(camera.fault.find("10 s after the newest camera_info"), std::string::npos) << camera.fault;
  camera.image_offset = 0.0;
  camera.play(PERIOD);  // its image is still the last without a pair
  EXPECT_LT(camera.play(2.0), 0.0) << camera.fault;
}

TEST(PairingWatch, TellsImagesWithoutCameraInfo)
{
  FakeCamera camera;
  EXPECT_LT(camera.play(1.0), 0.0);
  camera.infos = false;
  const double told = camera.play(1.0);
  EXPECT_GE(told, 0.0);
  EXPECT_LE(told, 0.25);
  EXPECT_EQ(camera.fault, "no camera_info comes on '/camera_info', though images come on '/image_raw'");
  camera.infos = true;
  camera.play(PERIOD);
  EXPECT_LT(camera.play(1.0), 0.0) << camera.fault;
}

TEST(PairingWatch, SaysNothingOfCameraInfoAlone)
{
  FakeCamera camera;
  camera.images = false;
  EXPECT_LT(camera.play(5.0), 0.0) << camera.fault;
}

TEST(PairingWatch, DoesNotCountImagesThatHaveCeased)
{
  FakeCamera camera;
  camera.infos = false;
  camera.play(1.0);
  camera.images = false;
  camera.infos = true;
  camera.play(1.0);
  EXPECT_LT(camera.play(3.0), 0.0) << camera.fault;
}

TEST(CameraTraffic, SaysNothingOfStampsThatAreNotKnown)
{
  EXPECT_EQ(faultOf(CameraTraffic{ 20, 19, 0, 5.0 }, { "/a", "/b" }),
            "no image and camera_info with the same stamp: 20 and 19 messages in 5 s on '/a' and '/b'");
  EXPECT_EQ(faultOf(CameraTraffic{ 20, 19, 1, 5.0 }, { "/a", "/b" }), "");
}

}  // namespace
}  // namespace view_servo
