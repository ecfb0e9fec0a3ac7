// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/segment_io.h"

#include "support/temporary_directory.h"
#include "support/text_file.h"
#include "support/thrown_message.h"

#include <gtest/gtest.h>

#include <unistd.h>

#include <filesystem>
#include <locale>
#include <string>

using view_servo::MAX_FILE_SEGMENTS;
using view_servo::readSegments;
using view_servo::SegmentError;
using view_servo::Segments;
using view_servo::test::TemporaryDirectory;
using view_servo::test::thrownMessage;
using view_servo::test::writeText;

namespace
{
class SegmentIoTest : public ::testing::Test
{
protected:
  std::string path(const std::string& name) const
  {
    return directory_.path() / name;
  }

  std::string write(const std::string& text) const
  {
    return writeText(path("segments.txt"), text);
  }

  Segments read(const std::string& text) const
  {
    return readSegments(write(text));
  }

  /** What reading says, in one line that names the file; empty when it is read. */
  static std::string errorOf(const std::string& path)
  {
    std::string message = thrownMessage<SegmentError>([&] { readSegments(path); });
    if (!message.empty())
    {
      EXPECT_NE(message.find(path), std::string::npos) << message;
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
    return message;
  }

  void expectFault(const std::string& text, int line) const
  {
    const std::string message = errorOf(write(text));
    EXPECT_NE(message.find("line " + std::to_string(line) + " "), std::string::npos) << text << message;
  }

private:
  TemporaryDirectory directory_;
};

}  // namespace

TEST_F(SegmentIoTest, ReadsFourNumbersALine)
{
  const Segments segments = read("1 2 3 4\n  -5.5\t6e1   7 \t8.25\t \n9 10 11 12");
  ASSERT_EQ(segments.size(), 3U);
  EXPECT_EQ(segments[0].start, Eigen::Vector2d(1.0, 2.0));
  EXPECT_EQ(segments[0].end, Eigen::Vector2d(3.0, 4.0));
  EXPECT_EQ(segments[1].start, Eigen::Vector2d(-5.5, 60.0));
  EXPECT_EQ(segments[1].end, Eigen::Vector2d(7.0, 8.25));
  EXPECT_EQ(segments[2].end, Eigen::Vector2d(11.0, 12.0));
}

TEST_F(SegmentIoTest, SkipsBlankLinesAndRemarks)
{
  EXPECT_EQ(read("# x1 y1 x2 y2\n\n1 2 3 4\n \t\n  # and so on\r\n5 6 7 8\r\n\n").size(), 2U);
  EXPECT_TRUE(read("").empty());
  EXPECT_TRUE(read("\n\n#\n").empty());
}

TEST_F(SegmentIoTest, NamesTheLineOfEachFault)
{
  for (const std::string bad : { "1 2 3",        "1 2 3 4 5",     "7",          "1 2 3 x",          "1 2 3 4x",
                                 "1,2,3,4",      "1,5 2 3 4",     "0x10 2 3 4", "1 2 - 4",          "nan 2 3 4",
                                 "1 NaN 3 4",    "1 2 inf 4",     "1 2 3 -inf", "1 2 3 1e999",      "1 2 1 2",
                                 "0 0 1e-200 0", "1 2 3 1000001", "-2e6 2 3 4", "1 2 3 4 # remark", "\x89PNG" })
  {
    expectFault(bad + "\n", 1);
    expectFault("1 2 3 4\n# remark\n\n" + bad, 4);
  }
  expectFault(std::string("1 2 3 4\n1 2 3 4\0 5\n", 17), 2);
}

TEST_F(SegmentIoTest, AcceptsTheLargestCoordinates)
{
  EXPECT_EQ(read("-1e6 -1e6 1e6 1e6\n").size(), 1U);
}

TEST_F(SegmentIoTest, RefusesLongLinesAtOnce)
{
  expectFault("1 2 3 4\n" + std::string(5'000'000, '1'), 2);
  expectFault("1 2 3 4" + std::string(5'000'000, ' ') + "\n", 1);
}

TEST_F(SegmentIoTest, RefusesTooManySegments)
{
  std::string text;
  for (std::size_t i = 0; i < MAX_FILE_SEGMENTS; ++i)
  {
    text += "1 2 3 4\n";
  }
  EXPECT_EQ(read(text).size(), MAX_FILE_SEGMENTS);
  expectFault(text + "1 2 3 4\n", static_cast<int>(MAX_FILE_SEGMENTS) + 1);
}

TEST_F(SegmentIoTest, RefusesWhatIsNoFile)
{
  EXPECT_NE(errorOf(path("none.txt")), "");
  EXPECT_NE(errorOf(path(".")).find("not a file"), std::string::npos);
  EXPECT_NE(errorOf("/dev/null").find("not a file"), std::string::npos);
  EXPECT_NE(errorOf(""), "");
}

TEST_F(SegmentIoTest, RefusesFilesItMayNotRead)
{
  if (geteuid() == 0)
  {
    GTEST_SKIP() << "root may read everything";
  }
  const std::string file = write("1 2 3 4\n");
  std::filesystem::permissions(file, std::filesystem::perms::none);
  EXPECT_NE(errorOf(file), "");
}

TEST_F(SegmentIoTest, DoesNotDependOnTheLocale)
{
  const std::locale old;
  class Commas : public std::numpunct<char>
  {
    char do_decimal_point() const override
    {
      return ',';
    }
  };
  std::locale::global(std::locale(old, new Commas));
  const Segments segments = read("1.5 2 3 4\n");
  const std::string fault = errorOf(write("1,5 2 3 4\n"));
  std::locale::global(old);
  ASSERT_EQ(segments.size(), 1U);
  EXPECT_EQ(segments[0].start.x(), 1.5);
  EXPECT_NE(fault, "");
}
