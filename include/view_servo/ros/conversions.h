// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/Homography.h"
#include "view_servo/LineMatch.h"
#include "view_servo/LineSegment.h"
#include "view_servo/PointMatch.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/camera_pose.h"
#include "view_servo/geometry/line_segment.h"
#include "view_servo/tracking/plane_tracker.h"
#include "view_servo/views/view_match.h"
#include "view_servo/views/view_store.h"

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovariance.h>
#include <geometry_msgs/Quaternion.h>
#include <geometry_msgs/Transform.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Vector3.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/RegionOfInterest.h>
#include <std_msgs/Header.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>

#include <string>
#include <vector>

namespace view_servo
{
/** @file
 * Between the core's types and messages. All results are copies: they do not refer to their source.
 */

/** A time [s] as a stamp: clamped to the range of stamps, and 0 when it is not finite. */
ros::Time toStamp(double seconds);

/** Whether two calibrations are the same; headers are not compared. */
bool sameCalibration(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b);

/**
 * The camera of the image that comes with `info`. Size, intrinsics and projection take binning and region of interest
 * into account, so that they hold for the pixels of that image.
 */
Camera toCamera(const sensor_msgs::CameraInfo& info);
/** A calibration for the pixels of the camera's images: without binning and region of interest. */
sensor_msgs::CameraInfo toCameraInfo(const Camera& camera, const std_msgs::Header& header);

/**
 * An image as 8-bit grey: mono, BGR(A), RGB(A), Bayer and YUV 4:2:2 encodings, 8 or 16 bit.
 * @param name what an error calls the image.
 * @throws ImageError when the encoding or the size cannot be used, or the data does not fit the size.
 */
cv::Mat toGrey(const sensor_msgs::Image& image, const std::string& name);

/**
 * As 8-bit BGR, for people; images of 16 bits and mosaics are shown as grey. @param name as above. @throws ImageError as
 * toGrey() does.
 */
cv::Mat toColour(const sensor_msgs::Image& image, const std::string& name);
/**
 * A JPEG or PNG image, or another format of decodeImage(), as 8-bit grey.
 * @param name as above. @throws ImageError, with format and number of bytes, when it is damaged, is not such an image,
 * holds depths (compressedDepth), or has a size beyond the limits, which is found before it is decoded.
 */
cv::Mat toGrey(const sensor_msgs::CompressedImage& image, const std::string& name);

/**
 * Size of a compressed image by the header of its data. @param name as above. @throws ImageError as toGrey() does,
 * unless it is what follows the header that is damaged.
 */
cv::Size sizeOf(const sensor_msgs::CompressedImage& image, const std::string& name);

/**
 * The encoding (sensor_msgs::image_encodings) of what OpenCV makes of a compressed image, as compressed_image_transport
 * has it: "rgb8; jpeg compressed bgr8" is decoded to BGR; a colour image without "compressed bgr" is in the order RGB;
 * what says nothing of colours, as "jpeg", is in the order BGR. @param type of the decoded image, e.g. CV_8UC3.
 */
std::string decodedEncoding(const std::string& format, int type);

/** The image as a message. @param encoding one of sensor_msgs::image_encodings, which must fit the image's type. */
sensor_msgs::Image toImage(const cv::Mat& image, const std::string& encoding, const std_msgs::Header& header);

/** Width and height 0 stand for the whole image, as an empty rectangle. @throws ImageError when it leaves the image. */
cv::Rect toRect(const sensor_msgs::RegionOfInterest& roi, const cv::Size& image);
sensor_msgs::RegionOfInterest toRegionOfInterest(const cv::Rect& rect);

/** The pose in a transform that tf gives from the view's frame (source) to ViewPose::frame (target). */
ViewPose toViewPose(const geometry_msgs::TransformStamped& transform);
/** The pose in its own frame, ViewPose::frame. */
geometry_msgs::PoseStamped toPoseStamped(const ViewPose& pose, const ros::Time& stamp);
/** Of CameraPose::view_from_current. */
geometry_msgs::PoseWithCovariance toPoseWithCovariance(const CameraPose& pose);

/** The matches in the same order; places in pixels, as they are. */
std::vector<PointMatch> toPointMatches(const std::vector<MatchedPoint>& matches);
LineSegment toLineSegment(const Segment& segment);
std::vector<LineMatch> toLineMatches(const std::vector<MatchedLine>& lines);

/**
 * Writes a matrix row by row into an array of nine numbers; arrays in messages are boost::array in some ROS releases
 * and std::array in others.
 */
template <typename Array>
void copyRowMajor(const Eigen::Matrix3d& matrix, Array& array)
{
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(array.data()) = matrix;
}

/** Matrices one after the other, nine numbers each, row by row. */
std::vector<double> toRowMajor(const std::vector<Eigen::Matrix3d>& matrices);

/**
 * A message about a plane that matching looked for: TRACKING and valid with the homography when `match` found one, else
 * SEARCHING. What would follow from a decomposition (rotation, translation, normal) is left NaN.
 */
Homography toHomography(const ViewMatch& match, const std::string& view, const std_msgs::Header& header);

/** The same for a tracked plane, with what is known of motion and plane. @param reason why it is not tracked. */
Homography toHomography(const PlaneTrack& track, const std::string& view, const std_msgs::Header& header,
                        const std::string& reason);

/** A transform as tf gives it: maps points of the source frame to the target frame. */
Eigen::Isometry3d toIsometry(const geometry_msgs::Transform& transform);

Eigen::Vector3d toVector(const geometry_msgs::Vector3& vector);
geometry_msgs::Vector3 toMessage(const Eigen::Vector3d& vector);
geometry_msgs::Quaternion toMessage(const Eigen::Quaterniond& rotation);

}  // namespace view_servo
