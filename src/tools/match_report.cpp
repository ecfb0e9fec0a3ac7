// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/match_report.h"

#include "tools/command_line.h"
#include "tools/json_text.h"
#include "view_servo/geometry/region.h"
#include "view_servo/views/overlay.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <fstream>
#include <iostream>
#include <iterator>
#include <stdexcept>

namespace view_servo
{
namespace
{
std::string nameOf(GeometryModel model)
{
  const auto known =
      std::find_if(MODELS.begin(), MODELS.end(), [=](const auto& entry) { return entry.second == model; });
  return known->first;
}

/** A homography from nine numbers, row by row, or from the first matrix of a file of OpenCV's (XML, YAML, JSON). */
Eigen::Matrix3d readHomography(const std::string& path)
{
  std::ifstream file(path);
  const std::vector<double> numbers{ std::istream_iterator<double>(file), std::istream_iterator<double>() };
  if (numbers.size() == 9)
  {
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers.data());
  }
  try
  {
    const QuietStandardError quiet;
    const cv::FileStorage storage(path, cv::FileStorage::READ);
    cv::Mat matrix;
    storage.getFirstTopLevelNode() >> matrix;
    if (matrix.size() == cv::Size(3, 3) && matrix.channels() == 1)
    {
      Eigen::Matrix3d h;
      cv::cv2eigen(matrix, h);
      return h;
    }
  }
  catch (const cv::Exception&)
  {
    // Whatever it is, it holds no matrix.
  }
  throw std::runtime_error("--truth: cannot read a 3 x 3 matrix from '" + path + "'");
}

/** Mean distance between the places to which two homographies take the corners of an image [px]. */
double meanCornerError(const Eigen::Matrix3d& h, const Eigen::Matrix3d& truth, const cv::Size& size)
{
  double sum = 0.0;
  for (const Eigen::Vector2d& corner : cornersOf(size))
  {
    const Eigen::Vector3d x = corner.homogeneous();
    sum += ((h * x).hnormalized() - (truth * x).hnormalized()).norm();
  }
  return sum / 4.0;
}

void writeOverlay(const std::string& path, const cv::Mat& picture)
{
  std::vector<unsigned char> bytes;
  cv::imencode(path.substr(path.rfind('.')), picture, bytes);
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file)
  {
    throw std::runtime_error("--overlay: cannot write '" + path + "'");
  }
}

nlohmann::json coordinates(const Segment& segment)
{
  return { segment.start.x(), segment.start.y(), segment.end.x(), segment.end.y() };
}

/** What all kinds of matches have in common. */
nlohmann::json resultOf(const ViewMatch& match, const std::optional<double>& corner_error)
{
  nlohmann::json json;
  json["success"] = match.outcome == MatchOutcome::MATCHED;
  json["message"] = match.message;
  json["model"] = nameOf(match.model);
  json["matrix"] = toJson(match.matrix);
  json["inliers"] = match.inliers;
  json["rms_error"] = match.rms_error;
  if (corner_error)
  {
    json["mean_corner_error"] = *corner_error;
  }
  json["elapsed_ms"]["total"] = match.elapsed_ms;
  for (const StageTime& stage : match.stages)
  {
    json["elapsed_ms"][stage.name] = stage.ms;
  }
  return json;
}

void printText(const ViewMatch& match, const MatchOptions& options, const std::optional<double>& corner_error)
{
  std::cout << match.message << '\n';
  if (match.outcome == MatchOutcome::MATCHED)
  {
    std::cout << nameOf(match.model) << " (reference -> current):\n" << match.matrix << '\n';
    std::cout << "rms error of the inliers: " << match.rms_error << " px\n";
  }
  if (corner_error)
  {
    std::cout << "mean corner error: " << *corner_error << " px\n";
  }
  std::cout << "time: " << match.elapsed_ms << " ms\n";
  if (!options.overlay.empty())
  {
    std::cout << "overlay: " << options.overlay << '\n';
  }
}

}  // namespace

nlohmann::json toJson(const Eigen::Vector2d& point)
{
  return point.allFinite() ? nlohmann::json{ point.x(), point.y() } : nlohmann::json();
}

nlohmann::json toJson(const Eigen::Matrix3d& matrix)
{
  if (!matrix.allFinite())
  {
    return nullptr;
  }
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = matrix;
  return std::vector<double>(rows.data(), rows.data() + rows.size());
}

nlohmann::json toJson(const std::vector<MatchedPoint>& points)
{
  nlohmann::json json = nlohmann::json::array();
  for (const MatchedPoint& point : points)
  {
    json.push_back({ { "reference", toJson(point.position.reference) },
                     { "current", toJson(point.position.current) },
                     { "score", point.score },
                     { "inlier", point.inlier } });
  }
  return json;
}

nlohmann::json toJson(const std::vector<MatchedLine>& lines)
{
  nlohmann::json json = nlohmann::json::array();
  for (const MatchedLine& line : lines)
  {
    json.push_back({ { "reference", coordinates(line.reference) },
                     { "current", coordinates(line.current) },
                     { "reference_index", line.reference_index },
                     { "current_index", line.current_index },
                     { "score", line.score },
                     { "plane", line.plane } });
  }
  return json;
}

nlohmann::json toJson(const std::vector<Eigen::Matrix3d>& matrices)
{
  nlohmann::json json = nlohmann::json::array();
  for (const Eigen::Matrix3d& matrix : matrices)
  {
    json.push_back(toJson(matrix));
  }
  return json;
}

MatchReport::MatchReport(const MatchOptions& options) : options_(options)
{
  if (!options.overlay.empty() && !cv::haveImageWriter(options.overlay))
  {
    throw std::runtime_error("--overlay: '" + options.overlay +
                             "' has no ending that says which kind of image to write, such as .png");
  }
  if (!options.truth.empty())
  {
    if (options.model != "homography")
    {
      throw std::runtime_error("--truth: only homographies can be compared");
    }
    truth_ = readHomography(options.truth);
  }
}

bool MatchReport::write(const ViewMatch& match, const PreparedImage& reference, const PreparedImage& current,
                        const nlohmann::json& more) const
{
  const bool found = match.outcome == MatchOutcome::MATCHED;
  if (!options_.overlay.empty())
  {
    writeOverlay(options_.overlay, drawOverlay(reference, current, match));
  }
  std::optional<double> corner_error;
  if (truth_ && found)
  {
    corner_error = meanCornerError(match.matrix, *truth_, reference.grey().size());
  }
  if (options_.json)
  {
    nlohmann::json json = resultOf(match, corner_error);
    json.update(more);
    std::cout << jsonText(json) << '\n';
  }
  else
  {
    printText(match, options_, corner_error);
  }
  return found;
}

}  // namespace view_servo
