// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/still_pose.h"

#include "view_servo/robust/random.h"

#include <gtest/gtest.h>

#include <optional>

namespace view_servo
{
namespace
{
ArmSample sampleAt(double stamp, const Eigen::Vector3d& place = { 0.3, 0.2, 0.5 }, double yaw = 3.0,
                   const Eigen::Vector2d& seen = { 100.0, 200.0 })
{
  ArmSample sample;
  sample.stamp = stamp;
  sample.flange_in_base = Eigen::Translation3d(place) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
  sample.seen = { seen, seen + Eigen::Vector2d(50.0, 0.0) };
  return sample;
}

class StillPoseTest : public ::testing::Test
{
protected:
  /** Ten samples a second up to a time. @return what came of the last. */
  std::optional<ArmSample> standUntil(double end)
  {
    std::optional<ArmSample> last;
    for (; stamp_ < end - 1e-9; stamp_ += 0.1)
    {
      last = still_.add(sampleAt(stamp_));
    }
    return last;
  }

  StillPose still_;
  double stamp_ = 10.0;
};

}  // namespace

TEST_F(StillPoseTest, WaitsForTheDuration)
{
  EXPECT_FALSE(standUntil(10.75));
  EXPECT_TRUE(standUntil(11.05));
}

TEST_F(StillPoseTest, AveragesWhatItHasSeen)
{
  Rng rng(1);
  std::optional<ArmSample> last;
  for (int i = 0; i < 30; ++i)
  {
    const double noise = uniform(rng, -1.0, 1.0);
    last = still_.add(sampleAt(0.1 * i, { 0.3 + 5e-4 * noise, 0.2, 0.5 }, 3.0 + 1e-3 * noise,
                               { 100.0 + 0.3 * noise, 200.0 - 0.3 * noise }));
  }
  ASSERT_TRUE(last);
  EXPECT_DOUBLE_EQ(last->stamp, 0.1 * 29);
  EXPECT_LT((last->flange_in_base.translation() - Eigen::Vector3d(0.3, 0.2, 0.5)).norm(), 4e-4);
  EXPECT_GT((last->flange_in_base.linear() * Eigen::AngleAxisd(-3.0, Eigen::Vector3d::UnitZ())).trace(), 3.0 - 1e-6);
  EXPECT_LT((last->seen[1] - Eigen::Vector2d(150.0, 200.0)).norm(), 0.3);
}

TEST_F(StillPoseTest, AMovementOfArmOrImageBeginsAnew)
{
  for (const ArmSample& moved : { sampleAt(0.0, { 0.303, 0.2, 0.5 }), sampleAt(0.0, { 0.3, 0.2, 0.5 }, 3.01),
                                  sampleAt(0.0, { 0.3, 0.2, 0.5 }, 3.0, { 100.0, 201.5 }) })
  {
    still_.clear();
    ASSERT_TRUE(standUntil(stamp_ + 1.5));
    ArmSample sample = moved;
    sample.stamp = stamp_;
    EXPECT_FALSE(still_.add(sample));
    stamp_ += 0.1;
    EXPECT_FALSE(standUntil(stamp_ + 0.65));
    EXPECT_TRUE(standUntil(stamp_ + 0.5));
  }
}

TEST_F(StillPoseTest, SlowMotionIsNoRest)
{
  for (int i = 0; i < 50; ++i)
  {
    EXPECT_FALSE(still_.add(sampleAt(0.1 * i, { 0.3 + 0.0005 * i, 0.2, 0.5 })));
  }
}

TEST_F(StillPoseTest, GapsAndTimesThatGoBackBeginAnew)
{
  ASSERT_TRUE(standUntil(11.5));
  EXPECT_FALSE(still_.add(sampleAt(stamp_ + 1.0)));
  stamp_ += 1.1;
  ASSERT_TRUE(standUntil(stamp_ + 1.5));
  EXPECT_FALSE(still_.add(sampleAt(5.0)));
  stamp_ = 5.1;
  ASSERT_TRUE(standUntil(stamp_ + 1.5));
  ArmSample other = sampleAt(stamp_);
  other.seen.pop_back();
  EXPECT_FALSE(still_.add(other));
}

TEST_F(StillPoseTest, RareSamplesHaveToBeEnough)
{
  for (int i = 0; i < 4; ++i)
  {
    EXPECT_FALSE(still_.add(sampleAt(0.4 * i)));
  }
  EXPECT_TRUE(still_.add(sampleAt(1.6)));
}

}  // namespace view_servo
