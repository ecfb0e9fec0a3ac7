// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "stored_files.h"

#include "view_servo/images/regular_file.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/views/view_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <sstream>
#include <system_error>
#include <thread>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

/** The last line of a text file is this and the checksum of all text above it. */
constexpr std::string_view CHECKSUM_KEY = "checksum: ";

[[noreturn]] void throwLastError(const fs::path& path)
{
  throw std::system_error(errno, std::generic_category(), path.string());
}

}  // namespace

std::string checksum(std::string_view bytes)
{
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const char byte : bytes)
  {
    hash = (hash ^ static_cast<unsigned char>(byte)) * 0x100000001b3U;
  }
  std::ostringstream text;
  text << std::hex;
  text.width(16);
  text.fill('0');
  text << hash;
  return text.str();
}

std::string withChecksum(const std::string& text)
{
  return text + std::string(CHECKSUM_KEY) + checksum(text) + "\n";
}

bool hasGoodChecksum(const std::string& text)
{
  const std::size_t end = text.rfind(CHECKSUM_KEY);
  return end != std::string::npos && text == withChecksum(text.substr(0, end));
}

std::string withoutChecksum(const std::string& text, const std::string& what)
{
  if (!hasGoodChecksum(text))
  {
    throw Damage(what + " does not agree with the checksum in its last line");
  }
  return text.substr(0, text.rfind(CHECKSUM_KEY));
}

std::optional<std::string> readStoredFile(const fs::path& path, std::uintmax_t max_size)
{
  try
  {
    return readRegularFile(path, max_size);
  }
  catch (const std::runtime_error& error)
  {
    throw Damage(path.string() + ": " + oneLine(error));
  }
}

fs::path yamlPath(const fs::path& directory, const std::string& name)
{
  return directory / (name + ".yaml");
}

std::vector<std::string> namesOfYamlFiles(const fs::path& directory)
{
  std::vector<std::string> names;
  if (!fs::exists(directory))
  {
    return names;
  }
  for (const fs::directory_entry& entry : fs::directory_iterator(directory))
  {
    if (entry.path().extension() == ".yaml" && isValidViewName(entry.path().stem().string()))
    {
      names.push_back(entry.path().stem().string());
    }
  }
  std::sort(names.begin(), names.end());
  return names;
}

void syncDirectory(const fs::path& directory)
{
  Descriptor(directory, O_RDONLY | O_DIRECTORY).sync();
}

void replaceFile(const fs::path& path, std::string_view bytes)
{
  const fs::path temporary = path.string() + ".tmp";
  try
  {
    // What a crash has left, or a link that somebody has put there to have another file overwritten
    fs::remove(temporary);
    const Descriptor file(temporary, O_WRONLY | O_CREAT | O_EXCL);
    file.write(bytes);
    file.sync();
    fs::rename(temporary, path);
  }
  catch (...)
  {
    std::error_code ignored;  // the first error is the one to tell
    fs::remove(temporary, ignored);
    throw;
  }
}

Descriptor::Descriptor(const fs::path& path, int flags)
  : path_(path), fd_(::open(path.c_str(), flags | O_CLOEXEC, 0666))
{
  if (fd_ < 0)
  {
    throwLastError(path_);
  }
}

Descriptor::~Descriptor()
{
  ::close(fd_);
}

void Descriptor::write(std::string_view bytes) const
{
  while (!bytes.empty())
  {
    const ssize_t written = ::write(fd_, bytes.data(), bytes.size());
    if (written < 0 && errno != EINTR)
    {
      throwLastError(path_);
    }
    bytes.remove_prefix(static_cast<std::size_t>(std::max<ssize_t>(written, 0)));
  }
}

void Descriptor::sync() const
{
  if (::fsync(fd_) != 0)
  {
    throwLastError(path_);
  }
}

DirectoryLock::DirectoryLock(const fs::path& directory) : file_(directory / ".lock", O_RDWR | O_CREAT | O_NOFOLLOW)
{
  constexpr std::chrono::seconds PATIENCE(10);
  constexpr std::chrono::milliseconds POLL(5);
  const auto deadline = std::chrono::steady_clock::now() + PATIENCE;
  while (::flock(file_.get(), LOCK_EX | LOCK_NB) != 0)
  {
    if (errno != EWOULDBLOCK && errno != EINTR)
    {
      return;  // a file system without locks: alone, nothing can happen
    }
    if (std::chrono::steady_clock::now() > deadline)
    {
      throw std::runtime_error("another process has been changing views in " + directory.string() + " for too long");
    }
    std::this_thread::sleep_for(POLL);
  }
}

}  // namespace view_servo
