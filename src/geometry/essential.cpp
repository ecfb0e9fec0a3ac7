// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/essential.h"

#include "levenberg_marquardt.h"
#include "residuals.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/rotation_vector.h"

#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include <cmath>

namespace view_servo
{
namespace
{
struct RelativePoseProblem
{
  using State = RelativePose;
  static constexpr int DOF = 5;

  const Correspondences& pairs;

  double cost(const RelativePose& pose) const
  {
    const Eigen::Matrix3d e = pose.essential();
    double sum = 0.0;
    for (const Correspondence& pair : pairs)
    {
      const double error = sampsonError(e, pair);
      sum += std::isfinite(error) ? error : 0.0;  // no constraint where a point is the epipole in both
    }
    return sum;
  }

  void linearize(const RelativePose& pose, Eigen::Matrix<double, 5, 5>& jtj,
                 Eigen::Matrix<double, 5, 1>& gradient) const
  {
    jtj.setZero();
    gradient.setZero();
    const Eigen::Matrix3d e = pose.essential();
    const Eigen::Matrix3d tangents = tangentsOf(pose.translation);
    Eigen::Matrix<double, 9, 5> entries;
    for (int k = 0; k < 3; ++k)
    {
      entries.col(k) = rowMajor(e * crossMatrix(Eigen::Vector3d::Unit(k)));  // of a turn to the right of R
    }
    for (int k = 0; k < 2; ++k)
    {
      entries.col(3 + k) = rowMajor(crossMatrix(tangents.col(k)) * pose.rotation);
    }
    for (const Correspondence& pair : pairs)
    {
      Eigen::Matrix<double, 1, 9> by_entries;
      const double residual = sampsonResidual(e, pair, by_entries);
      const Eigen::Matrix<double, 1, 5> jacobian = by_entries * entries;
      if (std::isfinite(residual) && jacobian.allFinite())
      {
        jtj += jacobian.transpose() * jacobian;
        gradient += jacobian.transpose() * residual;
      }
    }
  }

  static RelativePose moved(const RelativePose& pose, const Eigen::Matrix<double, 5, 1>& step)
  {
    const Eigen::Matrix3d tangents = tangentsOf(pose.translation);
    return { pose.rotation * rotationFromVector(step.head<3>()),
             (pose.translation + step(3) * tangents.col(0) + step(4) * tangents.col(1)).normalized() };
  }

  /** Two directions across a unit vector; the third column is the vector. */
  static Eigen::Matrix3d tangentsOf(const Eigen::Vector3d& direction)
  {
    Eigen::Matrix3d basis;
    basis.col(0) = direction.unitOrthogonal();
    basis.col(1) = direction.cross(basis.col(0));
    basis.col(2) = direction;
    return basis;
  }
};

}  // namespace

Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v)
{
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Eigen::Matrix3d RelativePose::essential() const
{
  return crossMatrix(translation) * rotation;
}

std::vector<Eigen::Matrix3d> essentialFromFivePoints(const Correspondences& five)
{
  constexpr std::size_t SAMPLE = 5;
  std::vector<Eigen::Matrix3d> solutions;
  if (five.size() != SAMPLE)
  {
    return solutions;
  }
  cv::Mat reference(static_cast<int>(SAMPLE), 2, CV_64F);
  cv::Mat current(static_cast<int>(SAMPLE), 2, CV_64F);
  for (int i = 0; i < static_cast<int>(SAMPLE); ++i)
  {
    for (int k = 0; k < 2; ++k)
    {
      reference.at<double>(i, k) = five[static_cast<std::size_t>(i)].reference(k);
      current.at<double>(i, k) = five[static_cast<std::size_t>(i)].current(k);
    }
  }
  // With as many points as a sample has, all solutions come, one below the other.
  const cv::Mat stacked = cv::findEssentialMat(reference, current, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC);
  for (int row = 0; row + 3 <= stacked.rows && stacked.cols == 3; row += 3)
  {
    Eigen::Matrix3d solution;
    cv::cv2eigen(stacked.rowRange(row, row + 3), solution);
    if (solution.allFinite())
    {
      solutions.push_back(solution);
    }
  }
  return solutions;
}

std::vector<RelativePose> posesFromEssential(const Eigen::Matrix3d& essential)
{
  Svd3 svd = singularValues(essential);
  Eigen::Matrix3d& u = svd.u;
  Eigen::Matrix3d& v = svd.v;
  u *= u.determinant() < 0.0 ? -1.0 : 1.0;
  v *= v.determinant() < 0.0 ? -1.0 : 1.0;
  Eigen::Matrix3d quarter_turn;
  quarter_turn << 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0;
  std::vector<RelativePose> poses;
  for (const Eigen::Matrix3d& turn : { quarter_turn, Eigen::Matrix3d(quarter_turn.transpose()) })
  {
    for (const double sense : { 1.0, -1.0 })
    {
      poses.push_back({ u * turn * v.transpose(), sense * u.col(2) });
    }
  }
  return poses;
}

RelativePose refineRelativePose(const RelativePose& initial, const Correspondences& pairs, int max_iterations)
{
  RelativePose pose = initial;
  levenbergMarquardt(RelativePoseProblem{ pairs }, pose, max_iterations);
  return pose;
}

Eigen::Matrix<double, 6, 6> covarianceOf(const RelativePose& pose, const Correspondences& pairs, double variance)
{
  Eigen::Matrix<double, 5, 5> information;
  Eigen::Matrix<double, 5, 1> gradient;
  RelativePoseProblem{ pairs }.linearize(pose, information, gradient);
  Eigen::Matrix<double, 6, 5> spread = Eigen::Matrix<double, 6, 5>::Zero();
  spread.topLeftCorner<3, 3>().setIdentity();
  spread.bottomRightCorner<3, 2>() = RelativePoseProblem::tangentsOf(pose.translation).leftCols<2>();
  return variance * spread * information.inverse() * spread.transpose();
}

}  // namespace view_servo
