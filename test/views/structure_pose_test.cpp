// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/structure_pose.h"

#include "support/camera_pose_error.h"
#include "support/matched_views.h"
#include "support/room_structure.h"
#include "view_servo/robust/random.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cstdint>
#include <optional>

namespace view_servo
{
namespace
{
void expectNear(const Eigen::Isometry3d& pose, const Eigen::Isometry3d& truth, double metres, double radians)
{
  EXPECT_LT((pose.translation() - truth.translation()).norm(), metres);
  EXPECT_LT(Eigen::AngleAxisd(pose.linear().transpose() * truth.linear()).angle(), radians);
}

/**
 * Of a camera that is tilted by `pitch` (downwards) when the view is taken, and then moves as `view_from_current` says.
 */
struct Walk
{
  StoredView view;
  ViewStructure structure;
  ViewMatch match;
  Eigen::Isometry3d view_from_current = test::roomViewFromCurrent();

  /** @param noise of pixels. @param wrong how many of a hundred matches are wrong. */
  Walk(double pitch, double noise, int wrong, std::uint64_t seed)
  {
    const Camera camera = test::roomCamera();
    view.camera = camera;
    view.pose = test::levelPose();
    view.pose->orientation = view.pose->orientation * Eigen::AngleAxisd(-pitch, Eigen::Vector3d::UnitX());
    // Points of the tilted camera's frame lie so far ahead along the floor.
    const Eigen::Vector3d level_axis = Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) * Eigen::Vector3d::UnitZ();
    Rng rng(seed);
    match.outcome = MatchOutcome::MATCHED;
    for (int i = 0; i < 100; ++i)
    {
      const Eigen::Vector2d pixel(uniform(rng, 20.0, 620.0), uniform(rng, 20.0, 460.0));
      const Eigen::Vector3d ray = camera.normalized(pixel).homogeneous();
      const Eigen::Vector3d point = ray * uniform(rng, 2.0, 5.0);
      structure.points.push_back({ pixel, 1.0 / level_axis.dot(point), 0.01 });
      const Eigen::Vector2d error(gaussian(rng), gaussian(rng));
      Eigen::Vector2d seen = camera.project(view_from_current.inverse() * point) + noise * error;
      if (i < wrong)
      {
        seen = Eigen::Vector2d(uniform(rng, 0.0, 640.0), uniform(rng, 0.0, 480.0));
      }
      match.matches.push_back({ { pixel, seen }, 1.0, true });
    }
  }

  std::optional<StructurePose> pose() const
  {
    return structurePose(match, view, structure, test::roomCamera());
  }
};

TEST(StructurePose, IsThatOfACameraInARoom)
{
  const test::RoomCorner room;
  const auto pose = structurePose(test::matchScene(room.reference, room.current), test::roomView(room),
                                  test::roomStructure(4), test::roomCamera());
  ASSERT_TRUE(pose);
  expectNear(pose->view_from_current, test::roomViewFromCurrent(), 0.02, 0.005);
  EXPECT_GE(pose->inliers, 50U);
}

TEST(StructurePose, KnowsThatDepthsAreMeasuredAlongTheFloor)
{
  for (const double pitch : { -0.4, 0.0, 0.4 })
  {
    SCOPED_TRACE(pitch);
    const Walk walk(pitch, 0.0, 0, 1);
    ASSERT_TRUE(walk.pose());
    expectNear(walk.pose()->view_from_current, walk.view_from_current, 1e-4, 1e-4);
  }
}

TEST(StructurePose, ToleratesWrongMatches)
{
  const Walk walk(0.1, 0.5, 30, 2);
  ASSERT_TRUE(walk.pose());
  expectNear(walk.pose()->view_from_current, walk.view_from_current, 0.03, 0.01);
  EXPECT_GE(walk.pose()->inliers, 60U);
  EXPECT_FALSE(Walk(0.1, 0.5, 70, 2).pose()) << "most disagree";
}

TEST(StructurePose, HasACovarianceThatIsNotTooSmall)
{
  constexpr int WALKS = 40;
  double normalised = 0.0;
  for (std::uint64_t seed = 1; seed <= WALKS; ++seed)
  {
    const Walk walk(0.2, 1.0, 0, seed);
    const auto pose = walk.pose();
    ASSERT_TRUE(pose);
    normalised += test::normalisedError(*pose, walk.view_from_current) / WALKS;
  }
  // Matches of real pictures do not err independently, as these do: so there is room.
  EXPECT_LT(normalised, 1.0);
  EXPECT_GT(normalised, 0.02);
}

TEST(StructurePose, IsNotToldOfWhatIsNotKnown)
{
  const Walk walk(0.0, 0.0, 0, 3);
  ASSERT_TRUE(walk.pose());

  Walk uncalibrated = walk;
  uncalibrated.view.camera.reset();
  EXPECT_FALSE(uncalibrated.pose());
  Walk without_pose = walk;
  without_pose.view.pose.reset();
  EXPECT_FALSE(without_pose.pose());
  EXPECT_FALSE(Walk(1.3, 0.0, 0, 3).pose()) << "it looks at the floor";
  Walk few = walk;
  few.structure.points.resize(11);
  EXPECT_FALSE(few.pose());
  Walk vague = walk;
  for (StructurePoint& point : vague.structure.points)
  {
    point.information = 1e-6;
  }
  EXPECT_FALSE(vague.pose());
  Walk unmatched = walk;
  unmatched.match.outcome = MatchOutcome::NO_GEOMETRY;
  EXPECT_FALSE(unmatched.pose());
  Walk refused = walk;
  for (MatchedPoint& point : refused.match.matches)
  {
    point.inlier = false;
  }
  EXPECT_FALSE(refused.pose());
}

}  // namespace
}  // namespace view_servo
