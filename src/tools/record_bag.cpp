// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/renderer.h"
#include "sim/world_reader.h"
#include "sim_ros/bag_writer.h"
#include "sim_ros/nomad_robot.h"
#include "sim_ros/puma_robot.h"
#include "sim_ros/robot_messages.h"
#include "tools/command_line.h"
#include "tools/package_folder.h"
#include "tools/video.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/views/camera_file.h"

#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_msgs/TFMessage.h>
#include <Eigen/Geometry>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

/** @file
 * `record_bag WORLD TRAJECTORY OUT.bag` drives a simulated robot along a trajectory, without a ROS master, and writes
 * the messages that it would publish, with the ground truth. `record_bag --images FOLDER OUT.bag` writes recorded
 * images, `record_bag --video FILE OUT.bag` those of a video. The same command writes the same bytes. Exit status: 0
 * written; 2 bad input, with one line on standard error that names the file or option, and no bag.
 */
namespace
{
using namespace view_servo;
namespace fs = std::filesystem;

enum ExitStatus
{
  WRITTEN = 0,
  BAD_INPUT = 2
};

constexpr char IMAGE_TOPIC[] = "/camera/image_raw";
constexpr char COMPRESSED_TOPIC[] = "/camera/image_raw/compressed";
constexpr char CAMERA_INFO_TOPIC[] = "/camera/camera_info";
constexpr char GROUND_TRUTH_TOPIC[] = "/ground_truth";
constexpr char ODOMETRY_TOPIC[] = "/odom";
constexpr char JOINT_STATES_TOPIC[] = "/joint_states";
constexpr char TF_TOPIC[] = "/tf";
constexpr char TF_STATIC_TOPIC[] = "/tf_static";

constexpr double DEFAULT_RATE = 4.0;   // of images that have no times of their own [Hz]
constexpr int STEPS_PER_SECOND = 100;  // of the simulation
constexpr double DT = 1.0 / STEPS_PER_SECOND;
constexpr double MAX_DURATION = 3600.0;  // of a trajectory [s]
constexpr double TRACKING_GAIN = 2.0;    // of the way back to the trajectory [1/s]
constexpr int BLUR_POSES = 5;            // seen during an exposure

/** An optional one that is not set is as the world has it, or without error. */
struct Options
{
  std::vector<std::string> names;
  std::string images;
  std::string video;
  std::string camera;           // file of the video's calibration
  std::optional<double> rate;   // of images [Hz]
  double odometry_rate = 20.0;  // or of encoders [Hz]
  double start_time = 1000.0;   // [s]
  std::uint64_t seed = 1;
  std::vector<std::string> groups;
  std::string urdf;
  double focal_length_error = 0.0;  // as a part
  std::optional<double> image_noise;
  std::optional<double> light_gain;
  std::optional<double> light_offset;
  std::optional<double> odometry_drift;
  std::optional<double> odometry_noise;
  std::optional<double> encoder_noise;
  std::optional<int> jpeg;  // quality; else images are not compressed
};

tf2_msgs::TFMessage toTf(const geometry_msgs::TransformStamped& transform)
{
  tf2_msgs::TFMessage message;
  message.transforms.push_back(transform);
  return message;
}

/** An image and its calibration, both with the stamp of the calibration. */
void writeImage(BagWriter& bag, const cv::Mat& image, const sensor_msgs::CameraInfo& info, const Options& options)
{
  bag.write(CAMERA_INFO_TOPIC, info.header.stamp, info);
  if (!options.jpeg)
  {
    bag.write(IMAGE_TOPIC, info.header.stamp, toImage(image, sensor_msgs::image_encodings::MONO8, info.header));
    return;
  }
  sensor_msgs::CompressedImage message;
  message.header = info.header;
  message.format = std::string(sensor_msgs::image_encodings::MONO8) + "; jpeg compressed ";
  if (!cv::imencode(".jpg", image, message.data, { cv::IMWRITE_JPEG_QUALITY, *options.jpeg }))
  {
    throw std::runtime_error("cannot compress an image as JPEG");
  }
  bag.write(COMPRESSED_TOPIC, info.header.stamp, message);
}

ros::Duration toDuration(double value)
{
  ros::Duration duration;
  duration.fromNSec(std::llround(1e9 * value));
  return duration;
}

ros::Time startOf(const Options& options)
{
  return ros::Time() + toDuration(options.start_time);
}

// ------------------------------------------------------------------------------------------------ simulated robots

using Twist = sim::Robot::Twist;

/** Writes the pose of the camera on the robot, where that is fixed. */
void writeCameraMount(BagWriter& bag, const sim::Robot& robot, const ros::Time& stamp)
{
  if (const auto mount = robot.cameraMount(stamp))
  {
    bag.writeLatched(TF_STATIC_TOPIC, stamp, toTf(*mount));
  }
}

/** Writes a reading of all sensors but the camera. */
void writeSensors(BagWriter& bag, sim::Robot& robot, const ros::Time& stamp)
{
  const sim::SensorMessages messages = robot.readSensors(stamp);
  bag.write(TF_TOPIC, stamp, toTf(messages.transform));
  if (messages.odometry)
  {
    bag.write(ODOMETRY_TOPIC, stamp, *messages.odometry);
  }
  if (messages.joints)
  {
    bag.write(JOINT_STATES_TOPIC, stamp, *messages.joints);
  }
}

/** The twist of `from` that would take it to `to` in a second. */
Twist twistBetween(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to)
{
  Twist twist;
  twist << from.linear().transpose() * (to.translation() - from.translation()),
      rotationVector(from.linear().transpose() * to.linear());
  return twist;
}

/** The twist that moves on with the trajectory and corrects the error. @param next where the trajectory is DT later. */
Twist trackingTwist(const Eigen::Isometry3d& pose, const Eigen::Isometry3d& wanted, const Eigen::Isometry3d& next)
{
  const Eigen::Matrix3d wanted_in_pose = pose.linear().transpose() * wanted.linear();
  const Twist ahead = twistBetween(wanted, next) / DT;
  Twist twist = TRACKING_GAIN * twistBetween(pose, wanted);
  twist.head<3>() += wanted_in_pose * ahead.head<3>();
  twist.tail<3>() += wanted_in_pose * ahead.tail<3>();
  return twist;
}

/** Poses of the camera during an exposure around `now`, when it goes on as it has come there since DT before. */
std::vector<Eigen::Isometry3d> posesOfExposure(const Eigen::Isometry3d& before, const Eigen::Isometry3d& now,
                                               double exposure)
{
  if (exposure == 0.0)
  {
    return { now };
  }
  const Twist motion = twistBetween(before, now) / DT;
  std::vector<Eigen::Isometry3d> poses;
  for (int i = 0; i < BLUR_POSES; ++i)
  {
    const double time = exposure * (static_cast<double>(i) / (BLUR_POSES - 1) - 0.5);
    Eigen::Isometry3d pose = now;
    pose.translation() += before.linear() * (time * motion.head<3>());
    pose.linear() = now.linear() * rotationFromVector(time * motion.tail<3>());
    poses.push_back(pose);
  }
  return poses;
}

/** Whether something that happens at a rate [Hz], beginning with step 0, happens at this step. */
bool isDue(int step, double rate)
{
  constexpr double ROUNDING = 1e-9;
  const auto count = [rate](int at) {
    return std::floor(at * rate * DT + ROUNDING);
  };
  return step == 0 || count(step) > count(step - 1);
}

std::string textOf(const std::string& path)
{
  std::ifstream file(path);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file)
  {
    throw std::runtime_error("cannot read '" + path + "'");
  }
  return text;
}

void refuse(const std::optional<double>& value, const std::string& option, const std::string& reason)
{
  if (value)
  {
    throw std::runtime_error(option + ": " + reason);
  }
}

std::unique_ptr<sim::Robot> makeRobot(const sim::World& world, const Options& options)
{
  if (world.robot == sim::RobotKind::NOMAD)
  {
    refuse(options.encoder_noise, "--encoder-noise", "the robot of world '" + world.name + "' has no arm");
    sim::NomadParams params;
    params.odometry_drift = options.odometry_drift.value_or(0.0);
    params.odometry_noise = options.odometry_noise.value_or(0.0);
    params.seed = options.seed;
    return std::make_unique<sim::NomadRobot>(world, params);
  }
  const std::string reason = "the robot of world '" + world.name + "' has no wheels";
  refuse(options.odometry_drift, "--odometry-drift", reason);
  refuse(options.odometry_noise, "--odometry-noise", reason);
  sim::PumaParams params;
  params.encoder_noise = options.encoder_noise.value_or(0.0);
  params.seed = options.seed;
  const std::string urdf = options.urdf.empty() ? (packageFolder() / "urdf" / "puma560.urdf").string() : options.urdf;
  return std::make_unique<sim::PumaRobot>(world, textOf(urdf), params);
}

void recordSimulation(const std::string& world_name, const std::string& trajectory_name, const std::string& file,
                      const Options& options)
{
  sim::World world = sim::findWorld(world_name, packageFolder() / "config" / "worlds");
  world.quality.noise = options.image_noise.value_or(world.quality.noise);
  world.light.gain = options.light_gain.value_or(world.light.gain);
  world.light.offset = options.light_offset.value_or(world.light.offset);
  const std::vector<sim::Waypoint>& trajectory = world.trajectory(trajectory_name);
  const double duration = trajectory.back().time - trajectory.front().time;
  const auto wanted_at = [&](int step) {
    return sim::poseAt(trajectory, trajectory.front().time + step * DT);
  };
  const auto fault = [&](const std::string& what) {
    return std::runtime_error("trajectory '" + trajectory_name + "' of world '" + world.name + "': " + what);
  };
  if (duration > MAX_DURATION)
  {
    throw fault("it takes more than an hour");
  }

  sim::SimulatedCamera camera(world, options.groups, options.seed);
  std::unique_ptr<sim::Robot> robot;
  try
  {
    robot = makeRobot(world, options);
    robot->setPose(trajectory.front().pose);
  }
  catch (const std::exception& error)
  {
    throw fault(error.what());
  }

  BagWriter bag(file);
  const ros::Time start = startOf(options);
  writeCameraMount(bag, *robot, start);
  Eigen::Isometry3d camera_before = robot->cameraPose();
  const int last_step = static_cast<int>(std::lround(duration / DT));
  for (int step = 0; step <= last_step; ++step)
  {
    const ros::Time stamp = start + toDuration(step * DT);
    const Eigen::Isometry3d camera_pose = robot->cameraPose();
    const bool image_due = isDue(step, options.rate.value_or(DEFAULT_RATE));
    const bool sensors_due = isDue(step, options.odometry_rate);
    if (sensors_due)
    {
      writeSensors(bag, *robot, stamp);
    }
    if (sensors_due || image_due)
    {
      bag.write(GROUND_TRUTH_TOPIC, stamp, sim::toGroundTruth(camera_pose, stamp));
    }
    if (image_due)
    {
      writeImage(bag, camera.capture(posesOfExposure(camera_before, camera_pose, world.quality.exposure)),
                 sim::toCameraInfo(world, options.focal_length_error, stamp), options);
    }
    camera_before = camera_pose;
    robot->command(trackingTwist(robot->pose(), wanted_at(step), wanted_at(step + 1)));
    robot->step(DT);
    const std::string obstruction = robot->obstruction();
    if (!obstruction.empty() && step < last_step)
    {
      throw fault(obstruction + " after " + std::to_string(step * DT) + " s");
    }
  }
  bag.finish();
}

// ------------------------------------------------------------------------------------------------- recorded images

struct PosedImage
{
  std::string file;
  Eigen::Isometry3d pose;  // world from optical frame
};

/** Reads lines with the name of an image and the 16 numbers of its pose, row by row; '#' starts a remark. */
std::vector<PosedImage> readPoses(const fs::path& path)
{
  std::istringstream lines(textOf(path.string()));
  std::vector<PosedImage> images;
  int number = 0;
  for (std::string line; std::getline(lines, line);)
  {
    ++number;
    std::istringstream words(line.substr(0, line.find('#')));
    PosedImage image;
    if (!(words >> image.file))
    {
      continue;
    }
    const std::vector<double> values{ std::istream_iterator<double>(words), std::istream_iterator<double>() };
    constexpr double TOLERANCE = 1e-3;  // of numbers written with few digits
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
    if (words.eof() && values.size() == 16)
    {
      matrix = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
    }
    const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
    if (!matrix.allFinite() || !rotation.isUnitary(TOLERANCE) || rotation.determinant() < 0.0 ||
        !matrix.row(3).isApprox(Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0)))
    {
      throw std::runtime_error(path.string() + ": line " + std::to_string(number) + " is no file's name with a pose");
    }
    image.pose = Eigen::Isometry3d(Eigen::Quaterniond(rotation).normalized());
    image.pose.translation() = matrix.topRightCorner<3, 1>();
    images.push_back(image);
  }
  if (images.empty())
  {
    throw std::runtime_error(path.string() + ": no poses");
  }
  return images;
}

Eigen::Matrix3d readIntrinsics(const fs::path& path)
{
  std::istringstream text(textOf(path.string()));
  const std::vector<double> values{ std::istream_iterator<double>(text), std::istream_iterator<double>() };
  Eigen::Matrix3d k = Eigen::Matrix3d::Zero();
  if (text.eof() && values.size() == 9)
  {
    k = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.data());
  }
  if (!k.allFinite() || !(k(0, 0) > 0.0) || !(k(1, 1) > 0.0) || k(2, 2) != 1.0)
  {
    throw std::runtime_error(path.string() + ": no 3 x 3 matrix of intrinsics");
  }
  return k;
}

/**
 * Writes a folder with K.txt, poses.txt (world from camera) and images/. It has no stamps, so the rate is an option.
 */
void recordImages(const std::string& file, const Options& options)
{
  const fs::path folder = options.images;
  const std::vector<PosedImage> images = readPoses(folder / "poses.txt");
  Camera camera;
  camera.k = readIntrinsics(folder / "K.txt");
  camera.projection.leftCols<3>() = camera.k;
  camera.distortion_model = "plumb_bob";
  camera.distortion.assign(5, 0.0);

  BagWriter bag(file);
  std_msgs::Header header;
  header.frame_id = sim::CAMERA_FRAME;
  for (std::size_t i = 0; i < images.size(); ++i)
  {
    const fs::path path = folder / "images" / images[i].file;
    const cv::Mat image = readGreyImage(path.string());
    if (i > 0 && image.size() != cv::Size(camera.width, camera.height))
    {
      throw std::runtime_error(path.string() + ": not of the size of those before");
    }
    camera.width = image.cols;
    camera.height = image.rows;
    header.stamp = startOf(options) + toDuration(static_cast<double>(i) / options.rate.value_or(DEFAULT_RATE));
    bag.write(GROUND_TRUTH_TOPIC, header.stamp, sim::toGroundTruth(images[i].pose, header.stamp));
    writeImage(bag, image, view_servo::toCameraInfo(camera, header), options);
  }
  bag.finish();
}

/**
 * Writes a video: all its frames, stamped by its own rate, or as many of them as `--rate` wants. Without a calibration
 * camera_info says the images' size alone.
 */
void recordVideo(const std::string& file, const Options& options)
{
  Video video(options.video);
  const double rate = video.rate() > 0.0 ? video.rate() : options.rate.value_or(0.0);
  if (!(rate > 0.0))
  {
    throw std::runtime_error("'" + options.video + "' does not say how many frames a second it has: say --rate");
  }
  const double wanted = std::min(rate, options.rate.value_or(rate));
  Camera camera;
  if (!options.camera.empty())
  {
    camera = readCameraFile(options.camera);
  }
  cv::Mat image = video.next();
  if (image.empty())
  {
    throw std::runtime_error("'" + options.video + "' has no frame that can be read");
  }
  if (!options.camera.empty() && image.size() != cv::Size(camera.width, camera.height))
  {
    throw std::runtime_error("--calibration: '" + options.camera + "' is of images of " + std::to_string(camera.width) +
                             " x " + std::to_string(camera.height) + ", the video's are " + std::to_string(image.cols) +
                             " x " + std::to_string(image.rows));
  }
  camera.width = image.cols;
  camera.height = image.rows;

  BagWriter bag(file);
  std_msgs::Header header;
  header.frame_id = sim::CAMERA_FRAME;
  constexpr double ROUNDING = 1e-6;  // of a period
  double next = 0.0;                 // periods of the wanted rate until the next image is due
  for (double frame = 0.0; !image.empty(); image = video.next(), ++frame)
  {
    if (frame / rate * wanted < next - ROUNDING)
    {
      continue;
    }
    ++next;
    header.stamp = startOf(options) + toDuration(frame / rate);
    writeImage(bag, image, view_servo::toCameraInfo(camera, header), options);
  }
  bag.finish();
}

// --------------------------------------------------------------------------------------------------- command line

void addOptions(CommandLine& line, Options& options)
{
  const NumberRange rates{ 0.001, STEPS_PER_SECOND };
  line.text("images", options.images, "Folder of recorded images with K.txt and poses.txt, instead of a world");
  line.text("video", options.video, "File of a video, instead of a world");
  line.text("calibration", options.camera,
            "Of the video's camera: yaml of camera_calibration, or of a stored view; default: camera_info has none");
  line.number("rate", options.rate, rates, "Images a second; default: 4, of a video all");
  line.number("start-time", options.start_time, { 1.0, 4e9 }, "Of the bag [s]");
  line.number("jpeg", options.jpeg, { 1.0, 100.0 },
              "Quality of JPEG images, on image_raw/compressed; default: images as they are, on image_raw");
  line.number("odometry-rate", options.odometry_rate, rates, "Readings of odometry or encoders a second");
  line.number("seed", options.seed, {}, "Of all noise");
  line.list("groups", options.groups, "Surfaces to show besides those that always are: groups, joined by commas", ',');
  line.number("image-noise", options.image_noise, { 0.0, 255.0 },
              "Standard deviation [grey levels]; default: the world's");
  line.number("light-gain", options.light_gain, { 0.001, 100.0 }, "Factor of the grey levels; default: the world's");
  line.number("light-offset", options.light_offset, { -255.0, 255.0 },
              "Added to the grey levels; default: the world's");
  line.number("focal-length-error", options.focal_length_error, { -0.5, 1.0 },
              "By which part camera_info has it too long");
  line.number("odometry-drift", options.odometry_drift, { -0.9, 10.0 },
              "By which part the Nomad measures distances too long");
  line.number("odometry-noise", options.odometry_noise, { 0.0, 10.0 },
              "Standard deviation of the motion that it measures in 20 ms, as a part of it");
  line.number("encoder-noise", options.encoder_noise, { 0.0, 1.0 },
              "Standard deviation of the Puma's joint angles [rad]");
  line.text("urdf", options.urdf, "File that describes the Puma; default: the package's");
}

/** Options that mean nothing for recorded images. @param source "--images" or "--video". */
void refuseOptionsOfWorlds(const CommandLine& line, const std::string& source)
{
  for (const char* name : { "odometry-rate", "seed", "groups", "image-noise", "light-gain", "light-offset",
                            "focal-length-error", "odometry-drift", "odometry-noise", "encoder-noise", "urdf" })
  {
    if (line.has(name))
    {
      throw std::runtime_error(std::string("--") + name + " is for simulated robots, not for " + source);
    }
  }
}

void checkSources(const CommandLine& line, const Options& options)
{
  if (!options.images.empty() && !options.video.empty())
  {
    throw std::runtime_error("say --images or --video, not both");
  }
  if (options.video.empty() && !options.camera.empty())
  {
    throw std::runtime_error("--calibration is for --video: worlds and folders of images have their own");
  }
  if (!options.images.empty() || !options.video.empty())
  {
    refuseOptionsOfWorlds(line, options.images.empty() ? "--video" : "--images");
  }
}

void record(const Options& options)
{
  const QuietStandardError quiet;
  if (!options.images.empty() || !options.video.empty())
  {
    if (options.names.size() != 1)
    {
      throw std::runtime_error(
          "say where to, and nothing else: record_bag --images FOLDER OUT.bag, or --video FILE OUT.bag");
    }
    (options.video.empty() ? recordImages : recordVideo)(options.names.front(), options);
    return;
  }
  if (options.names.size() != 3)
  {
    throw std::runtime_error("say what to record and where to: record_bag WORLD TRAJECTORY OUT.bag");
  }
  recordSimulation(options.names[0], options.names[1], options.names[2], options);
}

}  // namespace

int main(int argc, char** argv)
{
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);

  try
  {
    Options options;
    CommandLine line(
        "Records a bag of a simulated robot or of a folder of images, with the ground truth, or of a video:\n"
        "  record_bag WORLD TRAJECTORY OUT.bag [OPTIONS]\n"
        "  record_bag --images FOLDER OUT.bag [OPTIONS]\n"
        "  record_bag --video FILE OUT.bag [OPTIONS]\n"
        "WORLD is a world's file, or the name of one of the package's; TRAJECTORY the name of one of its.",
        "Exit status: 0 the bag was written, 2 bad input.");
    addOptions(line, options);
    const std::optional<std::vector<std::string>> words = line.parse(argc, argv);
    if (!words)
    {
      return WRITTEN;  // --help
    }
    options.names = *words;
    checkSources(line, options);
    record(options);
    return WRITTEN;
  }
  catch (const std::exception& error)
  {
    std::cerr << "record_bag: " << oneLine(error) << std::endl;
  }
  // Not by the end of main(): a BagWriter may have had to keep a bag that cannot be closed, which class_loader of ROS
  // 1.17, when rosbag's plugins are unloaded, has a line about after that of the error.
  std::_Exit(BAD_INPUT);
}
