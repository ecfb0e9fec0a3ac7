// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// Who of command, odometry and images is wrong; and what images of a simulated room and plane say of a motion.
#include "view_servo/parameters/numbers.h"

#include "check/motion.h"

#include "sim/renderer.h"
#include "sim/world_reader.h"
#include "support/shipped_files.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace view_servo::check
{
namespace
{
const Eigen::Vector3d ZERO = Eigen::Vector3d::Zero();

Leg slide(const Eigen::Vector3d& asked, const Eigen::Vector3d& measured, const Eigen::Vector3d& seen)
{
  Leg leg;
  leg.name = "left";
  leg.asked = { asked, ZERO };
  leg.measured_by = "odometry";
  leg.measured = { measured, ZERO };
  leg.seen.motion = Motion{ seen.normalized(), ZERO };
  leg.seen.matches = 100;
  return leg;
}

Leg turn(double asked, double measured, double seen)
{
  Leg leg;
  leg.name = "turn left";
  leg.turns = true;
  leg.asked = { ZERO, asked * DEGREE * Eigen::Vector3d::UnitZ() };
  leg.measured_by = "odometry";
  leg.measured = { ZERO, measured * DEGREE * Eigen::Vector3d::UnitZ() };
  leg.seen.motion = Motion{ ZERO, seen * DEGREE * Eigen::Vector3d::UnitZ() };
  leg.seen.matches = 100;
  return leg;
}

TEST(CheckMotion, JudgesWhoIsWrong)
{
  const Eigen::Vector3d x = 0.1 * Eigen::Vector3d::UnitX();
  const Eigen::Vector3d y = 0.1 * Eigen::Vector3d::UnitY();
  Leg unseen = slide(y, y, y);
  unseen.seen.motion.reset();
  unseen.seen.fault = "the images before and after have only 3 matches that agree";
  Leg pushed = slide(y, 1.6 * y, y);
  pushed.by_hand = true;
  Leg turned_only = slide(y, y, y);
  turned_only.seen.motion = Motion{ ZERO, 5.0 * DEGREE * Eigen::Vector3d::UnitZ() };
  struct Case
  {
    Leg leg;
    Level level;
    std::string words;  // in message or remedy
  };
  const std::vector<Case> cases = {
    { slide(y, 0.97 * y, y + 0.1 * x), Level::OK, "6 degrees from there" },
    { slide(y, -y, y), Level::ERROR, "command and images contradict odometry" },
    { slide(y, y, -y), Level::ERROR, "command and odometry contradict the images" },
    { slide(y, -y, -y), Level::ERROR, "odometry and images contradict the command" },
    { slide(y, -y, x), Level::ERROR, "each say another direction" },
    { slide(y, 0.01 * y, y), Level::ERROR, "hardly moved" },
    { slide(y, 0.6 * y, y), Level::WARNING, "units or scale" },
    { slide(y, y, y + 0.5 * x), Level::WARNING, "its yaw" },
    { unseen, Level::WARNING, "only 3 matches" },
    { pushed, Level::OK, "by hand" },
    { turned_only, Level::WARNING, "show a turn instead" },
    { turn(10.0, 9.8, 10.1), Level::OK, "10.1 degrees by images" },
    { turn(10.0, -10.0, 10.0), Level::ERROR, "command and images contradict odometry" },
    { turn(10.0, 10.0, -10.0), Level::ERROR, "command and odometry contradict the images" },
    { turn(-10.0, 10.0, 10.0), Level::ERROR, "odometry and images contradict the command" },
    { turn(10.0, 10.0, 8.0), Level::WARNING, "focal length" },
    { turn(10.0, 0.5, 10.0), Level::ERROR, "hardly moved" },
  };
  for (const Case& expected : cases)
  {
    const Finding finding = judgeLeg(expected.leg);
    SCOPED_TRACE(finding.message + " -> " + finding.remedy);
    EXPECT_EQ(finding.level, expected.level);
    EXPECT_NE((finding.message + finding.remedy).find(expected.words), std::string::npos) << expected.words;
    EXPECT_EQ(finding.name, "move " + expected.leg.name);
    EXPECT_EQ(finding.remedy.empty(), expected.level == Level::OK);
  }
}

/** A camera in one of the package's worlds. */
class Scene
{
public:
  explicit Scene(const std::string& name) : world_(sim::readWorld(test::worldFile(name))), camera_(world_, {}, 1)
  {
  }

  /** @param motion pose after it, in the frame before: of the base, or of the camera when there is no base. */
  ImagePair pair(const Eigen::Isometry3d& motion)
  {
    const Eigen::Isometry3d mount =
        world_.robot == sim::RobotKind::NOMAD ? world_.camera_on_base : Eigen::Isometry3d::Identity();
    return { camera_.capture(Eigen::Isometry3d(world_.goal * mount)),
             camera_.capture(Eigen::Isometry3d(world_.goal * motion * mount)), world_.camera };
  }

  const sim::World& world() const
  {
    return world_;
  }

private:
  sim::World world_;
  sim::SimulatedCamera camera_;
};

Eigen::Isometry3d pose(const Eigen::Vector3d& translation, double yaw)
{
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.translation() = translation;
  result.linear() = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return result;
}

TEST(CheckMotion, SeesABaseMove)
{
  Scene scene("desk");
  const CameraMount mount(scene.world().camera_on_base);
  for (const Eigen::Vector3d& way : { Eigen::Vector3d(0.1, 0.0, 0.0), Eigen::Vector3d(0.0, 0.1, 0.0) })
  {
    const SeenMotion seen = seenByBase(scene.pair(pose(way, 0.0)), mount, { way.x(), way.y(), 0.0 });
    ASSERT_TRUE(seen.motion) << seen.fault;
    EXPECT_GT(seen.motion->translation.dot(way.normalized()), std::cos(6.0 * DEGREE))
        << seen.motion->translation.transpose();
    EXPECT_LT(seen.motion->rotation.norm(), 0.5 * DEGREE);
  }
  const SeenMotion turned = seenByBase(scene.pair(pose(ZERO, 10.0 * DEGREE)), mount, { 0.0, 0.0, 10.0 * DEGREE });
  ASSERT_TRUE(turned.motion) << turned.fault;
  EXPECT_NEAR(turned.motion->rotation.z(), 10.0 * DEGREE, 0.3 * DEGREE);
  const SeenMotion still = seenByBase(scene.pair(pose(ZERO, 0.0)), mount, {});
  EXPECT_FALSE(still.motion);
  EXPECT_NE(still.fault.find("hardly changed"), std::string::npos) << still.fault;
}

TEST(CheckMotion, SeesThatAMountIsUpsideDown)
{
  Scene scene("desk");
  const CameraMount upside_down(scene.world().camera_on_base * pose(ZERO, M_PI));
  const Eigen::Vector3d left(0.0, 0.1, 0.0);
  const SeenMotion slid = seenByBase(scene.pair(pose(left, 0.0)), upside_down, { 0.0, 0.1, 0.0 });
  ASSERT_TRUE(slid.motion) << slid.fault;
  EXPECT_LT(slid.motion->translation.y(), -0.9);
  const SeenMotion turned = seenByBase(scene.pair(pose(ZERO, 10.0 * DEGREE)), upside_down, { 0.0, 0.0, 10.0 * DEGREE });
  ASSERT_TRUE(turned.motion) << turned.fault;
  EXPECT_NEAR(turned.motion->rotation.z(), -10.0 * DEGREE, 0.5 * DEGREE);
}

TEST(CheckMotion, SeesAHandMove)
{
  Scene scene("rice");
  for (const Eigen::Vector3d& way : { Eigen::Vector3d(0.05, 0.0, 0.0), Eigen::Vector3d(0.0, 0.05, 0.0) })
  {
    const SeenMotion seen = seenByHand(scene.pair(pose(way, 0.0)), { way, ZERO });
    ASSERT_TRUE(seen.motion) << seen.fault;
    EXPECT_GT(seen.motion->translation.dot(way.normalized()), std::cos(6.0 * DEGREE))
        << seen.motion->translation.transpose();
    // With the measured motion the other way round the images still say what is true.
    const SeenMotion mirrored = seenByHand(scene.pair(pose(way, 0.0)), { -way, ZERO });
    ASSERT_TRUE(mirrored.motion) << mirrored.fault;
    EXPECT_GT(mirrored.motion->translation.dot(way.normalized()), 0.5) << mirrored.motion->translation.transpose();
  }
}

TEST(CheckMotion, SeesThatAHandOnlyTurned)
{
  Scene scene("rice");
  for (double degrees = -12.0; degrees <= 12.0; degrees += 0.75)
  {
    const double angle = degrees * DEGREE;
    const SeenMotion rolled = seenByHand(scene.pair(pose(ZERO, angle)), { ZERO, angle * Eigen::Vector3d::UnitZ() });
    if (std::abs(degrees) > 1.0)
    {
      ASSERT_TRUE(rolled.motion) << degrees << ": " << rolled.fault;
      EXPECT_NEAR(rolled.motion->rotation.z(), angle, 0.3 * DEGREE);
    }
  }
}

}  // namespace
}  // namespace view_servo::check
