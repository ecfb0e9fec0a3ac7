// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>

/** @file
 * What the fuzz targets share. A target hands bytes to a reader; libFuzzer makes the bytes. A reader may accept them,
 * or refuse them by the exception that its header names, with a reason in one line. Anything else ends the program:
 * another exception, an answer that breaks its promise, what AddressSanitizer and UndefinedBehaviorSanitizer see, and
 * inputs that take too long or too much memory.
 */
namespace view_servo::fuzz
{
inline void require(bool holds, const std::string& what)
{
  if (!holds)
  {
    std::cerr << "broken promise: " << what << std::endl;
    std::abort();
  }
}

inline void requireReason(const std::string& reason)
{
  require(!reason.empty(), "a refusal has a reason");
  require(reason.find('\n') == std::string::npos, "the reason is one line: " + reason);
}

/** Reads, and takes a refusal by `Error` for good when it has a reason. */
template <typename Error, typename Body>
void readOrRefuse(const Body& body)
{
  try
  {
    body();
  }
  catch (const Error& error)
  {
    requireReason(error.what());
  }
}

/** A directory of this process, in memory where there is such a place, which goes when the process ends by itself. */
class Directory
{
public:
  Directory() : path_(memory() / ("view_servo_fuzz_" + std::to_string(getpid())))
  {
    std::filesystem::create_directories(path_);
  }
  ~Directory()
  {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Directory(const Directory&) = delete;
  Directory& operator=(const Directory&) = delete;

  const std::filesystem::path& path() const
  {
    return path_;
  }

  /** Replaces a file. @return its path. */
  std::string write(const std::string& name, const std::string& bytes) const
  {
    const std::string path = (path_ / name).string();
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    return path;
  }

private:
  static std::filesystem::path memory()
  {
    const std::filesystem::path shared = "/dev/shm";
    return std::filesystem::is_directory(shared) ? shared : std::filesystem::temp_directory_path();
  }

  std::filesystem::path path_;
};

/** FNV-1a, 64 bits, in hexadecimal, as the stores write it. */
inline std::string checksum(const std::string& bytes)
{
  std::uint64_t sum = 0xcbf29ce484222325ULL;
  for (const char byte : bytes)
  {
    sum = (sum ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
  }
  char text[17];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(sum));
  return text;
}

/** A text with the checksum that belongs to it, as else nothing behind the check would be reached. */
inline std::string withChecksum(const std::string& text)
{
  return text + "checksum: " + checksum(text) + "\n";
}

inline std::string toString(const std::uint8_t* data, std::size_t size)
{
  return { reinterpret_cast<const char*>(data), size };
}
}  // namespace view_servo::fuzz
