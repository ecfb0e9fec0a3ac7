// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "record_bag_test.h"

#include "sim/puma.h"
#include "sim/world_reader.h"
#include "sim_ros/robot_messages.h"
#include "view_servo/ros/conversions.h"

#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
Eigen::Isometry3d poseOf(const geometry_msgs::TransformStamped& transform)
{
  geometry_msgs::Pose pose;
  pose.position.x = transform.transform.translation.x;
  pose.position.y = transform.transform.translation.y;
  pose.position.z = transform.transform.translation.z;
  pose.orientation = transform.transform.rotation;
  return sim::toIsometry(pose);
}

/** Expects 1 mm and 0.1 degrees at most between two poses. */
void expectNear(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b, const ros::Time& when)
{
  EXPECT_LT((a.translation() - b.translation()).norm(), 1e-3) << when;
  EXPECT_LT(Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle(), 0.1 * DEGREE) << when;
}

/** Mean difference of neighbouring grey levels: less in a blurred image. */
double sharpness(const Image& image)
{
  const cv::Mat grey = toGrey(image, "image");
  return cv::norm(grey.colRange(1, grey.cols), grey.colRange(0, grey.cols - 1), cv::NORM_L1) /
         static_cast<double>(grey.total());
}

TEST_F(RecordBagTest, HasTheTopicsOfANomad)
{
  const std::string bag = record(nomad_);
  // 2 s, both ends included.
  const std::map<std::string, int> expected{ { CAMERA_INFOS, 9 }, { IMAGES, 9 },  { ODOMETRY, 41 },
                                             { TF, 41 },          { TRUTHS, 41 }, { TF_STATIC, 1 } };
  EXPECT_EQ(topicsOf(bag), expected);

  const std::vector<Image> images = messagesOf<Image>(bag, IMAGES);
  const std::vector<CameraInfo> infos = messagesOf<CameraInfo>(bag, CAMERA_INFOS);
  std::map<ros::Time, int> truths;
  for (const Truth& truth : messagesOf<Truth>(bag, TRUTHS))
  {
    ++truths[truth.header.stamp];
    EXPECT_EQ(truth.header.frame_id, "world");
  }
  for (std::size_t i = 0; i < images.size(); ++i)
  {
    EXPECT_EQ(images[i].header.stamp, ros::Time(1000.0 + 0.25 * static_cast<double>(i)));
    EXPECT_EQ(infos[i].header.stamp, images[i].header.stamp);
    EXPECT_EQ(truths.count(images[i].header.stamp), 1U);
    EXPECT_EQ(images[i].header.frame_id, "camera_optical_frame");
    EXPECT_EQ(infos[i].header.frame_id, "camera_optical_frame");
    EXPECT_EQ(images[i].encoding, sensor_msgs::image_encodings::MONO8);
    EXPECT_EQ(images[i].width, 160U);
    EXPECT_EQ(images[i].height, 120U);
  }
  for (const Odometry& odometry : messagesOf<Odometry>(bag, ODOMETRY))
  {
    EXPECT_EQ(odometry.header.frame_id, "odom");
    EXPECT_EQ(odometry.child_frame_id, "base_link");
    EXPECT_EQ(truths.count(odometry.header.stamp), 1U);
  }
}

TEST_F(RecordBagTest, CompressesImagesWhenAsked)
{
  const std::vector<Image> plain = messagesOf<Image>(record(nomad_, {}, "plain.bag"), IMAGES);
  const std::string bag = record(nomad_, { "--jpeg", "90" });
  EXPECT_EQ(topicsOf(bag).count(IMAGES), 0U);
  const auto images = messagesOf<sensor_msgs::CompressedImage>(bag, IMAGES + std::string("/compressed"));
  ASSERT_EQ(images.size(), plain.size());
  for (std::size_t i = 0; i < images.size(); ++i)
  {
    EXPECT_EQ(images[i].header, plain[i].header);
    EXPECT_EQ(images[i].format, "mono8; jpeg compressed ");
    const cv::Mat image = cv::imdecode(images[i].data, cv::IMREAD_UNCHANGED);
    const cv::Mat expected(cv::Size(160, 120), CV_8UC1, const_cast<unsigned char*>(plain[i].data.data()));
    ASSERT_EQ(image.size(), expected.size());
    ASSERT_EQ(image.type(), CV_8UC1);
    EXPECT_LT(cv::norm(image, expected, cv::NORM_L1), 3.0 * 160 * 120);
  }
}

TEST_F(RecordBagTest, KeepsTheStaticTransformForThoseWhoComeLater)
{
  const std::string file = record(nomad_);
  const rosbag::Bag bag(file);
  for (const rosbag::MessageInstance& instance : rosbag::View(bag))
  {
    const bool latched = (*instance.getConnectionHeader())["latching"] == "1";
    EXPECT_EQ(latched, instance.getTopic() == TF_STATIC) << instance.getTopic();
  }
}

TEST_F(RecordBagTest, FollowsTheTrajectory)
{
  const sim::World world = sim::readWorld(nomad_);
  for (const Truth& truth : messagesOf<Truth>(record(nomad_), TRUTHS))
  {
    const double time = 5.0 + (truth.header.stamp - ros::Time(1000.0)).toSec();
    const Eigen::Isometry3d wanted = sim::poseAt(world.trajectory("way"), time) * world.camera_on_base;
    const Eigen::Isometry3d pose = sim::toIsometry(truth.pose);
    EXPECT_LT((pose.translation() - wanted.translation()).norm(), 0.04) << time;
    EXPECT_LT(Eigen::AngleAxisd(pose.linear().transpose() * wanted.linear()).angle(), 4.0 * DEGREE) << time;
  }
}

TEST_F(RecordBagTest, IsTheSameForTheSameSeed)
{
  const std::vector<std::string> noise{ "--odometry-noise", "0.1" };
  const std::string first = readText(record(nomad_, noise, "a.bag"));
  EXPECT_GT(first.size(), 1000U);
  EXPECT_EQ(first, readText(record(nomad_, noise, "b.bag")));

  const std::string other = record(nomad_, { "--odometry-noise", "0.1", "--seed", "2" }, "c.bag");
  EXPECT_NE(messagesOf<Image>(path("a.bag"), IMAGES).back().data, messagesOf<Image>(other, IMAGES).back().data);
  EXPECT_NE(messagesOf<Odometry>(path("a.bag"), ODOMETRY).back().pose.pose.position.x,
            messagesOf<Odometry>(other, ODOMETRY).back().pose.pose.position.x);

  const std::string arm = readText(record(puma_, { "--encoder-noise", "0.001" }, "d.bag"));
  EXPECT_EQ(arm, readText(record(puma_, { "--encoder-noise", "0.001" }, "e.bag")));
  EXPECT_NE(arm, readText(record(puma_, { "--encoder-noise", "0.001", "--seed", "7" }, "f.bag")));
}

TEST_F(RecordBagTest, HasTheWorldsCalibration)
{
  for (const CameraInfo& info : messagesOf<CameraInfo>(record(nomad_), CAMERA_INFOS))
  {
    const Camera camera = toCamera(info);
    EXPECT_EQ(camera.width, 160);
    EXPECT_EQ(camera.height, 120);
    EXPECT_EQ(camera.k, sim::readWorld(nomad_).camera.k);
    EXPECT_EQ(camera.projection.leftCols<3>(), camera.k);
    EXPECT_EQ(camera.distortion_model, "plumb_bob");
  }
  for (const CameraInfo& info : messagesOf<CameraInfo>(record(nomad_, { "--focal-length-error", "0.1" }), CAMERA_INFOS))
  {
    EXPECT_NEAR(info.K[0], 143.0, 1e-9);
    EXPECT_NEAR(info.P[5], 145.2, 1e-9);
    EXPECT_EQ(info.K[2], 81.0);
  }
}

TEST_F(RecordBagTest, OdometryAgreesWithTheTruth)
{
  const std::string bag = record(nomad_);
  const Eigen::Isometry3d camera_on_base = poseOf(messagesOf<TFMessage>(bag, TF_STATIC).at(0).transforms.at(0));
  std::map<ros::Time, Eigen::Isometry3d> cameras;  // in odom
  for (const TFMessage& message : messagesOf<TFMessage>(bag, TF))
  {
    const geometry_msgs::TransformStamped& transform = message.transforms.at(0);
    EXPECT_EQ(transform.header.frame_id, "odom");
    EXPECT_EQ(transform.child_frame_id, "base_link");
    cameras[transform.header.stamp] = poseOf(transform) * camera_on_base;
  }
  for (const Odometry& odometry : messagesOf<Odometry>(bag, ODOMETRY))
  {
    expectNear(sim::toIsometry(odometry.pose.pose) * camera_on_base, cameras.at(odometry.header.stamp),
               odometry.header.stamp);
  }
  const std::vector<Truth> truths = messagesOf<Truth>(bag, TRUTHS);
  const Eigen::Isometry3d first = sim::toIsometry(truths.front().pose);
  for (std::size_t i = 1; i < truths.size(); ++i)
  {
    const ros::Time& stamp = truths[i].header.stamp;
    const Eigen::Isometry3d before = sim::toIsometry(truths[i - 1].pose);
    const Eigen::Isometry3d now = sim::toIsometry(truths[i].pose);
    expectNear(before.inverse() * now, cameras.at(truths[i - 1].header.stamp).inverse() * cameras.at(stamp), stamp);
    expectNear(first.inverse() * now, cameras.at(truths.front().header.stamp).inverse() * cameras.at(stamp), stamp);
  }
}

TEST_F(RecordBagTest, OdometryDriftsWhenToldSo)
{
  const auto distance = [&](const std::string& bag) {
    const auto at = messagesOf<Odometry>(bag, ODOMETRY).back().pose.pose.position;
    return std::hypot(at.x, at.y);
  };
  const double truth = distance(record(nomad_));
  EXPECT_NEAR(distance(record(nomad_, { "--odometry-drift", "0.2" })), 1.2 * truth, 0.01 * truth);
}

TEST_F(RecordBagTest, HasTheTopicsOfAPuma)
{
  const std::string bag = record(puma_);
  const std::map<std::string, int> expected{
    { CAMERA_INFOS, 9 }, { IMAGES, 9 }, { JOINT_STATES, 41 }, { TF, 41 }, { TRUTHS, 41 }
  };
  EXPECT_EQ(topicsOf(bag), expected);

  const sim::World world = sim::readWorld(puma_);
  std::map<ros::Time, Eigen::Isometry3d> truths;
  for (const Truth& truth : messagesOf<Truth>(bag, TRUTHS))
  {
    const double time = (truth.header.stamp - ros::Time(1000.0)).toSec();
    const Eigen::Isometry3d wanted = sim::poseAt(world.trajectory("way"), time);
    truths[truth.header.stamp] = sim::toIsometry(truth.pose);
    EXPECT_LT((truths[truth.header.stamp].translation() - wanted.translation()).norm(), 0.03) << time;
  }
  const sim::Puma puma(readText(PACKAGE_DIR "/urdf/puma560.urdf"), sim::PumaParams());
  for (const JointState& state : messagesOf<JointState>(bag, JOINT_STATES))
  {
    EXPECT_EQ(state.name, puma.jointNames());
    ASSERT_EQ(state.position.size(), 6U);
    const sim::Puma::Joints joints = Eigen::Map<const sim::Puma::Joints>(state.position.data());
    expectNear(world.robot_base * puma.nominalCameraPose(joints), truths.at(state.header.stamp), state.header.stamp);
  }
  for (const TFMessage& message : messagesOf<TFMessage>(bag, TF))
  {
    const geometry_msgs::TransformStamped& transform = message.transforms.at(0);
    EXPECT_EQ(transform.header.frame_id, "base_link");
    EXPECT_EQ(transform.child_frame_id, "camera_optical_frame");
    expectNear(world.robot_base * poseOf(transform), truths.at(transform.header.stamp), transform.header.stamp);
  }
}

TEST_F(RecordBagTest, EncodersAreNoisyWhenToldSo)
{
  const auto exact = messagesOf<JointState>(record(puma_, {}, "a.bag"), JOINT_STATES);
  const auto noisy = messagesOf<JointState>(record(puma_, { "--encoder-noise", "0.01" }, "b.bag"), JOINT_STATES);
  double sum = 0.0;
  for (std::size_t i = 0; i < exact.size(); ++i)
  {
    sum += std::pow(noisy.at(i).position[2] - exact[i].position[2], 2);
  }
  EXPECT_NEAR(std::sqrt(sum / static_cast<double>(exact.size())), 0.01, 0.005);
}

TEST_F(RecordBagTest, ShowsWhatTheOptionsSay)
{
  const auto first = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{ "--image-noise", "0" };
    arguments.insert(arguments.end(), more.begin(), more.end());
    return toGrey(messagesOf<Image>(record(nomad_, arguments), IMAGES).front(), "image");
  };
  const cv::Mat plain = first({});
  EXPECT_GT(cv::norm(plain, toGrey(messagesOf<Image>(record(nomad_), IMAGES).front(), "image"), cv::NORM_INF), 2.0);
  EXPECT_GT(cv::norm(plain, first({ "--groups", "extra" }), cv::NORM_INF), 20.0);
  cv::Mat dimmed;
  plain.convertTo(dimmed, CV_8U, 0.5, 20.0);
  EXPECT_LE(cv::norm(dimmed, first({ "--light-gain", "0.5", "--light-offset", "20" }), cv::NORM_INF), 1.0);
}

TEST_F(RecordBagTest, TakesRatesAndStart)
{
  const std::string bag =
      record(nomad_, { "--rate", "3", "--odometry-rate", "40", "--start-time", "12.5", "--groups", "extra" });
  const std::map<std::string, int> counts = topicsOf(bag);
  EXPECT_EQ(counts.at(IMAGES), 7);
  EXPECT_EQ(counts.at(ODOMETRY), 81);
  EXPECT_EQ(counts.at(TRUTHS), 81 + 4) << "at each image and each odometry";
  EXPECT_EQ(messagesOf<Image>(bag, IMAGES).front().header.stamp, ros::Time(12.5));
  EXPECT_EQ(messagesOf<Odometry>(bag, ODOMETRY).back().header.stamp, ros::Time(14.5));
}

TEST_F(RecordBagTest, BlursWhatMoves)
{
  const std::vector<std::string> no_noise{ "--image-noise", "0" };
  const auto sharp = messagesOf<Image>(record(nomad_, no_noise, "a.bag"), IMAGES);
  const auto blurred =
      messagesOf<Image>(record(writeNomadWorld("slow.yaml", ", exposure: 0.2"), no_noise, "b.bag"), IMAGES);
  EXPECT_NEAR(sharpness(blurred[0]), sharpness(sharp[0]), 0.01) << "it stands still";
  EXPECT_LT(sharpness(blurred[6]), 0.9 * sharpness(sharp[6]));
}

TEST_F(RecordBagTest, FindsTheWorldsOfThePackage)
{
  const ProgramRun outcome = run({ "desk", "lose", out_, "--rate", "0.1", "--image-noise", "0" });
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  const std::vector<Image> images = messagesOf<Image>(out_, IMAGES);
  ASSERT_EQ(images.size(), 2U);
  EXPECT_EQ(images[0].width, 640U);
}

TEST_F(RecordBagTest, RefusesWhatIsUnknown)
{
  expectBadInput({}, "WORLD TRAJECTORY OUT.bag");
  expectBadInput({ nomad_, out_ }, "WORLD TRAJECTORY OUT.bag");
  expectBadInput({ nomad_, "way", out_, "more" }, "WORLD TRAJECTORY OUT.bag");
  expectBadInput({ "nowhere", "way", out_ }, "'nowhere'");
  expectBadInput({ path("none.yaml"), "way", out_ }, path("none.yaml"));
  expectBadInput({ writeText("bad.yaml", "robot: [1, 2"), "way", out_ }, path("bad.yaml"));
  expectBadInput({ nomad_, "detour", out_ }, "'detour'");
  expectBadInput({ nomad_, "way", out_, "--groups", "extra,fruit" }, "'fruit'");
  expectBadInput({ nomad_, "way", out_, "--speed", "3" }, "--speed");
  expectBadInput({ nomad_, "way", out_, "--seed", "-1" }, "--seed");
  expectBadInput({ nomad_, "way", out_, "--rate" }, "--rate");
}

TEST_F(RecordBagTest, RefusesNumbersOutOfRange)
{
  for (const std::string option : { "--rate", "--odometry-rate", "--start-time", "--image-noise", "--light-gain",
                                    "--light-offset", "--focal-length-error", "--odometry-drift", "--odometry-noise" })
  {
    expectBadInput({ nomad_, "way", out_, option, "nan" }, option);
    expectBadInput({ nomad_, "way", out_, option, "-1000" }, option);
  }
  for (const std::string value : { "nan", "inf", "-inf", "1e999", "-0.1", "x", "1x" })
  {
    expectBadInput({ puma_, "way", out_, "--encoder-noise", value }, "--encoder-noise");
  }
  expectBadInput({ nomad_, "way", out_, "--rate", "0" }, "--rate");
  expectBadInput({ nomad_, "way", out_, "--rate", "101" }, "--rate");
}

TEST_F(RecordBagTest, RefusesWhatTheRobotDoesNotHave)
{
  expectBadInput({ nomad_, "way", out_, "--encoder-noise", "0.1" }, "--encoder-noise");
  expectBadInput({ puma_, "way", out_, "--odometry-noise", "0.1" }, "--odometry-noise");
  expectBadInput({ puma_, "way", out_, "--odometry-drift", "0.1" }, "--odometry-drift");
  expectBadInput({ puma_, "way", out_, "--urdf", path("none.urdf") }, path("none.urdf"));
}

TEST_F(RecordBagTest, RefusesWaysThatCannotBeFollowed)
{
  expectBadInput({ nomad_, "crash", out_ }, "the pillar");
  expectBadInput({ nomad_, "inside", out_ }, "the pillar");
  expectBadInput({ nomad_, "long", out_ }, "'long'");
  expectBadInput({ puma_, "far", out_ }, "'far'");
}

TEST_F(RecordBagTest, RefusesFilesThatCannotBeWritten)
{
  expectBadInput({ nomad_, "way", path("none/out.bag") }, path("none/out.bag"));
  std::filesystem::create_directory(path("folder"));
  expectBadInput({ nomad_, "way", path("folder") }, path("folder"));
#ifndef __SANITIZE_THREAD__  // whose own memory is a file
  expectBadInput({ nomad_, "way", out_, "--rate", "50" }, out_, "trap \"\" XFSZ; ulimit -f 400");  // as on a full disk
#endif
}

TEST_F(RecordBagTest, SparesAnOldBagWhenItFails)
{
  const std::string old = writeText("old.bag", "old");
  EXPECT_EQ(run({ nomad_, "crash", old }).status, 2);
  EXPECT_EQ(readText(old), "old");
}

}  // namespace
}  // namespace test
}  // namespace view_servo
