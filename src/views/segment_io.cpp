// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/segment_io.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <locale>
#include <sstream>
#include <system_error>
#include <vector>

namespace view_servo
{
namespace
{
constexpr std::size_t MAX_LINE_LENGTH = 1000;  // [characters], far more than four numbers and a remark take

const char* const BLANKS = " \t\r";

/** A file's lines one by one, and the words of the current one. */
class Lines
{
public:
  explicit Lines(const std::string& path) : path_(path)
  {
    namespace fs = std::filesystem;
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (error)
    {
      throw SegmentError("cannot read '" + path + "': " + error.message());
    }
    if (!fs::is_regular_file(status))
    {
      throw SegmentError("cannot read '" + path + "': not a file");
    }
    file_.open(path, std::ios::binary);
    if (!file_)
    {
      throw SegmentError("cannot read '" + path + "': " + std::generic_category().message(errno));
    }
  }

  /** Goes to the next line; false at the end of the file. */
  bool next()
  {
    std::array<char, MAX_LINE_LENGTH + 1> buffer{};
    file_.getline(buffer.data(), buffer.size());
    ++number_;
    if (file_.bad())
    {
      throw SegmentError("cannot read '" + path_ + "': reading failed");
    }
    if (file_.fail())
    {
      if (!file_.eof())
      {
        fail("is too long");
      }
      return false;
    }
    const std::streamsize newline = file_.eof() ? 0 : 1;
    line_.assign(buffer.data(), static_cast<std::size_t>(file_.gcount() - newline));
    return true;
  }

  std::vector<std::string> words() const
  {
    std::vector<std::string> words;
    for (std::size_t end = 0, start = 0; (start = line_.find_first_not_of(BLANKS, end)) != std::string::npos;)
    {
      end = std::min(line_.find_first_of(BLANKS, start), line_.size());
      words.push_back(line_.substr(start, end - start));
    }
    return words;
  }

  /** @throws SegmentError saying that something is wrong with the current line. */
  [[noreturn]] void fail(const std::string& what) const
  {
    throw SegmentError("'" + path_ + "': line " + std::to_string(number_) + " " + what);
  }

private:
  std::string path_;
  std::ifstream file_;
  std::string line_;
  std::size_t number_ = 0;
};

/** NaN when the text is not a number as a whole. */
double parsed(const std::string& text)
{
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  double value = 0.0;
  return stream >> value && stream.peek() == std::istringstream::traits_type::eof() ? value : std::nan("");
}

Segment segmentOf(const std::vector<std::string>& words, const Lines& lines)
{
  std::array<double, 4> numbers{};
  if (words.size() != numbers.size())
  {
    lines.fail("holds " + std::to_string(words.size()) + " numbers instead of 4");
  }
  for (std::size_t i = 0; i < numbers.size(); ++i)
  {
    numbers[i] = parsed(words[i]);
    if (!std::isfinite(numbers[i]))
    {
      lines.fail("does not hold finite numbers only");
    }
    if (std::abs(numbers[i]) > MAX_SEGMENT_COORDINATE)
    {
      lines.fail("holds a coordinate beyond 1e6 px");
    }
  }
  Segment segment{ { numbers[0], numbers[1] }, { numbers[2], numbers[3] } };
  if (!(segment.length() > 0.0))
  {
    lines.fail("is a segment of no length");
  }
  return segment;
}

}  // namespace

Segments readSegments(const std::string& path)
{
  Segments segments;
  for (Lines lines(path); lines.next();)
  {
    const std::vector<std::string> words = lines.words();
    if (words.empty() || words.front().front() == '#')
    {
      continue;
    }
    if (segments.size() == MAX_FILE_SEGMENTS)
    {
      lines.fail("is one segment more than the " + std::to_string(MAX_FILE_SEGMENTS) + " that are read at most");
    }
    segments.push_back(segmentOf(words, lines));
  }
  return segments;
}

}  // namespace view_servo
