// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/arm_geometry_experiment.h"

#include "experiments/arm_data.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/numbers.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iostream>
#include <limits>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
constexpr std::size_t MIDDLE = 2 * ArmData::COLUMNS + 4;  // of the board's corners
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

double degreesBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
  return std::atan2(a.cross(b).norm(), a.dot(b)) * DEGREES;
}

/** What the homography from the reference image to another one can come from. */
struct Comparison
{
  std::size_t current;
  std::vector<EuclideanHomography> solutions;
};

std::vector<Comparison> compareAll(const ArmData& data, std::size_t reference)
{
  std::vector<Comparison> comparisons;
  const Points& seen = data.views[reference].corners;
  for (std::size_t current = 0; current < data.views.size(); ++current)
  {
    if (current == reference)
    {
      continue;
    }
    Correspondences pairs;
    for (std::size_t i = 0; i < seen.size(); ++i)
    {
      pairs.push_back({ seen[i], data.views[current].corners[i] });
    }
    const auto h = homographyFromPoints(pairs);
    comparisons.push_back({ current, {} });
    if (h)
    {
      comparisons.back().solutions = decomposeHomography(refineHomography(*h, pairs), data.camera.k, seen);
    }
  }
  return comparisons;
}

/** The normal that all comparisons have a solution near to: the sum of the angles to the nearest ones is least. */
Eigen::Vector3d commonNormal(const std::vector<Comparison>& comparisons)
{
  Eigen::Vector3d best = Eigen::Vector3d::Constant(NONE);
  double least = std::numeric_limits<double>::infinity();
  for (const Comparison& proposer : comparisons)
  {
    for (const EuclideanHomography& proposed : proposer.solutions)
    {
      double sum = 0.0;
      for (const Comparison& comparison : comparisons)
      {
        double nearest = 180.0;
        for (const EuclideanHomography& solution : comparison.solutions)
        {
          nearest = std::min(nearest, degreesBetween(solution.normal, proposed.normal));
        }
        sum += nearest;
      }
      if (sum < least)
      {
        least = sum;
        best = proposed.normal;
      }
    }
  }
  return best;
}

/** The mean of the normals next to a common one, each with the weight that the filter of planes gives it. */
Eigen::Vector3d meanNormal(const std::vector<Comparison>& comparisons, const Eigen::Vector3d& common)
{
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Comparison& comparison : comparisons)
  {
    const auto nearest = std::min_element(comparison.solutions.begin(), comparison.solutions.end(),
                                          [&](const EuclideanHomography& a, const EuclideanHomography& b) {
                                            return a.normal.dot(common) > b.normal.dot(common);
                                          });
    if (nearest != comparison.solutions.end())
    {
      sum += nearest->translation_over_distance.squaredNorm() * nearest->normal;
    }
  }
  return sum.normalized();
}

/** The error of 2.5D servoing, of a point: x - x*, y - y* (normalised), log(Z / Z*), rotation vector [rad]. */
using ServoError = Eigen::Matrix<double, 6, 1>;

/**
 * @param current the point in the current camera, @param reference in the reference one, of the same unit of length.
 */
ServoError servoError(const Eigen::Vector3d& current, const Eigen::Vector3d& reference, const Eigen::Matrix3d& rotation)
{
  ServoError error;
  error << current.hnormalized() - reference.hnormalized(), std::log(current.z() / reference.z()),
      rotationVector(rotation);
  return error;
}

/** The point that the arm's cameras see at a corner, in the base's frame: least squares of the distances from rays. */
Eigen::Vector3d triangulate(const ArmData& data, std::size_t corner)
{
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const ArmView& view : data.views)
  {
    const Eigen::Vector3d ray =
        (view.camera_in_base.linear() * data.camera.normalized(view.corners[corner]).homogeneous()).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    sum += across;
    right += across * view.camera_in_base.translation();
  }
  return sum.inverse() * right;
}

/** How far a motion is from the arm's [degrees]. */
struct MotionError
{
  double rotation = NONE;
  double translation = NONE;  ///< of its direction
};

MotionError compare(const EuclideanHomography& found, const Eigen::Isometry3d& arm)
{
  return { Eigen::AngleAxisd(found.rotation * arm.linear().transpose()).angle() * DEGREES,
           degreesBetween(found.translation_over_distance, arm.translation()) };
}

/** Says on stdout how large errors are; NaN counts as larger than any. */
void summarize(const std::string& name, std::vector<double> errors, double bound)
{
  std::replace_if(
      errors.begin(), errors.end(), [](double e) { return std::isnan(e); }, std::numeric_limits<double>::infinity());
  std::sort(errors.begin(), errors.end());
  const std::size_t n = errors.size();
  const auto within = std::upper_bound(errors.begin(), errors.end(), bound) - errors.begin();
  std::cout << name << ": median " << 0.5 * (errors[n / 2] + errors[(n - 1) / 2]) << ", largest " << errors.back()
            << "; " << within << " of " << n << " within " << bound << std::endl;
}

/** How far from closing the turns from image to image are, around all three images [degrees]. */
std::vector<double> closures(const std::vector<std::vector<Eigen::Matrix3d>>& turns)
{
  std::vector<double> result;
  for (std::size_t a = 0; a < turns.size(); ++a)
  {
    for (std::size_t b = a + 1; b < turns.size(); ++b)
    {
      for (std::size_t c = b + 1; c < turns.size(); ++c)
      {
        result.push_back(Eigen::AngleAxisd(turns[c][a] * turns[b][c] * turns[a][b]).angle() * DEGREES);
      }
    }
  }
  return result;
}

/** All rows of one way to see the camera's lens. */
void compareWithArm(const ArmData& data, const std::string& lens, std::ostream& csv)
{
  const std::size_t count = data.views.size();
  const Eigen::Vector3d point = triangulate(data, MIDDLE);
  std::vector<double> rotations;
  std::vector<double> translations;
  std::vector<double> depths;
  int ambiguous = 0;
  int missed = 0;
  std::vector<std::vector<Eigen::Matrix3d>> turns(count,
                                                  std::vector<Eigen::Matrix3d>(count, Eigen::Matrix3d::Constant(NONE)));
  for (std::size_t reference = 0; reference < count; ++reference)
  {
    const ArmView& goal = data.views[reference];
    const Eigen::Vector3d seen = data.camera.normalized(goal.corners[MIDDLE]).homogeneous();
    const std::vector<Comparison> comparisons = compareAll(data, reference);
    const Eigen::Vector3d normal = meanNormal(comparisons, commonNormal(comparisons));
    for (const Comparison& comparison : comparisons)
    {
      std::vector<EuclideanHomography> solutions = comparison.solutions;
      std::sort(solutions.begin(), solutions.end(), [&](const EuclideanHomography& a, const EuclideanHomography& b) {
        return degreesBetween(a.normal, normal) < degreesBetween(b.normal, normal);
      });
      const ArmView& view = data.views[comparison.current];
      // X_cur = R X_ref + t
      const Eigen::Isometry3d arm = view.camera_in_base.inverse() * goal.camera_in_base;
      const ServoError by_arm =
          servoError(view.camera_in_base.inverse() * point, goal.camera_in_base.inverse() * point, arm.linear());
      MotionError chosen;
      MotionError other;
      double off_normal = NONE;
      double other_off_normal = NONE;
      ServoError by_homography = ServoError::Constant(NONE);
      if (!solutions.empty())
      {
        const EuclideanHomography motion = motionBefore(solutions[0].matrix(), normal);
        chosen = compare(motion, arm);
        off_normal = degreesBetween(solutions[0].normal, normal);
        // In units of Z*.
        by_homography = servoError(motion.matrix() * seen, seen, motion.rotation);
        turns[reference][comparison.current] = motion.rotation;
      }
      if (solutions.size() > 1)
      {
        other = compare(solutions[1], arm);
        other_off_normal = degreesBetween(solutions[1].normal, normal);
        ++ambiguous;
        missed += other.rotation < chosen.rotation ? 1 : 0;
      }
      const ServoError difference = by_homography - by_arm;
      rotations.push_back(chosen.rotation);
      translations.push_back(chosen.translation);
      depths.push_back(std::abs(difference(2)));
      csv << lens << ',' << reference + 1 << ',' << comparison.current + 1 << ',' << arm.translation().norm() << ','
          << Eigen::AngleAxisd(arm.linear()).angle() * DEGREES << ',' << solutions.size() << ',' << off_normal << ','
          << other_off_normal << ',' << chosen.rotation << ',' << chosen.translation << ',' << other.rotation << ','
          << other.translation << ',';
      for (Eigen::Index i = 0; i < by_homography.size(); ++i)
      {
        csv << by_homography[i] << ',';
      }
      csv << difference.head<2>().norm() << ',' << std::abs(difference(2)) << ','
          << difference.tail<3>().norm() * DEGREES << '\n';
    }
  }
  std::cout << "lens " << lens << ": " << ambiguous << " of " << rotations.size()
            << " homographies have two decompositions; the other one's rotation is nearer to the arm's in " << missed
            << std::endl;
  summarize("  rotation [degrees]", rotations, 1.0);
  summarize("  direction of the translation [degrees]", translations, 5.0);
  summarize("  log(Z / Z*)", depths, 0.02);
  summarize("  rotation around three images, without the arm [degrees]", closures(turns), 1.0);
}

}  // namespace

void runArmGeometryExperiment(const ExperimentContext& context, std::ostream& csv)
{
  csv << "lens,reference,current,baseline_m,rotation_deg,solutions,off_normal_deg,other_off_normal_deg,"
         "rotation_error_deg,translation_error_deg,other_rotation_error_deg,other_translation_error_deg,x,y,log_depth,"
         "ux,uy,uz,position_error,log_depth_error,rotation_vector_error_deg\n"
      << std::setprecision(8);
  ArmData data = readArmData(context.data / "eyeinhand_franka_visp");
  compareWithArm(data, "given", csv);
  const double rms = removeDistortion(data);
  std::cout << "corners after calibration of the lens: " << rms << " px" << std::endl;
  compareWithArm(data, "calibrated", csv);
}

}  // namespace view_servo
