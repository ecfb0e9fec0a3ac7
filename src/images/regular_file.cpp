// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/images/regular_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace view_servo
{
namespace
{
struct Closer
{
  ~Closer()
  {
    ::close(descriptor);
  }
  int descriptor;
};

[[noreturn]] void failByErrno()
{
  throw std::runtime_error(std::generic_category().message(errno));
}

}  // namespace

std::optional<std::string> readRegularFile(const std::filesystem::path& path, std::uintmax_t max_size)
{
  // Without O_NONBLOCK, to open a pipe is to wait for whoever writes to it.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor < 0)
  {
    if (errno == ENOENT)
    {
      return std::nullopt;
    }
    failByErrno();
  }
  const Closer closer{ descriptor };
  struct stat status = {};
  if (::fstat(descriptor, &status) != 0)
  {
    failByErrno();
  }
  if (!S_ISREG(status.st_mode))
  {
    throw std::runtime_error("not a file");
  }
  if (static_cast<std::uintmax_t>(status.st_size) > max_size)
  {
    throw std::runtime_error("file too large");
  }
  std::string bytes(static_cast<std::size_t>(status.st_size), '\0');
  std::size_t filled = 0;
  while (filled < bytes.size())
  {
    const ssize_t count = ::read(descriptor, bytes.data() + filled, bytes.size() - filled);
    if (count == 0)
    {
      break;  // it has become shorter
    }
    if (count < 0 && errno != EINTR)
    {
      failByErrno();
    }
    filled += static_cast<std::size_t>(std::max<ssize_t>(count, 0));
  }
  bytes.resize(filled);
  return bytes;
}

}  // namespace view_servo
