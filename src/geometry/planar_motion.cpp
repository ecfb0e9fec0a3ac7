// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/planar_motion.h"

#include "levenberg_marquardt.h"
#include "residuals.h"
#include "view_servo/geometry/essential.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/parameters/numbers.h"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>

namespace view_servo
{
namespace
{
/** Derivative of levelRotation() by the yaw. */
Eigen::Matrix3d levelRotationDerivative(double yaw)
{
  Eigen::Matrix3d d;
  d << -std::sin(yaw), 0.0, -std::cos(yaw), 0.0, 0.0, 0.0, std::cos(yaw), 0.0, -std::sin(yaw);
  return d;
}

PlanarPose unitPose(double heading, double yaw)
{
  return { std::cos(heading), std::sin(heading), yaw };
}

/** Coefficients of a polynomial of second degree, constant first. */
using Quadratic = std::array<double, 3>;

/** (constant + cosine cos a + sine sin a) (1 + t²) with t = tan(a / 2). */
Quadratic inHalfAngle(double constant, double cosine, double sine)
{
  return { constant + cosine, 2.0 * sine, constant - cosine };
}

void addProduct(const Quadratic& a, const Quadratic& b, double factor, std::array<double, 5>& product)
{
  for (std::size_t i = 0; i < a.size(); ++i)
  {
    for (std::size_t k = 0; k < b.size(); ++k)
    {
      product[i + k] += factor * a[i] * b[k];
    }
  }
}

/** Real roots of a polynomial of fourth degree or less, constant first. */
std::vector<double> realRoots(const std::array<double, 5>& coefficients)
{
  constexpr double NEGLIGIBLE = 1e-12;
  constexpr double REAL = 1e-6;
  double largest = 0.0;
  for (const double coefficient : coefficients)
  {
    largest = std::max(largest, std::abs(coefficient));
  }
  int degree = 4;
  while (degree > 0 && !(std::abs(coefficients[static_cast<std::size_t>(degree)]) > NEGLIGIBLE * largest))
  {
    --degree;
  }
  if (degree == 0)
  {
    return {};
  }
  Eigen::MatrixXd companion = Eigen::MatrixXd::Zero(degree, degree);
  for (int i = 0; i < degree; ++i)
  {
    companion(i, degree - 1) =
        -coefficients[static_cast<std::size_t>(i)] / coefficients[static_cast<std::size_t>(degree)];
    if (i > 0)
    {
      companion(i, i - 1) = 1.0;
    }
  }
  std::vector<double> roots;
  const Eigen::VectorXcd eigenvalues = companion.eigenvalues();
  for (Eigen::Index i = 0; i < eigenvalues.size(); ++i)
  {
    const std::complex<double>& root = eigenvalues[i];
    if (std::abs(root.imag()) < REAL * (1.0 + std::abs(root.real())))
    {
      roots.push_back(root.real());
    }
  }
  return roots;
}

/** A correspondence's part in t · (R x_ref × x_cur) = 0: t_x a + t_z b = 0, both by tan(yaw / 2). */
struct TranslationConstraint
{
  Quadratic a;
  Quadratic b;

  explicit TranslationConstraint(const Correspondence& pair)
    : a(inHalfAngle(pair.reference.y(), -pair.current.y(), -pair.current.y() * pair.reference.x())),
      b(inHalfAngle(-pair.reference.y() * pair.current.x(), pair.current.y() * pair.reference.x(), -pair.current.y()))
  {
  }
};

double valueAt(const Quadratic& polynomial, double t)
{
  return polynomial[0] + t * (polynomial[1] + t * polynomial[2]);
}

/** Tukey's cost of a squared residual: quadratic at first, constant beyond `limit`. */
double tukeyCost(double squared, double limit)
{
  const double rest = std::max(0.0, 1.0 - squared / (limit * limit));
  return limit * limit / 3.0 * (1.0 - rest * rest * rest);
}

double tukeyWeight(double squared, double limit)
{
  const double rest = std::max(0.0, 1.0 - squared / (limit * limit));
  return rest * rest;
}

struct PoseProblem
{
  using State = PlanarPose;
  static constexpr int DOF = 3;

  const std::vector<Sighting>& sightings;
  double limit;

  double cost(const PlanarPose& pose) const
  {
    double sum = 0.0;
    for (const Sighting& sighting : sightings)
    {
      const double squared = (project(sighting.landmark, pose) - sighting.current).squaredNorm();
      sum += squared < limit * limit ? tukeyCost(squared, limit) : limit * limit / 3.0;  // NaN: behind the camera
    }
    return sum;
  }

  void linearize(const PlanarPose& pose, Eigen::Matrix3d& jtj, Eigen::Vector3d& gradient) const
  {
    jtj.setZero();
    gradient.setZero();
    const Eigen::Matrix3d rotation = levelRotation(pose.yaw);
    const Eigen::Matrix3d derivative = levelRotationDerivative(pose.yaw);
    for (const Sighting& sighting : sightings)
    {
      const Eigen::Vector3d ray = sighting.landmark.reference.homogeneous();
      const double rho = sighting.landmark.inverse_depth;
      const Eigen::Vector3d point = rotation * ray + rho * levelTranslation(pose);
      if (!(point.z() > 0.0))
      {
        continue;
      }
      const Eigen::Vector2d residual = point.hnormalized() - sighting.current;
      if (!(residual.squaredNorm() < limit * limit))
      {
        continue;  // an outlier, or no number
      }
      Eigen::Matrix3d motion;
      motion.col(0) = Eigen::Vector3d(0.0, 0.0, rho);
      motion.col(1) = Eigen::Vector3d(-rho, 0.0, 0.0);
      motion.col(2) = derivative * ray;
      const Eigen::Matrix<double, 2, 3> jacobian = projectionDerivative(point) * motion;
      const double weight = tukeyWeight(residual.squaredNorm(), limit);
      jtj += weight * jacobian.transpose() * jacobian;
      gradient += weight * jacobian.transpose() * residual;
    }
  }

  static PlanarPose moved(const PlanarPose& pose, const Eigen::Vector3d& step)
  {
    return { pose.x + step.x(), pose.y + step.y(), pose.yaw + step.z() };
  }
};

struct MotionProblem
{
  /** Heading and yaw. */
  using State = Eigen::Vector2d;
  static constexpr int DOF = 2;

  const Correspondences& pairs;

  double cost(const Eigen::Vector2d& state) const
  {
    const Eigen::Matrix3d e = essentialMatrix(unitPose(state.x(), state.y()));
    double sum = 0.0;
    for (const Correspondence& pair : pairs)
    {
      const double error = sampsonError(e, pair);
      sum += std::isfinite(error) ? error : 0.0;  // no constraint where a point is the epipole in both
    }
    return sum;
  }

  void linearize(const Eigen::Vector2d& state, Eigen::Matrix2d& jtj, Eigen::Vector2d& gradient) const
  {
    jtj.setZero();
    gradient.setZero();
    const PlanarPose pose = unitPose(state.x(), state.y());
    const Eigen::Matrix3d rotation = levelRotation(pose.yaw);
    const Eigen::Matrix3d cross = crossMatrix(levelTranslation(pose));
    const Eigen::Matrix3d by_heading = crossMatrix({ -pose.x, 0.0, -pose.y }) * rotation;
    const Eigen::Matrix3d by_yaw = cross * levelRotationDerivative(pose.yaw);
    Eigen::Matrix<double, 9, 2> entries;
    entries << rowMajor(by_heading), rowMajor(by_yaw);
    const Eigen::Matrix3d e = cross * rotation;
    for (const Correspondence& pair : pairs)
    {
      Eigen::Matrix<double, 1, 9> by_entries;
      const double residual = sampsonResidual(e, pair, by_entries);
      const Eigen::RowVector2d jacobian = by_entries * entries;
      if (std::isfinite(residual) && jacobian.allFinite())
      {
        jtj += jacobian.transpose() * jacobian;
        gradient += jacobian.transpose() * residual;
      }
    }
  }

  static Eigen::Vector2d moved(const Eigen::Vector2d& state, const Eigen::Vector2d& step)
  {
    return state + step;
  }
};

}  // namespace

Eigen::Matrix3d levelRotation(double yaw)
{
  Eigen::Matrix3d rotation;
  rotation << std::cos(yaw), 0.0, -std::sin(yaw), 0.0, 1.0, 0.0, std::sin(yaw), 0.0, std::cos(yaw);
  return rotation;
}

Eigen::Vector3d levelTranslation(const PlanarPose& reference_in_current)
{
  return { -reference_in_current.y, 0.0, reference_in_current.x };
}

Eigen::Matrix3d essentialMatrix(const PlanarPose& reference_in_current)
{
  const double distance = reference_in_current.distance();
  return distance > 0.0 ? Eigen::Matrix3d(crossMatrix(levelTranslation(reference_in_current) / distance) *
                                          levelRotation(reference_in_current.yaw))
                        : Eigen::Matrix3d::Zero();
}

std::vector<PlanarPose> planarMotionFromTwoPoints(const Correspondence& first, const Correspondence& second)
{
  const TranslationConstraint one(first);
  const TranslationConstraint two(second);
  std::array<double, 5> determinant{};
  addProduct(one.a, two.b, 1.0, determinant);
  addProduct(two.a, one.b, -1.0, determinant);

  std::vector<PlanarPose> poses;
  for (const double t : realRoots(determinant))
  {
    // Of the two the better conditioned one; t_x = -y, t_z = x, hence x b = y a.
    const Eigen::Vector2d along_first(valueAt(one.a, t), valueAt(one.b, t));
    const Eigen::Vector2d along_second(valueAt(two.a, t), valueAt(two.b, t));
    const Eigen::Vector2d& along = along_first.norm() > along_second.norm() ? along_first : along_second;
    if (!(along.norm() > 0.0))
    {
      continue;
    }
    for (const double sense : { 1.0, -1.0 })
    {
      const Eigen::Vector2d direction = sense * along.normalized();
      const PlanarPose pose{ direction.x(), direction.y(), 2.0 * std::atan(t) };
      if (inverseDepth(first, pose).value > 0.0 && inverseDepth(second, pose).value > 0.0)
      {
        poses.push_back(pose);
      }
    }
  }
  return poses;
}

InverseDepth inverseDepth(const Correspondence& pair, const PlanarPose& reference_in_current)
{
  return inverseDepth(pair, levelRotation(reference_in_current.yaw), levelTranslation(reference_in_current));
}

InverseDepth inverseDepth(const Correspondence& pair, const Eigen::Matrix3d& rotation,
                          const Eigen::Vector3d& translation)
{
  // x_cur ~ R x_ref + rho t: linear in rho.
  const Eigen::Vector3d ray = rotation * pair.reference.homogeneous();
  const Eigen::Vector3d& t = translation;
  const Eigen::Vector2d a = ray.head<2>() - pair.current * ray.z();
  const Eigen::Vector2d b = t.head<2>() - pair.current * t.z();
  const double squared = b.squaredNorm();
  if (!(squared > 0.0))
  {
    return {};
  }
  const double rho = -a.dot(b) / squared;
  const double depth_ratio = ray.z() + rho * t.z();  // of the point in the current camera to that in the reference
  // Behind the current camera, or at infinity in the reference: no depth that the point can have.
  return depth_ratio > 0.0 ? InverseDepth{ rho, squared / (depth_ratio * depth_ratio) }
                           : InverseDepth{ -std::abs(rho), 0.0 };
}

Eigen::Vector2d project(const Landmark& landmark, const PlanarPose& reference_in_current)
{
  const Eigen::Vector3d point = levelRotation(reference_in_current.yaw) * landmark.reference.homogeneous() +
                                landmark.inverse_depth * levelTranslation(reference_in_current);
  return point.z() > 0.0 ? Eigen::Vector2d(point.hnormalized()) : Eigen::Vector2d::Constant(NOT_A_NUMBER);
}

PlanarPose refinePlanarPose(const PlanarPose& initial, const std::vector<Sighting>& sightings, double width)
{
  constexpr int ITERATIONS = 20;
  constexpr double LIMIT = 3.0;  // times the width
  if (sightings.size() < 2)
  {
    return initial;
  }
  PlanarPose pose = initial;
  levenbergMarquardt(PoseProblem{ sightings, LIMIT * width }, pose, ITERATIONS);
  pose.yaw = wrapAngle(pose.yaw);
  return pose;
}

PlanarPose refinePlanarMotion(const PlanarPose& initial, const Correspondences& pairs, int max_iterations)
{
  Eigen::Vector2d state(initial.heading(), initial.yaw);
  levenbergMarquardt(MotionProblem{ pairs }, state, max_iterations);
  return unitPose(state.x(), wrapAngle(state.y()));
}

}  // namespace view_servo
