// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/ros/conversions.h"

#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/parameters/shown_text.h"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>
#include <boost/endian/conversion.hpp>
#include <boost/make_shared.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
/** A homography message that says nothing. */
Homography unknownHomography(const std::string& view, const std_msgs::Header& header)
{
  Homography message;
  message.header = header;
  message.view = view;
  message.state = Homography::SEARCHING;
  copyRowMajor(Eigen::Matrix3d::Constant(NOT_A_NUMBER), message.h);
  message.rms_error = NOT_A_NUMBER;
  message.rotation.x = message.rotation.y = message.rotation.z = message.rotation.w = NOT_A_NUMBER;
  message.translation_over_distance = message.normal = toMessage(Eigen::Vector3d::Constant(NOT_A_NUMBER));
  message.distance = NOT_A_NUMBER;
  return message;
}

/** Encodings whose channels are not in the order the core reads: they have to pass through cv_bridge. */
bool needsReordering(const std::string& encoding)
{
  namespace enc = sensor_msgs::image_encodings;
  return enc::isBayer(encoding) || encoding == enc::RGB8 || encoding == enc::RGBA8 || encoding == enc::RGB16 ||
         encoding == enc::RGBA16 || encoding == enc::YUV422;
}

/** Grey of an image that needs reordering; all bits count. @throws cv_bridge::Exception, cv::Exception, ImageError. */
cv::Mat reordered(const cv_bridge::CvImageConstPtr& image, const std::string& name)
{
  namespace enc = sensor_msgs::image_encodings;
  const std::string& ordered = enc::bitDepth(image->encoding) == 16 ? enc::BGR16 : enc::BGR8;
  return toGrey(cv_bridge::cvtColor(image, ordered)->image, name);
}

/** @throws ImageError when a message has too many pixels, or not the bytes that it says. */
void requireWhole(const sensor_msgs::Image& image, const std::string& name)
{
  if (static_cast<std::uint64_t>(image.width) * image.height > static_cast<std::uint64_t>(MAX_IMAGE_PIXELS))
  {
    throw ImageError("'" + name + "': " + std::to_string(image.width) + " x " + std::to_string(image.height) +
                     " pixels are too many, the limit is " + std::to_string(MAX_IMAGE_PIXELS));
  }
  // cv_bridge compares in 32 bits, where the product may wrap.
  if (static_cast<std::uint64_t>(image.step) * image.height != image.data.size())
  {
    throw ImageError("'" + name + "': " + std::to_string(image.data.size()) + " bytes are not " +
                     std::to_string(image.height) + " rows of " + std::to_string(image.step));
  }
}

/** cv_bridge swaps the bytes of no image with padded rows, and changes the type of others. @throws cv_bridge's. */
bool needsSwapping(const sensor_msgs::Image& image)
{
  constexpr bool HERE = boost::endian::order::native == boost::endian::order::big;
  return (image.is_bigendian != 0) != HERE && sensor_msgs::image_encodings::bitDepth(image.encoding) == 16;
}

/** The same image in the order of bytes of this machine; of 16 bits. */
sensor_msgs::Image swapped(const sensor_msgs::Image& image)
{
  sensor_msgs::Image result = image;
  result.is_bigendian = image.is_bigendian != 0 ? 0 : 1;
  for (std::size_t row = 0; row < image.height; ++row)
  {
    std::uint8_t* const data = result.data.data() + row * image.step;
    for (std::size_t i = 0; i + 1 < image.step; i += 2)
    {
      std::swap(data[i], data[i + 1]);
    }
  }
  return result;
}

/**
 * Runs `body`, which uses an image. @throws ImageError; what OpenCV and cv_bridge throw is told as one.
 * @param said what the image is said to be.
 */
template <typename Body>
cv::Mat aboutImage(const std::string& name, const std::string& said, const Body& body)
{
  try
  {
    return body();
  }
  catch (const ImageError&)
  {
    throw;
  }
  catch (const std::exception& error)
  {
    throw ImageError("'" + name + "': " + said + ": " + oneLine(error));
  }
}

/** Hands a whole message in this machine's order of bytes to `body`. @throws ImageError. */
template <typename Body>
cv::Mat withImage(const sensor_msgs::Image& image, const std::string& name, const Body& body)
{
  requireWhole(image, name);
  return aboutImage(name, "encoding '" + shown(image.encoding) + "'", [&] {
    const boost::shared_ptr<const void> outlives_this_call;
    if (needsSwapping(image))
    {
      const sensor_msgs::Image ordered = swapped(image);
      return body(cv_bridge::toCvShare(ordered, outlives_this_call));
    }
    return body(cv_bridge::toCvShare(image, outlives_this_call));
  });
}

/** What `read`, given the data and its name, makes of a compressed image; errors say what it was said to be. */
template <typename Result>
Result readCompressed(const sensor_msgs::CompressedImage& image, const std::string& name,
                      Result (*read)(const std::string&, const std::string&))
{
  const std::string said = " (format '" + shown(image.format) + "', " + std::to_string(image.data.size()) + " bytes)";
  if (image.format.find("compressedDepth") != std::string::npos)
  {
    throw ImageError("'" + name + "' is a depth image, which shows no intensities" + said);
  }
  try
  {
    return read(std::string(image.data.begin(), image.data.end()), name);
  }
  catch (const ImageError& error)
  {
    throw ImageError(error.what() + said);
  }
}

}  // namespace

ros::Time toStamp(double seconds)
{
  constexpr double LARGEST = 4294967295.0;  // that a stamp holds [s]
  return ros::Time(std::isfinite(seconds) ? std::clamp(seconds, 0.0, LARGEST) : 0.0);
}

bool sameCalibration(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b)
{
  sensor_msgs::CameraInfo other = b;
  other.header = a.header;
  return other == a;
}

Camera toCamera(const sensor_msgs::CameraInfo& info)
{
  const bool whole = info.roi.width == 0 || info.roi.height == 0;
  const std::uint32_t width = whole ? info.width : info.roi.width;
  const std::uint32_t height = whole ? info.height : info.roi.height;
  const double bin_x = std::max(info.binning_x, 1U);  // 0 means 1
  const double bin_y = std::max(info.binning_y, 1U);

  // Pixels of the sensor -> pixels of the image.
  Eigen::Matrix3d to_image = Eigen::Vector3d(1.0 / bin_x, 1.0 / bin_y, 1.0).asDiagonal();
  if (!whole)
  {
    to_image(0, 2) = -(info.roi.x_offset / bin_x);
    to_image(1, 2) = -(info.roi.y_offset / bin_y);
  }
  Camera camera;
  constexpr double LARGEST = std::numeric_limits<int>::max();  // which no camera has, so that a fault is found
  camera.width = static_cast<int>(std::min(width / bin_x, LARGEST));
  camera.height = static_cast<int>(std::min(height / bin_y, LARGEST));
  camera.distortion_model = info.distortion_model;
  camera.distortion = info.D;
  camera.k = to_image * Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(info.K.data());
  camera.rectification = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(info.R.data());
  camera.projection = to_image * Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(info.P.data());
  return camera;
}

sensor_msgs::CameraInfo toCameraInfo(const Camera& camera, const std_msgs::Header& header)
{
  sensor_msgs::CameraInfo info;
  info.header = header;
  info.width = static_cast<std::uint32_t>(camera.width);
  info.height = static_cast<std::uint32_t>(camera.height);
  info.distortion_model = camera.distortion_model;
  info.D = camera.distortion;
  copyRowMajor(camera.k, info.K);
  copyRowMajor(camera.rectification, info.R);
  Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>(info.P.data()) = camera.projection;
  return info;
}

cv::Mat toGrey(const sensor_msgs::Image& image, const std::string& name)
{
  return withImage(image, name, [&](const cv_bridge::CvImageConstPtr& shared) {
    return needsReordering(image.encoding) ? reordered(shared, name) : toGrey(shared->image, name).clone();
  });
}

cv::Mat toColour(const sensor_msgs::Image& image, const std::string& name)
{
  namespace enc = sensor_msgs::image_encodings;
  if (enc::isColor(image.encoding) && enc::bitDepth(image.encoding) == 8)
  {
    return withImage(image, name, [](const cv_bridge::CvImageConstPtr& shared) {
      return cv_bridge::cvtColor(shared, enc::BGR8)->image.clone();
    });
  }
  cv::Mat colour;
  cv::cvtColor(toGrey(image, name), colour, cv::COLOR_GRAY2BGR);
  return colour;
}

cv::Size sizeOf(const sensor_msgs::CompressedImage& image, const std::string& name)
{
  return readCompressed(image, name, encodedImageSize);
}

cv::Mat toGrey(const sensor_msgs::CompressedImage& image, const std::string& name)
{
  const cv::Mat decoded = readCompressed(image, name, decodeImage);
  const std::string encoding = decodedEncoding(image.format, decoded.type());
  if (!needsReordering(encoding))
  {
    return toGrey(decoded, name);
  }
  return aboutImage(name, "format '" + shown(image.format) + "'", [&] {
    return reordered(boost::make_shared<const cv_bridge::CvImage>(image.header, encoding, decoded), name);
  });
}

std::string decodedEncoding(const std::string& format, int type)
{
  namespace enc = sensor_msgs::image_encodings;
  const std::size_t separator = format.find(';');
  std::string original = separator == std::string::npos ? "" : format.substr(0, separator);
  const bool is_rgb = enc::isColor(original) && format.find("compressed bgr", separator) == std::string::npos;
  const bool has_16_bits = CV_MAT_DEPTH(type) == CV_16U;
  switch (CV_MAT_CN(type))
  {
    case 3:
      return has_16_bits ? (is_rgb ? enc::RGB16 : enc::BGR16) : (is_rgb ? enc::RGB8 : enc::BGR8);
    case 4:
      return has_16_bits ? (is_rgb ? enc::RGBA16 : enc::BGRA16) : (is_rgb ? enc::RGBA8 : enc::BGRA8);
    default:
      if (enc::isBayer(original) && (enc::bitDepth(original) == 16) == has_16_bits)
      {
        return original;
      }
      return has_16_bits ? enc::MONO16 : enc::MONO8;
  }
}

sensor_msgs::Image toImage(const cv::Mat& image, const std::string& encoding, const std_msgs::Header& header)
{
  sensor_msgs::Image message;
  cv_bridge::CvImage(header, encoding, image).toImageMsg(message);
  return message;
}

cv::Rect toRect(const sensor_msgs::RegionOfInterest& roi, const cv::Size& image)
{
  if (roi.width == 0 && roi.height == 0)
  {
    return {};
  }
  const std::uint64_t right = std::uint64_t{ roi.x_offset } + roi.width;
  const std::uint64_t bottom = std::uint64_t{ roi.y_offset } + roi.height;
  if (roi.width == 0 || roi.height == 0 || right > static_cast<std::uint64_t>(image.width) ||
      bottom > static_cast<std::uint64_t>(image.height))
  {
    throw ImageError("roi: " + std::to_string(roi.width) + " x " + std::to_string(roi.height) + " at (" +
                     std::to_string(roi.x_offset) + ", " + std::to_string(roi.y_offset) +
                     ") does not lie within the image of " + std::to_string(image.width) + " x " +
                     std::to_string(image.height));
  }
  return { static_cast<int>(roi.x_offset), static_cast<int>(roi.y_offset), static_cast<int>(roi.width),
           static_cast<int>(roi.height) };
}

sensor_msgs::RegionOfInterest toRegionOfInterest(const cv::Rect& rect)
{
  sensor_msgs::RegionOfInterest roi;
  roi.x_offset = static_cast<std::uint32_t>(rect.x);
  roi.y_offset = static_cast<std::uint32_t>(rect.y);
  roi.width = static_cast<std::uint32_t>(rect.width);
  roi.height = static_cast<std::uint32_t>(rect.height);
  return roi;
}

ViewPose toViewPose(const geometry_msgs::TransformStamped& transform)
{
  const geometry_msgs::Vector3& position = transform.transform.translation;
  const geometry_msgs::Quaternion& orientation = transform.transform.rotation;
  return { transform.header.frame_id,
           { position.x, position.y, position.z },
           { orientation.w, orientation.x, orientation.y, orientation.z } };
}

geometry_msgs::PoseStamped toPoseStamped(const ViewPose& pose, const ros::Time& stamp)
{
  geometry_msgs::PoseStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = pose.frame;
  message.pose.position.x = pose.position.x();
  message.pose.position.y = pose.position.y();
  message.pose.position.z = pose.position.z();
  message.pose.orientation = toMessage(pose.orientation);
  return message;
}

geometry_msgs::PoseWithCovariance toPoseWithCovariance(const CameraPose& pose)
{
  geometry_msgs::PoseWithCovariance message;
  const Eigen::Vector3d position = pose.view_from_current.translation();
  message.pose.position.x = position.x();
  message.pose.position.y = position.y();
  message.pose.position.z = position.z();
  message.pose.orientation = toMessage(Eigen::Quaterniond(pose.view_from_current.linear()));
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.covariance.data()) = pose.covariance;
  return message;
}

std::vector<PointMatch> toPointMatches(const std::vector<MatchedPoint>& matches)
{
  std::vector<PointMatch> messages(matches.size());
  std::transform(matches.begin(), matches.end(), messages.begin(), [](const MatchedPoint& match) {
    PointMatch message;
    message.reference_x = match.position.reference.x();
    message.reference_y = match.position.reference.y();
    message.current_x = match.position.current.x();
    message.current_y = match.position.current.y();
    message.score = match.score;
    message.inlier = match.inlier;
    return message;
  });
  return messages;
}

LineSegment toLineSegment(const Segment& segment)
{
  LineSegment message;
  message.x1 = segment.start.x();
  message.y1 = segment.start.y();
  message.x2 = segment.end.x();
  message.y2 = segment.end.y();
  return message;
}

std::vector<LineMatch> toLineMatches(const std::vector<MatchedLine>& lines)
{
  std::vector<LineMatch> messages(lines.size());
  std::transform(lines.begin(), lines.end(), messages.begin(), [](const MatchedLine& line) {
    LineMatch message;
    message.reference = toLineSegment(line.reference);
    message.current = toLineSegment(line.current);
    message.score = line.score;
    message.plane = line.plane;
    return message;
  });
  return messages;
}

std::vector<double> toRowMajor(const std::vector<Eigen::Matrix3d>& matrices)
{
  std::vector<double> numbers;
  numbers.reserve(9 * matrices.size());
  for (const Eigen::Matrix3d& matrix : matrices)
  {
    std::array<double, 9> rows;
    copyRowMajor(matrix, rows);
    numbers.insert(numbers.end(), rows.begin(), rows.end());
  }
  return numbers;
}

Homography toHomography(const ViewMatch& match, const std::string& view, const std_msgs::Header& header)
{
  Homography message = unknownHomography(view, header);
  message.matches = static_cast<std::int32_t>(match.matches.size());
  message.valid = match.outcome == MatchOutcome::MATCHED && match.model == GeometryModel::HOMOGRAPHY;
  if (!message.valid)
  {
    message.reason = match.message;
    return message;
  }
  message.state = Homography::TRACKING;
  copyRowMajor(match.matrix, message.h);
  message.inliers = match.inliers;
  message.rms_error = match.rms_error;
  return message;
}

Homography toHomography(const PlaneTrack& track, const std::string& view, const std_msgs::Header& header,
                        const std::string& reason)
{
  Homography message = unknownHomography(view, header);
  message.matches = track.homography.looked_for;
  message.valid = track.state == TrackingState::TRACKING;
  if (!message.valid)
  {
    message.state = track.state == TrackingState::LOST ? Homography::LOST : Homography::SEARCHING;
    message.reason = reason;
    return message;
  }
  message.state = Homography::TRACKING;
  copyRowMajor(track.homography.h, message.h);
  message.inliers = track.homography.supporting;
  message.rms_error = track.homography.rms;
  if (track.plane)
  {
    const EuclideanHomography& motion = track.plane->motion;
    message.rotation = toMessage(Eigen::Quaterniond(motion.rotation));
    message.translation_over_distance = toMessage(motion.translation_over_distance);
    if (track.plane->normal_known)
    {
      message.normal = toMessage(motion.normal);
    }
    message.distance = track.plane->distance.value_or(NOT_A_NUMBER);
    message.ambiguous = track.plane->ambiguous;
  }
  return message;
}

Eigen::Isometry3d toIsometry(const geometry_msgs::Transform& transform)
{
  const Eigen::Quaterniond rotation(transform.rotation.w, transform.rotation.x, transform.rotation.y,
                                    transform.rotation.z);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotation.normalized().toRotationMatrix();
  pose.translation() = toVector(transform.translation);
  return pose;
}

Eigen::Vector3d toVector(const geometry_msgs::Vector3& vector)
{
  return { vector.x, vector.y, vector.z };
}

geometry_msgs::Quaternion toMessage(const Eigen::Quaterniond& rotation)
{
  geometry_msgs::Quaternion message;
  message.x = rotation.x();
  message.y = rotation.y();
  message.z = rotation.z();
  message.w = rotation.w();
  return message;
}

geometry_msgs::Vector3 toMessage(const Eigen::Vector3d& vector)
{
  geometry_msgs::Vector3 message;
  message.x = vector.x();
  message.y = vector.y();
  message.z = vector.z();
  return message;
}

}  // namespace view_servo
