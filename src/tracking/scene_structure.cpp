// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "scene_structure.h"

#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/robust/quantile.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double LEAST_DEPTH_ERROR = 0.003;  // of an inverse depth, as a part of it: what no sighting tells better

/** Where a point is seen, by its motion and its inverse depth. */
struct Linearized
{
  bool in_front = false;
  Eigen::Vector2d seen;
  Eigen::Matrix<double, 2, 6> by_motion;  // by exp(w, v) motion: first the turn w, then the way v
  Eigen::Vector2d by_depth;
};

Linearized linearize(const ScenePoint& point, const Eigen::Isometry3d& motion)
{
  constexpr double NEAREST = 0.05;  // depth over that in the view
  Linearized result;
  const Eigen::Vector3d at = motion.linear() * point.point.homogeneous() + point.inverse_depth * motion.translation();
  result.in_front = at.z() > NEAREST;
  if (!result.in_front)
  {
    return result;
  }
  result.seen = at.hnormalized();
  Eigen::Matrix<double, 2, 3> by_at;
  by_at << 1.0, 0.0, -result.seen.x(), 0.0, 1.0, -result.seen.y();
  by_at /= at.z();
  result.by_motion << -by_at * crossMatrix(at), point.inverse_depth * by_at;
  result.by_depth = by_at * motion.translation();
  return result;
}

Eigen::Isometry3d moved(const Eigen::Isometry3d& motion, const Vector6& step)
{
  Eigen::Isometry3d change = Eigen::Isometry3d::Identity();
  change.linear() = rotationFromVector(step.head<3>());
  change.translation() = step.tail<3>();
  Eigen::Isometry3d result = change * motion;
  result.linear() = Eigen::Quaterniond(result.linear()).normalized().toRotationMatrix();
  return result;
}

/** Geman and McClure's weight of a squared error in units of its variance. @param width where it is a quarter. */
double weightOf(double squared, double width)
{
  const double ratio = 1.0 / (1.0 + squared / (width * width));
  return ratio * ratio;
}

double depthVariance(const ScenePoint& point)
{
  const double least = LEAST_DEPTH_ERROR * point.inverse_depth;
  return (point.information > 0.0 ? 1.0 / point.information : 1.0) + least * least;
}

/**
 * The inverse depth of a match by a motion, from the plane of both rays; not positive where they do not meet in front.
 */
double inverseDepthOf(const Correspondence& match, const RelativePose& motion)
{
  // [x_cur] x (R x_ref + w t) = 0.
  const Eigen::Vector3d seen = match.current.homogeneous();
  const Eigen::Vector3d by_turn = seen.cross(motion.rotation * match.reference.homogeneous());
  const Eigen::Vector3d by_way = seen.cross(motion.translation);
  return -by_turn.dot(by_way) / by_way.squaredNorm();
}

/** A match whose depth is known. */
struct Depth
{
  Eigen::Vector2d point;
  double inverse;
};

/** Sets a point's prior from the matches nearest to it. */
void takePrior(const std::vector<Depth>& depths, double pixel, ScenePoint& point)
{
  constexpr std::size_t NEIGHBOURS = 7;
  constexpr double LEAST = 0.03;  // standard deviations, as parts of the inverse depth
  constexpr double A_PIXEL_AWAY = 0.004;
  constexpr double LARGEST = 0.5;
  std::vector<std::pair<double, double>> nearest;  // distance, inverse depth
  nearest.reserve(depths.size());
  for (const Depth& depth : depths)
  {
    nearest.emplace_back((depth.point - point.point).norm(), depth.inverse);
  }
  const std::size_t count = std::min(NEIGHBOURS, nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<std::ptrdiff_t>(count), nearest.end());
  std::vector<double> values;
  std::vector<double> distances;
  for (std::size_t i = 0; i < count; ++i)
  {
    distances.push_back(nearest[i].first);
    values.push_back(nearest[i].second);
  }
  point.prior = medianOf(values);
  std::vector<double> deviations;
  deviations.reserve(values.size());
  for (const double value : values)
  {
    deviations.push_back(std::abs(value - point.prior));
  }
  const double relative =
      LEAST + 1.5 * quantileOf(deviations, 0.7) / point.prior + A_PIXEL_AWAY * medianOf(distances) / pixel;
  const double deviation = std::min(relative, LARGEST) * point.prior;
  point.prior_information = 1.0 / (deviation * deviation);
}

}  // namespace

Eigen::Vector2d projected(const ScenePoint& point, const Eigen::Isometry3d& motion)
{
  const Linearized at = linearize(point, motion);
  return at.in_front ? at.seen : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

Eigen::Isometry3d beginStructure(const RelativePose& motion, const Correspondences& matches, double pixel,
                                 std::vector<ScenePoint>& points)
{
  constexpr double LEAST_PARALLAX = 4.0;  // median of all matches: less tells no depth [px]
  constexpr double LEAST_OF_MATCH = 2.0;  // of one match [px]
  constexpr double UNKNOWN = 0.4;         // standard deviation of an inverse depth of which nothing is known
  constexpr std::size_t FEWEST = 8;
  std::vector<Depth> depths;
  std::vector<double> parallaxes;
  for (const Correspondence& match : matches)
  {
    const Eigen::Vector3d turned = motion.rotation * match.reference.homogeneous();
    const double parallax = turned.z() > 0.0 ? (match.current - turned.hnormalized()).norm() / pixel
                                             : std::numeric_limits<double>::infinity();
    parallaxes.push_back(parallax);
    const double inverse = inverseDepthOf(match, motion);
    if (parallax >= LEAST_OF_MATCH && inverse > 0.0)
    {
      depths.push_back({ match.reference, inverse });
    }
  }
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = motion.rotation;
  const bool known = depths.size() >= FEWEST && medianOf(parallaxes) >= LEAST_PARALLAX;
  double unit = 1.0;
  if (known)
  {
    std::vector<double> inverses;
    inverses.reserve(depths.size());
    for (const Depth& depth : depths)
    {
      inverses.push_back(depth.inverse);
    }
    unit = medianOf(inverses);
    for (Depth& depth : depths)
    {
      depth.inverse /= unit;
    }
    result.translation() = unit * motion.translation;
  }
  for (ScenePoint& point : points)
  {
    point.prior = 1.0;
    point.prior_information = 1.0 / (UNKNOWN * UNKNOWN);
    if (known)
    {
      takePrior(depths, pixel, point);
    }
    point.inverse_depth = point.prior;
    point.information = point.prior_information;
    point.slope.setZero();
  }
  return result;
}

Eigen::Isometry3d fitMotion(const std::vector<ScenePoint>& points, const std::vector<SceneSighting>& sightings,
                            const Eigen::Isometry3d& initial)
{
  constexpr int ITERATIONS = 12;
  constexpr double LEAST_WIDTH = 3.0;  // of the weights, in standard deviations
  constexpr double OF_MEDIAN = 2.5;
  constexpr double SMALL = 1e-8;
  Eigen::Isometry3d motion = initial;
  for (int iteration = 0; iteration < ITERATIONS; ++iteration)
  {
    std::vector<Linearized> all;
    std::vector<Eigen::Matrix2d> informations;
    std::vector<double> errors;
    for (const SceneSighting& sighting : sightings)
    {
      const ScenePoint& point = points[sighting.index];
      all.push_back(linearize(point, motion));
      const Linearized& at = all.back();
      informations.emplace_back(Eigen::Matrix2d::Zero());
      if (at.in_front)
      {
        const Eigen::Matrix2d covariance =
            sighting.covariance + depthVariance(point) * at.by_depth * at.by_depth.transpose();
        informations.back() = covariance.inverse();
        const Eigen::Vector2d residual = at.seen - sighting.seen;
        errors.push_back(residual.dot(informations.back() * residual));
      }
    }
    if (errors.empty())
    {
      return motion;
    }
    const double width = std::max(LEAST_WIDTH, OF_MEDIAN * std::sqrt(medianOf(errors)));
    Matrix6 normal = Matrix6::Zero();
    Vector6 right = Vector6::Zero();
    for (std::size_t i = 0; i < sightings.size(); ++i)
    {
      if (all[i].in_front)
      {
        const Eigen::Vector2d residual = all[i].seen - sightings[i].seen;
        const double weight = weightOf(residual.dot(informations[i] * residual), width);
        const Eigen::Matrix<double, 6, 2> weighted = weight * all[i].by_motion.transpose() * informations[i];
        normal += weighted * all[i].by_motion;
        right -= weighted * residual;
      }
    }
    normal.diagonal() *= 1.0 + 1e-9;
    const Vector6 step = normal.ldlt().solve(right);
    if (!step.allFinite())
    {
      return motion;
    }
    motion = moved(motion, step);
    if (step.norm() < SMALL)
    {
      break;
    }
  }
  return motion;
}

Matrix6 motionCovariance(const std::vector<ScenePoint>& points, const std::vector<SceneSighting>& sightings,
                         const Eigen::Isometry3d& motion)
{
  constexpr double INDEPENDENT = 150.0;
  Matrix6 information = Matrix6::Zero();
  double squares = 0.0;
  double count = 0.0;
  for (const SceneSighting& sighting : sightings)
  {
    const ScenePoint& point = points[sighting.index];
    const Linearized at = linearize(point, motion);
    if (at.in_front)
    {
      const Eigen::Matrix2d covariance =
          sighting.covariance + depthVariance(point) * at.by_depth * at.by_depth.transpose();
      const Eigen::Matrix2d own = covariance.inverse();
      const Eigen::Vector2d residual = at.seen - sighting.seen;
      squares += residual.dot(own * residual);
      information += at.by_motion.transpose() * own * at.by_motion;
      count += 1.0;
    }
  }
  // linearize() moves t with the rotation.
  Matrix6 by_step = Matrix6::Identity();
  by_step.bottomLeftCorner<3, 3>() = -crossMatrix(motion.translation());
  const double variance = squares / std::max(1.0, 2.0 * count) * std::max(1.0, count / INDEPENDENT);
  return variance * by_step * information.inverse() * by_step.transpose();
}

bool supports(const ScenePoint& point, const SceneSighting& sighting, const Eigen::Isometry3d& motion, double radius,
              double& residual)
{
  constexpr double DEVIATIONS = 2.0;  // of the depth
  const Linearized at = linearize(point, motion);
  if (!at.in_front)
  {
    return false;
  }
  const Eigen::Vector2d difference = sighting.seen - at.seen;
  const double length = at.by_depth.norm();
  const double open = DEVIATIONS * std::sqrt(depthVariance(point)) * length;
  const Eigen::Vector2d along = length > 0.0 ? Eigen::Vector2d(at.by_depth / length) : Eigen::Vector2d::Zero();
  const double by_depth = std::clamp(difference.dot(along), -open, open);
  residual = (difference - by_depth * along).norm();
  return residual <= radius;
}

double withSighting(const ScenePoint& point, const SceneSighting& sighting, const Eigen::Isometry3d& motion)
{
  constexpr double LEAST = 0.2;  // part of the inverse depth before
  const Linearized at = linearize(point, motion);
  if (!at.in_front)
  {
    return point.inverse_depth;
  }
  const Eigen::Vector2d pull = sighting.covariance.inverse() * at.by_depth;
  const double change = pull.dot(sighting.seen - at.seen) / (pull.dot(at.by_depth) + 1.0 / depthVariance(point));
  return std::max(LEAST * point.inverse_depth, point.inverse_depth + change);
}

namespace
{
/** The equations of one round of the adjustment. */
class Adjustment
{
public:
  Adjustment(const std::vector<ScenePoint>& points, const std::vector<SceneFrame>& frames)
    : points_(points), frames_(frames), by_point_(points.size())
  {
    for (std::size_t f = 0; f < frames.size(); ++f)
    {
      for (std::size_t s = 0; s < frames[f].sightings.size(); ++s)
      {
        by_point_[frames[f].sightings[s].index].emplace_back(f, s);
      }
    }
  }

  /** Robust cost; infinite where a point is not in front of a camera that sees it. */
  static double cost(const std::vector<ScenePoint>& points, const std::vector<SceneFrame>& frames)
  {
    double sum = 0.0;
    for (const ScenePoint& point : points)
    {
      const double off = point.inverse_depth - point.prior;
      sum += point.prior_information * off * off;
    }
    for (const SceneFrame& frame : frames)
    {
      for (const SceneSighting& sighting : frame.sightings)
      {
        const Linearized at = linearize(points[sighting.index], frame.motion);
        if (!at.in_front)
        {
          return std::numeric_limits<double>::infinity();
        }
        const Eigen::Vector2d residual = at.seen - sighting.seen;
        const double squared = residual.dot(sighting.covariance.inverse() * residual);
        sum += squared / (1.0 + squared / (WIDTH * WIDTH));
      }
    }
    return sum;
  }

  /** Solves for a step, the depths eliminated. @param damping of Levenberg and Marquardt. */
  bool step(double damping, std::vector<Vector6>& motions, std::vector<double>& depths)
  {
    const Eigen::Index size = 6 * static_cast<Eigen::Index>(frames_.size());
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size, size);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
    std::vector<double> own(points_.size());
    std::vector<double> pulls(points_.size());
    std::vector<std::vector<Vector6>> mixed(points_.size());
    for (std::size_t p = 0; p < points_.size(); ++p)
    {
      const ScenePoint& point = points_[p];
      own[p] = point.prior_information;
      pulls[p] = point.prior_information * (point.prior - point.inverse_depth);
      for (const auto& [f, s] : by_point_[p])
      {
        const SceneSighting& sighting = frames_[f].sightings[s];
        const Linearized at = linearize(point, frames_[f].motion);
        if (!at.in_front)
        {
          return false;
        }
        const Eigen::Vector2d residual = at.seen - sighting.seen;
        Eigen::Matrix2d information = sighting.covariance.inverse();
        information *= weightOf(residual.dot(information * residual), WIDTH);
        const Eigen::Matrix<double, 6, 2> weighted = at.by_motion.transpose() * information;
        const Eigen::Index at_frame = 6 * static_cast<Eigen::Index>(f);
        normal.block<6, 6>(at_frame, at_frame) += weighted * at.by_motion;
        right.segment<6>(at_frame) -= weighted * residual;
        own[p] += at.by_depth.dot(information * at.by_depth);
        pulls[p] -= at.by_depth.dot(information * residual);
        mixed[p].push_back(weighted * at.by_depth);
      }
    }
    information_ = own;
    normal.diagonal() *= 1.0 + damping;
    for (std::size_t p = 0; p < points_.size(); ++p)
    {
      own[p] *= 1.0 + damping;
      for (std::size_t i = 0; i < mixed[p].size(); ++i)
      {
        const Eigen::Index row = 6 * static_cast<Eigen::Index>(by_point_[p][i].first);
        right.segment<6>(row) -= mixed[p][i] * (pulls[p] / own[p]);
        for (std::size_t j = 0; j < mixed[p].size(); ++j)
        {
          const Eigen::Index column = 6 * static_cast<Eigen::Index>(by_point_[p][j].first);
          normal.block<6, 6>(row, column) -= mixed[p][i] * mixed[p][j].transpose() / own[p];
        }
      }
    }
    const Eigen::VectorXd solution = normal.ldlt().solve(right);
    if (!solution.allFinite())
    {
      return false;
    }
    motions.clear();
    for (std::size_t f = 0; f < frames_.size(); ++f)
    {
      motions.emplace_back(solution.segment<6>(6 * static_cast<Eigen::Index>(f)));
    }
    depths.assign(points_.size(), 0.0);
    for (std::size_t p = 0; p < points_.size(); ++p)
    {
      double pull = pulls[p];
      for (std::size_t i = 0; i < mixed[p].size(); ++i)
      {
        pull -= mixed[p][i].dot(motions[by_point_[p][i].first]);
      }
      depths[p] = pull / own[p];
    }
    return true;
  }

  /** Of the inverse depths, by the last step(). */
  const std::vector<double>& information() const
  {
    return information_;
  }

private:
  static constexpr double WIDTH = 5.0;  // of the weights, in standard deviations

  const std::vector<ScenePoint>& points_;
  const std::vector<SceneFrame>& frames_;
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> by_point_;  // frame, sighting in it
  std::vector<double> information_;
};

}  // namespace

void adjustStructure(std::vector<ScenePoint>& points, std::vector<SceneFrame>& frames)
{
  constexpr int ITERATIONS = 8;
  constexpr double LEAST = 0.02;   // inverse depth, of the median
  constexpr double ENOUGH = 1e-4;  // decrease, as a part of the cost
  constexpr double MOST_DAMPING = 1e6;
  double damping = 1e-4;
  double cost = Adjustment::cost(points, frames);
  for (int iteration = 0; iteration < ITERATIONS && std::isfinite(cost); ++iteration)
  {
    Adjustment adjustment(points, frames);
    std::vector<Vector6> motions;
    std::vector<double> depths;
    double decrease = 0.0;
    while (!(decrease > 0.0) && damping < MOST_DAMPING)
    {
      std::vector<ScenePoint> new_points = points;
      std::vector<SceneFrame> new_frames = frames;
      double new_cost = std::numeric_limits<double>::infinity();
      if (adjustment.step(damping, motions, depths))
      {
        for (std::size_t p = 0; p < points.size(); ++p)
        {
          new_points[p].inverse_depth = std::max(LEAST, points[p].inverse_depth + depths[p]);
          new_points[p].information = adjustment.information()[p];
        }
        for (std::size_t f = 0; f < frames.size(); ++f)
        {
          new_frames[f].motion = moved(frames[f].motion, motions[f]);
        }
        new_cost = Adjustment::cost(new_points, new_frames);
      }
      decrease = cost - new_cost;
      if (decrease > 0.0)
      {
        points = std::move(new_points);
        for (std::size_t f = 0; f < frames.size(); ++f)
        {
          frames[f].motion = new_frames[f].motion;
        }
        damping = std::max(0.1 * damping, 1e-9);
      }
      else
      {
        damping *= 10.0;
      }
    }
    if (!(decrease > ENOUGH * cost))
    {
      break;
    }
    cost -= decrease;
  }
}

void findSlopes(std::vector<ScenePoint>& points, double pixel)
{
  constexpr double REACH = 60.0;    // farthest neighbour [px]
  constexpr double SAME = 0.02;     // difference from the surface at which a neighbour counts a quarter, of 1 / Z
  constexpr double STEEPEST = 1.5;  // tangent of the angle that surfaces are expected to have with the image, at most
  constexpr int ROUNDS = 4;
  for (ScenePoint& point : points)
  {
    const double scale = SAME * point.inverse_depth + std::sqrt(depthVariance(point));
    Eigen::Vector2d slope = Eigen::Vector2d::Zero();
    for (int round = 0; round < ROUNDS; ++round)
    {
      const double expected = STEEPEST * point.inverse_depth;
      Eigen::Matrix2d normal = Eigen::Matrix2d::Identity() / (expected * expected);
      Eigen::Vector2d right = Eigen::Vector2d::Zero();
      for (const ScenePoint& other : points)
      {
        const Eigen::Vector2d away = other.point - point.point;
        if (&other == &point || away.norm() > REACH * pixel)
        {
          continue;
        }
        const double difference = other.inverse_depth - point.inverse_depth;
        const double off = difference - slope.dot(away);
        const double weight = weightOf(off * off, scale) / (depthVariance(other) + depthVariance(point));
        normal += weight * away * away.transpose();
        right += weight * difference * away;
      }
      slope = normal.ldlt().solve(right);
    }
    point.slope = slope.allFinite() ? slope : Eigen::Vector2d::Zero();
  }
}

std::size_t locate(const std::vector<ScenePoint>& points, const Correspondences& matches, double pixel,
                   Eigen::Isometry3d& motion)
{
  constexpr double SAME_POINT = 4.0;   // distance of a match from the point whose depth it takes [px]
  constexpr double WELL_KNOWN = 0.05;  // standard deviation of an inverse depth, as a part of it
  constexpr std::size_t FEWEST = 12;
  constexpr double THRESHOLD = 3.0;  // of a match that agrees [px]
  constexpr int SAMPLES = 300;
  std::vector<cv::Point3d> places;
  std::vector<cv::Point2d> seen;
  for (const ScenePoint& point : points)
  {
    const Correspondence* nearest = nullptr;
    double least = SAME_POINT * pixel;
    for (const Correspondence& match : matches)
    {
      const double distance = (match.reference - point.point).norm();
      if (distance < least)
      {
        least = distance;
        nearest = &match;
      }
    }
    if (nearest != nullptr && std::sqrt(depthVariance(point)) < WELL_KNOWN * point.inverse_depth)
    {
      const double inverse = point.inverse_depth + point.slope.dot(nearest->reference - point.point);
      const Eigen::Vector3d at = nearest->reference.homogeneous() / inverse;
      places.emplace_back(at.x(), at.y(), at.z());
      seen.emplace_back(nearest->current.x(), nearest->current.y());
    }
  }
  cv::Mat turn;
  cv::Mat way;
  std::vector<int> inliers;
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  if (places.size() < FEWEST ||
      !cv::solvePnPRansac(places, seen, identity, cv::noArray(), turn, way, false, SAMPLES,
                          static_cast<float>(THRESHOLD * pixel), 0.999, inliers, cv::SOLVEPNP_EPNP) ||
      inliers.size() < FEWEST || 2 * inliers.size() < places.size())
  {
    return 0;
  }
  cv::Mat matrix;
  cv::Rodrigues(turn, matrix);
  Eigen::Matrix3d rotation;
  Eigen::Vector3d translation;
  cv::cv2eigen(matrix, rotation);
  cv::cv2eigen(way, translation);
  if (!rotation.allFinite() || !translation.allFinite())
  {
    return 0;
  }
  motion.linear() = rotation;
  motion.translation() = translation;
  return inliers.size();
}

}  // namespace view_servo
