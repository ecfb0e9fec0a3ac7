// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/arm_kinematics.h"

#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/faults.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/random.h"

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
#include <mutex>
#include <utility>

namespace view_servo::sim
{
namespace
{
using Joints = ArmKinematics::Joints;
using Twist = ArmKinematics::Twist;

constexpr int JOINTS = ArmKinematics::JOINTS;
constexpr double NO_MOTION = 1e-9;      // joint velocity, as part of the fastest joint's, that is rounding
constexpr double POSE_ACCURACY = 1e-6;  // of inverse kinematics [m, rad]

/**
 * Gathers what urdfdom has to say about a faulty URDF, which it otherwise only prints. One at a time: whom
 * console_bridge tells is one for all threads.
 */
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
    static std::mutex one_at_a_time;
    const std::lock_guard<std::mutex> lock(one_at_a_time);
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
std::vector<urdf::JointConstSharedPtr> movingJoints(const urdf::ModelInterface& model,
                                                    const ArmKinematicsParams& params)
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

  if (joints.size() != JOINTS)
  {
    faults.push_back("from " + params.base_link + " to " + params.camera_frame + " there are " +
                     std::to_string(joints.size()) + " moving joints, not " + std::to_string(JOINTS));
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
  KDL::JntArray array(JOINTS);
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

std::vector<std::string> ArmKinematicsParams::validate() const
{
  ArmKinematicsParams copy = *this;
  Faults faults;
  faults.require(!base_link.empty(), "base_link must not be empty");
  faults.require(!camera_frame.empty(), "camera_frame must not be empty");
  faults.add(faultsOf({
      real("damping", copy.damping, "", ">= 0", "damping of the inverse at a singularity"),
      real("min_manipulability", copy.min_manipulability, "", "> 0",
           "smallest singular value of the Jacobian that needs no damping"),
  }));
  return faults.list();
}

struct ArmKinematics::Chain
{
  KDL::Chain kdl;
};

ArmKinematics::ArmKinematics(const std::string& urdf_xml, const ArmKinematicsParams& params) : params_(params)
{
  requireNoFaults("parameters of the arm", params.validate());
  const urdf::ModelInterfaceSharedPtr model = parsed(urdf_xml);
  int i = 0;
  for (const urdf::JointConstSharedPtr& joint : movingJoints(*model, params))
  {
    names_.push_back(joint->name);
    lower_(i) = joint->limits->lower;
    upper_(i) = joint->limits->upper;
    max_velocity_(i) = joint->limits->velocity;
    ++i;
  }
  Chain chain;
  KDL::Tree tree;
  if (!kdl_parser::treeFromUrdfModel(*model, tree) ||
      !tree.getChain(params.base_link, params.camera_frame, chain.kdl) || chain.kdl.getNrOfJoints() != JOINTS)
  {
    requireNoFaults("URDF", { "KDL makes no chain of it" });
  }
  chain_ = std::make_unique<const Chain>(std::move(chain));
}

ArmKinematics::~ArmKinematics() = default;

Eigen::Isometry3d ArmKinematics::pose(const Joints& joints) const
{
  KDL::Frame frame;
  KDL::ChainFkSolverPos_recursive(chain_->kdl).JntToCart(toKdl(joints), frame);
  return toEigen(frame);
}

ArmKinematics::Jacobian ArmKinematics::jacobian(const Joints& joints) const
{
  KDL::Jacobian in_base(JOINTS);
  KDL::ChainJntToJacSolver(chain_->kdl).JntToJac(toKdl(joints), in_base);
  const Eigen::Matrix3d camera_from_base = pose(joints).linear().transpose();
  Jacobian in_camera;
  in_camera << camera_from_base * in_base.data.topRows<3>(), camera_from_base * in_base.data.bottomRows<3>();
  return in_camera;
}

std::optional<Joints> ArmKinematics::inverse(const Eigen::Isometry3d& goal, const Joints& near) const
{
  constexpr int STARTS = 60;
  constexpr int ITERATIONS = 100;
  constexpr double ACCURACY = 1e-10;
  KDL::ChainIkSolverPos_LMA solver(chain_->kdl, Eigen::Matrix<double, 6, 1>::Ones(), ACCURACY, ITERATIONS);
  Rng rng(1);
  std::optional<Joints> nearest;
  Joints start = near;
  for (int i = 0; i < STARTS; ++i)
  {
    KDL::JntArray found(JOINTS);
    solver.CartToJnt(toKdl(start), toKdl(goal), found);
    const Joints joints = nearestTurns(improve(found.data, goal), near);
    if (samePose(pose(joints), goal) && (!nearest || (joints - near).norm() < (*nearest - near).norm()))
    {
      nearest = joints;
    }
    for (int j = 0; j < JOINTS; ++j)
    {
      start(j) = uniform(rng, lower_(j), upper_(j));
    }
  }
  return nearest;
}

/** Some Newton steps towards a pose: KDL takes rotations of less than 1e-6 for none. */
ArmKinematics::Joints ArmKinematics::improve(Joints joints, const Eigen::Isometry3d& goal) const
{
  constexpr int STEPS = 3;
  for (int i = 0; i < STEPS; ++i)
  {
    const Eigen::Isometry3d left = pose(joints).inverse() * goal;
    Twist twist;  // for 1 s
    twist << left.translation(), rotationVector(left.linear());
    joints += follow(joints, twist).velocities;
  }
  return joints;
}

/** The same angles but for full turns: next to `near` within the limits, or at a limit where none lies within them. */
ArmKinematics::Joints ArmKinematics::nearestTurns(const Joints& joints, const Joints& near) const
{
  Joints turned;
  for (int i = 0; i < JOINTS; ++i)
  {
    const double next = near(i) + std::remainder(joints(i) - near(i), 2.0 * M_PI);
    const double other = next > upper_(i) ? next - 2.0 * M_PI : next + 2.0 * M_PI;
    const bool turns = (next < lower_(i) || next > upper_(i)) && other >= lower_(i) && other <= upper_(i);
    turned(i) = turns ? other : std::clamp(next, lower_(i), upper_(i));
  }
  return turned;
}

ArmKinematics::Following ArmKinematics::follow(const Joints& joints, const Twist& twist) const
{
  constexpr double SINGULAR = 1e-12;  // singular value that has no inverse without damping
  const Eigen::JacobiSVD<Jacobian> svd(jacobian(joints), Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Joints& values = svd.singularValues();
  const double smallest = values(JOINTS - 1);
  const double ratio = std::min(smallest / params_.min_manipulability, 1.0);
  const double damping = params_.damping * (1.0 - ratio * ratio);
  Joints along = svd.matrixU().transpose() * twist;
  for (int i = 0; i < JOINTS; ++i)
  {
    const double size = std::hypot(values(i), damping);
    along(i) *= size > SINGULAR ? values(i) / size / size : 0.0;
  }
  const Joints velocities = svd.matrixV() * along;
  return { (velocities.array().abs() > NO_MOTION * velocities.cwiseAbs().maxCoeff()).select(velocities, 0.0),
           smallest };
}

ArmKinematics::Slowdown ArmKinematics::withinVelocityLimits(const Joints& velocities) const
{
  Slowdown slowdown;
  slowdown.factor = 1.0 / std::max(velocities.cwiseAbs().cwiseQuotient(max_velocity_).maxCoeff(&slowdown.joint), 1.0);
  return slowdown;
}

ArmKinematics::Slowdown ArmKinematics::beforeEnds(const Joints& joints, const Joints& velocities, double dt,
                                                  double acceleration) const
{
  const double stopping = velocities.cwiseAbs().maxCoeff() / (2.0 * acceleration);  // way to stop over velocity [s]
  Slowdown slowdown;
  for (int i = 0; i < JOINTS; ++i)
  {
    const double left = velocities(i) > 0.0 ? upper_(i) - joints(i) : joints(i) - lower_(i);
    const double linear = std::abs(velocities(i)) * dt;
    const double square = std::abs(velocities(i)) * stopping;
    if (linear + square > left)
    {
      // factor * linear + factor² * square = left
      const double factor = 2.0 * left / (linear + std::sqrt(linear * linear + 4.0 * square * left));
      if (factor < slowdown.factor)
      {
        slowdown = { factor, i };
      }
    }
  }
  return slowdown;
}

ArmKinematics::Joints ArmKinematics::accelerate(const Joints& joints, const Joints& velocities, const Joints& wanted,
                                                double dt, double acceleration) const
{
  const double most = acceleration * dt;
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < JOINTS; ++i)
  {
    const double speed = std::abs(wanted(i));
    const double along = wanted(i) < 0.0 ? -velocities(i) : velocities(i);
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
  const double nearest = square > 0.0 ? std::clamp(velocities.dot(wanted) / square, 0.0, 1.0) : 0.0;
  Joints next = velocities + limited(nearest * wanted - velocities);
  if (beforeEnds(joints, next, dt, acceleration).factor == 1.0)
  {
    return next;
  }
  const Joints braked = velocities - limited(velocities);
  constexpr int HALVINGS = 40;
  low = 0.0;
  high = 1.0;
  for (int i = 0; i < HALVINGS; ++i)
  {
    const double middle = 0.5 * (low + high);
    const Joints between = braked + middle * (next - braked);
    (beforeEnds(joints, between, dt, acceleration).factor == 1.0 ? low : high) = middle;
  }
  return braked + low * (next - braked);
}

}  // namespace view_servo::sim
