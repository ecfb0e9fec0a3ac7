// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/place_watch.h"

#include "view_servo/geometry/rotation_vector.h"

#include <algorithm>
#include <limits>

namespace view_servo
{
namespace
{
constexpr double NEVER = std::numeric_limits<double>::infinity();

/**
 * How far a motion that is seen goes along one that is known, as a part of the latter; neither has to be exact in
 * length.
 */
double alongPart(const Eigen::Vector3d& known, const Eigen::Vector3d& seen)
{
  return seen.dot(known) / known.squaredNorm();
}
}  // namespace

void PlaceWatch::restart(const Eigen::Isometry3d& place)
{
  last_.reset();
  believed_ = place;
}

void PlaceWatch::doubt()
{
  trusted_ = false;
  is_new_ = true;
}

void PlaceWatch::interrupt()
{
  interrupted_ = true;
}

Eigen::Isometry3d PlaceWatch::placeOf(const Sight& sight, double unit)
{
  Eigen::Isometry3d view_in_camera = sight.view_in_camera;
  view_in_camera.translation() *= unit;
  return sight.camera * view_in_camera;
}

PlaceWatch::Verdict PlaceWatch::judge(const Sight& from, const Sight& to, double way, double turn, double least_turn)
{
  constexpr double LEAST_WAY = 0.1;  // part of the known way that has to be seen; the unit may be far from known
  const Eigen::Isometry3d known = from.camera.inverse() * to.camera;
  const Eigen::Isometry3d seen = from.view_in_camera * to.view_in_camera.inverse();
  const Eigen::Vector3d known_turn = rotationVector(known.linear());
  const bool far = known.translation().norm() >= way;
  const bool turned = known_turn.norm() >= turn;
  if (!far && !turned)
  {
    return Verdict::OPEN;
  }
  const bool alike = (!far || alongPart(known.translation(), seen.translation()) >= LEAST_WAY) &&
                     (!turned || alongPart(known_turn, rotationVector(seen.linear())) >= least_turn);
  return alike ? Verdict::ALIKE : Verdict::OTHERWISE;
}

void PlaceWatch::Doubt::add(Verdict verdict, double stretch, double limit, const Sight& now)
{
  if (verdict != Verdict::OPEN)
  {
    length = verdict == Verdict::ALIKE ? 0.0 : length + stretch;
    contradicted = length >= limit;
    from = now;
  }
}

bool PlaceWatch::add(const Eigen::Isometry3d& camera, const Eigen::Isometry3d& view_in_camera, double unit)
{
  // Parts of a turn that have to be seen. Wheels that slip turn the camera by less than odometry says.
  constexpr double PROVED = 0.4;
  constexpr double TURNED = 0.2;
  constexpr double BY_RANGE = 0.05;  // part of the distance of the view by which its place may change
  // Part of the camera's way since the last sight by which it may, too, as the unit is not known well. Not by all of it
  // where nothing was seen meanwhile: a picture that appears while the camera brakes is as far ahead as that way.
  const double by_step = interrupted_ ? 0.3 : 1.0;
  const Sight now{ camera, view_in_camera };
  const Eigen::Isometry3d place = placeOf(now, unit);
  const Eigen::Isometry3d step = last_ ? last_->camera.inverse() * camera : Eigen::Isometry3d::Identity();
  // By the present unit: that it has become better known is no jump.
  const Eigen::Isometry3d before = last_ ? placeOf(*last_, unit) : believed_.value_or(place);
  const Eigen::Isometry3d change = before.inverse() * place;
  // A place far away is known less exactly.
  const double range = unit * std::min(view_in_camera.translation().norm(),
                                       (last_ ? last_->view_in_camera : view_in_camera).translation().norm());
  const bool jumped =
      change.translation().norm() > limits_.jump + by_step * step.translation().norm() + BY_RANGE * range ||
      rotationVector(change.linear()).norm() > limits_.jump_turn + by_step * rotationVector(step.linear()).norm();
  interrupted_ = false;
  if (jumped)
  {
    trusted_ = false;
    // The picture has changed, unless only its measure has, or what was averaged before the camera stopped.
    const bool elsewhere =
        change.translation().norm() > limits_.doubt || rotationVector(change.linear()).norm() > limits_.doubt_turn;
    const bool forgotten = last_.has_value() && elsewhere;
    doubtful_way_.contradicted = doubtful_way_.contradicted && !forgotten;
    doubtful_turn_.contradicted = doubtful_turn_.contradicted && !forgotten;
  }
  if (jumped || !last_)
  {
    proof_from_ = doubtful_way_.from = doubtful_turn_.from = now;
  }
  else if (is_new_)
  {
    proof_from_ =
        now;  // the first sight of another place may still be on its way there, and seem to move with this one
  }
  is_new_ = jumped;
  last_ = now;
  if (const Verdict verdict = judge(proof_from_, now, limits_.proof, limits_.proof_turn, PROVED);
      verdict != Verdict::OPEN)
  {
    trusted_ = verdict == Verdict::ALIKE;
    proof_from_ = now;
  }
  // Each by itself: a picture that is turned round turns about the camera's axis as the camera does, but goes the other
  // way.
  const Eigen::Isometry3d driven = doubtful_way_.from.camera.inverse() * camera;
  doubtful_way_.add(judge(doubtful_way_.from, now, limits_.doubt / 2.0, NEVER, TURNED), driven.translation().norm(),
                    limits_.doubt, now);
  const Eigen::Isometry3d turned = doubtful_turn_.from.camera.inverse() * camera;
  doubtful_turn_.add(judge(doubtful_turn_.from, now, NEVER, limits_.doubt_turn / 2.0, TURNED),
                     rotationVector(turned.linear()).norm(), limits_.doubt_turn, now);
  return jumped;
}

}  // namespace view_servo
