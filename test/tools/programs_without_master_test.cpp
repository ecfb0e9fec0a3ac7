// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file Programs that work with ROS answer --help, and refuse a wrong command line, where no master is. */
#include "support/program_run.h"
#include "support/temporary_directory.h"
#include "test_paths.h"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <string>
#include <vector>

namespace view_servo
{
namespace test
{
namespace
{
/** Killed, with status 137, when it waits for the master. */
ProgramRun runWithoutMaster(const std::string& program, const std::vector<std::string>& arguments)
{
  return runProgram(
      "timeout",
      [&] {
        std::vector<std::string> words{ "--signal=KILL", "20", program };
        words.insert(words.end(), arguments.begin(), arguments.end());
        return words;
      }(),
      "export ROS_MASTER_URI=http://localhost:1");
}

class RunProgramTest : public testing::TestWithParam<std::string>
{
protected:
  void expectRefusal(const std::vector<std::string>& arguments, const std::string& culprit) const
  {
    expectBadInput(runWithoutMaster(GetParam(), arguments), culprit);
  }
};

TEST_P(RunProgramTest, AnswersHelp)
{
  for (const std::string word : { "--help", "-h" })
  {
    const ProgramRun run = runWithoutMaster(GetParam(), { "_exit:=false", word });
    EXPECT_EQ(run.status, 0);
    EXPECT_EQ(run.err, "");
    for (const std::string part : { "rosrun view_servo run_", "_world:=", "time limit of the goal [s; > 0]" })
    {
      EXPECT_NE(run.out.find(part), std::string::npos) << part << " in " << run.out;
    }
  }
}

TEST_P(RunProgramTest, RefusesWhatIsNotUnderstood)
{
  expectRefusal({ "desk" }, "'desk' is not understood; see --help");
  expectRefusal({ "--world", "desk" }, "'--world' is not understood; see --help");
  expectRefusal({ "_wrld:=desk" }, "unknown parameter 'wrld' (did you mean 'world'?); see --help");
  expectRefusal({ "_timeout:=long" }, "parameter 'timeout': 'long' is not of type double; see --help");
  expectRefusal({ "_timeout:=-1" }, "timeout must be > 0 s, not -1; see --help");
  expectRefusal({ "_exit:=perhaps", "camera:=front" }, "parameter 'exit': 'perhaps'");
}

TEST_P(RunProgramTest, WaitsForTheMasterWithWhatIsUnderstood)
{
  const ProgramRun run = runProgram(
      "timeout", { "2", GetParam(), "_world:=desk", "_timeout:=1e2", "_exit:=True", "__ns:=/a", "camera:=front" },
      "export ROS_MASTER_URI=http://localhost:1");
  EXPECT_EQ(run.status, 124) << run.out << run.err;
}

INSTANTIATE_TEST_SUITE_P(Programs, RunProgramTest, testing::Values(RUN_ARM_PATH, RUN_HOMING_PATH, RUN_ROUTE_PATH));

/** Of those that take options. */
class OptionProgramTest : public testing::TestWithParam<std::string>
{
};

TEST_P(OptionProgramTest, AnswersHelpAndRefusesAnUnknownOption)
{
  const ProgramRun help = runWithoutMaster(GetParam(), { "--help" });
  EXPECT_EQ(help.status, 0);
  EXPECT_EQ(help.err, "");
  EXPECT_NE(help.out.find("Options:"), std::string::npos) << help.out;
  expectBadInput(runWithoutMaster(GetParam(), { "--nonsense" }), "--nonsense");
}

INSTANTIATE_TEST_SUITE_P(Programs, OptionProgramTest,
                         testing::Values(CALIBRATE_HAND_EYE_PATH, CALIBRATE_MOUNT_PATH, CHECK_ROBOT_PATH,
                                         PICK_VIEW_PATH));

/** A master that takes connections, and never says a word. */
TEST(Programs, DoNotWaitForAMasterThatHangs)
{
  const int listener = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t length = sizeof(address);
  ASSERT_EQ(bind(listener, reinterpret_cast<const sockaddr*>(&address), length), 0);
  ASSERT_EQ(listen(listener, 10), 0);
  ASSERT_EQ(getsockname(listener, reinterpret_cast<sockaddr*>(&address), &length), 0);
  const std::string uri = "export ROS_MASTER_URI=http://localhost:" + std::to_string(ntohs(address.sin_port));
  const TemporaryDirectory directory;
  const std::string out = (directory.path() / "out.yaml").string();
  const std::vector<std::vector<std::string>> commands = { { CALIBRATE_HAND_EYE_PATH, "--view", "x", "--out", out },
                                                           { CALIBRATE_MOUNT_PATH, "--view", "x", "--out", out },
                                                           { CHECK_ROBOT_PATH } };
  for (const std::vector<std::string>& command : commands)
  {
    std::vector<std::string> words{ "--signal=KILL", "20" };
    words.insert(words.end(), command.begin(), command.end());
    const ProgramRun run = runProgram("timeout", words, uri);
    EXPECT_TRUE(run.status == 1 || run.status == 2) << command[0] << ": " << run.status;
    EXPECT_NE((run.out + run.err).find("does not answer"), std::string::npos) << run.out << run.err;
  }
  close(listener);
}

TEST(Calibrations, RefuseFilesThatWouldBeLost)
{
  const TemporaryDirectory directory;
  const std::string file = (directory.path() / "poses.yaml").string();
  for (const std::string program : { CALIBRATE_HAND_EYE_PATH, CALIBRATE_MOUNT_PATH })
  {
    expectBadInput(runWithoutMaster(program, { "--view", "x", "--keep", file, "--out", file }), "is the file of --out");
    expectBadInput(runWithoutMaster(program, { "--file", file, "--out", file, "--overwrite" }),
                   "is the file of --file");
    expectBadInput(runWithoutMaster(program, { "--view", "x", "--out", "" }), "--out: name the file");
    expectBadInput(runWithoutMaster(program, { "--view", "x", "--out", directory.path().string(), "--overwrite" }),
                   "is a directory");
  }
}

class NodeTest : public testing::TestWithParam<std::string>
{
};

TEST_P(NodeTest, AnswersHelpAndRefusesWhatIsNotOfRos)
{
  const ProgramRun help = runWithoutMaster(GetParam(), { "__name:=a", "--help" });
  EXPECT_EQ(help.status, 0);
  EXPECT_EQ(help.err, "");
  EXPECT_NE(help.out.find("_PARAMETER:=VALUE"), std::string::npos) << help.out;
  expectBadInput(runWithoutMaster(GetParam(), { "_rate=5" }), "'_rate=5' is not understood");
}

INSTANTIATE_TEST_SUITE_P(Nodes, NodeTest, testing::Values(POINT_MATCHER_PATH, HOMING_PATH, NOMAD_SIM_PATH));

}  // namespace
}  // namespace test
}  // namespace view_servo
