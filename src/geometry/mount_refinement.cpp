// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "mount_refinement.h"

#include "decompositions.h"
#include "levenberg_marquardt.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace view_servo::mount
{
namespace
{
using hand_eye::CORNERS;
using hand_eye::ENDLESS;
using hand_eye::ROWS;

/** The columns of Problem::linearize() that a base on a floor has. */
Eigen::MatrixXd onFloor(const Eigen::MatrixXd& by_state, const Eigen::MatrixXd& by_arm)
{
  Eigen::MatrixXd columns(ROWS, SHARED + PER_POSE);
  columns << by_state.leftCols(2), by_state.middleCols(3, SHARED - 2), by_arm.leftCols(2), by_arm.rightCols(1);
  return columns;
}

hand_eye::State movedState(const hand_eye::State& state, const Eigen::VectorXd& step)
{
  Eigen::VectorXd all(hand_eye::DOF);
  all << step.head(2), 0.0, step.segment(2, SHARED - 2), 0.0;
  return hand_eye::moved(state, all);
}

/** For levenbergMarquardt(): errors of images and odometry. The first pose of the base stays where it is. */
class MountFit
{
public:
  using State = Estimate;
  static constexpr int DOF = Eigen::Dynamic;

  MountFit(const Problem& problem, const Selection& selection)
    : problem_(problem), selection_(selection), columns_(problem.size(), NO_COLUMN)
  {
    for (std::size_t k = 1; k < selection.poses.size(); ++k)
    {
      columns_[selection.poses[k]] = SHARED + PER_POSE * (static_cast<int>(k) - 1);
    }
    size_ = SHARED + PER_POSE * (static_cast<int>(selection.poses.size()) - 1);
  }

  double cost(const Estimate& estimate) const
  {
    const Sums sums = sumsOf(estimate);
    const Sigmas& sigmas = selection_.sigmas;
    double cost = sums.image / (sigmas.image * sigmas.image);
    for (std::size_t part = 0; part < PARTS; ++part)
    {
      cost += sums.legs[part] / (sigmas.legs[part] * sigmas.legs[part]);
    }
    return cost;
  }

  /**
   * Squared errors: of images [px²], and of legs in their standard deviations; and how many of the latter there are.
   */
  struct Sums
  {
    double image = 0.0;
    std::array<double, PARTS> legs = {};
    std::array<std::size_t, PARTS> counts = {};
  };
  Sums sumsOf(const Estimate& estimate) const
  {
    Sums sums;
    for (const std::size_t i : selection_.poses)
    {
      Eigen::VectorXd errors;
      const bool seen = problem_.errors(estimate.state, i, inSpace(estimate.bases[i]).inverse(), errors);
      sums.image += seen ? errors.squaredNorm() : ENDLESS;
    }
    for (const Leg& leg : selection_.legs)
    {
      const Eigen::Vector3d error = legError(leg, estimate.bases[leg.from], estimate.bases[leg.to]);
      const Part place = leg.on_the_spot ? SPOT : WAY;
      sums.legs[place] += error.head<2>().squaredNorm();
      sums.counts[place] += 2;
      sums.legs[TURN] += error.z() * error.z();
      ++sums.counts[TURN];
    }
    return sums;
  }

  /** Sums of Jᵀ J and Jᵀ e of all images [1/px²]. */
  void addImages(const Estimate& estimate, double weight, Eigen::MatrixXd& jtj, Eigen::VectorXd& gradient) const
  {
    for (const std::size_t i : selection_.poses)
    {
      const Eigen::Isometry3d odom_in_base = inSpace(estimate.bases[i]).inverse();
      Eigen::VectorXd errors;
      Eigen::MatrixXd by_state;
      Eigen::MatrixXd by_arm;
      problem_.errors(estimate.state, i, odom_in_base, errors);
      problem_.linearize(estimate.state, odom_in_base, by_state, by_arm);
      std::vector<int> places(SHARED);
      for (int column = 0; column < SHARED; ++column)
      {
        places[static_cast<std::size_t>(column)] = column;
      }
      appendPlaces(i, places);
      add(onFloor(by_state, by_arm), errors, weight, places, jtj, gradient);
    }
  }

  /** Likewise of a part of the legs. */
  void addLegs(const Estimate& estimate, Part part, double weight, Eigen::MatrixXd& jtj,
               Eigen::VectorXd& gradient) const
  {
    for (const Leg& leg : selection_.legs)
    {
      if (part != TURN && leg.on_the_spot != (part == SPOT))
      {
        continue;
      }
      Eigen::MatrixXd by_from;
      Eigen::MatrixXd by_to;
      const Eigen::Vector3d error = legError(leg, estimate.bases[leg.from], estimate.bases[leg.to], &by_from, &by_to);
      std::vector<int> places;
      appendPlaces(leg.from, places);
      appendPlaces(leg.to, places);
      Eigen::MatrixXd both(PER_POSE, 2 * PER_POSE);
      both << by_from, by_to;
      const int first = part == TURN ? 2 : 0;
      const int rows = part == TURN ? 1 : 2;
      add(both.middleRows(first, rows), error.segment(first, rows), weight, places, jtj, gradient);
    }
  }

  void linearize(const Estimate& estimate, Eigen::MatrixXd& jtj, Eigen::VectorXd& gradient) const
  {
    const Sigmas& sigmas = selection_.sigmas;
    jtj.setZero(size_, size_);
    gradient.setZero(size_);
    addImages(estimate, 1.0 / (sigmas.image * sigmas.image), jtj, gradient);
    for (const Part part : { WAY, SPOT, TURN })
    {
      addLegs(estimate, part, 1.0 / (sigmas.legs[part] * sigmas.legs[part]), jtj, gradient);
    }
  }

  Estimate moved(const Estimate& estimate, const Eigen::VectorXd& step) const
  {
    Estimate next = estimate;
    next.state = movedState(estimate.state, step.head(SHARED));
    for (const std::size_t i : selection_.poses)
    {
      if (columns_[i] != NO_COLUMN)
      {
        const Eigen::VectorXd own = step.segment(columns_[i], PER_POSE);
        next.bases[i] = compose(estimate.bases[i], { own(0), own(1), own(2) });
      }
    }
    return next;
  }

  int size() const
  {
    return size_;
  }

private:
  static constexpr int NO_COLUMN = -1;

  void appendPlaces(std::size_t pose, std::vector<int>& places) const
  {
    for (int k = 0; k < PER_POSE; ++k)
    {
      places.push_back(columns_[pose] == NO_COLUMN ? NO_COLUMN : columns_[pose] + k);
    }
  }

  /** @param places of the jacobian's columns in the sums. */
  static void add(const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& errors, double weight,
                  const std::vector<int>& places, Eigen::MatrixXd& jtj, Eigen::VectorXd& gradient)
  {
    const Eigen::MatrixXd transposed = jacobian.transpose();
    const Eigen::MatrixXd square = product(transposed, jacobian);
    const Eigen::VectorXd right = applied(transposed, errors);
    for (std::size_t row = 0; row < places.size(); ++row)
    {
      if (places[row] == NO_COLUMN)
      {
        continue;
      }
      const auto r = static_cast<Eigen::Index>(row);
      gradient(places[row]) += weight * right(r);
      for (std::size_t column = 0; column < places.size(); ++column)
      {
        if (places[column] != NO_COLUMN)
        {
          jtj(places[row], places[column]) += weight * square(r, static_cast<Eigen::Index>(column));
        }
      }
    }
  }

  const Problem& problem_;
  const Selection& selection_;
  std::vector<int> columns_;  // of each pose among the unknowns
  int size_;
};

/** For levenbergMarquardt(): where the base is by one image, all else given. */
class BaseFit
{
public:
  using State = PlanarPose;
  static constexpr int DOF = Eigen::Dynamic;

  BaseFit(const Problem& problem, const hand_eye::State& state, std::size_t pose)
    : problem_(problem), state_(state), pose_(pose)
  {
  }

  double cost(const PlanarPose& base) const
  {
    Eigen::VectorXd errors;
    return problem_.errors(state_, pose_, inSpace(base).inverse(), errors) ? errors.squaredNorm() : ENDLESS;
  }

  void linearize(const PlanarPose& base, Eigen::MatrixXd& jtj, Eigen::VectorXd& gradient) const
  {
    Eigen::VectorXd errors;
    Eigen::MatrixXd by_state;
    Eigen::MatrixXd by_arm;
    problem_.errors(state_, pose_, inSpace(base).inverse(), errors);
    problem_.linearize(state_, inSpace(base).inverse(), by_state, by_arm);
    const Eigen::MatrixXd transposed = onFloor(by_state, by_arm).rightCols(PER_POSE).transpose();
    jtj = product(transposed, transposed.transpose());
    gradient = applied(transposed, errors);
  }

  static PlanarPose moved(const PlanarPose& base, const Eigen::VectorXd& step)
  {
    return compose(base, { step(0), step(1), step(2) });
  }

private:
  const Problem& problem_;
  const hand_eye::State& state_;
  std::size_t pose_;
};

/** Moves each base to where its image has it. @return the squared errors that remain [px²]. */
std::vector<double> imageErrors(const Problem& problem, Estimate& estimate)
{
  constexpr int ITERATIONS = 20;
  const std::vector<EuclideanHomography> motions = problem.motionsBefore(estimate.state.normal);
  std::vector<double> errors;
  for (std::size_t i = 0; i < problem.size(); ++i)
  {
    const BaseFit by_image(problem, estimate.state, i);
    const PlanarPose start = baseByImage(estimate.state, motions[i]);
    PlanarPose& base = estimate.bases[i];
    base = by_image.cost(start) < by_image.cost(base) ? start : base;
    levenbergMarquardt(by_image, base, ITERATIONS);
    errors.push_back(by_image.cost(base));
  }
  return errors;
}

/** Estimates the sigmas anew from the errors of what is selected, and the covariance with them. */
void estimateSigmas(const Problem& problem, const Estimate& estimate, Selection& selection)
{
  constexpr double LEAST_IMAGE = 1e-4;  // [px]
  constexpr double LEAST_FACTOR = 1e-3;
  constexpr double LEAST_FREEDOM = 1.0;
  const MountFit fitted(problem, selection);
  const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(fitted.size(), fitted.size());
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(fitted.size());
  Eigen::MatrixXd image = none;
  std::array<Eigen::MatrixXd, PARTS> legs = { { none, none, none } };
  Sigmas& sigmas = selection.sigmas;
  fitted.addImages(estimate, 1.0 / (sigmas.image * sigmas.image), image, gradient);
  Eigen::MatrixXd all = image;
  for (const Part part : { WAY, SPOT, TURN })
  {
    fitted.addLegs(estimate, part, 1.0 / (sigmas.legs[part] * sigmas.legs[part]), legs[part], gradient);
    all += legs[part];
  }
  selection.covariance = SymmetricDecomposition(all).inverse();
  const MountFit::Sums sums = fitted.sumsOf(estimate);
  const auto sigma = [&](double squares, std::size_t count, const Eigen::MatrixXd& part, double least) {
    // The part of the errors' number that the estimate does not take up.
    const double freedom = static_cast<double>(count) - selection.covariance.cwiseProduct(part).sum();
    return std::max(least, std::sqrt(squares / std::max(freedom, LEAST_FREEDOM)));
  };
  sigmas.image = sigma(sums.image, ROWS * selection.poses.size(), image, LEAST_IMAGE);
  for (const Part part : { WAY, SPOT, TURN })
  {
    if (sums.counts[part] > 0)
    {
      sigmas.legs[part] = sigma(sums.legs[part], sums.counts[part], legs[part], LEAST_FACTOR);
    }
  }
}

/** A limit above which values are no longer those of the same distribution as most. */
double limitOf(const std::vector<double>& values, double times, double least)
{
  return values.empty() ? least : std::max(times * hand_eye::medianOf(values), least);
}

/** The legs that contradict the images go from `legs` to `refused`. */
void refuseLegs(const Estimate& estimate, std::vector<Leg>& legs, std::vector<Leg>& refused)
{
  // Times the median, beyond which normally distributed errors are once in 4000.
  constexpr double FAR_WAY = 12.0;
  constexpr double FAR_TURN = 30.0;
  constexpr double LEAST =
      2.0;  // so little means nothing: on some ways, such as turns on the spot, there is hardly an error
  std::array<std::vector<double>, PARTS> squares;
  for (const Leg& leg : legs)
  {
    const Eigen::Vector3d error = legError(leg, estimate.bases[leg.from], estimate.bases[leg.to]);
    squares[leg.on_the_spot ? SPOT : WAY].push_back(error.head<2>().squaredNorm());
    squares[TURN].push_back(error.z() * error.z());
  }
  const std::array<double, PARTS> limits = { { limitOf(squares[WAY], FAR_WAY, LEAST),
                                               limitOf(squares[SPOT], FAR_WAY, LEAST),
                                               limitOf(squares[TURN], FAR_TURN, LEAST) } };
  std::vector<Leg> kept;
  for (const Leg& leg : legs)
  {
    const Eigen::Vector3d error = legError(leg, estimate.bases[leg.from], estimate.bases[leg.to]);
    const bool fits =
        error.head<2>().squaredNorm() <= limits[leg.on_the_spot ? SPOT : WAY] && error.z() * error.z() <= limits[TURN];
    (fits ? kept : refused).push_back(leg);
  }
  legs = kept;
}

/** The poses whose images agree with the estimate. @param errors as imageErrors() has them. */
Indices agreeing(const std::vector<double>& errors, const Indices& used)
{
  constexpr double TOO_FAR = 6.0;               // times the median; chance has 1 in 10^4
  constexpr double LEAST = ROWS * 0.03 * 0.03;  // so little error means nothing [px²]
  std::vector<double> of_used;
  for (const std::size_t i : used)
  {
    of_used.push_back(errors[i]);
  }
  const double limit = limitOf(of_used, TOO_FAR, LEAST);
  Indices result;
  for (std::size_t i = 0; i < errors.size(); ++i)
  {
    if (errors[i] <= limit)
    {
      result.push_back(i);
    }
  }
  return result;
}

/**
 * The poses between two legs that are both refused: odometry has the base elsewhere there, and before and after it has
 * not.
 */
Indices misplaced(const std::vector<Leg>& refused)
{
  Indices result;
  for (const Leg& before : refused)
  {
    for (const Leg& after : refused)
    {
      if (before.to == after.from)
      {
        result.push_back(before.to);
      }
    }
  }
  return result;
}

bool contains(const Indices& indices, std::size_t i)
{
  return std::find(indices.begin(), indices.end(), i) != indices.end();
}

/** Why what is selected tells nothing; empty when it does. @param count of all poses. */
std::string contradiction(const Selection& selection, std::size_t count)
{
  if (selection.poses.size() < hand_eye::LEAST_POSES || 2 * selection.poses.size() < count)
  {
    return "the poses contradict one another: fewer than half of them agree on one mounting of the camera; check "
           "that the frames are right, and that the view's plane has not been moved";
  }
  if (2 * selection.legs.size() < selection.poses.size())
  {
    return "odometry contradicts the images on more than half of the ways between poses; check that the frame of "
           "odometry is right, and that the wheels do not slip";
  }
  return "";
}

}  // namespace

void fit(const Problem& problem, const Selection& selection, Estimate& estimate)
{
  constexpr int ITERATIONS = 50;
  levenbergMarquardt(MountFit(problem, selection), estimate, ITERATIONS);
}

double costOf(const Problem& problem, const std::vector<Leg>& legs, Estimate& estimate)
{
  constexpr double LARGE = 16.0;
  const Sigmas sigmas;
  double sum = 0.0;
  for (const double error : imageErrors(problem, estimate))
  {
    sum += std::min(LARGE * CORNERS, error / (sigmas.image * sigmas.image));
  }
  for (const Leg& leg : legs)
  {
    sum += std::min(LARGE, legError(leg, estimate.bases[leg.from], estimate.bases[leg.to]).squaredNorm());
  }
  return sum;
}

std::string refine(const Problem& problem, const std::vector<PlanarPose>& odometry, const MountParams& params,
                   Estimate& estimate, Selection& selection)
{
  constexpr int ROUNDS = 12;
  constexpr int PASSES = 4;  // of the estimate of sigmas, which depends on the weights by the last one
  using Choice = std::pair<Indices, Indices>;  // poses, and those at the ends of refused legs
  std::vector<Choice> before;
  Indices elsewhere;  // poses at which odometry is wrong
  while (true)
  {
    selection.legs = legsBetween(selection.poses, odometry, params);
    selection.refused.clear();
    refuseLegs(estimate, selection.legs, selection.refused);
    if (const Indices now = misplaced(selection.refused); !now.empty())
    {
      elsewhere.push_back(now.front());  // the first of them only: without it the next one may be right
      selection.poses.erase(std::find(selection.poses.begin(), selection.poses.end(), now.front()));
      continue;
    }
    if (std::string fault = contradiction(selection, problem.size()); !fault.empty())
    {
      return fault;
    }
    Choice choice{ selection.poses, {} };
    for (const Leg& leg : selection.refused)
    {
      choice.second.push_back(leg.to);
    }
    if (!before.empty() && choice == before.back())
    {
      return "";
    }
    const bool last = before.size() == ROUNDS || std::find(before.begin(), before.end(), choice) != before.end();
    before.push_back(choice);
    for (int pass = 0; pass < PASSES; ++pass)
    {
      fit(problem, selection, estimate);
      estimateSigmas(problem, estimate, selection);
    }
    if (last)
    {
      return "";
    }
    Estimate by_images = estimate;
    Indices next;
    for (const std::size_t i : agreeing(imageErrors(problem, by_images), selection.poses))
    {
      if (!contains(elsewhere, i))
      {
        estimate.bases[i] = contains(selection.poses, i) ? estimate.bases[i] : by_images.bases[i];
        next.push_back(i);
      }
    }
    selection.poses = next;
  }
}

}  // namespace view_servo::mount
