// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/region_judgement.h"
#include "tools/region_picker.h"
#include "tools/ros_program.h"
#include "view_servo/SaveView.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/call_service.h"
#include "view_servo/ros/camera_image.h"
#include "view_servo/ros/conversions.h"
#include "view_servo/ros/node_base.h"
#include "view_servo/ros/readiness.h"

#include <ros/init.h>
#include <ros/names.h>
#include <ros/node_handle.h>
#include <ros/service.h>
#include <ros/spinner.h>
#include <sys/wait.h>
#include <unistd.h>
#include <opencv2/highgui.hpp>
#include <opencv2/imgproc.hpp>

#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <future>
#include <iostream>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
using Clock = std::chrono::steady_clock;

constexpr int STORED = 0;
constexpr int NOT_STORED = 1;
constexpr int CANNOT = 2;

constexpr double WINDOW_PATIENCE = 10.0;  // until a window is open [s]
constexpr double IMAGE_PATIENCE = 10.0;   // until the first image has come [s]
constexpr double OLD_IMAGE = 2.0;         // what is shown is called old from this age on [s]
constexpr double SAVE_PATIENCE = 20.0;    // until view_store has answered [s]

/** What ends the program with one line. */
class Problem : public std::runtime_error
{
  using std::runtime_error::runtime_error;
};

/**
 * Libraries of windows end the whole process when there is no display, so another process tries.
 * @return whether a window can be opened.
 */
bool canOpenWindow()
{
  const pid_t child = fork();
  if (child == 0)
  {
    const QuietStandardError quiet;
    try
    {
      cv::namedWindow("probe", cv::WINDOW_AUTOSIZE);
      cv::destroyAllWindows();
    }
    catch (const cv::Exception&)
    {
      _exit(1);
    }
    _exit(0);
  }
  const Clock::time_point begin = Clock::now();
  int status = 0;
  pid_t ended = 0;
  while (child > 0 && (ended = waitpid(child, &status, WNOHANG)) == 0)
  {
    if (secondsSince(begin) > WINDOW_PATIENCE)
    {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return ended == child && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

/** A word of the command line that is meant as an argument of a launch file is, NAME:=VALUE; else the default. */
std::string argument(const std::string& name, const std::string& otherwise)
{
  const ros::M_string& words = ros::names::getUnresolvedRemappings();
  const auto word = words.find(name);
  return word == words.end() ? otherwise : word->second;
}

/** The newest image of a camera. */
class LiveImage
{
public:
  LiveImage()
  {
    const std::string topic = ros::names::resolve("camera") + "/" + argument("image", "image_raw");
    subscriber_.registerCallback([this](const CameraImageConstPtr& image) {
      guarded("an image on '" + image->topic + "'", [&] { onImage(*image); });
    });
    subscriber_.subscribe(ros::NodeHandle(), ros::NodeHandle("~"), topic, argument("image_transport", "raw"), 1);
  }

  std::string topic() const
  {
    return subscriber_.getTopic();
  }

  /** In colours, as windows have them; empty while none has come. Its age [s] is since it came. */
  std::pair<cv::Mat, double> latest() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return { picture_, secondsSince(time_) };
  }

  /** Why an image that came cannot be shown; or empty. */
  std::string problem() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return problem_;
  }

private:
  void onImage(const CameraImage& image)
  {
    cv::Mat picture;
    std::string problem;
    try
    {
      picture = toColour(image);
    }
    catch (const std::exception& error)
    {
      problem = oneLine(error);
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    problem_ = problem;
    if (!picture.empty())
    {
      picture_ = picture;
      time_ = Clock::now();
    }
  }

  mutable std::mutex mutex_;
  cv::Mat picture_;
  Clock::time_point time_ = Clock::now();
  std::string problem_;
  CameraImageSubscriber subscriber_;
};

/** Calls view_store/save in a thread that is left behind when it hangs. */
class Saving
{
public:
  void start(const SaveView::Request& request)
  {
    std::promise<std::pair<bool, std::string>> promise;
    answer_ = promise.get_future();
    begin_ = Clock::now();
    std::thread([request, promise = std::move(promise)]() mutable {
      SaveView service;
      service.request = request;
      if (callService("view_store/save", service))
      {
        promise.set_value({ service.response.success != 0, service.response.message });
      }
      else
      {
        promise.set_value({ false, "there is no " + ros::names::resolve("view_store/save") +
                                       ", or it has failed: start matching.launch" });
      }
    }).detach();
  }

  bool isRunning() const
  {
    return answer_.valid();
  }

  /** Whether the view was stored, and what was said, once that is known. */
  std::optional<std::pair<bool, std::string>> result()
  {
    if (answer_.valid() && answer_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
    {
      return answer_.get();
    }
    if (answer_.valid() && secondsSince(begin_) > SAVE_PATIENCE)
    {
      answer_ = {};
      return { { false, "view_store has not answered in time: look at its output" } };
    }
    return std::nullopt;
  }

private:
  std::future<std::pair<bool, std::string>> answer_;
  Clock::time_point begin_;
};

/** Breaks a text into lines that are no wider than `width` [px] when they are drawn. */
std::vector<std::string> wrapped(const std::string& text, int width, double size)
{
  std::vector<std::string> lines;
  std::istringstream words(text);
  std::string word;
  while (words >> word)
  {
    const std::string longer = lines.empty() ? word : lines.back() + " " + word;
    int baseline = 0;
    const bool fits = cv::getTextSize(longer, cv::FONT_HERSHEY_SIMPLEX, size, 1, &baseline).width <= width;
    if (lines.empty() || !fits)
    {
      lines.push_back(word);
    }
    else
    {
      lines.back() = longer;
    }
  }
  return lines;
}

/** @return the picture with texts in a strip below it, of a height that does not depend on them. */
cv::Mat withTexts(const cv::Mat& picture, const std::vector<std::pair<std::string, cv::Scalar>>& texts)
{
  constexpr double SIZE = 0.5;
  constexpr int LINE = 20;  // [px]
  constexpr int LINES = 8;
  constexpr int MARGIN = 8;  // [px]
  cv::Mat canvas;
  cv::copyMakeBorder(picture, canvas, 0, LINES * LINE, 0, 0, cv::BORDER_CONSTANT, cv::Scalar(40, 40, 40));
  int bottom = picture.rows;
  for (const auto& [text, colour] : texts)
  {
    for (const std::string& line : wrapped(text, picture.cols - 2 * MARGIN, SIZE))
    {
      bottom += LINE;
      cv::putText(canvas, line, { MARGIN, bottom - 6 }, cv::FONT_HERSHEY_SIMPLEX, SIZE, colour, 1, cv::LINE_AA);
    }
  }
  return canvas;
}

class PickWindow
{
public:
  PickWindow(std::string view, bool overwrite, const LiveImage& camera)
    : view_(std::move(view)), title_("view_servo: " + view_), overwrite_(overwrite), camera_(camera)
  {
    cv::namedWindow(title_, cv::WINDOW_AUTOSIZE | cv::WINDOW_GUI_NORMAL);
    cv::setMouseCallback(title_, &PickWindow::onMouse, this);
  }
  ~PickWindow()
  {
    cv::destroyAllWindows();
  }
  PickWindow(const PickWindow&) = delete;
  PickWindow& operator=(const PickWindow&) = delete;

  /** Until somebody leaves. @return whether the view has been stored. */
  bool run()
  {
    constexpr int ESCAPE = 27;
    constexpr int PERIOD = 30;  // [ms]
    bool shown = false;
    while (ros::ok())
    {
      show();
      const int key = cv::waitKey(PERIOD);
      // Closed by its own button: it was visible and is no more.
      const bool visible = cv::getWindowProperty(title_, cv::WND_PROP_VISIBLE) > 0.0;
      if ((key & 0xff) == ESCAPE || (shown && !visible))
      {
        break;
      }
      shown = shown || visible;
      const bool is_enter = (key & 0xff) == '\r' || (key & 0xff) == '\n';
      if (key >= 0 && is_enter && !saving_.isRunning() && !picker_.isDragged())
      {
        store();
      }
      if (const auto result = saving_.result())
      {
        stored_ = stored_ || result->first;
        outcome_ = *result;
        const std::string field = "overwrite: true";
        const std::size_t place = outcome_->second.find(field);
        if (place != std::string::npos)
        {
          outcome_->second.replace(place, field.size(), "pick_view " + view_ + " --overwrite");
        }
        std::cout << outcome_->second << std::endl;
      }
    }
    return stored_;
  }

private:
  static void onMouse(int event, int x, int y, int /*flags*/, void* self)
  {
    RegionPicker& picker = static_cast<PickWindow*>(self)->picker_;
    if (event == cv::EVENT_LBUTTONDOWN)
    {
      picker.press({ x, y });
    }
    else if (event == cv::EVENT_MOUSEMOVE)
    {
      picker.move({ x, y });
    }
    else if (event == cv::EVENT_LBUTTONUP)
    {
      picker.release({ x, y });
    }
  }

  void store()
  {
    SaveView::Request request;
    request.name = view_;
    request.roi = toRegionOfInterest(picker_.region());
    request.overwrite = static_cast<std::uint8_t>(overwrite_ || stored_);
    saving_.start(request);
    outcome_.reset();
  }

  void show()
  {
    const cv::Scalar white(255, 255, 255);
    const cv::Scalar green(120, 255, 120);
    const cv::Scalar red(120, 120, 255);
    const auto [image, age] = camera_.latest();
    picker_.setImageSize(image.size());
    const double scale = picker_.scale();
    cv::Mat picture;
    cv::resize(image, picture, {}, scale, scale, cv::INTER_AREA);
    const cv::Rect region = picker_.region();
    if (!region.empty())
    {
      const cv::Point first(cvRound(region.x * scale), cvRound(region.y * scale));
      const cv::Point last(cvRound(region.br().x * scale) - 1, cvRound(region.br().y * scale) - 1);
      cv::rectangle(picture, first, last, cv::Scalar(0, 0, 0), 3);
      cv::rectangle(picture, first, last, green, 1);
    }
    std::vector<std::pair<std::string, cv::Scalar>> texts;
    texts.emplace_back("Drag a region with the mouse; a click: everywhere. Enter stores '" + view_ + "', Esc leaves.",
                       white);
    texts.emplace_back(region.empty()
                           ? "Region: everywhere"
                           : "Region: x " + std::to_string(region.x) + ", y " + std::to_string(region.y) + ", width " +
                                 std::to_string(region.width) + ", height " + std::to_string(region.height),
                       white);
    if (!region.empty() && !picker_.isDragged())
    {
      if (region != judged_)
      {
        judged_ = region;
        judgement_ = judgeRegion(image, region);
      }
      texts.emplace_back(judgement_.text, judgement_.is_good ? green : red);
    }
    if (age > OLD_IMAGE)
    {
      texts.emplace_back("No image has come for " + std::to_string(static_cast<int>(age)) + " s on " + camera_.topic(),
                         red);
    }
    if (saving_.isRunning())
    {
      texts.emplace_back("Storing ...", white);
    }
    else if (outcome_)
    {
      texts.emplace_back(outcome_->second, outcome_->first ? green : red);
    }
    cv::imshow(title_, withTexts(picture, texts));
  }

  const std::string view_;
  const std::string title_;
  const bool overwrite_;
  const LiveImage& camera_;
  RegionPicker picker_;
  cv::Rect judged_;
  RegionJudgement judgement_;  // of that
  Saving saving_;
  bool stored_ = false;
  std::optional<std::pair<bool, std::string>> outcome_;
};

int run(const std::string& view, bool overwrite)
{
  requireMaster();
  const LiveImage camera;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  const std::string missing = waitUntilReady(IMAGE_PATIENCE, [&]() -> std::string {
    if (!camera.latest().first.empty())
    {
      return "";
    }
    const std::string problem = camera.problem();
    return (problem.empty() ? "no image has come on '" + camera.topic() + "'"
                            : "images on '" + camera.topic() + "' cannot be shown: " + problem) +
           "; camera:=NAMESPACE, image:=NAME and image_transport:=compressed say otherwise";
  });
  if (!ros::ok())
  {
    return NOT_STORED;
  }
  if (!missing.empty())
  {
    throw Problem(missing);
  }
  return PickWindow(view, overwrite, camera).run() ? STORED : NOT_STORED;
}

}  // namespace
}  // namespace view_servo

int main(int argc, char** argv)
{
  using namespace view_servo;
  int status = CANNOT;
  try
  {
    bool overwrite = false;
    CommandLine line(
        "Shows what the camera sees, and stores it as a view with a region that is dragged with the mouse.\n"
        "\n"
        "  rosrun view_servo pick_view NAME [OPTIONS] [camera:=NAMESPACE] [image:=NAME] [image_transport:=NAME]",
        "Example: rosrun view_servo pick_view shelf --overwrite camera:=/camera\n"
        "Exit status: 0 stored, 1 not stored, 2 cannot, with one line on standard error.");
    line.flag("overwrite", overwrite, "replace a view of that name");
    const auto names = parseWithoutRosWords(line, argc, argv);
    if (!names)
    {
      return STORED;  // --help
    }
    if (names->size() != 1)
    {
      throw Problem("say the view's name, and nothing else: pick_view NAME");
    }
    if (!canOpenWindow())
    {
      const char* display = std::getenv("DISPLAY");
      throw Problem(
          std::string("no window can be opened on display '") + (display == nullptr ? "" : display) +
          "': run it where there is one, or over ssh -X; without, view save NAME --roi X Y W H does the same");
    }
    initQuietly(argc, argv, "pick_view");
    status = run(names->front(), overwrite);
  }
  catch (const std::exception& error)
  {
    std::cerr << "pick_view: " << oneLine(error) << '\n';
  }
  if (ros::isInitialized())
  {
    ros::shutdown();
  }
  std::cout.flush();
  _exit(status);  // a call that hangs is left behind
}
