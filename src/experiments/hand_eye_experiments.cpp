// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/hand_eye_experiments.h"

#include "experiments/arm_data.h"
#include "experiments/input_file.h"
#include "experiments/parallel.h"
#include "experiments/shipped_worlds.h"
#include "experiments/statistics.h"
#include "tools/package_folder.h"
#include "trials/hand_eye_trial.h"
#include "view_servo/geometry/hand_eye.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/rotation_vector.h"
#include "view_servo/parameters/numbers.h"

#include <Eigen/Geometry>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
namespace
{
constexpr std::array<const char*, 2> HAND_EYE_WORLDS = { "rice", "mouse" };

double millimetresBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  return 1e3 * (a.translation() - b.translation()).norm();
}

double degreesBetween(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b)
{
  return DEGREES * rotationVector(a.linear().transpose() * b.linear()).norm();
}

/** Errors of place [mm] and direction [degrees] along the axes of the true camera, as numbers of a table. */
std::string inFrame(const Eigen::Isometry3d& camera, const Eigen::Isometry3d& truth)
{
  const Eigen::Isometry3d off = truth.inverse() * camera;
  const Eigen::IOFormat format(Eigen::StreamPrecision, Eigen::DontAlignCols, ",", ",");
  std::ostringstream text;
  text << Eigen::Vector3d(1e3 * off.translation()).transpose().format(format) << ','
       << Eigen::Vector3d(DEGREES * rotationVector(off.linear())).transpose().format(format);
  return text.str();
}

int usedOf(const HandEyeResult& result)
{
  return static_cast<int>(std::count_if(result.residuals.begin(), result.residuals.end(),
                                        [](const HandEyeResidual& residual) { return residual.used; }));
}

double largest(const std::vector<double>& values)
{
  return *std::max_element(values.begin(), values.end());
}

// -------------------------------------------------------------------------------------------------------- real arm

/** The pose of the camera on the hand, by the board with the size of its squares. */
Eigen::Isometry3d byBoard(const ArmData& data, cv::HandEyeCalibrationMethod method)
{
  std::vector<cv::Mat> hand_rotations;
  std::vector<cv::Mat> hand_translations;
  std::vector<cv::Mat> board_rotations;
  std::vector<cv::Mat> board_translations;
  std::vector<cv::Point3d> board;
  for (const Eigen::Vector3d& corner : ArmData::board())
  {
    board.emplace_back(corner.x(), corner.y(), corner.z());
  }
  cv::Mat k;
  cv::eigen2cv(data.camera.k, k);
  for (const ArmView& view : data.views)
  {
    std::vector<cv::Point2d> seen;
    for (const Eigen::Vector2d& corner : view.corners)
    {
      seen.emplace_back(corner.x(), corner.y());
    }
    cv::Mat rotation;
    cv::Mat translation;
    cv::solvePnP(board, seen, k, cv::noArray(), rotation, translation);
    cv::Mat matrix;
    cv::Rodrigues(rotation, matrix);
    board_rotations.push_back(matrix);
    board_translations.push_back(translation);
    cv::Mat hand_rotation;
    cv::Mat hand_translation;
    cv::eigen2cv(Eigen::Matrix3d(view.hand_in_base.linear()), hand_rotation);
    cv::eigen2cv(Eigen::Vector3d(view.hand_in_base.translation()), hand_translation);
    hand_rotations.push_back(hand_rotation);
    hand_translations.push_back(hand_translation);
  }
  cv::Mat rotation;
  cv::Mat translation;
  cv::calibrateHandEye(hand_rotations, hand_translations, board_rotations, board_translations, rotation, translation,
                       method);
  Eigen::Matrix3d r;
  Eigen::Vector3d t;
  cv::cv2eigen(rotation, r);
  cv::cv2eigen(translation, t);
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = r;
  result.translation() = t;
  return result;
}

/** The distance of the board from a camera, with the size of its squares [m]. */
double distanceOfBoard(const ArmData& data, const ArmView& view)
{
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> seen;
  const std::vector<Eigen::Vector3d> corners = ArmData::board();
  for (std::size_t i = 0; i < corners.size(); ++i)
  {
    board.emplace_back(corners[i].x(), corners[i].y(), 0.0);
    seen.emplace_back(view.corners[i].x(), view.corners[i].y());
  }
  cv::Mat k;
  cv::Mat rotation;
  cv::Mat translation;
  cv::eigen2cv(data.camera.k, k);
  cv::solvePnP(board, seen, k, cv::noArray(), rotation, translation);
  cv::Mat matrix;
  cv::Rodrigues(rotation, matrix);
  return std::abs(matrix.col(2).dot(translation));
}

/** The pose of the camera on the hand, by the board's corners as one image has them. */
HandEyeResult byView(const ArmData& data, std::size_t reference, double distance)
{
  HandEyeParams params;
  params.distance = distance;
  params.max_translation_sigma = std::numeric_limits<double>::infinity();  // the table tells how uncertain it is

  const Points& seen = data.views[reference].corners;
  HandEyeView view;
  view.k = data.camera.k;
  view.corners = { seen[0], seen[ArmData::COLUMNS - 1], seen[ArmData::CORNERS - 1],
                   seen[ArmData::CORNERS - ArmData::COLUMNS] };
  std::vector<HandEyePose> poses;
  for (const ArmView& other : data.views)
  {
    Correspondences pairs;
    for (std::size_t i = 0; i < seen.size(); ++i)
    {
      pairs.push_back({ seen[i], other.corners[i] });
    }
    const std::optional<Eigen::Matrix3d> h = homographyFromPoints(pairs);
    if (!h)
    {
      throw std::runtime_error("corners of the board are not those of a plane");
    }
    poses.push_back({ other.hand_in_base, refineHomography(*h, pairs) });
  }
  return calibrateHandEye(view, poses, params);
}

void compare(const ArmData& data, const std::string& lens, std::ostream& csv)
{
  const Eigen::Isometry3d tsai = byBoard(data, cv::CALIB_HAND_EYE_TSAI);
  const Eigen::Isometry3d park = byBoard(data, cv::CALIB_HAND_EYE_PARK);
  std::cout << "lens " << lens << ": cv::calibrateHandEye with the board's size: Tsai and Park differ by "
            << millimetresBetween(tsai, park) << " mm, " << degreesBetween(tsai, park) << " degrees" << std::endl;
  for (std::size_t k = 0; k < 2 * data.views.size(); ++k)
  {
    const std::size_t i = k / 2;
    const bool known = k % 2 == 1;
    const double distance = distanceOfBoard(data, data.views[i]);
    const HandEyeResult result = byView(data, i, known ? distance : std::numeric_limits<double>::quiet_NaN());
    const double distance_error = 100.0 * (result.distance / distance - 1.0);
    csv << lens << ',' << (known ? 1 : 0) << ',' << i + 1 << ',' << (result.found ? 1 : 0) << ',' << usedOf(result)
        << ',' << millimetresBetween(result.camera_in_flange, tsai) << ','
        << degreesBetween(result.camera_in_flange, tsai) << ',' << millimetresBetween(result.camera_in_flange, park)
        << ',' << degreesBetween(result.camera_in_flange, park) << ',' << 1e3 * result.translationSigma() << ','
        << DEGREES * result.rotationSigma() << ',' << result.image_error << ',' << 1e3 * result.translation_error << ','
        << DEGREES * result.rotation_error << ',' << distance_error << ','
        << result.camera_in_flange.translation().transpose().format(Eigen::IOFormat(6, Eigen::DontAlignCols, ",", ","))
        << '\n';
    std::cout << "  view " << i + 1 << ", distance " << (known ? "known" : "unknown") << ": " << usedOf(result)
              << " poses, " << millimetresBetween(result.camera_in_flange, tsai) << " mm, "
              << degreesBetween(result.camera_in_flange, tsai) << " degrees from Tsai's, "
              << millimetresBetween(result.camera_in_flange, park) << " mm, "
              << degreesBetween(result.camera_in_flange, park) << " degrees from Park's; sigma "
              << 1e3 * result.translationSigma() << " mm, " << DEGREES * result.rotationSigma() << " degrees; distance "
              << distance_error << " % " << result.message << std::endl;
  }
}

}  // namespace

void runHandEyeExperiment(const ExperimentContext& context, std::ostream& csv)
{
  struct Row
  {
    std::vector<double> millimetres;
    std::vector<double> degrees;
    int failures = 0;
  };
  std::ifstream urdf_file = openForReading(packageFolder() / "urdf" / "puma560.urdf");
  const std::string urdf{ std::istreambuf_iterator<char>(urdf_file), std::istreambuf_iterator<char>() };
  const auto runs = static_cast<std::size_t>(context.runsOf(HAND_EYE_RUNS));
  const Worlds worlds = readShippedWorlds({ HAND_EYE_WORLDS.begin(), HAND_EYE_WORLDS.end() });
  std::vector<std::string> lines(runs * HAND_EYE_WORLDS.size());
  std::map<std::string, Row> table;
  std::mutex mutex;
  inParallel(lines.size(), context.threads, [&](std::size_t i) {
    const std::string world = HAND_EYE_WORLDS[i / runs];
    sim::HandEyeTrialParams params;
    params.seed = context.seedOf(HAND_EYE_RUNS, i % runs + 1);
    sim::HandEyeTrial calibration(worlds.at(world), urdf, params);
    const HandEyeResult result = calibration.run();
    const double millimetres = millimetresBetween(result.camera_in_flange, calibration.truth());
    const double degrees = degreesBetween(result.camera_in_flange, calibration.truth());
    std::ostringstream line;
    line << world << ',' << i % runs << ',' << (result.found ? 1 : 0) << ',' << result.residuals.size() << ','
         << usedOf(result) << ',' << millimetres << ',' << degrees << ',' << 1e3 * result.translationSigma() << ','
         << DEGREES * result.rotationSigma() << ',' << result.image_error << ',' << 1e3 * result.translation_error
         << ',' << DEGREES * result.rotation_error << ',' << inFrame(result.camera_in_flange, calibration.truth())
         << '\n';
    const std::lock_guard<std::mutex> lock(mutex);
    lines[i] = line.str();
    std::cerr << line.str() << (result.message.empty() ? "" : result.message + "\n") << std::flush;
    Row& row = table[world];
    if (result.found)
    {
      row.millimetres.push_back(millimetres);
      row.degrees.push_back(degrees);
    }
    else
    {
      ++row.failures;
    }
  });
  csv << "world,index,found,poses,used,translation_error_mm,rotation_error_deg,translation_sigma_mm,rotation_sigma_deg,"
         "image_error_px,arm_translation_error_mm,arm_rotation_error_deg,x_mm,y_mm,z_mm,x_deg,y_deg,z_deg\n";
  for (const std::string& line : lines)
  {
    csv << line;
  }
  for (const auto& [world, row] : table)
  {
    std::printf("%-6s %d of %zu failed", world.c_str(), row.failures, runs);
    if (!row.millimetres.empty())
    {
      std::printf("; mean %.3f mm, %.4f degrees, largest %.3f mm, %.4f degrees", mean(row.millimetres),
                  mean(row.degrees), largest(row.millimetres), largest(row.degrees));
    }
    std::printf("\n");
  }
}

void runHandEyeRealExperiment(const ExperimentContext& context, std::ostream& csv)
{
  csv << "lens,known_distance,view,found,used,from_tsai_mm,from_tsai_deg,from_park_mm,from_park_deg,translation_sigma_"
         "mm,"
         "rotation_sigma_deg,image_error_px,arm_translation_error_mm,arm_rotation_error_deg,distance_error_percent,x,y,"
         "z\n";
  ArmData data = readArmData(context.data / "eyeinhand_franka_visp");
  compare(data, "given", csv);
  removeDistortion(data);
  compare(data, "calibrated", csv);
}

}  // namespace view_servo
