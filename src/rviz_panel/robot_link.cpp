// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "rviz_panel/robot_link.h"

#include "view_servo/DeleteView.h"
#include "view_servo/FollowRouteAction.h"
#include "view_servo/GetView.h"
#include "view_servo/HomeToViewAction.h"
#include "view_servo/ListViews.h"
#include "view_servo/SaveView.h"
#include "view_servo/ServoToViewAction.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/seconds_since.h"
#include "view_servo/ros/camera_image.h"
#include "view_servo/ros/conversions.h"

#include <actionlib/client/action_client.h>
#include <actionlib_msgs/GoalStatusArray.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/callback_queue.h>
#include <ros/master.h>
#include <ros/message_event.h>
#include <ros/spinner.h>
#include <std_srvs/SetBool.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <exception>
#include <map>
#include <mutex>
#include <utility>

namespace view_servo
{
namespace
{
using Clock = std::chrono::steady_clock;

constexpr double LIST_PATIENCE = 5.0;    // until view_store has answered [s]
constexpr double SAVE_PATIENCE = 20.0;   // likewise, and has perhaps waited for an image [s]
constexpr double GATE_PATIENCE = 2.0;    // until a driver has answered [s]
constexpr double LOOK_PERIOD = 3.0;      // views and topics are looked for [s]
constexpr double PICTURE_PERIOD = 0.05;  // pictures are decoded at most this often [s]
constexpr double CURVE_SPAN = 60.0;      // [s]
constexpr double FOLLOWED_SPAN = 3.0;    // diagnostics of the tracker are believed for so long [s]

struct DriverKind
{
  std::string name;
  std::string action;
};
const std::array<DriverKind, DRIVERS> KINDS = { DriverKind{ "homing", "home" }, DriverKind{ "servo_25d", "servo" },
                                                DriverKind{ "route_follower", "follow" } };

cv::Mat toThumbnail(const sensor_msgs::Image& image, const cv::Rect& region)
{
  constexpr double WIDTH = 128.0;  // [px]
  const cv::Mat grey = toGrey(image, "image");
  const double scale = WIDTH / grey.cols;
  cv::Mat thumbnail;
  cv::resize(grey, thumbnail, { static_cast<int>(WIDTH), std::max(1, cvRound(scale * grey.rows)) }, 0.0, 0.0,
             cv::INTER_AREA);
  if (!region.empty())
  {
    const cv::Rect frame(cvRound(region.x * scale), cvRound(region.y * scale), cvRound(region.width * scale),
                         cvRound(region.height * scale));
    cv::rectangle(thumbnail, frame, cv::Scalar(0), 3);
    cv::rectangle(thumbnail, frame, cv::Scalar(255), 1);
  }
  return thumbnail;
}

/** Of a key; empty where there is none. */
std::string valueOf(const diagnostic_msgs::DiagnosticStatus& status, const std::string& key)
{
  const auto pair = std::find_if(status.values.begin(), status.values.end(),
                                 [&](const diagnostic_msgs::KeyValue& other) { return other.key == key; });
  return pair == status.values.end() ? "" : pair->value;
}

/** What homography_tracker's diagnostics say for people; empty while it tracks nothing. */
std::string whatIsFollowed(const diagnostic_msgs::DiagnosticStatus& tracking)
{
  if (tracking.message != "tracking")
  {
    return "";
  }
  return "the camera sees view '" + valueOf(tracking, "View") + "' as " +
         (valueOf(tracking, "Followed as") == "scene" ? "a scene with depth" : "one plane");
}

/** The field of a goal for the view to drive to. */
std::string& viewOf(HomeToViewGoal& goal)
{
  return goal.view;
}
std::string& viewOf(ServoToViewGoal& goal)
{
  return goal.view;
}
std::string& viewOf(FollowRouteGoal& goal)
{
  return goal.goal;
}

/** Sends goals of one kind of driver. */
class DriverClient
{
public:
  virtual ~DriverClient() = default;
  virtual bool isThere() const = 0;
  /** Drives to a view. */
  virtual void go(const std::string& view) = 0;
  virtual void cancelAll() = 0;
};

/**
 * `end` is told, by a thread of the callback queue, how a goal has ended: whether at the view, and the driver's words.
 */
template <typename Action>
class ActionDriver : public DriverClient
{
public:
  using End = std::function<void(bool, const std::string&)>;

  ActionDriver(const ros::NodeHandle& nh, const std::string& action, ros::CallbackQueue& queue, End end)
    : end_(std::move(end)), client_(nh, action, &queue)
  {
  }

  bool isThere() const override
  {
    return client_.isServerConnected();
  }

  void go(const std::string& view) override
  {
    typename Action::_action_goal_type::_goal_type goal;
    viewOf(goal) = view;
    handle_ = client_.sendGoal(goal, [this](Handle handle) {
      if (handle.getCommState() == actionlib::CommState::DONE)
      {
        const auto result = handle.getResult();
        end_(result && result->success, result ? result->message : "the driver has forgotten the goal");
      }
    });
  }

  void cancelAll() override
  {
    client_.cancelAllGoals();
    if (!handle_.isExpired() && handle_.getCommState() != actionlib::CommState::DONE)
    {
      handle_.cancel();  // by its id, in case it arrives after its cancellation
    }
  }

private:
  using Handle = actionlib::ClientGoalHandle<Action>;

  End end_;
  mutable actionlib::ActionClient<Action> client_;
  Handle handle_;
};

}  // namespace

bool operator==(const RobotNames& a, const RobotNames& b)
{
  return a.robot_namespace == b.robot_namespace && a.camera_topic == b.camera_topic &&
         a.overlay_topic == b.overlay_topic;
}

/** What the workers, the callbacks and the link share. */
class RobotLink::Core
{
public:
  explicit Core(RobotNames names) : names_(std::move(names))
  {
    for (std::size_t k = 0; k < KINDS.size(); ++k)
    {
      data_.drivers[k].kind = KINDS[k].name;
    }
  }

  // ------------------------------------------------------------------------------------------------- for the link

  RobotSnapshot snapshot()
  {
    const std::shared_ptr<Connections> connections = this->connections();
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t k = 0; k < KINDS.size(); ++k)
    {
      data_.drivers[k].is_there = connections && connections->clients[k]->isThere();
      data_.drivers[k].silence = diagnosed_[k] ? secondsSince(*diagnosed_[k]) : 0.0;
    }
    if (followed_ && secondsSince(*followed_) > FOLLOWED_SPAN)
    {
      data_.followed.clear();
    }
    while (!data_.errors.empty() && secondsSince(data_.errors.front().time) > CURVE_SPAN)
    {
      data_.errors.pop_front();
    }
    return data_;
  }

  void say(const std::string& text, bool is_good)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    data_.words.text = text;
    data_.words.is_good = is_good;
    ++data_.words.count;
  }

  /** Kinds of drivers that are there. */
  std::vector<std::size_t> present() const
  {
    std::vector<std::size_t> kinds;
    const std::shared_ptr<Connections> connections = this->connections();
    for (std::size_t k = 0; connections && k < KINDS.size(); ++k)
    {
      if (connections->clients[k]->isThere())
      {
        kinds.push_back(k);
      }
    }
    return kinds;
  }

  /** The only one; says what is the matter when there is none or several. */
  std::optional<std::size_t> onlyDriver()
  {
    const std::vector<std::size_t> kinds = present();
    if (kinds.size() == 1)
    {
      return kinds.front();
    }
    say(kinds.empty() ? "No driver runs" + place() + ": start a launch file that drives, or name the robot's namespace"
                      : KINDS[kinds[0]].name + " and " + KINDS[kinds[1]].name + " both run" + place() +
                            ": start them in namespaces of their own",
        false);
    return std::nullopt;
  }

  void go(std::size_t kind, const std::string& view)
  {
    if (const std::shared_ptr<Connections> connections = this->connections())
    {
      say(KINDS[kind].name + " is asked to drive to '" + view + "'", true);
      setStopped(kind, false);
      connections->clients[kind]->go(view);
    }
  }

  /** @return whether there was something to publish on. */
  bool cancelAll()
  {
    const std::shared_ptr<Connections> connections = this->connections();
    for (std::size_t k = 0; connections && k < KINDS.size(); ++k)
    {
      connections->clients[k]->cancelAll();
      setStopped(k, true);
    }
    return connections != nullptr;
  }

  // ---------------------------------------------------------------------------------------------- for the workers

  /** Subscribes and advertises. */
  void connect()
  {
    try
    {
      auto connections = std::make_shared<Connections>();
      ros::NodeHandle nh(names_.robot_namespace);
      nh.setCallbackQueue(&connections->queue);
      connections->subscribers.push_back(nh.subscribe<ServoStatus>(
          "status", 20,
          boost::function<void(const ros::MessageEvent<ServoStatus const>&)>(
              [this](const ros::MessageEvent<ServoStatus const>& event) { takeStatus(event); })));
      for (std::size_t k = 0; k < KINDS.size(); ++k)
      {
        using Event = ros::MessageEvent<actionlib_msgs::GoalStatusArray const>;
        connections->subscribers.push_back(nh.subscribe<actionlib_msgs::GoalStatusArray>(
            KINDS[k].action + "/status", 1, boost::function<void(const Event&)>([this, k](const Event& event) {
              takeNode(k, event.getPublisherName());
            })));
        const auto end = [this, k](bool success, const std::string& words) {
          takeEnd(k, success, words);
        };
        const auto client = [&](auto type) -> std::unique_ptr<DriverClient> {
          return std::make_unique<ActionDriver<decltype(type)>>(nh, KINDS[k].action, connections->queue, end);
        };
        connections->clients[k] = k == 0   ? client(HomeToViewAction())
                                  : k == 1 ? client(ServoToViewAction())
                                           : client(FollowRouteAction());
      }
      tracking_ = resolved("homography_tracker").substr(1) + ": tracking";
      connections->subscribers.push_back(nh.subscribe<diagnostic_msgs::DiagnosticArray>(
          "/diagnostics", 20,
          boost::function<void(const diagnostic_msgs::DiagnosticArrayConstPtr&)>(
              [this](const diagnostic_msgs::DiagnosticArrayConstPtr& message) { takeDiagnostics(*message); })));
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        connections_ = connections;
      }
      connections->spinner.start();
      subscribe(nh, names_.camera_topic, connections->camera, &RobotSnapshot::camera);
      showOverlay(overlay_wanted_);
    }
    catch (const std::exception& error)
    {
      say("The robot cannot be reached: " + oneLine(error), false);
    }
  }

  /** Subscribes only while somebody looks: what nobody looks at is not drawn, and perhaps not even matched. */
  void showOverlay(bool shown)
  {
    overlay_wanted_ = shown;
    const std::shared_ptr<Connections> connections = this->connections();
    if (!connections || shown == (connections->overlay != nullptr))
    {
      return;
    }
    connections->overlay.reset();
    if (shown)
    {
      connections->overlay = std::make_unique<CameraImageSubscriber>();
      ros::NodeHandle nh(names_.robot_namespace);
      nh.setCallbackQueue(&connections->queue);
      subscribe(nh, names_.overlay_topic, *connections->overlay, &RobotSnapshot::overlay);
    }
  }

  void disconnect()
  {
    std::shared_ptr<Connections> connections;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      connections.swap(connections_);
    }
  }

  /** For topics and views, and waits with the next look. What hinders it stands where the views would. */
  void look(ServiceCaller& caller)
  {
    const Clock::time_point begin = Clock::now();
    try
    {
      lookForTopics();
      lookForViews(caller, false);
    }
    catch (const std::exception& error)
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      data_.views_fault = oneLine(error);
    }
    rest(secondsSince(begin));
  }

  /** Lists the views, and reads those that are not known. @param all also those that are. */
  void lookForViews(ServiceCaller& caller, bool all)
  {
    ListViews list;
    const std::string fault = ask(caller, "view_store/list", list, LIST_PATIENCE);
    if (!fault.empty())
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      data_.views_fault = fault;
      return;
    }
    std::vector<ListedView> views;
    std::map<std::string, ListedView> known;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (const ListedView& view : data_.views)
      {
        if (!all && view.fault.empty() && view.name != changed_)
        {
          known[view.name] = view;
        }
      }
      changed_.clear();
    }
    bool is_new = all;
    for (const std::string& name : list.response.names)
    {
      const auto place = known.find(name);
      is_new = is_new || place == known.end();
      views.push_back(place != known.end() ? place->second : read(caller, name));
    }
    for (const DamagedView& damaged : list.response.damaged)
    {
      views.push_back({ damaged.name, cv::Mat(), 0.0, damaged.reason });
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    is_new = is_new || !std::equal(views.begin(), views.end(), data_.views.begin(), data_.views.end(),
                                   [](const ListedView& a, const ListedView& b) {
                                     return a.name == b.name && a.fault == b.fault;
                                   });
    data_.views_fault.clear();
    data_.views = std::move(views);
    data_.views_count += is_new ? 1 : 0;
  }

  bool isTimeToLook() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return Clock::now() >= next_look_;
  }
  /**
   * Waits with the next look: many views take view_store long to list, and it is not to be busy with that all the time.
   * @param took how long looking for topics and views took [s].
   */
  void rest(double took)
  {
    constexpr double TIMES = 10.0;
    constexpr double LONGEST = 30.0;  // [s]
    const double wait = std::clamp(TIMES * took, LOOK_PERIOD, LONGEST);
    const std::lock_guard<std::mutex> lock(mutex_);
    next_look_ = Clock::now() + std::chrono::milliseconds(static_cast<int>(1000 * wait));
  }

  void lookForTopics()
  {
    ros::master::V_TopicInfo topics;
    std::vector<std::string> names;
    if (ros::master::getTopics(topics))
    {
      for (const ros::master::TopicInfo& topic : topics)
      {
        if (topic.datatype == "sensor_msgs/Image" ||
            (topic.datatype == "sensor_msgs/CompressedImage" && endsWith(topic.name, COMPRESSED)))
        {
          names.push_back(topic.name);
        }
      }
    }
    std::sort(names.begin(), names.end());
    const std::lock_guard<std::mutex> lock(mutex_);
    data_.image_topics = std::move(names);
  }

  void save(ServiceCaller& caller, const std::string& view, const cv::Rect& region, bool overwrite, bool learn)
  {
    SaveView service;
    service.request.name = view;
    service.request.roi = toRegionOfInterest(region);
    service.request.overwrite = static_cast<std::uint8_t>(overwrite);
    service.request.learn = static_cast<std::uint8_t>(learn);
    std::string fault = ask(caller, "view_store/save", service, SAVE_PATIENCE);
    if (!fault.empty())
    {
      const std::string field = "overwrite: true";
      const std::size_t place = fault.find(field);
      if (place != std::string::npos)
      {
        fault.replace(place, field.size(), "'Replace' ticked");
      }
      say("Not stored: " + fault, false);
      return;
    }
    say(service.response.message, true);
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      changed_ = view;
    }
    lookForViews(caller, false);
  }

  void deleteView(ServiceCaller& caller, const std::string& view)
  {
    DeleteView service;
    service.request.name = view;
    const std::string fault = ask(caller, "view_store/delete", service, SAVE_PATIENCE);
    say(fault.empty() ? service.response.message : "Not deleted: " + fault, fault.empty());
    lookForViews(caller, false);
  }

  void openGate(ServiceCaller& caller, std::size_t kind)
  {
    std_srvs::SetBool service;
    service.request.data = 1;
    const std::string fault = setGate(caller, kind, service);
    say(fault.empty() ? KINDS[kind].name + " is " + service.response.message : "Not enabled: " + fault, fault.empty());
  }

  /** @param was_there whether the driver was, when somebody pressed Stop. */
  void closeGate(ServiceCaller& caller, std::size_t kind, bool was_there)
  {
    std_srvs::SetBool service;
    service.request.data = 0;
    CallOutcome::Kind outcome = CallOutcome::GIVEN_UP;
    const std::string fault = setGate(caller, kind, service, &outcome);
    if (fault.empty())
    {
      say("Stop: " + KINDS[kind].name + " is " + service.response.message + ", its goals are cancelled", true);
    }
    else if (was_there || outcome != CallOutcome::NO_SERVICE)
    {
      say("Stop: the goals are cancelled, but " + fault + "; use the robot's emergency stop unless it stands", false);
    }
  }

  std::string place() const
  {
    return names_.robot_namespace.empty() ? "" : " in '" + names_.robot_namespace + "'";
  }

private:
  inline static const std::string COMPRESSED = "/compressed";

  /** The first members end last. */
  struct Connections
  {
    ros::CallbackQueue queue;
    std::vector<ros::Subscriber> subscribers;
    CameraImageSubscriber camera;
    std::unique_ptr<CameraImageSubscriber> overlay;
    std::array<std::unique_ptr<DriverClient>, DRIVERS> clients;
    ros::AsyncSpinner spinner{ 1, &queue };
  };

  void setStopped(std::size_t kind, bool stopped)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopped_[kind] = stopped;
  }

  static bool endsWith(const std::string& text, const std::string& end)
  {
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
  }

  std::shared_ptr<Connections> connections() const
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    return connections_;
  }

  std::string resolved(const std::string& name) const
  {
    return ros::NodeHandle(names_.robot_namespace).resolveName(name);
  }

  /** Calls a service of view_store. @return what is wrong; or empty. */
  template <typename Service>
  std::string ask(ServiceCaller& caller, const std::string& name, Service& service, double patience) const
  {
    const CallOutcome outcome = caller.call(resolved(name), service, patience);
    if (outcome.kind == CallOutcome::ANSWERED)
    {
      return service.response.success ? "" : service.response.message;
    }
    return outcome.kind == CallOutcome::NO_SERVICE
               ? outcome.text +
                     ": start matching.launch, homing.launch or arm_servo.launch, or name the robot's namespace"
               : outcome.text;
  }

  ListedView read(ServiceCaller& caller, const std::string& name) const
  {
    ListedView view;
    view.name = name;
    GetView service;
    service.request.name = name;
    view.fault = ask(caller, "view_store/get", service, LIST_PATIENCE);
    if (!view.fault.empty())
    {
      return view;
    }
    try
    {
      const sensor_msgs::Image& image = service.response.image;
      view.thumbnail = toThumbnail(image, toRect(service.response.roi, cv::Size(image.width, image.height)));
      view.stamp = image.header.stamp.toSec();
    }
    catch (const std::exception& error)
    {
      view.fault = oneLine(error);  // of this view alone
    }
    return view;
  }

  std::string setGate(ServiceCaller& caller, std::size_t kind, std_srvs::SetBool& service,
                      CallOutcome::Kind* kind_of_outcome = nullptr)
  {
    // It is below the name of the node that serves the action, which may have been given another one. A nodelet's is below
    // its own name, but its action is its manager's.
    std::string node;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      node = nodes_[kind];
    }
    const std::string usual = resolved(KINDS[kind].name + "/enable");
    const std::string name = node.empty() ? usual : node + "/enable";
    CallOutcome outcome = caller.call(name, service, GATE_PATIENCE);
    if (outcome.kind == CallOutcome::NO_SERVICE && name != usual)
    {
      outcome = caller.call(usual, service, GATE_PATIENCE);
    }
    if (kind_of_outcome != nullptr)
    {
      *kind_of_outcome = outcome.kind;
    }
    if (outcome.kind != CallOutcome::ANSWERED)
    {
      return outcome.kind == CallOutcome::GIVEN_UP ? name + " was called again" : outcome.text;
    }
    if (!service.response.success)
    {
      return service.response.message;
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    data_.drivers[kind].enabled = service.request.data != 0;
    return "";
  }

  void subscribe(const ros::NodeHandle& nh, std::string topic, CameraImageSubscriber& subscriber,
                 TopicPicture RobotSnapshot::*place)
  {
    if (topic.empty())
    {
      return;
    }
    std::string transport = "raw";
    if (place == &RobotSnapshot::camera)
    {
      ros::NodeHandle("~").getParam("camera_transport", transport);
    }
    if (endsWith(topic, COMPRESSED))
    {
      topic.resize(topic.size() - COMPRESSED.size());
      transport = COMPRESSED.substr(1);
    }
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      TopicPicture& last = data_.*place;
      last.since = Clock::now();
      last.topic = topic;
      last.picture.release();  // what was shown before is not what is seen now
      last.fault.clear();
    }
    try
    {
      subscriber.registerCallback(boost::function<void(const CameraImageConstPtr&)>(
          [this, place](const CameraImageConstPtr& image) { takeImage(*image, place); }));
      subscriber.subscribe(nh, ros::NodeHandle("~"), topic, transport, 1);
      const std::lock_guard<std::mutex> lock(mutex_);
      (data_.*place).topic = subscriber.getTopic();
    }
    catch (const std::exception& error)
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      (data_.*place).fault = oneLine(error);
    }
  }

  // ------------------------------------------------------------------------------------------------- the callbacks

  void takeImage(const CameraImage& image, TopicPicture RobotSnapshot::*place)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      const TopicPicture& last = data_.*place;
      if (!last.picture.empty() && secondsSince(last.since) < PICTURE_PERIOD)
      {
        return;
      }
    }
    cv::Mat picture;
    std::string fault;
    try
    {
      picture = toColour(image);
    }
    catch (const std::exception& error)
    {
      fault = oneLine(error);
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    TopicPicture& last = data_.*place;
    last.fault = fault;
    if (!picture.empty())
    {
      last.picture = picture;
      last.since = Clock::now();
      ++last.count;
    }
  }

  void takeNode(std::size_t kind, const std::string& node)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    nodes_[kind] = node;
  }

  void takeStatus(const ros::MessageEvent<ServoStatus const>& event)
  {
    const ServoStatus& status = *event.getMessage();
    const std::lock_guard<std::mutex> lock(mutex_);
    for (std::size_t k = 0; k < KINDS.size(); ++k)
    {
      // The latched one may come before the action's node is known by its name.
      const std::string& node = nodes_[k];
      const std::string usual = resolved(KINDS[k].name);
      if (event.getPublisherName() != (node.empty() ? usual : node))
      {
        continue;
      }
      data_.drivers[k].status = status;
      const bool is_known = std::isfinite(status.translation_error) || std::isfinite(status.rotation_error) ||
                            std::isfinite(status.point_error);
      if (is_known)
      {
        data_.errors.push_back({ Clock::now(), status.translation_error, status.rotation_error, status.point_error });
      }
    }
  }

  void takeDiagnostics(const diagnostic_msgs::DiagnosticArray& message)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const diagnostic_msgs::DiagnosticStatus& status : message.status)
    {
      if (status.name == tracking_)
      {
        followed_ = Clock::now();
        data_.followed = whatIsFollowed(status);
      }
      for (std::size_t k = 0; k < KINDS.size(); ++k)
      {
        // A nodelet's are named by itself, but its action is its manager's; see setGate().
        const std::string usual = resolved(KINDS[k].name);
        if (nodes_[k].empty() || (status.name != nodes_[k].substr(1) + ": " + KINDS[k].action &&
                                  status.name != usual.substr(1) + ": " + KINDS[k].action))
        {
          continue;
        }
        diagnosed_[k] = Clock::now();
        data_.drivers[k].level = static_cast<unsigned char>(status.level);
        for (const diagnostic_msgs::KeyValue& pair : status.values)
        {
          if (pair.key == "Enabled")
          {
            data_.drivers[k].enabled = pair.value == "True";
          }
          else if (pair.key == "Dry run")
          {
            data_.drivers[k].dry_run = pair.value == "True";
          }
        }
      }
    }
  }

  void takeEnd(std::size_t kind, bool success, const std::string& words)
  {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (stopped_[kind])
      {
        return;  // what Stop says matters more
      }
    }
    if (success)
    {
      say("Arrived: " + words, true);
    }
    else if (words.rfind("disabled: call ~enable first", 0) == 0)
    {
      say("Not driven: the gate of " + KINDS[kind].name +
              " is closed, so that nothing moves by mistake: press Enable, then Go",
          false);
    }
    else
    {
      say("Not arrived: " + words, false);
    }
  }

  const RobotNames names_;
  mutable std::mutex mutex_;
  Clock::time_point next_look_;  // when topics and views are looked for again
  RobotSnapshot data_;
  std::array<std::string, DRIVERS> nodes_;  // absolute names of those that serve the actions; empty: not known yet
  std::array<std::optional<Clock::time_point>, DRIVERS> diagnosed_;
  std::string tracking_;                       // name of the tracker's diagnostics; set before any come
  std::optional<Clock::time_point> followed_;  // when the tracker has said what it sees
  bool overlay_wanted_ = false;                // for the worker
  std::array<bool, DRIVERS> stopped_{};        // somebody has pressed Stop since the last goal was sent
  std::string changed_;                        // a view that was stored and has to be read anew
  std::shared_ptr<Connections> connections_;
};

template <typename Body>
TaskWorker::Task RobotLink::task(Body body) const
{
  return [core = core_, body](ServiceCaller& caller) {
    try
    {
      body(*core, caller);
    }
    catch (const std::exception& error)
    {
      core->say("It has failed: " + oneLine(error), false);
    }
  };
}

RobotLink::RobotLink(const RobotNames& names) : core_(std::make_shared<Core>(names))
{
  views_.add(task([](Core& core, ServiceCaller& /*caller*/) { core.connect(); }));
}

RobotLink::~RobotLink()
{
  for (TaskWorker& gate : gates_)
  {
    gate.finish([](ServiceCaller& /*caller*/) {});
  }
  views_.finish(task([](Core& core, ServiceCaller& /*caller*/) { core.disconnect(); }));
}

RobotSnapshot RobotLink::snapshot()
{
  views_.expire();
  for (TaskWorker& gate : gates_)
  {
    gate.expire();
    const std::string waiting = gate.waitsForMaster(GATE_PATIENCE);
    if (!waiting.empty())
    {
      core_->say("The master does not answer, so that " + waiting +
                     " cannot be called; use the robot's emergency stop unless it stands",
                 false);
    }
  }
  if (core_->isTimeToLook() && views_.isIdle())
  {
    views_.add(task([](Core& core, ServiceCaller& caller) { core.look(caller); }));
  }
  return core_->snapshot();
}

void RobotLink::showOverlay(bool shown)
{
  views_.add(task([shown](Core& core, ServiceCaller& /*caller*/) { core.showOverlay(shown); }));
}

void RobotLink::reloadViews()
{
  views_.add(task([](Core& core, ServiceCaller& caller) { core.lookForViews(caller, true); }));
}

void RobotLink::store(const std::string& view, const cv::Rect& region, bool overwrite, bool learn)
{
  core_->say("Storing '" + view + "' ...", true);
  views_.add(task([=](Core& core, ServiceCaller& caller) { core.save(caller, view, region, overwrite, learn); }));
}

void RobotLink::deleteView(const std::string& view)
{
  core_->say("Deleting '" + view + "' ...", true);
  views_.add(task([view](Core& core, ServiceCaller& caller) { core.deleteView(caller, view); }));
}

void RobotLink::go(const std::string& view)
{
  if (const auto kind = core_->onlyDriver())
  {
    core_->go(*kind, view);
  }
}

void RobotLink::enable()
{
  if (const auto kind = core_->onlyDriver())
  {
    core_->say("Enabling " + KINDS[*kind].name + " ...", true);
    gates_[*kind].add(task([kind = *kind](Core& core, ServiceCaller& caller) { core.openGate(caller, kind); }));
  }
}

void RobotLink::stop()
{
  const bool published = core_->cancelAll();
  const std::vector<std::size_t> present = core_->present();
  core_->say(present.empty() ? "Stop: no driver is known" + core_->place() +
                                   "; goals and gates are ended all the same where there are any"
                             : "Stop: all goals are told to end, the gates are being closed",
             published && !present.empty());
  for (std::size_t k = 0; k < gates_.size(); ++k)
  {
    const bool was_there = std::find(present.begin(), present.end(), k) != present.end();
    gates_[k].replace(
        task([k, was_there](Core& core, ServiceCaller& caller) { core.closeGate(caller, k, was_there); }));
  }
}

}  // namespace view_servo
