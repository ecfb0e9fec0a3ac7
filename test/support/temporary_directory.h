// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <system_error>

namespace view_servo
{
namespace test
{
/** An empty directory of its own, removed with all it holds at the end of its scope. */
class TemporaryDirectory
{
public:
  TemporaryDirectory()
  {
    std::string pattern = std::filesystem::temp_directory_path() / "view_servo_test_XXXXXX";
    if (mkdtemp(pattern.data()) == nullptr)
    {
      throw std::system_error(errno, std::generic_category(), pattern);
    }
    path_ = pattern;
  }
  ~TemporaryDirectory()
  {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;

  const std::filesystem::path& path() const
  {
    return path_;
  }

private:
  std::filesystem::path path_;
};

}  // namespace test
}  // namespace view_servo
