// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * What it costs to bring a camera's images to the nodes of homing.launch or arm_servo.launch: as processes, as nodelets
 * of one process, and as nodelets in the camera's own process, in one run:
 *
 *     bench_transport homing|arm [--seconds N]
 *
 * It starts a master of its own and plays a camera of rgb8 images at 30 Hz, of 640x480 and of 1280x720, that looks at a
 * stored view. For each it prints processor time, that of the camera and of all nodes [% of one core]: of the
 * transport, which is the difference between images that come and are not worked on, as no view is wanted, and no
 * images; and of everything while the view is matched, with how many matches come a second, which a busy machine makes
 * fewer, and the time from an image's stamp to its point_matches, median; with the arm, of homographies. Each is taken
 * over N seconds.
 */
#include "timing.h"
#include "view_servo/Homography.h"
#include "view_servo/PointMatches.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/views/view_store.h"

#include <nav_msgs/Odometry.h>
#include <nodelet/loader.h>
#include <ros/master.h>
#include <ros/package.h>
#include <ros/ros.h>
#include <ros/service.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_ros/static_transform_broadcaster.h>
#include <boost/function.hpp>
#include <boost/make_shared.hpp>
#include <opencv2/imgproc.hpp>

#include <arpa/inet.h>
#include <fcntl.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace
{
using namespace view_servo;  // NOLINT(google-build-using-namespace): a program of its own

const std::string NAME = "bench_transport";
const std::string VIEW = "desk";
constexpr double RATE = 30.0;      // of images [Hz]
constexpr double PATIENCE = 60.0;  // longest wait for programs to be there [s]

/** @return whether `holds()` was true in time. */
template <typename Condition>
bool waitUntil(double patience, const Condition& holds)
{
  using Clock = std::chrono::steady_clock;
  const Clock::time_point end = Clock::now() + std::chrono::milliseconds(static_cast<int>(1e3 * patience));
  while (!holds())
  {
    if (Clock::now() > end)
    {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return true;
}

template <typename Condition>
void require(const std::string& what, const Condition& holds)
{
  if (!waitUntil(PATIENCE, holds))
  {
    throw std::runtime_error("waited in vain for " + what);
  }
}

/** A program that ends with this object, in a process group of its own. */
class Child
{
public:
  Child(std::vector<std::string> command, const std::filesystem::path& log)
  {
    std::vector<char*> argv;
    argv.reserve(command.size() + 1);
    for (std::string& word : command)
    {
      argv.push_back(word.data());
    }
    argv.push_back(nullptr);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&actions, 1, 2);
    const int error = posix_spawnp(&pid_, argv[0], &actions, &attributes, argv.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    if (error != 0)
    {
      throw std::runtime_error("cannot start " + command[0] + "; source devel/setup.bash first");
    }
  }
  ~Child()
  {
    constexpr double LONGEST = 30.0;  // [s]
    kill(-pid_, SIGINT);
    if (!waitUntil(LONGEST, [this] { return waitpid(pid_, nullptr, WNOHANG) == pid_; }))
    {
      kill(-pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  pid_t pid() const
  {
    return pid_;
  }

private:
  pid_t pid_ = 0;
};

/** Processor time [ms] of all processes that a process has started, directly or not; its own is left out. */
double timeOfOffspring(pid_t ancestor)
{
  struct Process
  {
    pid_t parent = 0;
    double time = 0.0;
  };
  const double tick = 1e3 / static_cast<double>(sysconf(_SC_CLK_TCK));
  std::map<pid_t, Process> processes;
  for (const auto& entry : std::filesystem::directory_iterator("/proc"))
  {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos)
    {
      continue;
    }
    std::ifstream file(entry.path() / "stat");
    const std::string text{ std::istreambuf_iterator<char>(file), {} };
    const std::size_t end_of_name = text.rfind(')');
    if (end_of_name == std::string::npos)
    {
      continue;  // it has ended meanwhile
    }
    // state, parent, ..., and as 14th and 15th of all the times in user and in system mode
    std::istringstream fields(text.substr(end_of_name + 1));
    const std::vector<std::string> words{ std::istream_iterator<std::string>(fields), {} };
    processes[std::stoi(name)] = { std::stoi(words.at(1)), tick * (std::stod(words.at(11)) + std::stod(words.at(12))) };
  }
  double sum = 0.0;
  for (const auto& [pid, process] : processes)
  {
    pid_t above = process.parent;
    while (above != ancestor && processes.count(above) > 0)
    {
      above = processes[above].parent;
    }
    sum += above == ancestor ? process.time : 0.0;
  }
  return sum;
}

int freePort()
{
  const int descriptor = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  const bool bound = bind(descriptor, reinterpret_cast<sockaddr*>(&address), length) == 0 &&
                     getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &length) == 0;
  close(descriptor);
  if (!bound)
  {
    throw std::runtime_error("there is no free port");
  }
  return ntohs(address.sin_port);
}

/**
 * A camera that looks at a picture, on a base that stands still: image_raw and camera_info of `camera`, odom, and tf.
 */
class PlayedCamera
{
public:
  /**
   * @param shares whether nodes in this process may get images without a copy: then each is a new one, as a driver's
   * are.
   */
  PlayedCamera(const cv::Mat& picture, bool shares) : shares_(shares)
  {
    ros::NodeHandle nh;
    images_ = nh.advertise<sensor_msgs::Image>("camera/image_raw", 2);
    infos_ = nh.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 2);
    odometry_ = nh.advertise<nav_msgs::Odometry>("odom", 2);
    cv::Mat colour;
    cv::cvtColor(picture, colour, cv::COLOR_GRAY2RGB);
    std_msgs::Header header;
    header.frame_id = "camera";
    image_ = toImage(colour, sensor_msgs::image_encodings::RGB8, header);
    Camera camera;
    camera.width = picture.cols;
    camera.height = picture.rows;
    camera.k << picture.cols, 0.0, 0.5 * picture.cols, 0.0, picture.cols, 0.5 * picture.rows, 0.0, 0.0, 1.0;
    camera.projection.leftCols<3>() = camera.k;
    info_ = toCameraInfo(camera, header);
    thread_ = std::thread([this] { run(); });
  }
  ~PlayedCamera()
  {
    over_ = true;
    thread_.join();
  }
  PlayedCamera(const PlayedCamera&) = delete;
  PlayedCamera& operator=(const PlayedCamera&) = delete;

  void pause(bool paused)
  {
    paused_ = paused;
  }

private:
  void run()
  {
    using Clock = std::chrono::steady_clock;
    const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / RATE));
    nav_msgs::Odometry odometry;
    odometry.header.frame_id = "odom";
    odometry.child_frame_id = "base_link";
    odometry.pose.pose.orientation.w = 1.0;
    for (Clock::time_point next = Clock::now(); !over_; next += period)
    {
      std::this_thread::sleep_until(next);
      if (paused_)
      {
        continue;
      }
      image_.header.stamp = info_.header.stamp = odometry.header.stamp = ros::Time::now();
      odometry_.publish(odometry);
      infos_.publish(info_);
      shares_ ? images_.publish(boost::make_shared<const sensor_msgs::Image>(image_)) : images_.publish(image_);
    }
  }

  const bool shares_;
  ros::Publisher images_;
  ros::Publisher infos_;
  ros::Publisher odometry_;
  sensor_msgs::Image image_;
  sensor_msgs::CameraInfo info_;
  std::atomic<bool> over_{ false };
  std::atomic<bool> paused_{ false };
  std::thread thread_;
};

/** Where the nodes run. */
enum class Home
{
  PROCESSES,
  MANAGER,
  CAMERA
};

/** Processor time [% of a core]. */
struct Load
{
  double camera = 0.0;  ///< of the camera's process
  double nodes = 0.0;   ///< of all others
};

struct Measured
{
  Load transport;
  Load matching;
  double rate = 0.0;     ///< of matches [Hz]
  double latency = 0.0;  ///< median [ms]
};

/** What is launched. */
struct Robot
{
  std::string launch_file;
  std::vector<std::string> services;  ///< that are there when all nodes are
};

const std::map<std::string, Robot> ROBOTS{
  { "homing",
    { "homing.launch", { "homing/enable", "point_matcher/match", "line_matcher/match", "view_store/list" } } },
  { "arm",
    { "arm_servo.launch",
      { "servo_25d/enable", "homography_tracker/start", "point_matcher/match", "line_matcher/match",
        "view_store/list" } } },
};

class Bench
{
public:
  Bench(const std::string& robot, std::filesystem::path directory, double seconds)
    : robot_(ROBOTS.at(robot)), directory_(std::move(directory)), seconds_(seconds), views_(directory_ / "views")
  {
    geometry_msgs::TransformStamped mount;
    mount.header.frame_id = "base_link";
    mount.header.stamp = ros::Time::now();
    mount.child_frame_id = "camera";
    mount.transform.rotation.x = mount.transform.rotation.z = -0.5;  // the axis of an optical frame is its z
    mount.transform.rotation.y = mount.transform.rotation.w = 0.5;
    broadcaster_.sendTransform(mount);
    ros::NodeHandle nh;
    if (robot == "homing")
    {
      const boost::function<void(const PointMatches::ConstPtr&)> take = [this](const PointMatches::ConstPtr& message) {
        add(message->homography);
      };
      results_ = nh.subscribe<PointMatches>("point_matcher/point_matches", 20, take);
    }
    else
    {
      const boost::function<void(const Homography::ConstPtr&)> take = [this](const Homography::ConstPtr& message) {
        add(*message);
      };
      results_ = nh.subscribe<Homography>("homography_tracker/homography", 20, take);
    }
  }

  Measured measure(const cv::Mat& picture, Home home)
  {
    StoredView view;
    view.name = VIEW;
    view.image = picture;
    views_.save(view, true);
    PlayedCamera camera(picture, home == Home::CAMERA);
    Measured measured;
    {
      const std::unique_ptr<Child> nodes = start(home, "");
      const Load with_images = load(*nodes);
      camera.pause(true);
      const Load without = load(*nodes);
      camera.pause(false);
      measured.transport = { with_images.camera - without.camera, with_images.nodes - without.nodes };
    }
    const std::unique_ptr<Child> nodes = start(home, VIEW);
    measured.matching = load(*nodes);
    const std::vector<double> ages = takeAges();
    if (ages.empty())
    {
      throw std::runtime_error("no matches have come for " + std::to_string(seconds_) + " s");
    }
    measured.rate = static_cast<double>(ages.size()) / seconds_;
    measured.latency = medianOf(ages);
    return measured;
  }

private:
  void add(const Homography& homography)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (homography.valid != 0)
    {
      ages_.push_back(1e3 * (ros::Time::now() - homography.header.stamp).toSec());
    }
  }

  /** The nodes, once they are there and, when a view is named, match it. */
  std::unique_ptr<Child> start(Home home, const std::string& view)
  {
    std::vector<std::string> command{ "roslaunch",    "view_servo",    robot_.launch_file,
                                      "sim:=false",   "view:=" + view, "views_dir:=" + views_.directory().string(),
                                      "dry_run:=true" };
    if (home != Home::PROCESSES)
    {
      command.emplace_back("nodelets:=true");
    }
    if (home == Home::CAMERA)
    {
      command.push_back("manager:=" + NAME);
    }
    auto nodes = std::make_unique<Child>(command, directory_ / "nodes.log");
    for (const std::string& service : robot_.services)
    {
      require("the service " + service, [&] { return ros::service::exists(service, false); });
    }
    if (!view.empty())
    {
      takeAges();
      require("matches of the view", [this] {
        const std::lock_guard<std::mutex> lock(mutex_);
        return !ages_.empty();
      });
    }
    return nodes;
  }

  /** Over the time that was asked for, after a while in which things settle. */
  Load load(const Child& nodes)
  {
    constexpr double WARM = 3.0;  // [s]
    ros::WallDuration(WARM).sleep();
    takeAges();
    const auto begin = std::chrono::steady_clock::now();
    const double own = processorTime();
    const double offspring = timeOfOffspring(nodes.pid());
    ros::WallDuration(seconds_).sleep();
    const double passed = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    return { 100.0 * (processorTime() - own) / passed, 100.0 * (timeOfOffspring(nodes.pid()) - offspring) / passed };
  }

  std::vector<double> takeAges()
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(ages_, {});
  }

  const Robot& robot_;
  const std::filesystem::path directory_;
  const double seconds_;
  const ViewStore views_;
  tf2_ros::StaticTransformBroadcaster broadcaster_;
  ros::Subscriber results_;
  std::mutex mutex_;  // guards what follows
  std::vector<double> ages_;
};

void print(const cv::Size& size, const char* home, const Measured& m)
{
  std::printf("| %dx%d | %s | %.1f | %.1f | **%.1f** | %.1f | %.1f | **%.1f** | %.1f | %.0f |\n", size.width,
              size.height, home, m.transport.camera, m.transport.nodes, m.transport.camera + m.transport.nodes,
              m.matching.camera, m.matching.nodes, m.matching.camera + m.matching.nodes, m.rate, m.latency);
  std::fflush(stdout);
}

void measureAll(const std::string& robot, const std::filesystem::path& directory, double seconds)
{
  Bench bench(robot, directory, seconds);
  const ViewStore samples(ros::package::getPath("view_servo") + "/samples/views");
  const cv::Mat picture = samples.load(VIEW).image;
  std::printf(
      "| images | nodes run | transport: camera | nodes | sum | all: camera | nodes | sum | matches [Hz] | after [ms] "
      "|\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  for (const cv::Size& size : { cv::Size(640, 480), cv::Size(1280, 720) })
  {
    cv::Mat seen;
    cv::resize(picture, seen, size, 0.0, 0.0, cv::INTER_AREA);
    print(size, "as processes", bench.measure(seen, Home::PROCESSES));
    print(size, "as nodelets", bench.measure(seen, Home::MANAGER));
    print(size, "with the camera", bench.measure(seen, Home::CAMERA));
  }
}

int run(int argc, char** argv)
{
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  const bool timed = arguments.size() == 3 && arguments[1] == "--seconds";
  if (arguments.empty() || ROBOTS.count(arguments[0]) == 0 || (arguments.size() > 1 && !timed))
  {
    throw std::invalid_argument("it is " + NAME + " homing|arm [--seconds N]");
  }
  const double seconds = timed ? std::atof(arguments[2].c_str()) : 10.0;
  if (!(seconds >= 1.0 && seconds <= 600.0))
  {
    throw std::invalid_argument("--seconds: a number from 1 to 600");
  }
  std::string directory = (std::filesystem::temp_directory_path() / "view_servo_bench_XXXXXX").string();
  if (mkdtemp(directory.data()) == nullptr)
  {
    throw std::runtime_error("cannot make the directory " + directory);
  }
  const std::string port = std::to_string(freePort());
  setenv("ROS_MASTER_URI", ("http://localhost:" + port).c_str(), 1);
  setenv("ROS_HOSTNAME", "localhost", 1);
  setenv("ROS_HOME", directory.c_str(), 1);
  {
    const Child master({ "roscore", "-p", port }, directory + "/master.log");
    ros::init(argc, argv, NAME);
    require("a master", [] { return ros::master::check(); });
    const ros::NodeHandle nh;
    if (ros::console::set_logger_level(ROSCONSOLE_ROOT_LOGGER_NAME, ros::console::levels::Warn))
    {
      ros::console::notifyLoggerLevelsChanged();
    }
    ros::AsyncSpinner spinner(2);
    spinner.start();
    {
      const nodelet::Loader loader;  // this process is a manager, too
      try
      {
        measureAll(arguments[0], directory, seconds);
      }
      catch (const std::exception& error)
      {
        throw std::runtime_error(error.what() + ("; what was printed is in " + directory));
      }
    }
    ros::shutdown();
  }
  std::filesystem::remove_all(directory);
  return 0;
}

}  // namespace

int main(int argc, char** argv)
{
  try
  {
    return run(argc, argv);
  }
  catch (const std::exception& error)
  {
    std::cerr << NAME << ": " << error.what() << '\n';
    return 1;
  }
}
