// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/images/image_io.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <optional>
#include <system_error>
#include <vector>

namespace view_servo
{
namespace
{
using Bytes = std::vector<unsigned char>;

/** No image within the limit needs more: four channels of 16 bits, and room for comments [bytes]. */
constexpr std::uintmax_t MAX_FILE_SIZE = 8 * MAX_IMAGE_PIXELS + 16'000'000;

/** What a file's header says before anything is decoded. */
struct Header
{
  std::int64_t width;
  std::int64_t height;
};

std::string quoted(const std::string& name)
{
  return "'" + name + "'";
}

void checkSize(const Header& size, const std::string& name)
{
  const std::string is = quoted(name) + " is " + std::to_string(size.width) + " x " + std::to_string(size.height);
  if (size.width < MIN_IMAGE_SIDE || size.height < MIN_IMAGE_SIDE)
  {
    throw ImageError(is + " pixels; an image needs at least " + std::to_string(MIN_IMAGE_SIDE) + " on a side");
  }
  if (size.width > MAX_IMAGE_PIXELS / size.height)
  {
    throw ImageError(is + " pixels; images over " + std::to_string(MAX_IMAGE_PIXELS / 1'000'000) +
                     " megapixels are refused");
  }
}

/** Big-endian number of COUNT bytes; 0 at the end of the file. */
template <int COUNT>
std::int64_t readNumber(std::istream& file)
{
  std::int64_t value = 0;
  for (int i = 0; i < COUNT; ++i)
  {
    const int byte = file.get();
    value = value * 256 + std::max(byte, 0);
  }
  return file ? value : 0;
}

/** Of a file whose signature (8 bytes) and first chunk's length and type (4 and 4) come before its size. */
std::optional<Header> readPngHeader(std::istream& file)
{
  file.seekg(16);
  const std::int64_t width = readNumber<4>(file);
  const std::int64_t height = readNumber<4>(file);
  return file ? std::optional<Header>({ width, height }) : std::nullopt;
}

/** Walks the segments as far as the start of frame. */
std::optional<Header> readJpegHeader(std::istream& file)
{
  file.seekg(2);
  while (file)
  {
    int marker = file.get();
    while (marker == 0xFF)  // any number of fill bytes may come before a marker
    {
      marker = file.get();
    }
    const std::int64_t length = readNumber<2>(file);
    const bool is_start_of_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_start_of_frame)
    {
      file.get();  // bits a sample
      const std::int64_t height = readNumber<2>(file);
      const std::int64_t width = readNumber<2>(file);
      return file ? std::optional<Header>({ width, height }) : std::nullopt;
    }
    file.seekg(std::max<std::int64_t>(length - 2, 0), std::ios::cur);
  }
  return std::nullopt;
}

/** Width and height in decimal after the magic number, between white space and comments. */
std::optional<Header> readPnmHeader(std::istream& file)
{
  file.seekg(2);
  std::array<std::int64_t, 2> size{};
  for (std::int64_t& side : size)
  {
    while (std::isspace(file.peek()) != 0 || file.peek() == '#')
    {
      if (file.get() == '#')
      {
        std::string comment;
        std::getline(file, comment);
      }
    }
    file >> side;
  }
  return file ? std::optional<Header>({ size[0], size[1] }) : std::nullopt;
}

/** Empty for other formats and when the header is cut short. */
std::optional<Header> readHeader(std::istream& file)
{
  std::array<char, 2> magic{};
  file.read(magic.data(), magic.size());
  if (magic == std::array<char, 2>{ '\x89', 'P' })
  {
    return readPngHeader(file);
  }
  if (magic == std::array<char, 2>{ '\xFF', '\xD8' })
  {
    return readJpegHeader(file);
  }
  if (magic[0] == 'P' && magic[1] >= '1' && magic[1] <= '6')
  {
    return readPnmHeader(file);
  }
  return std::nullopt;
}

/** A JPEG without its end mark: libjpeg fills what is missing with grey and calls it a success. */
bool isTruncatedJpeg(const Bytes& bytes)
{
  constexpr std::array<unsigned char, 3> START_MARK{ 0xFF, 0xD8, 0xFF };
  constexpr std::array<unsigned char, 2> SCAN_MARK{ 0xFF, 0xDA };
  constexpr std::array<unsigned char, 2> END_MARK{ 0xFF, 0xD9 };
  if (bytes.size() < START_MARK.size() || !std::equal(START_MARK.begin(), START_MARK.end(), bytes.begin()))
  {
    return false;
  }
  // The last scan starts after any thumbnail, which has an end mark of its own. 0xFF is escaped within a scan.
  const auto scan = std::find_end(bytes.begin(), bytes.end(), SCAN_MARK.begin(), SCAN_MARK.end());
  return std::search(scan, bytes.end(), END_MARK.begin(), END_MARK.end()) == bytes.end();
}

Bytes readFile(const std::string& path)
{
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (error)
  {
    throw ImageError("cannot read " + quoted(path) + ": " + error.message());
  }
  if (!fs::is_regular_file(status))
  {
    throw ImageError("cannot read " + quoted(path) + ": not a file");
  }
  std::ifstream file(path, std::ios::binary);
  if (!file)
  {
    throw ImageError("cannot read " + quoted(path) + ": " + std::generic_category().message(errno));
  }
  if (const std::optional<Header> header = readHeader(file))
  {
    checkSize(*header, path);
  }
  const std::uintmax_t size = fs::file_size(path, error);
  if (error || size > MAX_FILE_SIZE)
  {
    throw ImageError("cannot read " + quoted(path) + ": " + (error ? error.message() : std::string("file too large")));
  }
  Bytes bytes(size);
  file.clear();
  file.seekg(0);
  file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(file.gcount()) != size)
  {
    throw ImageError("cannot read " + quoted(path) + ": reading failed");
  }
  return bytes;
}

}  // namespace

cv::Mat toGrey(const cv::Mat& image, const std::string& name)
{
  if (image.empty())
  {
    throw ImageError(quoted(name) + " is empty");
  }
  checkSize({ image.cols, image.rows }, name);
  if (image.depth() != CV_8U && image.depth() != CV_16U)
  {
    throw ImageError(quoted(name) + " has pixels that are neither 8 nor 16 bits of intensity");
  }

  cv::Mat grey;
  switch (image.channels())
  {
    case 1:
      grey = image;
      break;
    case 3:
      cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
      break;
    case 4:
      cv::cvtColor(image, grey, cv::COLOR_BGRA2GRAY);
      break;
    default:
      throw ImageError(quoted(name) + " has " + std::to_string(image.channels()) + " channels; 1, 3 or 4 are known");
  }
  if (grey.depth() == CV_16U)
  {
    cv::Mat reduced;
    grey.convertTo(reduced, CV_8U, 1.0 / 257.0);
    return reduced;
  }
  return grey;
}

cv::Mat readGreyImage(const std::string& path)
{
  const Bytes bytes = readFile(path);
  cv::Mat image;
  if (!bytes.empty() && !isTruncatedJpeg(bytes))
  {
    try
    {
      // Unchanged: features are looked for in the pixels as the camera gave them, not as a viewer would turn them.
      image = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
    }
    catch (const cv::Exception&)
    {
      image.release();  // says the same as an empty result
    }
  }
  if (image.empty())
  {
    throw ImageError(quoted(path) + " is not an image, or is damaged");
  }
  return toGrey(image, path);
}

}  // namespace view_servo
