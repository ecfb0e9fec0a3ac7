// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
// How the node starts and ends.
#include "child_process.h"
#include "homography_tracker_test.h"
#include "support/temporary_directory.h"
#include "test_paths.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** Nodes that the test starts itself. */
class HomographyTrackerProcessTest : public HomographyTrackerNodeTest
{
protected:
  std::vector<std::string> command(const std::string& name, const std::vector<std::string>& more = {}) const
  {
    std::vector<std::string> words{ HOMOGRAPHY_TRACKER_PATH,
                                    "__name:=" + name,
                                    "_odom_frame:=",
                                    "_views_dir:=" + viewsDir("homography_tracker").string(),
                                    "image_raw:=camera/image_raw",
                                    "camera_info:=camera/camera_info" };
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  std::string output() const
  {
    return directory_.path() / "output";
  }

  TemporaryDirectory directory_;
};

TEST_F(HomographyTrackerProcessTest, FollowsWhatWasWantedBeforeItStarted)
{
  camera_.show(picture());
  want("goal", "long ago");
  const ChildProcess node(command("late"), output());
  const Recorder<Homography> homographies("late/homography");
  EXPECT_TRUE(waitForAnswer(homographies, "long ago", [](const Homography& message) { return message.valid != 0; }))
      << node.output();
}

TEST_F(HomographyTrackerProcessTest, FollowsItsParameterUntilADriverWantsAnother)
{
  const ChildProcess node(command("told", { "_view:=unknown" }), output());
  const Recorder<Homography> homographies("told/homography");
  EXPECT_TRUE(waitForAnswer(homographies, "", [](const Homography& message) {
    return message.refused && message.view == "unknown";
  })) << node.output();
  camera_.show(picture());
  want("goal", "goal");
  EXPECT_TRUE(waitForAnswer(homographies, "goal", [](const Homography& message) { return message.valid != 0; }));
}

TEST_F(HomographyTrackerProcessTest, EndsAtOnceWhileItLooksForTheView)
{
  camera_.show(texturedPicture(9));
  ChildProcess node(command("ending", { "_match_period:=0.001", "_view:=goal" }), output());
  const Recorder<Homography> homographies("ending/homography");
  ASSERT_TRUE(waitForAnswer(homographies, "", [](const Homography& message) {
    return message.reason.find("geometry") != std::string::npos;
  })) << node.output();
  const ros::WallTime start_time = ros::WallTime::now();
  node.interrupt();
  EXPECT_EQ(node.exitStatus(), 0) << node.output();
  EXPECT_LT((ros::WallTime::now() - start_time).toSec(), 2.0 * SLOWDOWN);
}

TEST_F(HomographyTrackerProcessTest, ListsAllFaultsOfItsParameters)
{
  ChildProcess node(command("faulty", { "_match_period:=0", "_matching/coefficients:=7", "_matching/assignment:=lucky",
                                        "_tf_patience:=-1", "_matching/max_cornes:=3" }),
                    output());
  EXPECT_EQ(node.exitStatus(), 1);
  for (const char* words : { "~match_period", "coefficients", "~matching/assignment", "~tf_patience",
                             "~matching/max_cornes", "~matching/max_corners?" })
  {
    EXPECT_NE(node.output().find(words), std::string::npos) << words << " is missing in\n" << node.output();
  }
}

}  // namespace
}  // namespace test
}  // namespace view_servo
