// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/images/image_io.h"

#include "view_servo/images/regular_file.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdlib>
#include <optional>
#include <sstream>
#include <vector>

namespace view_servo
{
namespace
{
/** No image within the limit needs more: four channels of 16 bits, and room for comments [bytes]. */
constexpr std::uintmax_t MAX_FILE_SIZE = 8 * MAX_IMAGE_PIXELS + 16'000'000;

/** Within these bytes a header has to say the image's size, after whatever else it says. */
constexpr std::size_t HEADER_SIZE = 4'000'000;

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

ImageError unreadable(const std::string& name)
{
  return ImageError(quoted(name) + " is not an image, or is damaged; PNG, JPEG, PNM, BMP and TIFF are read");
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

/** Big-endian number of COUNT bytes; 0 at the end of the data. */
template <int COUNT>
std::int64_t readNumber(std::istream& data)
{
  std::int64_t value = 0;
  for (int i = 0; i < COUNT; ++i)
  {
    const int byte = data.get();
    value = value * 256 + std::max(byte, 0);
  }
  return data ? value : 0;
}

/** The same with the least significant byte first. */
template <int COUNT>
std::int64_t readReversedNumber(std::istream& data)
{
  std::int64_t value = 0;
  for (int i = 0; i < COUNT; ++i)
  {
    value += static_cast<std::int64_t>(std::max(data.get(), 0)) << (8 * i);
  }
  return data ? value : 0;
}

/** Of a file whose signature (8 bytes) and first chunk's length and type (4 and 4) come before its size. */
std::optional<Header> readPngHeader(std::istream& file)
{
  file.seekg(16);
  const std::int64_t width = readNumber<4>(file);
  const std::int64_t height = readNumber<4>(file);
  return file ? std::optional<Header>({ width, height }) : std::nullopt;
}

/** Goes to behind the marker and length of the first segment of a JPEG file of a wanted kind; false: there is none. */
template <typename IsWanted>
bool goToJpegSegment(std::istream& file, const IsWanted& is_wanted)
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
    if (is_wanted(marker))
    {
      return static_cast<bool>(file);
    }
    file.seekg(std::max<std::int64_t>(length - 2, 0), std::ios::cur);
  }
  return false;
}

/** Of the start of frame. */
std::optional<Header> readJpegHeader(std::istream& file)
{
  const auto is_start_of_frame = [](int marker) {
    return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
  };
  if (!goToJpegSegment(file, is_start_of_frame))
  {
    return std::nullopt;
  }
  file.get();  // bits a sample
  const std::int64_t height = readNumber<2>(file);
  const std::int64_t width = readNumber<2>(file);
  return file ? std::optional<Header>({ width, height }) : std::nullopt;
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

/** The information header, or the older core header of 12 bytes, comes after a file header of 14. */
std::optional<Header> readBmpHeader(std::istream& file)
{
  constexpr std::int64_t CORE_HEADER = 12;
  file.seekg(14);
  if (readReversedNumber<4>(file) == CORE_HEADER)
  {
    const std::int64_t width = readReversedNumber<2>(file);
    const std::int64_t height = readReversedNumber<2>(file);
    return file ? std::optional<Header>({ width, height }) : std::nullopt;
  }
  const auto width = static_cast<std::int32_t>(readReversedNumber<4>(file));
  const auto height = static_cast<std::int32_t>(readReversedNumber<4>(file));  // negative: from top to bottom
  return file ? std::optional<Header>({ width, std::abs(std::int64_t{ height }) }) : std::nullopt;
}

/** The first directory has the sizes of image, tiles and strips; memory is taken by the largest of them. */
template <bool REVERSED>
std::optional<Header> readTiffHeader(std::istream& file)
{
  constexpr std::int64_t SHORT = 3;
  constexpr std::int64_t WIDTH = 256;
  constexpr std::int64_t HEIGHT = 257;
  constexpr std::int64_t ROWS_PER_STRIP = 278;
  constexpr std::int64_t TILE_WIDTH = 322;
  constexpr std::int64_t TILE_HEIGHT = 323;
  constexpr std::int64_t ALL_ROWS = 0xFFFFFFFF;
  const auto two = [&] {
    return REVERSED ? readReversedNumber<2>(file) : readNumber<2>(file);
  };
  const auto four = [&] {
    return REVERSED ? readReversedNumber<4>(file) : readNumber<4>(file);
  };
  file.seekg(4);
  file.seekg(four());
  Header size{ 0, 0 };
  Header part{ 0, 0 };
  for (std::int64_t entries = two(); entries > 0 && file; --entries)
  {
    const std::int64_t tag = two();
    const std::int64_t type = two();
    four();  // how many values
    const std::int64_t value = type == SHORT ? two() : four();
    if (type == SHORT)
    {
      two();
    }
    std::int64_t unused = 0;
    (tag == WIDTH                                                         ? size.width
     : tag == HEIGHT                                                      ? size.height
     : tag == TILE_WIDTH                                                  ? part.width
     : tag == TILE_HEIGHT || (tag == ROWS_PER_STRIP && value != ALL_ROWS) ? part.height
                                                                          : unused) = value;
  }
  if (!file || size.width == 0 || size.height == 0)
  {
    return std::nullopt;
  }
  return Header{ std::max(size.width, part.width), std::max(size.height, part.height) };
}

/** Empty for other formats, which cannot tell their size before they are decoded, and when the header is cut short. */
std::optional<Header> readHeader(const std::string& bytes)
{
  std::istringstream data(bytes.substr(0, HEADER_SIZE));
  const auto begins = [&](const std::string& magic) {
    return bytes.compare(0, magic.size(), magic) == 0;
  };
  if (begins("\x89P"))
  {
    return readPngHeader(data);
  }
  if (begins("\xFF\xD8"))
  {
    return readJpegHeader(data);
  }
  if (bytes.size() > 1 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6')
  {
    return readPnmHeader(data);
  }
  if (begins("BM"))
  {
    return readBmpHeader(data);
  }
  if (begins(std::string("II*\0", 4)))
  {
    data.str(bytes);  // its directory may be anywhere
    return readTiffHeader<true>(data);
  }
  if (begins(std::string("MM\0*", 4)))
  {
    data.str(bytes);
    return readTiffHeader<false>(data);
  }
  return std::nullopt;
}

/** A JPEG without its end mark: libjpeg fills what is missing with grey and calls it a success. */
bool isTruncatedJpeg(const std::string& bytes)
{
  constexpr std::array<char, 3> START_MARK{ '\xFF', '\xD8', '\xFF' };
  constexpr std::array<char, 2> END_MARK{ '\xFF', '\xD9' };
  if (bytes.size() < START_MARK.size() || !std::equal(START_MARK.begin(), START_MARK.end(), bytes.begin()))
  {
    return false;
  }
  // The first scan starts after any thumbnail, which has an end mark of its own. 0xFF is escaped within a scan. Whatever
  // comes after the end mark, as a film does in pictures of some phones, does not count.
  std::istringstream file(bytes);
  if (!goToJpegSegment(file, [](int marker) { return marker == 0xDA; }))
  {
    return true;
  }
  const auto scan = bytes.begin() + static_cast<std::ptrdiff_t>(file.tellg());
  return std::search(scan, bytes.end(), END_MARK.begin(), END_MARK.end()) == bytes.end();
}

/** The levels between which nearly all pixels are. */
struct Span
{
  int low;
  int high;
};

/** Of the pixels of every few rows. */
Span spanOf(const cv::Mat& grey, double outside)
{
  constexpr int ROWS = 200;  // looked at
  const int every = std::max(1, grey.rows / ROWS);
  std::vector<int> counts(std::size_t{ 1 } << 16U, 0);
  int total = 0;
  for (int row = 0; row < grey.rows; row += every)
  {
    for (int column = 0; column < grey.cols; ++column, ++total)
    {
      ++counts[grey.depth() == CV_16U ? grey.at<std::uint16_t>(row, column) : grey.at<unsigned char>(row, column)];
    }
  }
  const int few = static_cast<int>(outside * total);
  const auto edge = [few](auto from) {
    int passed = 0;
    int level = 0;
    for (; (passed += *from) <= few; ++from)
    {
      ++level;
    }
    return level;
  };
  return { edge(counts.begin()), static_cast<int>(counts.size()) - 1 - edge(counts.rbegin()) };
}

/** 16 bits to 8. A signal that uses a part of the range, as of 10 or 12 bits or infrared, is stretched. */
cv::Mat reduced(const cv::Mat& grey)
{
  constexpr double OUTSIDE = 0.005;  // of the pixels, at each end
  constexpr int WIDE = 26214;        // 0.4 of the range: signals this wide are left as they are
  constexpr int NARROWEST = 64;      // what is narrower is noise
  constexpr double MARGIN = 0.1;     // of the span, at each end: what is brighter than nearly all is still told apart
  constexpr double WHOLE = 257.0;    // 65535 / 255
  const Span span = spanOf(grey, OUTSIDE);
  const int width = std::max(span.high - span.low, NARROWEST);
  cv::Mat result;
  if (width >= WIDE)
  {
    grey.convertTo(result, CV_8U, 1.0 / WHOLE);
    return result;
  }
  const double scale = 255.0 / ((1.0 + 2.0 * MARGIN) * width);
  grey.convertTo(result, CV_8U, scale, -scale * (span.low - MARGIN * width));
  return result;
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
    return reduced(grey);
  }
  return grey;
}

cv::Size encodedImageSize(const std::string& bytes, const std::string& name)
{
  const std::optional<Header> header = readHeader(bytes);
  if (!header)
  {
    throw unreadable(name);
  }
  checkSize(*header, name);
  return { static_cast<int>(header->width), static_cast<int>(header->height) };
}

cv::Mat decodeImage(const std::string& bytes, const std::string& name)
{
  encodedImageSize(bytes, name);
  cv::Mat image;
  if (!isTruncatedJpeg(bytes))
  {
    try
    {
      // Unchanged: features are looked for in the pixels as the camera gave them, not as a viewer would turn them.
      const cv::Mat data(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
      image = cv::imdecode(data, cv::IMREAD_UNCHANGED);
    }
    catch (const cv::Exception&)
    {
      image.release();  // says the same as an empty result
    }
  }
  if (image.empty())
  {
    throw unreadable(name);
  }
  return image;
}

cv::Mat decodeGreyImage(const std::string& bytes, const std::string& name)
{
  return toGrey(decodeImage(bytes, name), name);
}

cv::Mat readGreyImage(const std::string& path)
{
  std::optional<std::string> bytes;
  std::string reason = "No such file or directory";
  try
  {
    bytes = readRegularFile(path, MAX_FILE_SIZE);
  }
  catch (const std::runtime_error& error)
  {
    reason = error.what();
  }
  if (!bytes)
  {
    throw ImageError("cannot read " + quoted(path) + ": " + reason);
  }
  return decodeGreyImage(*bytes, path);
}

std::string lackOfLight(const cv::Mat& grey)
{
  constexpr double OUTSIDE = 0.01;  // of the pixels, at each end
  constexpr int DARK = 20;
  constexpr int BRIGHT = 235;
  constexpr int EVEN = 10;
  const Span span = spanOf(grey, OUTSIDE);
  if (span.high < DARK)
  {
    return "nearly black";
  }
  if (span.low > BRIGHT)
  {
    return "nearly white";
  }
  return span.high - span.low < EVEN ? "nearly the same everywhere" : "";
}

}  // namespace view_servo
