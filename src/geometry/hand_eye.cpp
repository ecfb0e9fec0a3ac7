// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/hand_eye.h"

#include "decompositions.h"
#include "levenberg_marquardt.h"
#include "view_servo/geometry/euclidean_homography.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/rotation_vector.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
constexpr double ENDLESS = std::numeric_limits<double>::infinity();
constexpr double DEGREES = 180.0 / M_PI;
constexpr int CORNERS = 4;
constexpr int ROWS = 2 * CORNERS;  // of a pose's errors
constexpr int DOF = 15;            // camera on flange, view in base, direction and distance of the plane
constexpr int LEAST_POSES = 6;

using Errors = Eigen::Matrix<double, ROWS, 1>;
// Of sizes that the compiler does not know, which spares it a minute: ROWS x ROWS, ROWS x DOF, ROWS x 6.
using Square = Eigen::MatrixXd;
using Jacobian = Eigen::MatrixXd;
using ArmJacobian = Eigen::MatrixXd;
using Normal = Eigen::Matrix<double, DOF, DOF>;
using Indices = std::vector<std::size_t>;

/** What is unknown. */
struct State
{
  Eigen::Isometry3d camera_in_flange;
  Eigen::Isometry3d view_in_base;
  Eigen::Vector3d normal;
  double distance;
};

/** A pose, prepared. */
struct Observation
{
  Eigen::Isometry3d base_in_flange;
  Eigen::Matrix3d calibrated;  // R + (t / d) nᵀ
  Errors corners;              // where the image has the view's corners [px]
};

Eigen::Matrix3d crossMatrix(const Eigen::Vector3d& v)
{
  Eigen::Matrix3d matrix;
  matrix << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return matrix;
}

/** Two unit vectors square to a unit vector and to each other, as columns. */
Eigen::Matrix<double, 3, 2> squareTo(const Eigen::Vector3d& unit)
{
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = unit.unitOrthogonal();
  basis.col(1) = unit.cross(basis.col(0));
  return basis;
}

double angleOf(const Eigen::Matrix3d& rotation)
{
  return rotationVector(rotation).norm();
}

/** The value in the middle of some. */
double medianOfSome(std::vector<double> values)
{
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/** Numbers as people read them. */
std::string rounded(double value, int decimals = 1)
{
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

void check(const HandEyeView& view, const std::vector<HandEyePose>& poses)
{
  constexpr double NO_ROTATION = 1e-6;
  if (!view.k.allFinite() || !(view.k(0, 0) > 0.0) || !(view.k(1, 1) > 0.0) || !(view.k(2, 2) > 0.0))
  {
    throw std::invalid_argument("the camera is not calibrated: its matrix is none");
  }
  Correspondences corners;
  for (const Eigen::Vector2d& corner : view.corners)
  {
    corners.push_back({ corner, corner });
  }
  if (corners.size() != CORNERS || !isHomographySample(corners))
  {
    throw std::invalid_argument("the view's region needs four corners, no three of them on one line");
  }
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    const Eigen::Isometry3d& flange = poses[i].flange_in_base;
    const Eigen::Matrix3d& r = flange.linear();
    if (!flange.matrix().allFinite() || !(r * r.transpose()).isIdentity(NO_ROTATION) || !(r.determinant() > 0.0))
    {
      throw std::invalid_argument("the flange's pose " + std::to_string(i + 1) + " is no rigid motion");
    }
    if (!poses[i].h.allFinite() || poses[i].h.isZero(0.0))
    {
      throw std::invalid_argument("the homography of pose " + std::to_string(i + 1) + " is none");
    }
  }
}

/** Solves for the state from poses. */
class HandEye
{
public:
  /** @param distance of the plane from the view's camera [m]; NaN: not known. */
  HandEye(const HandEyeView& view, const std::vector<HandEyePose>& poses, double distance)
    : view_(view), known_distance_(distance)
  {
    const Eigen::Matrix3d inverse = view.k.inverse();
    for (const Eigen::Vector2d& corner : view.corners)
    {
      rays_.emplace_back(inverse * corner.homogeneous());
    }
    for (const HandEyePose& pose : poses)
    {
      Observation observation;
      observation.base_in_flange = pose.flange_in_base.inverse();
      observation.calibrated = calibratedHomography(pose.h, view.k, view.corners);
      for (int i = 0; i < CORNERS; ++i)
      {
        observation.corners.segment<2>(2 * i) =
            (view.k * observation.calibrated * rays_[static_cast<std::size_t>(i)]).hnormalized();
      }
      observations_.push_back(observation);
      decompositions_.push_back(decomposeHomography(pose.h, view.k, view.corners));
    }
  }

  std::size_t size() const
  {
    return observations_.size();
  }

  const Observation& observation(std::size_t i) const
  {
    return observations_[i];
  }

  /**
   * The direction of the plane on which most homographies agree, and the second best when it is another one: which of two
   * is true may be left open by the images, not by the arm.
   */
  std::vector<Eigen::Vector3d> normals() const
  {
    constexpr double FAR = 0.35;   // an angle beyond which homographies just disagree [rad]
    constexpr double SAME = 0.25;  // between two answers that are one [rad]
    struct Vote
    {
      Eigen::Vector3d normal;
      double cost;
    };
    std::vector<Vote> votes;
    for (const auto& candidates : decompositions_)
    {
      for (const EuclideanHomography& candidate : candidates)
      {
        if (!candidate.normal.allFinite())
        {
          continue;
        }
        double cost = 0.0;
        for (const auto& others : decompositions_)
        {
          double least = FAR;
          for (const EuclideanHomography& other : others)
          {
            if (other.normal.allFinite())
            {
              least = std::min(least, std::acos(std::clamp(candidate.normal.dot(other.normal), -1.0, 1.0)));
            }
          }
          cost += least;
        }
        votes.push_back({ candidate.normal, cost });
      }
    }
    std::stable_sort(votes.begin(), votes.end(), [](const Vote& a, const Vote& b) { return a.cost < b.cost; });
    std::vector<Eigen::Vector3d> result;
    for (const Vote& vote : votes)
    {
      if (result.empty() || (result.size() == 1 && result.front().dot(vote.normal) < std::cos(SAME)))
      {
        result.push_back(vote.normal);
      }
    }
    return result;
  }

  /**
   * The state from three poses and the plane's direction, in closed form. @return false when they do not tell it.
   */
  bool solve(const Indices& three, const std::vector<EuclideanHomography>& motions, State& state) const
  {
    std::vector<cv::Mat> rotations[2];
    std::vector<cv::Mat> translations[2];
    const auto append = [](const Eigen::Matrix3d& r, const Eigen::Vector3d& t, std::vector<cv::Mat>& rotation,
                           std::vector<cv::Mat>& translation) {
      cv::Mat matrix;
      cv::Mat vector;
      cv::eigen2cv(r, matrix);
      cv::eigen2cv(t, vector);
      rotation.push_back(matrix);
      translation.push_back(vector);
    };
    for (const std::size_t i : three)
    {
      const Eigen::Isometry3d flange = observations_[i].base_in_flange.inverse();
      append(flange.linear(), flange.translation(), rotations[0], translations[0]);
      append(motions[i].rotation, motions[i].translation_over_distance, rotations[1], translations[1]);
    }
    cv::Mat matrix;
    cv::Mat vector;
    try
    {
      // The rotation alone counts: it does not depend on the scale of translations, which is not known.
      cv::calibrateHandEye(rotations[0], translations[0], rotations[1], translations[1], matrix, vector,
                           cv::CALIB_HAND_EYE_HORAUD);
    }
    catch (const cv::Exception&)
    {
      return false;
    }
    Eigen::Matrix3d x;
    cv::cv2eigen(matrix, x);
    if (!x.allFinite())
    {
      return false;
    }
    x = nearestRotation(x);

    // (R_A - I) t_X - d R_X t_B = -t_A for each of the three motions.
    Eigen::Matrix<double, 9, 4> a;
    Eigen::Matrix<double, 9, 1> b;
    for (int row = 0; row < 3; ++row)
    {
      const std::size_t i = three[static_cast<std::size_t>(row)];
      const std::size_t k = three[static_cast<std::size_t>((row + 1) % 3)];
      const Eigen::Isometry3d motion = observations_[k].base_in_flange * observations_[i].base_in_flange.inverse();
      const Eigen::Vector3d way = motions[k].translation_over_distance - motions[k].rotation *
                                                                             motions[i].rotation.transpose() *
                                                                             motions[i].translation_over_distance;
      a.block<3, 3>(3 * row, 0) = motion.linear() - Eigen::Matrix3d::Identity();
      a.block<3, 1>(3 * row, 3) = -x * way;
      b.segment<3>(3 * row) = -motion.translation();
    }
    Eigen::Vector4d solution;
    if (std::isnan(known_distance_))
    {
      solution = solveSymmetric(Eigen::Matrix4d(a.transpose() * a), Eigen::Vector4d(a.transpose() * b));
    }
    else
    {
      const Eigen::Matrix<double, 9, 3> rotated = a.leftCols<3>();
      const Eigen::Matrix<double, 9, 1> rest = b - known_distance_ * a.col(3);
      solution << solveSymmetric(Eigen::Matrix3d(rotated.transpose() * rotated),
                                 Eigen::Vector3d(rotated.transpose() * rest)),
          known_distance_;
    }
    if (!solution.allFinite() || !(solution(3) > 0.0))
    {
      return false;
    }
    state.camera_in_flange = Eigen::Isometry3d::Identity();
    state.camera_in_flange.linear() = x;
    state.camera_in_flange.translation() = solution.head<3>();
    state.distance = solution(3);
    state.normal = motions[three.front()].normal;
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    for (const std::size_t i : three)
    {
      const Eigen::Isometry3d view = viewInBase(state, i, motions[i]);
      sum += view.linear();
      position += view.translation() / 3.0;
    }
    state.view_in_base = Eigen::Isometry3d::Identity();
    state.view_in_base.linear() = nearestRotation(sum);
    state.view_in_base.translation() = position;
    return state.view_in_base.matrix().allFinite();
  }

  /** Where the view's camera was, by one pose. */
  Eigen::Isometry3d viewInBase(const State& state, std::size_t i, const EuclideanHomography& motion) const
  {
    Eigen::Isometry3d camera_from_view = Eigen::Isometry3d::Identity();
    camera_from_view.linear() = motion.rotation;
    camera_from_view.translation() = motion.translation_over_distance * state.distance;
    return observations_[i].base_in_flange.inverse() * state.camera_in_flange * camera_from_view;
  }

  std::vector<EuclideanHomography> motionsBefore(const Eigen::Vector3d& normal) const
  {
    std::vector<EuclideanHomography> motions;
    for (const Observation& observation : observations_)
    {
      motions.push_back(motionBefore(observation.calibrated, normal));
    }
    return motions;
  }

  /** Where the view's corners should be, less where they are [px]. False when a corner is behind the camera. */
  bool errors(const State& state, std::size_t i, Errors& errors) const
  {
    const Eigen::Isometry3d camera_from_view =
        state.camera_in_flange.inverse() * observations_[i].base_in_flange * state.view_in_base;
    for (int corner = 0; corner < CORNERS; ++corner)
    {
      const Eigen::Vector3d& ray = rays_[static_cast<std::size_t>(corner)];
      const double facing = state.normal.dot(ray);
      const Eigen::Vector3d point = camera_from_view * Eigen::Vector3d(ray * (state.distance / facing));
      if (!(facing > 0.0) || !(point.z() > 0.0))
      {
        return false;
      }
      errors.segment<2>(2 * corner) = (view_.k * point).hnormalized() - observations_[i].corners.segment<2>(2 * corner);
    }
    return errors.allFinite();
  }

  /** Mean squared distance of a pose's corners from where they should be [px²]. */
  double squaredError(const State& state, std::size_t i) const
  {
    Errors difference;
    return errors(state, i, difference) ? difference.squaredNorm() / CORNERS : ENDLESS;
  }

  /**
   * Derivatives of errors() by the state, in the order of moved(), and by the flange's place and rotation along its own
   * axes [px per m or rad].
   */
  void linearize(const State& state, std::size_t i, Jacobian& by_state, ArmJacobian& by_arm) const
  {
    const Observation& observation = observations_[i];
    const Eigen::Matrix3d camera_from_flange = state.camera_in_flange.linear().transpose();
    const Eigen::Matrix3d camera_from_base = camera_from_flange * observation.base_in_flange.linear();
    const Eigen::Matrix<double, 3, 2> basis = squareTo(state.normal);
    for (int corner = 0; corner < CORNERS; ++corner)
    {
      const Eigen::Vector3d& ray = rays_[static_cast<std::size_t>(corner)];
      const double facing = state.normal.dot(ray);
      const Eigen::Vector3d in_view = ray * (state.distance / facing);
      const Eigen::Vector3d turned = state.view_in_base.linear() * in_view;
      const Eigen::Vector3d in_flange = observation.base_in_flange * (state.view_in_base * in_view);
      const Eigen::Vector3d in_camera = state.camera_in_flange.inverse() * in_flange;

      const Eigen::Vector3d pixel = view_.k * in_camera;
      Eigen::Matrix<double, 2, 3> projection;
      projection << view_.k.row(0) / pixel.z() - view_.k.row(2) * (pixel.x() / (pixel.z() * pixel.z())),
          view_.k.row(1) / pixel.z() - view_.k.row(2) * (pixel.y() / (pixel.z() * pixel.z()));

      Eigen::Matrix<double, 3, DOF> point;
      point.block<3, 3>(0, 0) = -camera_from_flange;
      point.block<3, 3>(0, 3) = camera_from_flange * crossMatrix(in_flange - state.camera_in_flange.translation());
      point.block<3, 3>(0, 6) = camera_from_base;
      point.block<3, 3>(0, 9) = -camera_from_base * crossMatrix(turned);
      point.block<3, 2>(0, 12) = -camera_from_base * turned * (ray.transpose() * basis) / facing;
      point.col(14) = camera_from_base * turned;
      by_state.middleRows<2>(2 * corner) = projection * point;

      Eigen::Matrix<double, 3, 6> moved;
      moved.leftCols<3>() = -camera_from_flange;
      moved.rightCols<3>() = camera_from_flange * crossMatrix(in_flange);
      by_arm.middleRows<2>(2 * corner) = projection * moved;
    }
  }

  /** Weight of distanceError(): with a known distance so large that it holds, else none. */
  double distanceWeight() const
  {
    constexpr double EXACT = 1e10;  // one over the square of 1e-5, for one pixel of error in images
    return std::isnan(known_distance_) ? 0.0 : EXACT;
  }
  /** Logarithm of the distance over the one that is known. */
  double distanceError(const State& state) const
  {
    return std::isnan(known_distance_) ? 0.0 : std::log(state.distance / known_distance_);
  }

private:
  const HandEyeView& view_;
  double known_distance_;
  std::vector<Eigen::Vector3d> rays_;  // of the view's corners, z = 1
  std::vector<Observation> observations_;
  std::vector<std::vector<EuclideanHomography>> decompositions_;
};

/**
 * For levenbergMarquardt(): errors of some poses, weighted. Steps: camera on flange, place [m] and rotation [rad] along the
 * flange's axes; view in base likewise; direction of the plane [rad]; logarithm of its distance.
 */
class Refinement
{
public:
  using State = view_servo::State;
  static constexpr int DOF = view_servo::DOF;

  /** @param whitening of all poses, so that whitened errors have a covariance of identity times some factor. */
  Refinement(const HandEye& hand_eye, const Indices& used, const std::vector<Square>& whitening)
    : hand_eye_(hand_eye), used_(used), whitening_(whitening)
  {
  }

  double cost(const State& state) const
  {
    double sum = hand_eye_.distanceWeight() * hand_eye_.distanceError(state) * hand_eye_.distanceError(state);
    for (const std::size_t i : used_)
    {
      Errors errors;
      if (!hand_eye_.errors(state, i, errors))
      {
        return ENDLESS;
      }
      sum += (whitening_[i] * errors).squaredNorm();
    }
    return sum;
  }

  void linearize(const State& state, Normal& jtj, Eigen::Matrix<double, DOF, 1>& gradient) const
  {
    jtj.setZero();
    gradient.setZero();
    jtj(14, 14) = hand_eye_.distanceWeight();
    gradient(14) = hand_eye_.distanceWeight() * hand_eye_.distanceError(state);
    for (const std::size_t i : used_)
    {
      Errors errors;
      Jacobian jacobian(ROWS, DOF);
      ArmJacobian by_arm(ROWS, 6);
      hand_eye_.errors(state, i, errors);
      hand_eye_.linearize(state, i, jacobian, by_arm);
      jacobian = whitening_[i] * jacobian;
      jtj += jacobian.transpose() * jacobian;
      gradient += jacobian.transpose() * (whitening_[i] * errors);
    }
  }

  static State moved(const State& state, const Eigen::Matrix<double, DOF, 1>& step)
  {
    State next = state;
    next.camera_in_flange.translation() += step.segment<3>(0);
    next.camera_in_flange.linear() = rotationFromVector(step.segment<3>(3)) * state.camera_in_flange.linear();
    next.view_in_base.translation() += step.segment<3>(6);
    next.view_in_base.linear() = rotationFromVector(step.segment<3>(9)) * state.view_in_base.linear();
    next.normal = (state.normal + squareTo(state.normal) * step.segment<2>(12)).normalized();
    next.distance = state.distance * std::exp(step(14));
    return next;
  }

private:
  const HandEye& hand_eye_;
  const Indices& used_;
  const std::vector<Square>& whitening_;
};

/** How large errors are, and what that means for a state. */
struct ErrorModel
{
  double ratio = 0.0;     // of the arm's error [rad] to that of images [px]
  double variance = 0.0;  // of images [px²]
  Normal inverse;         // of the normal equations' matrix: covariance of the state for a variance of 1
};

/** Covariance of a pose's errors, for one pixel of error in images. */
Square covarianceOf(const ArmJacobian& by_arm, double ratio, double lever)
{
  Eigen::Matrix<double, 6, 1> scale;
  scale << Eigen::Vector3d::Constant(ratio * lever), Eigen::Vector3d::Constant(ratio);
  const ArmJacobian scaled = by_arm * scale.asDiagonal();
  return Square::Identity(ROWS, ROWS) + scaled * scaled.transpose();
}

Square whiteningOf(const Square& covariance)
{
  const Eigen::LLT<Square> cholesky(covariance);
  return cholesky.matrixL().solve(Square::Identity(ROWS, ROWS));
}

/** The ratio of errors with the largest restricted likelihood (Patterson & Thompson 1971), tried out. */
ErrorModel errorModel(const HandEye& hand_eye, const State& state, const Indices& used, double lever)
{
  constexpr int TRIALS = 37;
  constexpr double LEAST = 1e-6;  // [rad/px]
  constexpr double STEP = 1.4;
  std::vector<Errors> errors(used.size());
  std::vector<Jacobian> jacobians(used.size(), Jacobian(ROWS, DOF));
  std::vector<ArmJacobian> by_arm(used.size(), ArmJacobian(ROWS, 6));
  for (std::size_t k = 0; k < used.size(); ++k)
  {
    hand_eye.errors(state, used[k], errors[k]);
    hand_eye.linearize(state, used[k], jacobians[k], by_arm[k]);
  }
  const double freedom = static_cast<double>(ROWS * used.size()) - DOF + (hand_eye.distanceWeight() > 0.0 ? 1.0 : 0.0);
  ErrorModel best;
  double best_likelihood = -ENDLESS;
  for (int trial = 0; trial < TRIALS; ++trial)
  {
    ErrorModel model;
    model.ratio = LEAST * std::pow(STEP, trial);
    Normal normal = Normal::Zero();
    normal(14, 14) = hand_eye.distanceWeight();
    Eigen::Matrix<double, DOF, 1> gradient = Eigen::Matrix<double, DOF, 1>::Zero();
    double squares = 0.0;
    double logarithms = 0.0;
    for (std::size_t k = 0; k < used.size(); ++k)
    {
      const Square whitening = whiteningOf(covarianceOf(by_arm[k], model.ratio, lever));
      const Jacobian jacobian = whitening * jacobians[k];
      const Errors white = whitening * errors[k];
      normal += jacobian.transpose() * jacobian;
      gradient += jacobian.transpose() * white;
      squares += white.squaredNorm();
      logarithms -= 2.0 * whitening.diagonal().array().log().sum();
    }
    const Eigen::LDLT<Normal> solver(normal);
    squares -= gradient.dot(solver.solve(gradient));
    model.variance = std::max(squares, 1e-16) / freedom;
    logarithms += solver.vectorD().array().max(1e-300).log().sum();
    const double likelihood = -freedom * std::log(model.variance) - logarithms;
    if (likelihood > best_likelihood)
    {
      best_likelihood = likelihood;
      model.inverse = solver.solve(Normal::Identity());
      best = model;
    }
  }
  return best;
}

std::vector<Square> whiteningOf(const HandEye& hand_eye, const State& state, double ratio, double lever)
{
  std::vector<Square> result;
  for (std::size_t i = 0; i < hand_eye.size(); ++i)
  {
    Jacobian by_state(ROWS, DOF);
    ArmJacobian by_arm(ROWS, 6);
    hand_eye.linearize(state, i, by_state, by_arm);
    result.push_back(whiteningOf(covarianceOf(by_arm, ratio, lever)));
  }
  return result;
}

/**
 * How far each pose is from what the others say, squared, in units that are the same for all: errors that a pose would have
 * had it not been used, against the covariance of these.
 */
std::vector<double> disagreements(const HandEye& hand_eye, const State& state, const Indices& used,
                                  const ErrorModel& model, double lever)
{
  std::vector<double> result;
  for (std::size_t i = 0; i < hand_eye.size(); ++i)
  {
    Errors errors;
    if (!hand_eye.errors(state, i, errors))
    {
      result.push_back(ENDLESS);
      continue;
    }
    Jacobian jacobian(ROWS, DOF);
    ArmJacobian by_arm(ROWS, 6);
    hand_eye.linearize(state, i, jacobian, by_arm);
    const Square whitening = whiteningOf(covarianceOf(by_arm, model.ratio, lever));
    jacobian = whitening * jacobian;
    errors = whitening * errors;
    const bool is_used = std::find(used.begin(), used.end(), i) != used.end();
    const Square leverage = jacobian * model.inverse * jacobian.transpose();
    const Square covariance =
        is_used ? Square(Square::Identity(ROWS, ROWS) - leverage) : Square(Square::Identity(ROWS, ROWS) + leverage);
    result.push_back(std::max(0.0, errors.dot(covariance.ldlt().solve(errors))));
  }
  return result;
}

/** The poses with the smallest errors. */
Indices best(const HandEye& hand_eye, const State& state, std::size_t count)
{
  std::vector<double> errors;
  for (std::size_t i = 0; i < hand_eye.size(); ++i)
  {
    errors.push_back(hand_eye.squaredError(state, i));
  }
  Indices order(hand_eye.size());
  std::iota(order.begin(), order.end(), std::size_t{ 0 });
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return errors[a] < errors[b]; });
  order.resize(std::min(count, order.size()));
  return order;
}

/** Squared errors of the poses with the smallest ones. */
double trimmedCost(const HandEye& hand_eye, const State& state, std::size_t count)
{
  std::vector<double> errors;
  for (std::size_t i = 0; i < hand_eye.size(); ++i)
  {
    errors.push_back(hand_eye.squaredError(state, i));
  }
  std::sort(errors.begin(), errors.end());
  return std::accumulate(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(count), 0.0);
}

constexpr int ITERATIONS = 50;

/**
 * The state that suits a part of the poses best (least trimmed squares: Rousseeuw 1984), from closed forms of triples.
 * @return whether there is one.
 */
bool robustStart(const HandEye& hand_eye, std::size_t count, State& start)
{
  constexpr std::size_t MOST_TRIPLES = 400;
  constexpr std::size_t REFINED = 3;
  constexpr int ROUNDS = 3;
  struct Candidate
  {
    State state;
    double cost;
  };
  const std::size_t n = hand_eye.size();
  const std::size_t stride = n * (n - 1) * (n - 2) / 6 / MOST_TRIPLES + 1;
  const std::vector<Square> plain(n, Square::Identity(ROWS, ROWS));
  double best_cost = ENDLESS;
  for (const Eigen::Vector3d& normal : hand_eye.normals())
  {
    const std::vector<EuclideanHomography> motions = hand_eye.motionsBefore(normal);
    std::vector<Candidate> candidates;
    std::size_t number = 0;
    for (std::size_t i = 0; i < n; ++i)
    {
      for (std::size_t k = i + 1; k < n; ++k)
      {
        for (std::size_t l = k + 1; l < n; ++l)
        {
          State state;
          if (number++ % stride == 0 && hand_eye.solve({ i, k, l }, motions, state))
          {
            candidates.push_back({ state, trimmedCost(hand_eye, state, count) });
          }
        }
      }
    }
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
    candidates.resize(std::min(candidates.size(), REFINED));
    for (Candidate& candidate : candidates)
    {
      for (int round = 0; round < ROUNDS && std::isfinite(candidate.cost); ++round)
      {
        const Indices used = best(hand_eye, candidate.state, count);
        levenbergMarquardt(Refinement(hand_eye, used, plain), candidate.state, ITERATIONS);
        candidate.cost = trimmedCost(hand_eye, candidate.state, count);
      }
      if (candidate.cost < best_cost)
      {
        best_cost = candidate.cost;
        start = candidate.state;
      }
    }
  }
  return std::isfinite(best_cost);
}

/**
 * Refines a state by the poses that agree. @param used those that agree, in ascending order. @return empty, or why the
 * poses do not tell it.
 */
std::string refine(const HandEye& hand_eye, double lever, State& state, Indices& used, ErrorModel& model)
{
  constexpr int ROUNDS = 12;
  constexpr double TOO_FAR = 5.0;  // times the median disagreement, beyond which a pose disagrees; chance has 1 in 10^5
  constexpr double LEAST = ROWS * 0.02 * 0.02;  // so little disagreement means nothing [px²]
  std::vector<Indices> before;
  while (std::find(before.begin(), before.end(), used) == before.end() && before.size() < ROUNDS)
  {
    before.push_back(used);
    model = errorModel(hand_eye, state, used, lever);
    const std::vector<Square> whitening = whiteningOf(hand_eye, state, model.ratio, lever);
    levenbergMarquardt(Refinement(hand_eye, used, whitening), state, ITERATIONS);
    model = errorModel(hand_eye, state, used, lever);
    const std::vector<double> all = disagreements(hand_eye, state, used, model, lever);
    std::vector<double> of_used;
    for (const std::size_t i : used)
    {
      of_used.push_back(all[i]);
    }
    const double limit = std::max(TOO_FAR * medianOfSome(of_used), LEAST);
    used.clear();
    for (std::size_t i = 0; i < all.size(); ++i)
    {
      if (all[i] <= limit)
      {
        used.push_back(i);
      }
    }
    if (used.size() < LEAST_POSES || 2 * used.size() < all.size())
    {
      return "the poses contradict one another: fewer than half of them agree on one mounting of the camera; check "
             "that "
             "the frames are right, and that the view's plane has not been moved";
    }
  }
  used = before.back();
  return "";
}

double sigmaOf(const Eigen::Matrix3d& covariance)
{
  return std::sqrt(std::max(0.0, singularValues(covariance).values(0)));
}

HandEyeMotion motionOf(const HandEye& hand_eye, const std::vector<HandEyePose>& poses, const Eigen::Vector3d& normal)
{
  constexpr double SAME_PLACE = 0.01;          // [m]
  constexpr double SAME_TURN = 2.0 / DEGREES;  // [rad]
  HandEyeMotion motion;
  std::vector<const HandEyePose*> different;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  std::vector<Eigen::Vector3d> turns;
  for (const HandEyePose& pose : poses)
  {
    bool is_new = true;
    for (const HandEyePose* other : different)
    {
      const Eigen::Isometry3d way = other->flange_in_base.inverse() * pose.flange_in_base;
      is_new = is_new && (way.translation().norm() > SAME_PLACE || angleOf(way.linear()) > SAME_TURN);
    }
    if (is_new)
    {
      for (const HandEyePose* other : different)
      {
        turns.push_back(rotationVector(other->flange_in_base.linear().transpose() * pose.flange_in_base.linear()));
        scatter += turns.back() * turns.back().transpose();
      }
      different.push_back(&pose);
    }
  }
  motion.poses = static_cast<int>(different.size());
  const Eigen::Vector3d axis = singularValues(scatter).u.col(0);
  for (const Eigen::Vector3d& turn : turns)
  {
    motion.rotation = std::max(motion.rotation, std::abs(turn.dot(axis)));
    motion.second_rotation = std::max(motion.second_rotation, (turn - axis * turn.dot(axis)).norm());
  }
  if (!normal.allFinite())
  {
    motion.travel = NONE;
    return motion;
  }
  std::vector<Eigen::Vector3d> places;
  for (const EuclideanHomography& homography : hand_eye.motionsBefore(normal))
  {
    places.push_back(-homography.rotation.transpose() * homography.translation_over_distance);
    for (const Eigen::Vector3d& place : places)
    {
      motion.travel = std::max(motion.travel, (place - places.back()).norm());
    }
  }
  return motion;
}

HandEyeMotion motionOf(const HandEye& hand_eye, const std::vector<HandEyePose>& poses)
{
  const std::vector<Eigen::Vector3d> normals = hand_eye.normals();
  return motionOf(hand_eye, poses,
                  normals.empty() ? Eigen::Vector3d(Eigen::Vector3d::Constant(NONE)) : normals.front());
}

/** Lines as one, for a message. */
std::string joined(const std::vector<std::string>& lines)
{
  std::string text;
  for (const std::string& line : lines)
  {
    text += (text.empty() ? "" : "; ") + line;
  }
  return text;
}

std::vector<HandEyeResidual> residualsOf(const HandEye& hand_eye, const State& state, const Indices& used)
{
  std::vector<HandEyeResidual> residuals;
  const std::vector<EuclideanHomography> motions = hand_eye.motionsBefore(state.normal);
  for (std::size_t i = 0; i < hand_eye.size(); ++i)
  {
    const Eigen::Isometry3d camera_by_arm =
        state.view_in_base.inverse() * hand_eye.observation(i).base_in_flange.inverse() * state.camera_in_flange;
    const Eigen::Vector3d by_image =
        -motions[i].rotation.transpose() * motions[i].translation_over_distance * state.distance;
    HandEyeResidual residual;
    residual.used = std::find(used.begin(), used.end(), i) != used.end();
    residual.pixels = std::sqrt(hand_eye.squaredError(state, i));
    residual.translation = (camera_by_arm.translation() - by_image).norm();
    residual.rotation = angleOf(camera_by_arm.linear() * motions[i].rotation);
    residuals.push_back(residual);
  }
  return residuals;
}

/** What makes a result more certain. */
std::string remedyFor(const HandEyeResult& result)
{
  constexpr double ALONG = 0.8;  // cosine of the angle to an axis
  const Eigen::Vector3d weakest = singularValues(result.covariance.topLeftCorner<3, 3>()).u.col(0);
  // Poses around one point, at one distance from it, do not tell the distance from how far back the camera is mounted.
  return std::abs(weakest.dot(result.camera_in_flange.linear().col(2))) > ALONG
             ? "most of it along the camera's axis: add poses nearer to the plane and farther away, and poses beside "
               "each other "
               "without a turn between them, or tell the distance of the plane"
             : "add poses with larger turns about two axes";
}

}  // namespace

double HandEyeResult::translationSigma() const
{
  return sigmaOf(covariance.topLeftCorner<3, 3>());
}

double HandEyeResult::rotationSigma() const
{
  return sigmaOf(covariance.bottomRightCorner<3, 3>());
}

HandEyeMotion handEyeMotion(const HandEyeView& view, const std::vector<HandEyePose>& poses)
{
  check(view, poses);
  return motionOf(HandEye(view, poses, NONE), poses);
}

std::vector<std::string> missingMotion(const HandEyeMotion& motion, const HandEyeParams& params)
{
  std::vector<std::string> lines;
  const int least = std::max(params.min_poses, LEAST_POSES);
  if (motion.poses < least)
  {
    lines.push_back("there are " + std::to_string(motion.poses) + " different poses: " + std::to_string(least) +
                    " are needed, 1 cm or 2 degrees from one another");
  }
  if (motion.rotation < params.min_rotation)
  {
    lines.push_back("the flange was turned by " + rounded(motion.rotation * DEGREES) + " degrees at most: turn it by " +
                    rounded(params.min_rotation * DEGREES, 0) + " or more, about the camera's axis, say");
  }
  else if (motion.second_rotation < params.min_second_rotation)
  {
    lines.push_back("the flange was turned about one axis only (" + rounded(motion.second_rotation * DEGREES) +
                    " degrees about others): turn it about another axis, too, by " +
                    rounded(params.min_second_rotation * DEGREES, 0) +
                    " degrees or more, so that the plane is seen from aside");
  }
  if (!(motion.travel >= params.min_travel))
  {
    lines.push_back((std::isfinite(motion.travel) ? "the camera moved by " + rounded(100.0 * motion.travel, 0) +
                                                        " % of its distance from the plane"
                                                  : std::string("the images do not show that the camera moved")) +
                    ": move it by " + rounded(100.0 * params.min_travel, 0) + " % or more");
  }
  return lines;
}

HandEyeResult calibrateHandEye(const HandEyeView& view, const std::vector<HandEyePose>& poses,
                               const HandEyeParams& params)
{
  constexpr double PART = 0.6;        // of the poses, which the start has to suit
  constexpr double CLEARLY = 3.0;     // times the typical error, beyond which a pose is left out at the start
  constexpr double CONSISTENT = 1.5;  // a normal distribution's standard deviation over its median error, about
  constexpr double LEAST = 0.1;       // errors that are none at the start [px]
  check(view, poses);
  if (!std::isnan(params.distance) && !(params.distance > 0.0 && std::isfinite(params.distance)))
  {
    throw std::invalid_argument("the distance of the plane has to be above 0");
  }
  const HandEye hand_eye(view, poses, params.distance);
  HandEyeResult result;
  result.residuals.resize(poses.size());
  result.motion = motionOf(hand_eye, poses);
  result.missing = missingMotion(result.motion, params);
  if (!result.missing.empty())
  {
    result.message = "too little motion: " + joined(result.missing);
    return result;
  }

  State state;
  const auto count = static_cast<std::size_t>(std::ceil(PART * static_cast<double>(poses.size())));
  if (!robustStart(hand_eye, count, state))
  {
    result.message =
        "the motions of arm and images do not fit one another for any mounting of the camera; check that the "
        "frames are right";
    return result;
  }
  std::vector<double> errors;
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    errors.push_back(std::sqrt(hand_eye.squaredError(state, i)));
  }
  const double limit = CLEARLY * std::max(CONSISTENT * medianOfSome(errors), LEAST);
  Indices used;
  for (std::size_t i = 0; i < poses.size(); ++i)
  {
    if (errors[i] <= limit)
    {
      used.push_back(i);
    }
  }
  ErrorModel model;
  result.message = refine(hand_eye, params.arm_lever, state, used, model);
  result.residuals = residualsOf(hand_eye, state, used);
  if (!result.message.empty())
  {
    return result;
  }

  std::vector<HandEyePose> agreeing;
  for (const std::size_t i : used)
  {
    agreeing.push_back(poses[i]);
  }
  result.camera_in_flange = state.camera_in_flange;
  result.view_in_base = state.view_in_base;
  result.normal = state.normal;
  result.distance = state.distance;
  const Normal covariance = model.variance * model.inverse;
  result.covariance = covariance.topLeftCorner<6, 6>();
  result.distance_sigma = state.distance * std::sqrt(covariance(14, 14));
  result.image_error = std::sqrt(model.variance);
  result.rotation_error = model.ratio * result.image_error;
  result.translation_error = params.arm_lever * result.rotation_error;
  result.motion = motionOf(HandEye(view, agreeing, NONE), agreeing, state.normal);
  result.missing = missingMotion(result.motion, params);
  if (!result.missing.empty())
  {
    result.message = "too little motion, without the poses that disagree: " + joined(result.missing);
    return result;
  }
  if (!(result.translationSigma() <= params.max_translation_sigma) ||
      !(result.rotationSigma() <= params.max_rotation_sigma))
  {
    result.missing.push_back("the result is uncertain by " + rounded(1e3 * result.translationSigma()) + " mm and " +
                             rounded(DEGREES * result.rotationSigma(), 2) + " degrees (standard deviation), " +
                             remedyFor(result));
    result.message = result.missing.back();
    return result;
  }
  result.found = true;
  return result;
}

}  // namespace view_servo
