// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "check/report.h"
#include "check_ros/robot_check.h"
#include "check_ros/test_drive.h"
#include "tools/check_robot_options.h"
#include "tools/json_text.h"
#include "tools/ros_program.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/ros/control_node.h"

#include <poll.h>
#include <ros/init.h>
#include <ros/spinner.h>
#include <unistd.h>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include <cmath>
#include <cstdint>
#include <exception>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
using check::Findings;

constexpr int BAD_INPUT = 2;
constexpr int INTERRUPTED = 130;  // as shells have it

/** Prints findings as they are found, or all of them as one JSON object at the end. */
class Report
{
public:
  explicit Report(const CheckOptions& options) : options_(options)
  {
  }

  void add(const Findings& findings)
  {
    append(findings_, findings);
    if (!options_.json)
    {
      std::cout << toLines(findings) << std::flush;
    }
  }

  void setPicture(std::string path)
  {
    picture_ = std::move(path);
  }

  /** @return the exit status. */
  int finish() const
  {
    if (options_.json)
    {
      std::cout << jsonText(toJson(), 2) << std::endl;
    }
    else
    {
      std::cout << '\n'
                << summary(findings_) << (picture_.empty() ? "" : "; the camera's picture is in " + picture_)
                << std::endl;
    }
    requireWritten(std::cout);
    return exitStatus(findings_);
  }

private:
  nlohmann::json toJson() const
  {
    nlohmann::json list = nlohmann::json::array();
    for (const check::Finding& finding : findings_)
    {
      list.push_back({ { "level", toText(finding.level) },
                       { "name", finding.name },
                       { "message", finding.message },
                       { "remedy", finding.remedy } });
    }
    return { { "status", exitStatus(findings_) },
             { "robot", options_.setup.is_arm ? "arm_servo" : "homing" },
             { "picture", picture_ },
             { "findings", list } };
  }

  const CheckOptions& options_;
  Findings findings_;
  std::string picture_;
};

/** A line that the user types; empty after two minutes, at the end of the input, and when the program is to end. */
std::string typedLine()
{
  constexpr double PATIENCE = 120.0;  // [s]
  constexpr int POLL = 50;            // [ms]
  const double end = check::steadySeconds() + PATIENCE;
  while (check::steadySeconds() < end && !detail::shutdownRequested())
  {
    pollfd input{ STDIN_FILENO, POLLIN, 0 };
    if (poll(&input, 1, POLL) > 0)
    {
      std::string line;
      std::getline(std::cin, line);
      return line;
    }
  }
  return "";
}

/** Writes the camera's picture. @return a warning when that fails. */
Findings savePicture(const check::RobotCheck& robot, const std::string& path, Report& report)
{
  const cv::Mat drawing = path.empty() ? cv::Mat() : robot.drawing();
  if (drawing.empty())
  {
    return {};
  }
  try
  {
    if (cv::imwrite(path, drawing))
    {
      report.setPicture(path);
      return {};
    }
  }
  catch (const cv::Exception&)
  {
    // OpenCV's text names its own source; what matters follows.
  }
  return { check::warning("file", "the picture cannot be written to '" + path + "'",
                          "say --picture FILE.png in a directory of yours") };
}

Findings move(const check::RobotCheck& robot, const CheckOptions& options, const Findings& before)
{
  check::TestDrive test(robot, options.drive, &detail::shutdownRequested);
  // What is asked goes to standard error: with --json standard output is for the result alone.
  std::string answer = options.yes ? "drive" : "";
  if (!options.yes)
  {
    std::cerr << "\n--move: " << test.plan() << ", without looking for obstacles. Keep a hand on the emergency stop.\n"
              << "Type 'drive' to let it drive, 'push' to move it by hand, anything else to end: " << std::flush;
    answer = typedLine();
  }
  if (answer != "drive" && answer != "push")
  {
    return { check::warning("move", "not asked for: 'drive' or 'push' was not typed",
                            "type one of them, or say --yes") };
  }
  const std::string refusal = test.refusal(before, answer == "push");
  if (!refusal.empty())
  {
    return { check::error("move", "nothing is moved: " + refusal, "see to that first") };
  }
  if (answer == "drive")
  {
    return test.drive();
  }
  return test.followHand([](const std::string& text) {
    std::cerr << text << "; then press Enter." << std::endl;
    typedLine();
    return !detail::shutdownRequested();
  });
}

int run(const CheckOptions& options)
{
  Report report(options);
  try
  {
    requireMaster();
  }
  catch (const std::runtime_error& error)
  {
    const std::string text = error.what();
    const std::size_t colon = text.find(": ");
    report.add({ check::error("master", text.substr(0, colon), text.substr(colon + 2)) });
    return report.finish();
  }
  const ros::NodeHandle nh;
  detail::deferShutdown();
  check::RobotCheck robot(nh, options.setup);
  constexpr std::uint32_t THREADS = 2;
  ros::AsyncSpinner spinner(THREADS);
  spinner.start();
  if (!options.json)
  {
    std::cerr << "Listening for " << options.seconds << " s" << std::endl;
  }
  robot.listen(options.seconds, &detail::shutdownRequested);
  if (detail::shutdownRequested())
  {
    return INTERRUPTED;
  }
  const Findings findings = robot.findings();
  report.add(findings);
  report.add(savePicture(robot, options.no_picture ? "" : options.picture, report));
  if (options.move)
  {
    report.add(move(robot, options, findings));
  }
  spinner.stop();
  return detail::shutdownRequested() ? INTERRUPTED : report.finish();
}

}  // namespace
}  // namespace view_servo

int main(int argc, char** argv)
{
  using namespace view_servo;
  try
  {
    const std::optional<CheckOptions> options = readCheckOptions(argc, argv);
    if (!options)
    {
      return 0;  // --help
    }
    std::vector<std::string> words = options->for_ros;
    std::vector<char*> pointers;
    pointers.reserve(words.size());
    for (std::string& word : words)
    {
      pointers.push_back(&word[0]);
    }
    int count = static_cast<int>(pointers.size());
    initQuietly(count, pointers.data(), "check_robot", ros::init_options::NoSigintHandler);
    const ExitDeadline exit_deadline(&detail::shutdownRequested, INTERRUPTED);
    return run(*options);
  }
  catch (const std::exception& error)
  {
    std::cerr << "check_robot: " << oneLine(error) << '\n';
    return BAD_INPUT;
  }
}
