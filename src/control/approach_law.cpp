// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/approach_law.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <sstream>
#include <utility>

namespace view_servo
{
namespace
{
/** A course to where an approach goes, with its speeds. */
Course courseOf(Course::Kind kind, const ApproachParams& params)
{
  Course course;
  course.kind = kind;
  course.gain = params.gain;
  course.turn_gain = params.turn_gain;
  return course;
}

/** Straight to the goal, turning on the way. */
class HolonomicLaw final : public ApproachLaw
{
public:
  explicit HolonomicLaw(const ApproachParams& params) : params_(params)
  {
  }

  void update(const Situation& situation) override
  {
    goal_in_odom_ = situation.goal_in_odom;
  }

  Course course() const override
  {
    Course course = courseOf(Course::TO_VIEW, params_);
    course.view = goal_in_odom_;
    return course;
  }

  double tolerance() const override
  {
    return params_.distance_tolerance;
  }
  std::string text() const override
  {
    return "";
  }
  std::string failure() const override
  {
    return "";
  }

private:
  const ApproachParams params_;
  std::optional<PlanarPose> held_goal_;  // in odometry's frame, while the base corrects where it stood
  PlanarPose goal_in_odom_;              // by which the base drives
};

/**
 * Manoeuvres of turns and straight legs, planned with what the view's pose is known by, and planned anew when it turns
 * out to be another. The last leg lies along the goal's axis; what it leaves across is taken away by going back a
 * little and coming again.
 */
class DifferentialLaw final : public ApproachLaw
{
public:
  DifferentialLaw(const ApproachParams& params, double most_tolerance)
    : params_(params),
      most_tolerance_(most_tolerance),
      tolerance_(std::min(TOLERANCE_ACROSS * params.distance_tolerance, most_tolerance))
  {
  }

  void update(const Situation& situation) override
  {
    goal_in_odom_ = held_goal_.value_or(situation.goal_in_odom);
    base_in_odom_ = situation.base_in_odom;
    base_ = compose(inverse(goal_in_odom_), base_in_odom_);
    if (situation.known_anew && !held_goal_ && (manoeuvre_.legs.empty() ? isTimeToTry() : isAnother(goal_in_odom_)))
    {
      plan(situation, params_.manoeuvre);
    }
    advance();
    if (compose(inverse(planned_from_), base_in_odom_).distance() > DRIVEN)
    {
      plans_ = 0;
    }
    if (docked())
    {
      held_goal_.reset();
    }
    // Where a view is flat, or a focal length wrong, a turn looks like a motion across: what is seen while the base is
    // turned away is no reason to steer.
    const bool steers = part_ == Part::LEG && isLast() && std::abs(base_.yaw) > STRAIGHT;
    axis_in_odom_ = steers ? axis_in_odom_ : goal_in_odom_;
    const bool stands =
        docked() && std::abs(base_.x) <= params_.distance_tolerance && std::abs(base_.yaw) <= params_.yaw_tolerance;
    looks_ = stands ? looks_ + (situation.seen ? 1 : 0) : 0;
    const PlanarPose left = compose(inverse(situation.goal_in_odom), base_in_odom_);
    if (looks_ >= ENOUGH_LOOKS && left.distance() > tolerance_)
    {
      looks_ = 0;
      correct(situation, left.distance());
    }
  }

  Course course() const override
  {
    if (manoeuvre_.legs.empty())
    {
      return Course();
    }
    Course course = courseOf(part_ == Part::LEG ? Course::LINE : Course::TURN, params_);
    course.min_speed = params_.min_speed;
    course.min_turn_rate = params_.min_turn_rate;
    course.yaw_tolerance = SHARE_OF_TOLERANCE * params_.yaw_tolerance;
    course.distance_tolerance = SHARE_OF_TOLERANCE * params_.distance_tolerance;
    course.end = compose(goal_in_odom_, part_ == Part::LAST_TURN ? PlanarPose() : leg().end);
    if (part_ == Part::LEG)
    {
      // Of the last leg only the way along it is what was seen last. The others end at speed: what comes next is a
      // turn.
      const PlanarPose on_axis = compose(inverse(axis_in_odom_), base_in_odom_);
      course.end = isLast() ? compose(axis_in_odom_, { on_axis.x - base_.x, 0.0, 0.0 })
                            : compose(course.end, { leg().backwards ? -PASSED : PASSED, 0.0, 0.0 });
    }
    return course;
  }

  double tolerance() const override
  {
    return tolerance_;
  }

  std::string text() const override
  {
    if (manoeuvre_.legs.empty())
    {
      return "no way to the view keeps enough of it in sight";
    }
    if (docked())
    {
      return "";
    }
    std::ostringstream text;
    text.precision(2);
    const std::string place = " (" + std::to_string(leg_ + 1) + " of " + std::to_string(manoeuvre_.legs.size()) + ")";
    if (part_ == Part::TURN)
    {
      const double angle = wrapAngle(leg().end.yaw - base_.yaw);
      text << "turns " << std::abs(angle) * 180.0 / M_PI << " degrees to the " << (angle > 0.0 ? "left" : "right");
    }
    else
    {
      text << "drives " << left() << " m " << (leg().backwards ? "back" : "ahead");
    }
    return text.str() + place;
  }

  std::string failure() const override
  {
    return failure_;
  }

private:
  static constexpr double DRIVEN = 0.1;              // as far a base has to go for a new plan to be worth it [m]
  static constexpr double STRAIGHT = 0.03;           // as little a base is turned away on the goal's axis [rad]
  static constexpr int ENOUGH_LOOKS = 5;             // images from where the base stands, before it is corrected
  static constexpr double TOLERANCE_ACROSS = 2.0;    // times the tolerance along the way
  static constexpr double SHARE_OF_TOLERANCE = 0.7;  // to which a course leads, so that estimates may change a little
  static constexpr double PASSED =
      0.1;  // intermediate legs lead so far beyond their places, which are passed at speed [m]

  enum class Part
  {
    TURN,  // before a leg
    LEG,
    LAST_TURN  // at the goal
  };

  const Leg& leg() const
  {
    return manoeuvre_.legs[leg_];
  }
  bool isLast() const
  {
    return leg_ + 1 == manoeuvre_.legs.size();
  }
  bool docked() const
  {
    return part_ == Part::LAST_TURN;
  }

  /** Length of the leg that is left [m]; negative beyond its end. */
  double left() const
  {
    const double along = compose(inverse(leg().end), base_).x;
    return leg().backwards ? along : -along;
  }

  /**
   * Whether the goal is clearly elsewhere than it was when the manoeuvre was planned. Where what is seen changes to and
   * fro, only driving tells more: then the manoeuvre is kept for a while.
   */
  bool isAnother(const PlanarPose& goal_in_odom) const
  {
    constexpr int MOST_PLANS = 3;  // in a row, without driving in between
    if (plans_ >= MOST_PLANS)
    {
      return false;
    }
    constexpr double NEAR = 0.05;         // [m]
    constexpr double SHARE = 0.15;        // of the distance
    constexpr double TURNED = 0.1;        // [rad]
    constexpr double SLOPE = 0.3;         // across by along: as much as the last leg makes up for
    constexpr double MADE_UP_FOR = 0.02;  // [m]
    const PlanarPose change = compose(inverse(planned_goal_), goal_in_odom);
    const bool moved = change.distance() > NEAR + SHARE * base_.distance() || std::abs(change.yaw) > TURNED;
    if (part_ == Part::LEG && isLast())
    {
      return moved && std::abs(base_.y) > MADE_UP_FOR + SLOPE * std::abs(base_.x);
    }
    return moved && !docked();
  }

  /** Without a manoeuvre: at once, and then now and then, as a search that finds no way takes long. */
  bool isTimeToTry()
  {
    constexpr int EVERY = 5;  // image or matches
    return tries_++ % EVERY == 0;
  }

  void plan(const Situation& situation, const ManoeuvreParams& params)
  {
    const Manoeuvre found = planManoeuvre(base_, situation.share, params);
    if (!found.legs.empty())
    {
      begin(found);
    }
  }

  void begin(const Manoeuvre& manoeuvre)
  {
    manoeuvre_ = manoeuvre;
    planned_goal_ = goal_in_odom_;
    planned_from_ = base_in_odom_;
    ++plans_;
    leg_ = 0;
    beginTurn();
  }

  /** The leg's direction is that from where the base is. */
  void beginTurn()
  {
    constexpr double SHORT = 0.05;  // no direction to follow [m]
    part_ = Part::TURN;
    Leg& leg = manoeuvre_.legs[leg_];
    const Eigen::Vector2d way(leg.end.x - base_.x, leg.end.y - base_.y);
    if (!isLast() && way.norm() > SHORT)
    {
      leg.end.yaw = leg.backwards ? std::atan2(-way.y(), -way.x()) : std::atan2(way.y(), way.x());
    }
  }

  /** Begins the next part when one has ended. */
  void advance()
  {
    constexpr double TURNED_ENOUGH = 0.03;  // before a leg, which makes up for the rest [rad]
    if (manoeuvre_.legs.empty())
    {
      return;
    }
    if (part_ == Part::TURN && std::abs(wrapAngle(leg().end.yaw - base_.yaw)) <= TURNED_ENOUGH)
    {
      part_ = Part::LEG;
    }
    if (part_ == Part::LEG && !isLast() && left() <= 0.0)
    {
      ++leg_;
      beginTurn();
    }
    const bool reached = std::abs(base_.x) <= SHARE_OF_TOLERANCE * params_.distance_tolerance;
    if (part_ == Part::LEG && isLast() && reached)
    {
      part_ = Part::LAST_TURN;
    }
    // A later image may say that some way is left.
    if (part_ == Part::LAST_TURN && std::abs(base_.yaw) <= params_.yaw_tolerance &&
        std::abs(base_.x) > params_.distance_tolerance)
    {
      part_ = Part::LEG;
    }
  }

  /**
   * Goes back a little and comes again, by odometry alone: what is seen at the goal is exact, what is seen from a
   * little farther away may be wrong in the same way each time. Where that does not help, less has to do.
   * @param error distance from the goal to where the base stands [m].
   */
  void correct(const Situation& situation, double error)
  {
    constexpr int WITHOUT_GAIN = 3;
    constexpr double GAIN = 0.8;       // of the error, to be one
    constexpr double GROWTH = 1.5;     // of the tolerance
    constexpr double SLOPE = 10.0;     // length of the last leg by what it has to make up for
    constexpr double SHORTEST = 0.12;  // last leg [m]
    corrections_ = error < GAIN * least_error_ ? 0 : corrections_ + 1;
    least_error_ = std::min(least_error_, error);
    if (corrections_ < WITHOUT_GAIN)
    {
      ManoeuvreParams little = params_.manoeuvre;
      little.straight_end = std::clamp(SLOPE * error, SHORTEST, params_.manoeuvre.straight_end);
      plan(situation, little);
      held_goal_ = situation.goal_in_odom;
    }
    else if (tolerance_ < most_tolerance_)
    {
      tolerance_ = std::min(GROWTH * tolerance_, most_tolerance_);
      corrections_ = 0;
    }
    else
    {
      failure_ = "corrections do not bring the base nearer than " + std::to_string(least_error_) + " m";
    }
  }

  const ApproachParams params_;
  const double most_tolerance_;
  double tolerance_;
  Manoeuvre manoeuvre_;
  PlanarPose planned_goal_;              // when the manoeuvre was planned, in odometry's frame
  PlanarPose planned_from_;              // where the base was then, in odometry's frame
  int plans_ = 0;                        // in a row, without driving in between
  int tries_ = 0;                        // images or matches while there was no manoeuvre
  std::optional<PlanarPose> held_goal_;  // in odometry's frame, while the base corrects where it stood
  PlanarPose goal_in_odom_;              // by which the base drives
  PlanarPose axis_in_odom_;              // the goal when the base was last not turned away from it
  PlanarPose base_in_odom_;
  PlanarPose base_;  // in the goal's frame
  std::size_t leg_ = 0;
  Part part_ = Part::TURN;
  int looks_ = 0;        // images from where the base stands at the end
  int corrections_ = 0;  // in a row that gained nothing
  double least_error_ = std::numeric_limits<double>::infinity();
  std::string failure_;
};

}  // namespace

std::vector<Parameter> parameters(ApproachParams& params)
{
  return joined({
      {
          choice<BaseKind>("base", params.base,
                           { { "holonomic", BaseKind::HOLONOMIC }, { "differential", BaseKind::DIFFERENTIAL } },
                           "how the base can move: in any direction, or ahead and back only, turning on the spot"),
          real("gain", params.gain, "1/s", "> 0", "speed per distance"),
          real("turn_gain", params.turn_gain, "1/s", "> 0", "turn rate per yaw error"),
          real("min_speed", params.min_speed, "m/s", "> 0",
               "differential base: it drives no slower, so that it moves at all"),
          real("min_turn_rate", params.min_turn_rate, "rad/s", "> 0",
               "differential base: it turns on the spot no slower, so that it moves at all"),
          real("distance_tolerance", params.distance_tolerance, "m", "> 0",
               "distance from the view at which it has arrived; a differential base: along its way, and twice as much "
               "across"),
          real("yaw_tolerance", params.yaw_tolerance, "rad", "> 0", "yaw error at which it has arrived"),
      },
      parameters(params.manoeuvre),
  });
}

std::unique_ptr<ApproachLaw> makeApproachLaw(const ApproachParams& params, double most_tolerance)
{
  if (params.base == BaseKind::DIFFERENTIAL)
  {
    return std::make_unique<DifferentialLaw>(params, most_tolerance);
  }
  return std::make_unique<HolonomicLaw>(params);
}

}  // namespace view_servo
