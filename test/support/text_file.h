// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace view_servo
{
namespace test
{
/** All bytes of a file. A file that cannot be read fails the test. */
inline std::string readText(const std::filesystem::path& file)
{
  std::ifstream stream(file, std::ios::binary);
  EXPECT_TRUE(stream) << "cannot read " << file;
  return { std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>() };
}

/** Makes a file of these bytes, or replaces one. A file that cannot be written fails the test. @return the file. */
inline std::string writeText(const std::filesystem::path& file, const std::string& text)
{
  std::ofstream stream(file, std::ios::binary);
  stream << text << std::flush;
  EXPECT_TRUE(stream) << "cannot write " << file;
  return file.string();
}

/** The text with the only place where it says `from` saying `to`. Another number of places fails the test. */
inline std::string edited(std::string text, const std::string& from, const std::string& to)
{
  const std::size_t at = text.find(from);
  if (at == std::string::npos || text.find(from, at + 1) != std::string::npos)
  {
    ADD_FAILURE() << "'" << from << "' is not there once";
    return text;
  }
  return text.replace(at, from.size(), to);
}

}  // namespace test
}  // namespace view_servo
