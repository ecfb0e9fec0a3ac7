// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace view_servo
{
/** @file
 * How stored views, and routes of them, are written and read: text files whose last line is a checksum, replaced in one
 * step, in directories that one process at a time changes.
 */

/** What is wrong with a stored file; without its name, which whoever catches it knows. */
class Damage : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

/** FNV-1a, 64 bits, in hexadecimal: finds every changed byte, and tells two images of a view apart. */
std::string checksum(std::string_view bytes);

/** The text, and a last line with its checksum. */
std::string withChecksum(const std::string& text);

/** Whether the text is, to the byte, what withChecksum() wrote. */
bool hasGoodChecksum(const std::string& text);

/** The text before the last line. @throws Damage when that is not, to the byte, what withChecksum() wrote. */
std::string withoutChecksum(const std::string& text, const std::string& what);

/** All bytes; empty when there is no such file. @param max_size larger files are refused [bytes]. @throws Damage. */
std::optional<std::string> readStoredFile(const std::filesystem::path& path, std::uintmax_t max_size);

/** The text file of the view or route of that name. */
std::filesystem::path yamlPath(const std::filesystem::path& directory, const std::string& name);

/**
 * Sorted names, without their ending, of the files NAME.yaml whose names a view can have; none when there is no such
 * directory. @throws std::filesystem::filesystem_error.
 */
std::vector<std::string> namesOfYamlFiles(const std::filesystem::path& directory);

/** Waits until what was changed in a directory is on the disk. @throws std::system_error. */
void syncDirectory(const std::filesystem::path& directory);

/**
 * After this the file holds either what it held before or all of `bytes`, whatever happens in between. Its directory
 * has to be synced before it is certain which of the two. The bytes are written beside it first, to its name with
 * ".tmp" appended.
 * @throws std::system_error.
 */
void replaceFile(const std::filesystem::path& path, std::string_view bytes);

/** A file descriptor that closes itself. All members throw std::system_error. */
class Descriptor
{
public:
  /** Opens a file; flags as open(2) takes them. */
  Descriptor(const std::filesystem::path& path, int flags);
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  /** Writes all bytes. */
  void write(std::string_view bytes) const;
  /** Waits until what was written is on the disk. */
  void sync() const;
  /** The descriptor itself. */
  int get() const
  {
    return fd_;
  }

private:
  std::filesystem::path path_;
  int fd_;
};

/** Only one process at a time changes a directory's files; others wait. Readers do not take part. */
class DirectoryLock
{
public:
  /** Waits until no other process holds the lock, and takes it. @throws std::runtime_error when that takes too long. */
  explicit DirectoryLock(const std::filesystem::path& directory);

private:
  Descriptor file_;  // the lock ends with it
};

}  // namespace view_servo
