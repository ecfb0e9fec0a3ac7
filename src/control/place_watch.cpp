// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/place_watch.h"

#include "view_servo/geometry/rotation_vector.h"

#include <algorithm>

namespace view_servo
{
namespace
{
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

Eigen::Isometry3d PlaceWatch::placeOf(const Sight& sight, double unit)
{
  Eigen::Isometry3d view_in_camera = sight.view_in_camera;
  view_in_camera.translation() *= unit;
  return sight.camera * view_in_camera;
}

PlaceWatch::Verdict PlaceWatch::judge(const Sight& from, const Sight& to, double way, double turn)
{
  // Parts of the known motion that have to be seen. The unit of the way may be far from known, but a turn has none.
  constexpr double LEAST_WAY = 0.1;
  constexpr double LEAST_TURN = 0.4;
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
                     (!turned || alongPart(known_turn, rotationVector(seen.linear())) >= LEAST_TURN);
  return alike ? Verdict::ALIKE : Verdict::OTHERWISE;
}

void PlaceWatch::add(const Eigen::Isometry3d& camera, const Eigen::Isometry3d& view_in_camera, double unit)
{
  constexpr double BY_RANGE = 0.05;  // part of the distance of the view by which its place may change
  const Sight now{ camera, view_in_camera };
  const Eigen::Isometry3d place = placeOf(now, unit);
  const Eigen::Isometry3d step = last_ ? last_->camera.inverse() * camera : Eigen::Isometry3d::Identity();
  // By the present unit: that it has become better known is no jump.
  const Eigen::Isometry3d before = last_ ? placeOf(*last_, unit) : believed_.value_or(place);
  const Eigen::Isometry3d change = before.inverse() * place;
  // A place far away is known less exactly.
  const double range = unit * std::min(view_in_camera.translation().norm(),
                                       (last_ ? last_->view_in_camera : view_in_camera).translation().norm());
  const bool jumped = change.translation().norm() > limits_.jump + step.translation().norm() + BY_RANGE * range ||
                      rotationVector(change.linear()).norm() > limits_.jump_turn + rotationVector(step.linear()).norm();
  if (jumped)
  {
    trusted_ = false;
    contradicted_ = contradicted_ && !last_;  // the picture has changed, unless only its measure has
  }
  if (jumped || !last_)
  {
    proof_from_ = doubt_from_ = now;
  }
  last_ = now;
  if (const Verdict verdict = judge(*proof_from_, now, limits_.proof, limits_.proof_turn); verdict != Verdict::OPEN)
  {
    trusted_ = verdict == Verdict::ALIKE;
    proof_from_ = now;
  }
  doubtful_way_ += step.translation().norm();
  doubtful_turn_ += rotationVector(step.linear()).norm();
  if (const Verdict verdict = judge(*doubt_from_, now, limits_.doubt / 2.0, limits_.doubt_turn / 2.0);
      verdict != Verdict::OPEN)
  {
    if (verdict == Verdict::ALIKE)
    {
      doubtful_way_ = doubtful_turn_ = 0.0;
    }
    contradicted_ = doubtful_way_ >= limits_.doubt || doubtful_turn_ >= limits_.doubt_turn;
    doubt_from_ = now;
  }
}

}  // namespace view_servo
