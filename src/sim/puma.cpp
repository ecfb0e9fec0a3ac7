// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/puma.h"

#include "view_servo/parameters/faults.h"

#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>
#include <Eigen/SVD>
#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainiksolverpos_lma.hpp>
#include <kdl/chainjnttojacsolver.hpp>
#include <kdl/tree.hpp>
#include <kdl_parser/kdl_parser.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <sstream>
#include <stdexcept>

namespace view_servo::sim
{
namespace
{
using Joints = Puma::Joints;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double MAX_STEP = 0.002;      // of the integration [s]
constexpr double LONGEST = 60.0;        // that one call moves on [s]
constexpr double FASTEST = 1e3;         // twist that is told from faster ones [m/s, rad/s]; the joints limit it anyway
constexpr double NO_MOTION = 1e-9;      // joint velocity, as part of the fastest joint's, that is rounding
constexpr double POSE_ACCURACY = 1e-6;  // of inverse kinematics [m, rad]

/** Uniform on the sphere. */
Eigen::Vector3d randomDirection(Rng& rng)
{
  const double x = gaussian(rng);
  const double y = gaussian(rng);
  return Eigen::Vector3d(x, y, gaussian(rng)).normalized();
}

/** Gathers what urdfdom has to say about a faulty URDF, which it otherwise only prints. */
class ParserErrors : public console_bridge::OutputHandler
{
public:
  ParserErrors()
  {
    console_bridge::useOutputHandler(this);
  }
  ~ParserErrors() override
  {
    console_bridge::restorePreviousOutputHandler();
  }
  ParserErrors(const ParserErrors&) = delete;
  ParserErrors& operator=(const ParserErrors&) = delete;

  void log(const std::string& text, console_bridge::LogLevel level, const char* /*file*/, int /*line*/) override
  {
    if (level == console_bridge::CONSOLE_BRIDGE_LOG_ERROR)
    {
      errors.push_back(text);
    }
  }

  std::vector<std::string> errors;
};

urdf::ModelInterfaceSharedPtr parsed(const std::string& urdf_xml)
{
  urdf::ModelInterfaceSharedPtr model;
  std::vector<std::string> faults;
  {
    ParserErrors parser;
    model = urdf::parseURDF(urdf_xml);
    faults = parser.errors;
  }
  if (!model && faults.empty())
  {
    faults.emplace_back("not a robot's description");
  }
  requireNoFaults("URDF", faults);
  return model;
}

/** The joints that move the camera, base first. @throws std::invalid_argument when they are not six revolute ones. */
std::vector<urdf::JointConstSharedPtr> movingJoints(const urdf::ModelInterface& model, const PumaParams& params)
{
  std::vector<std::string> faults;
  for (const std::string& link : { params.base_link, params.camera_frame })
  {
    if (!model.getLink(link))
    {
      faults.push_back("there is no link " + link);
    }
  }
  requireNoFaults("URDF", faults);

  std::vector<urdf::JointConstSharedPtr> joints;
  urdf::LinkConstSharedPtr link = model.getLink(params.camera_frame);
  for (; link->name != params.base_link; link = link->getParent())
  {
    if (!link->parent_joint)
    {
      requireNoFaults("URDF", { params.base_link + " does not carry " + params.camera_frame });
    }
    if (link->parent_joint->type != urdf::Joint::FIXED)
    {
      joints.insert(joints.begin(), link->parent_joint);
    }
  }

  if (joints.size() != Puma::JOINTS)
  {
    faults.push_back("from " + params.base_link + " to " + params.camera_frame + " there are " +
                     std::to_string(joints.size()) + " moving joints, not " + std::to_string(Puma::JOINTS));
  }
  for (const urdf::JointConstSharedPtr& joint : joints)
  {
    if (joint->type != urdf::Joint::REVOLUTE)
    {
      faults.push_back(joint->name + " is not revolute");
    }
    else if (!(joint->limits->lower < joint->limits->upper && std::isfinite(joint->limits->lower) &&
               std::isfinite(joint->limits->upper)))
    {
      faults.push_back(joint->name + " needs limits, the lower one below the upper one");
    }
    else if (!(joint->limits->velocity > 0.0 && std::isfinite(joint->limits->velocity)))
    {
      faults.push_back(joint->name + " needs a velocity limit above 0");
    }
  }
  requireNoFaults("URDF", faults);
  return joints;
}

KDL::JntArray toKdl(const Joints& joints)
{
  KDL::JntArray array(Puma::JOINTS);
  array.data = joints;
  return array;
}

KDL::Frame toKdl(const Eigen::Isometry3d& pose)
{
  const Eigen::Matrix4d& m = pose.matrix();
  return KDL::Frame(KDL::Rotation(m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)),
                    KDL::Vector(m(0, 3), m(1, 3), m(2, 3)));
}

Eigen::Isometry3d toEigen(const KDL::Frame& frame)
{
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 3; ++i)
  {
    for (int j = 0; j < 4; ++j)
    {
      pose(i, j) = frame(i, j);
    }
  }
  return pose;
}

/** Also false when `b`'s rotation is none. */
bool samePose(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  // Matrices of rotations that differ by a small angle are √2 times the angle apart.
  return (a.translation() - b.translation()).norm() <= POSE_ACCURACY &&
         (a.linear() - b.linear()).norm() <= std::sqrt(2.0) * POSE_ACCURACY;
}

}  // namespace

std::vector<std::string> PumaParams::validate() const
{
  std::vector<std::string> faults;
  const auto require = [&](bool right, const char* fault) {
    if (!right)
    {
      faults.emplace_back(fault);
    }
  };
  const auto not_negative = [](double value) {
    return value >= 0.0 && std::isfinite(value);
  };
  const auto positive = [](double value) {
    return value > 0.0 && std::isfinite(value);
  };
  require(!base_link.empty(), "base_link must not be empty");
  require(!camera_frame.empty(), "camera_frame must not be empty");
  require(positive(max_joint_acceleration), "max_joint_acceleration must be positive");
  require(not_negative(damping), "damping must not be negative");
  require(positive(min_manipulability), "min_manipulability must be positive");
  require(not_negative(encoder_noise), "encoder_noise must not be negative");
  require(not_negative(hand_eye_translation_error), "hand_eye_translation_error must not be negative");
  require(hand_eye_rotation_error >= 0.0 && hand_eye_rotation_error <= M_PI,
          "hand_eye_rotation_error must lie in [0, pi]");
  return faults;
}

/** Of the camera where the URDF has it. */
struct Puma::Kinematics
{
  Kinematics(const std::string& urdf_xml, const PumaParams& params)
  {
    const urdf::ModelInterfaceSharedPtr model = parsed(urdf_xml);
    int i = 0;
    for (const urdf::JointConstSharedPtr& joint : movingJoints(*model, params))
    {
      names.push_back(joint->name);
      lower(i) = joint->limits->lower;
      upper(i) = joint->limits->upper;
      max_velocity(i) = joint->limits->velocity;
      ++i;
    }
    KDL::Tree tree;
    if (!kdl_parser::treeFromUrdfModel(*model, tree) || !tree.getChain(params.base_link, params.camera_frame, chain) ||
        chain.getNrOfJoints() != JOINTS)
    {
      requireNoFaults("URDF", { "KDL makes no chain of it" });
    }
  }

  /** base_link from the optical frame. */
  Eigen::Isometry3d pose(const Joints& joints) const
  {
    KDL::Frame frame;
    KDL::ChainFkSolverPos_recursive(chain).JntToCart(toKdl(joints), frame);
    return toEigen(frame);
  }

  /** Joint velocities -> twist in the optical frame. */
  Matrix6 jacobian(const Joints& joints) const
  {
    KDL::Jacobian in_base(JOINTS);
    KDL::ChainJntToJacSolver(chain).JntToJac(toKdl(joints), in_base);
    const Eigen::Matrix3d camera_from_base = pose(joints).linear().transpose();
    Matrix6 in_camera;
    in_camera << camera_from_base * in_base.data.topRows<3>(), camera_from_base * in_base.data.bottomRows<3>();
    return in_camera;
  }

  /** Of the solutions found, the one nearest to `near`. */
  std::optional<Joints> inverse(const Eigen::Isometry3d& goal, const Joints& near, const PumaParams& params) const
  {
    constexpr int STARTS = 60;
    constexpr int ITERATIONS = 100;
    constexpr double ACCURACY = 1e-10;
    KDL::ChainIkSolverPos_LMA solver(chain, Eigen::Matrix<double, 6, 1>::Ones(), ACCURACY, ITERATIONS);
    Rng rng(1);
    std::optional<Joints> nearest;
    Joints start = near;
    for (int i = 0; i < STARTS; ++i)
    {
      KDL::JntArray found(JOINTS);
      solver.CartToJnt(toKdl(start), toKdl(goal), found);
      const Joints joints = nearestTurns(improved(found.data, goal, params), near);
      if (samePose(pose(joints), goal) && (!nearest || (joints - near).norm() < (*nearest - near).norm()))
      {
        nearest = joints;
      }
      for (int j = 0; j < JOINTS; ++j)
      {
        start(j) = uniform(rng, lower(j), upper(j));
      }
    }
    return nearest;
  }

  /** By some Newton steps: KDL takes rotations of less than 1e-6 for none. */
  Joints improved(Joints joints, const Eigen::Isometry3d& goal, const PumaParams& params) const
  {
    constexpr int STEPS = 3;
    for (int i = 0; i < STEPS; ++i)
    {
      const Eigen::Isometry3d left = pose(joints).inverse() * goal;
      const Eigen::AngleAxisd turn(left.linear());
      Twist twist;  // for 1 s
      twist << left.translation(), turn.angle() * turn.axis();
      double unused = 0.0;
      joints += following(joints, twist, params, unused);
    }
    return joints;
  }

  /** The same angles, give or take full turns, next to `near` but within the limits; at a limit if there are none. */
  Joints nearestTurns(const Joints& joints, const Joints& near) const
  {
    Joints turned;
    for (int i = 0; i < JOINTS; ++i)
    {
      const double next = near(i) + std::remainder(joints(i) - near(i), 2.0 * M_PI);
      const double other = next > upper(i) ? next - 2.0 * M_PI : next + 2.0 * M_PI;
      const bool turns = (next < lower(i) || next > upper(i)) && other >= lower(i) && other <= upper(i);
      turned(i) = turns ? other : std::clamp(next, lower(i), upper(i));
    }
    return turned;
  }

  /**
   * Joint velocities for a twist in the optical frame by damped least squares: undamped while the smallest singular
   * value of the Jacobian, which is returned as well, is at least `min_manipulability`; smoothly more below.
   */
  Joints following(const Joints& joints, const Twist& twist, const PumaParams& params, double& smallest) const
  {
    constexpr double SINGULAR = 1e-12;  // singular value that has no inverse without damping
    const Eigen::JacobiSVD<Matrix6> svd(jacobian(joints), Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Joints& values = svd.singularValues();
    smallest = values(JOINTS - 1);
    const double ratio = std::min(smallest / params.min_manipulability, 1.0);
    const double damping = params.damping * (1.0 - ratio * ratio);
    Joints along = svd.matrixU().transpose() * twist;
    for (int i = 0; i < JOINTS; ++i)
    {
      const double size = std::hypot(values(i), damping);
      along(i) *= size > SINGULAR ? values(i) / size / size : 0.0;
    }
    const Joints velocity = svd.matrixV() * along;
    return (velocity.array().abs() > NO_MOTION * velocity.cwiseAbs().maxCoeff()).select(velocity, 0.0);
  }

  /** How much of a velocity, in [0, 1], is possible, and the joint that keeps it from being more. */
  struct Possible
  {
    double part = 1.0;
    int joint = 0;
  };

  Possible withinVelocityLimits(const Joints& velocity) const
  {
    Possible possible;
    possible.part = 1.0 / std::max(velocity.cwiseAbs().cwiseQuotient(max_velocity).maxCoeff(&possible.joint), 1.0);
    return possible;
  }

  /**
   * The velocity with which the arm can go on for `dt` from `joints` and then still stop before any joint's end, on its
   * path: all joints slow down in proportion, the fastest one with `acceleration`.
   */
  Possible beforeEnds(const Joints& joints, const Joints& velocity, double dt, double acceleration) const
  {
    const double stopping = velocity.cwiseAbs().maxCoeff() / (2.0 * acceleration);  // way over velocity [s]
    Possible possible;
    for (int i = 0; i < JOINTS; ++i)
    {
      const double left = velocity(i) > 0.0 ? upper(i) - joints(i) : joints(i) - lower(i);
      const double linear = std::abs(velocity(i)) * dt;
      const double square = std::abs(velocity(i)) * stopping;
      if (linear + square > left)
      {
        // part * linear + part² * square = left
        const double part = 2.0 * left / (linear + std::sqrt(linear * linear + 4.0 * square * left));
        if (part < possible.part)
        {
          possible = { part, i };
        }
      }
    }
    return possible;
  }

  /**
   * What the acceleration allows within `dt` from `velocity`: `wanted`, or as large a part of it as possible, which
   * keeps the camera on its path. When there is none, towards the part that is nearest, with as little braking as keeps
   * the joints before their ends. Braking alone always does, when `velocity` was chosen so before.
   * @param wanted before the joints' ends itself.
   */
  Joints accelerated(const Joints& joints, const Joints& velocity, const Joints& wanted, double dt,
                     double acceleration) const
  {
    const double most = acceleration * dt;
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < JOINTS; ++i)
    {
      const double speed = std::abs(wanted(i));
      const double along = wanted(i) < 0.0 ? -velocity(i) : velocity(i);
      if (speed > 0.0)
      {
        low = std::max(low, (along - most) / speed);
        high = std::min(high, (along + most) / speed);
      }
      else if (std::abs(along) > most)
      {
        high = -1.0;
      }
    }
    if (low <= high)
    {
      return high * wanted;
    }

    const auto limited = [&](const Joints& change) -> Joints {
      return most / std::max(change.cwiseAbs().maxCoeff(), most) * change;
    };
    const double square = wanted.squaredNorm();
    const double nearest = square > 0.0 ? std::clamp(velocity.dot(wanted) / square, 0.0, 1.0) : 0.0;
    Joints next = velocity + limited(nearest * wanted - velocity);
    if (beforeEnds(joints, next, dt, acceleration).part == 1.0)
    {
      return next;
    }
    const Joints braked = velocity - limited(velocity);
    constexpr int HALVINGS = 40;
    low = 0.0;
    high = 1.0;
    for (int i = 0; i < HALVINGS; ++i)
    {
      const double middle = 0.5 * (low + high);
      const Joints between = braked + middle * (next - braked);
      (beforeEnds(joints, between, dt, acceleration).part == 1.0 ? low : high) = middle;
    }
    return braked + low * (next - braked);
  }

  KDL::Chain chain;
  std::vector<std::string> names;
  Joints lower;         ///< [rad]
  Joints upper;         ///< [rad]
  Joints max_velocity;  ///< [rad/s]
};

Puma::Puma(const std::string& urdf_xml, const PumaParams& params)
  : params_(params), rng_(params.seed), nominal_from_true_camera_(Eigen::Isometry3d::Identity())
{
  requireNoFaults("parameters of the arm", params.validate());
  kinematics_ = std::make_unique<Kinematics>(urdf_xml, params);
  nominal_from_true_camera_.translation() = params.hand_eye_translation_error * randomDirection(rng_);
  nominal_from_true_camera_.linear() =
      Eigen::AngleAxisd(params.hand_eye_rotation_error, randomDirection(rng_)).toRotationMatrix();
  rest(Joints::Zero().cwiseMax(kinematics_->lower).cwiseMin(kinematics_->upper));
}

Puma::~Puma() = default;

const std::vector<std::string>& Puma::jointNames() const
{
  return kinematics_->names;
}

void Puma::setJoints(const Joints& joints)
{
  std::vector<std::string> faults;
  for (int i = 0; i < JOINTS; ++i)
  {
    if (!(joints(i) >= kinematics_->lower(i) && joints(i) <= kinematics_->upper(i)))
    {
      std::ostringstream fault;
      fault << kinematics_->names[static_cast<std::size_t>(i)] << " = " << joints(i) << " does not lie in ["
            << kinematics_->lower(i) << ", " << kinematics_->upper(i) << "]";
      faults.push_back(fault.str());
    }
  }
  requireNoFaults("joint angles", faults);
  rest(joints);
}

bool Puma::setCameraPose(const Eigen::Isometry3d& camera)
{
  if (!camera.matrix().allFinite())
  {
    return false;
  }
  const auto found = kinematics_->inverse(camera * nominal_from_true_camera_.inverse(), joints_, params_);
  if (found)
  {
    rest(*found);
  }
  return found.has_value();
}

void Puma::rest(const Joints& joints)
{
  joints_ = joints;
  velocities_.setZero();
  twist_.setZero();
  state_ = State::STILL;
  message_.clear();
}

void Puma::halt()
{
  rest(joints_);
}

bool Puma::command(const Twist& twist)
{
  if (!twist.allFinite())
  {
    return false;
  }
  const double speed = twist.cwiseAbs().maxCoeff();
  twist_ = speed > FASTEST ? Twist(FASTEST * (twist / speed)) : twist;
  return true;
}

void Puma::step(double dt)
{
  if (!(dt > 0.0 && dt <= LONGEST))
  {
    throw std::invalid_argument("Puma::step: the time must lie in (0, 60] s");
  }
  const int parts = static_cast<int>(std::ceil(dt / MAX_STEP));
  for (int i = 0; i < parts; ++i)
  {
    advance(dt / parts);
  }
}

void Puma::advance(double dt)
{
  const double acceleration = params_.max_joint_acceleration;
  const Joints middle = joints_ + 0.5 * dt * velocities_;
  double smallest = 0.0;  // singular value
  const Joints following = kinematics_->following(middle, twist_, params_, smallest);
  const auto speed = kinematics_->withinVelocityLimits(following);

  // Half of the acceleration is for the camera's path, along which the joints' velocities change with the square of
  // the speed; so the other half is left for speeding up and braking.
  constexpr double AHEAD = 1e-3;  // [s]
  double unused = 0.0;
  const Joints soon = kinematics_->following(middle + AHEAD * speed.part * following, twist_, params_, unused);
  const double turning = speed.part * (soon - following).cwiseAbs().maxCoeff() / AHEAD;  // [rad/s²]
  const double steady = 1.0 / std::sqrt(std::max(turning / (0.5 * acceleration), 1.0));

  const Joints allowed = steady * speed.part * following;
  const auto end = kinematics_->beforeEnds(joints_, allowed, dt, 0.5 * acceleration);
  velocities_ = kinematics_->accelerated(joints_, velocities_, end.part * allowed, dt, acceleration);
  joints_ = (joints_ + dt * velocities_).cwiseMax(kinematics_->lower).cwiseMin(kinematics_->upper);

  const auto name = [&](int joint) {
    return kinematics_->names[static_cast<std::size_t>(joint)];
  };
  std::ostringstream message;
  if (twist_.isZero(0.0))
  {
    state_ = velocities_.isZero(0.0) ? State::STILL : State::MOVING;
  }
  else if (end.part < 1.0)
  {
    state_ = State::AT_LIMIT;
    const bool up = allowed(end.joint) > 0.0;
    message << name(end.joint) << " comes to its " << (up ? "upper" : "lower") << " limit of "
            << (up ? kinematics_->upper : kinematics_->lower)(end.joint) << " rad";
  }
  else if (smallest < params_.min_manipulability)
  {
    state_ = State::NEAR_SINGULARITY;
    message << "slowed down near a singularity: smallest singular value " << smallest << ", below "
            << params_.min_manipulability;
  }
  else
  {
    state_ = State::MOVING;
    if (steady * speed.part < 1.0)
    {
      message << "slowed down to " << steady * speed.part << " of the twist by ";
      message << (steady < speed.part ? "the limit of accelerations" : "the velocity limit of " + name(speed.joint));
    }
  }
  message_ = message.str();
}

const Joints& Puma::joints() const
{
  return joints_;
}

const Joints& Puma::velocities() const
{
  return velocities_;
}

Joints Puma::measuredJoints()
{
  Joints measured = joints_;
  for (int i = 0; i < JOINTS; ++i)
  {
    measured(i) += params_.encoder_noise * gaussian(rng_);
  }
  return measured;
}

Eigen::Isometry3d Puma::cameraPose() const
{
  return nominalCameraPose(joints_) * nominal_from_true_camera_;
}

Eigen::Isometry3d Puma::nominalCameraPose(const Joints& joints) const
{
  return kinematics_->pose(joints);
}

Puma::State Puma::state() const
{
  return state_;
}

const std::string& Puma::message() const
{
  return message_;
}

}  // namespace view_servo::sim
