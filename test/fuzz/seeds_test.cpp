// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "support/text_file.h"
#include "test_paths.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

/** Of each target in fuzz/: the function that libFuzzer calls, by another name. They end the program when a promise is broken. */
extern "C"
{
  int fuzzArms(const std::uint8_t* data, std::size_t size);
  int fuzzBags(const std::uint8_t* data, std::size_t size);
  int fuzzCameraInfo(const std::uint8_t* data, std::size_t size);
  int fuzzCameras(const std::uint8_t* data, std::size_t size);
  int fuzzHandEye(const std::uint8_t* data, std::size_t size);
  int fuzzImageMessages(const std::uint8_t* data, std::size_t size);
  int fuzzImages(const std::uint8_t* data, std::size_t size);
  int fuzzMessages(const std::uint8_t* data, std::size_t size);
  int fuzzRoutes(const std::uint8_t* data, std::size_t size);
  int fuzzSegments(const std::uint8_t* data, std::size_t size);
  int fuzzStructure(const std::uint8_t* data, std::size_t size);
  int fuzzViews(const std::uint8_t* data, std::size_t size);
  int fuzzWorlds(const std::uint8_t* data, std::size_t size);
}

namespace view_servo
{
namespace
{
struct Target
{
  std::string name;
  int (*read)(const std::uint8_t* data, std::size_t size);
};

void PrintTo(const Target& target, std::ostream* stream)
{
  *stream << target.name;
}

class FuzzSeedsTest : public ::testing::TestWithParam<Target>
{
};

/** The seeds, and what broke a reader once; each also cut short at every eighth of its length. */
TEST_P(FuzzSeedsTest, AreReadOrRefusedWithAReason)
{
  constexpr std::size_t CUTS = 8;
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(PACKAGE_DIR "/fuzz/seeds/" + GetParam().name))
  {
    SCOPED_TRACE(entry.path().string());
    const std::string bytes = view_servo::test::readText(entry.path());
    ASSERT_FALSE(bytes.empty());
    for (std::size_t cut = 0; cut <= CUTS; ++cut)
    {
      const auto* data = reinterpret_cast<const std::uint8_t*>(bytes.data());
      EXPECT_EQ(GetParam().read(data, bytes.size() * cut / CUTS), 0);
    }
    ++count;
  }
  EXPECT_GE(count, 1U);
}

INSTANTIATE_TEST_SUITE_P(Readers, FuzzSeedsTest,
                         ::testing::Values(Target{ "arms", fuzzArms }, Target{ "bags", fuzzBags },
                                           Target{ "image_messages", fuzzImageMessages },
                                           Target{ "messages", fuzzMessages }, Target{ "camera_info", fuzzCameraInfo },
                                           Target{ "cameras", fuzzCameras }, Target{ "hand_eye", fuzzHandEye },
                                           Target{ "images", fuzzImages }, Target{ "routes", fuzzRoutes },
                                           Target{ "segments", fuzzSegments }, Target{ "structure", fuzzStructure },
                                           Target{ "views", fuzzViews }, Target{ "worlds", fuzzWorlds }),
                         [](const ::testing::TestParamInfo<Target>& target) { return target.param.name; });

}  // namespace
}  // namespace view_servo
