// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/command_line.h"
#include "tools/find_view.h"
#include "tools/match_options.h"
#include "tools/match_report.h"
#include "tools/stopwatch.h"
#include "view_servo/features/line_segments.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/matching/line_features.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/views/camera_file.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"
#include "view_servo/views/scene_motion.h"
#include "view_servo/views/segment_io.h"

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>

#include <cmath>
#include <exception>
#include <iostream>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/** @file
 * `match_images points|lines|scene REF CUR` matches two image files from the command line; `match_images find DIR CUR`
 * says which of many views an image shows. Exit status: 0 a geometry or a view was found, 1 none was found, 2 bad
 * input, with one line on standard error that names the file or option.
 */
namespace
{
using namespace view_servo;

enum ExitStatus
{
  FOUND = 0,
  NOTHING_FOUND = 1,
  BAD_INPUT = 2
};

const std::map<std::string, MatchSubcommand> SUBCOMMANDS{ { "points", MatchSubcommand::POINTS },
                                                          { "lines", MatchSubcommand::LINES },
                                                          { "scene", MatchSubcommand::SCENE } };

template <typename Matcher, typename Params>
Matcher makeMatcher(const std::vector<std::string>& settings)
{
  const auto params = paramsWith<Params>(settings);
  try
  {
    return Matcher(params);
  }
  catch (const std::invalid_argument& error)
  {
    throw std::runtime_error(std::string("--set: ") + error.what());
  }
}

bool matchPoints(const MatchOptions& options)
{
  const auto matcher = makeMatcher<PointViewMatcher, PointViewMatcherParams>(options.settings);
  const MatchReport report(options);
  const PreparedImage reference(readImage(options.reference), cv::Rect(), matcher.params().points);
  const PreparedImage current(readImage(options.current), cv::Rect(), matcher.params().points);
  const ViewMatch match = matcher.match(reference, current, MODELS.at(options.model));
  return report.write(match, reference, current, { { "matches", toJson(match.matches) } });
}

/** From the file, directed as detected ones are; without a file those detected. */
Segments segmentsOf(const cv::Mat& grey, const std::string& file, const LineSegmentParams& params)
{
  return file.empty() ? detectLineSegments(grey, params) : directedByContrast(grey, readSegments(file));
}

bool matchLines(const MatchOptions& options)
{
  const auto matcher = makeMatcher<LineViewMatcher, LineMatcherParams>(options.settings);
  const LineMatcherParams& params = matcher.params();
  const MatchReport report(options);
  const FeatureParams features(params.segments, params.features);
  const PreparedImage reference(readImage(options.reference), cv::Rect(), features);
  const PreparedImage current(readImage(options.current), cv::Rect(), features);
  const GeometryModel model = MODELS.at(options.model);
  const LineGrouping groups = GROUPS.at(options.groups);

  ViewMatch match;
  const Stopwatch stopwatch;
  if (options.reference_segments.empty() && options.current_segments.empty())
  {
    reference.lines();
    current.lines();
    const double segments_ms = stopwatch.elapsedMs();
    match = matcher.match(reference, current, model, groups);
    match.stages.insert(match.stages.begin(), { "segments", segments_ms });
    match.elapsed_ms += segments_ms;
  }
  else
  {
    const LineFeatures reference_lines(
        reference.grey(), segmentsOf(reference.grey(), options.reference_segments, params.segments), params.features);
    const LineFeatures current_lines(
        current.grey(), segmentsOf(current.grey(), options.current_segments, params.segments), params.features);
    const double segments_ms = stopwatch.elapsedMs();
    match = matcher.match(reference_lines, current_lines, model, groups);
    match.stages.insert(match.stages.begin(), { "segments", segments_ms });
    match.elapsed_ms += segments_ms;
  }

  return report.write(match, reference, current,
                      { { "matches", toJson(match.lines) },
                        { "points", toJson(match.matches) },
                        { "planes", toJson(match.planes) },
                        { "fundamental", toJson(match.fundamental) } });
}

Camera readCamera(const std::string& option, const std::string& path, const cv::Size& image)
{
  try
  {
    Camera camera = readCameraFile(path);
    if (camera.width != image.width || camera.height != image.height)
    {
      throw std::runtime_error("'" + path + "' is of images of " + std::to_string(camera.width) + " x " +
                               std::to_string(camera.height) + ", not " + std::to_string(image.width) + " x " +
                               std::to_string(image.height));
    }
    return camera;
  }
  catch (const std::runtime_error& error)
  {
    throw std::runtime_error(option + ": " + error.what());
  }
}

nlohmann::json resultOf(const SceneMotion& motion)
{
  const Eigen::Quaterniond rotation(motion.pose.rotation);
  const Eigen::Vector3d& direction = motion.pose.translation;
  return { { "rotation", { rotation.x(), rotation.y(), rotation.z(), rotation.w() } },
           { "direction", { direction.x(), direction.y(), direction.z() } },
           { "covariance", std::vector<double>(motion.covariance.data(), motion.covariance.data() + 36) },
           { "inliers", motion.inliers } };
}

void printMotion(const SceneMotion& motion)
{
  const Eigen::AngleAxisd turn(motion.pose.rotation);
  std::cout << "motion, X_cur = R X_ref + t: a turn of " << turn.angle() * DEGREES << " degrees about "
            << turn.axis().transpose() << ", t along " << motion.pose.translation.transpose()
            << " (standard deviations: " << std::sqrt(motion.covariance.topLeftCorner<3, 3>().trace() / 3.0) * DEGREES
            << " and " << std::sqrt(motion.covariance.bottomRightCorner<3, 3>().trace() / 2.0) * DEGREES
            << " degrees)\n";
}

bool matchScene(const MatchOptions& options)
{
  const auto matcher = makeMatcher<SceneMatcher, SceneMatcherParams>(options.settings);
  const MatchReport report(options);
  if (options.reference_camera.empty() != options.current_camera.empty())
  {
    throw std::runtime_error(options.reference_camera.empty()
                                 ? "--camera-ref is missing: give it as well as --camera-cur"
                                 : "--camera-cur is missing: give it as well as --camera-ref");
  }
  const FeatureParams features = matcher.features();
  const PreparedImage reference(readImage(options.reference), cv::Rect(), features);
  const PreparedImage current(readImage(options.current), cv::Rect(), features);
  std::optional<Camera> cameras[2];
  if (!options.reference_camera.empty())
  {
    cameras[0] = readCamera("--camera-ref", options.reference_camera, reference.grey().size());
    cameras[1] = readCamera("--camera-cur", options.current_camera, current.grey().size());
  }
  const ViewMatch match = matcher.match(reference, current, MODELS.at(options.model));
  const std::optional<SceneMotion> motion =
      cameras[0] ? sceneMotion(match, *cameras[0], *cameras[1]) : std::optional<SceneMotion>();
  nlohmann::json more = {
    { "matches", toJson(match.matches) }, { "lines", toJson(match.lines) },
    { "planes", toJson(match.planes) },   { "epipole_reference", nullptr },
    { "epipole_current", nullptr },       { "motion", motion ? resultOf(*motion) : nlohmann::json() }
  };
  if (match.outcome == MatchOutcome::MATCHED && match.model == GeometryModel::FUNDAMENTAL)
  {
    more["epipole_reference"] = toJson(epipolePixel(referenceEpipole(match.matrix)));
    more["epipole_current"] = toJson(epipolePixel(currentEpipole(match.matrix)));
  }
  const bool found = report.write(match, reference, current, more);
  if (cameras[0] && found && !options.json)
  {
    if (motion)
    {
      printMotion(*motion);
    }
    else
    {
      std::cout << "no motion: "
                << (match.model == GeometryModel::HOMOGRAPHY ? "a plane leaves two of them"
                                                             : "too few points agree with one")
                << '\n';
    }
  }
  return found;
}

/** Takes the threads that an option asks for. */
void useThreads(int threads)
{
  if (threads > 0)
  {
    cv::setNumThreads(threads);
  }
}

bool matchImages(MatchSubcommand subcommand, const MatchOptions& options)
{
  useThreads(options.threads);
  switch (subcommand)
  {
    case MatchSubcommand::LINES:
      return matchLines(options);
    case MatchSubcommand::SCENE:
      return matchScene(options);
    case MatchSubcommand::POINTS:
      break;
  }
  return matchPoints(options);
}

ExitStatus run(int argc, const char* const* argv)
{
  const std::string word = argc > 1 ? argv[1] : "";
  bool found = true;  // as after --help
  if (word == "find")
  {
    if (const std::optional<FindOptions> options = readFindOptions(argc - 1, argv + 1))
    {
      useThreads(options->threads);
      found = findView(*options);
    }
  }
  else if (const auto subcommand = SUBCOMMANDS.find(word); subcommand != SUBCOMMANDS.end())
  {
    if (const std::optional<MatchOptions> options = readMatchOptions(subcommand->second, argc - 1, argv + 1))
    {
      found = matchImages(subcommand->second, *options);
    }
  }
  else
  {
    runWithoutSubcommand(argc, argv);
  }
  return found ? FOUND : NOTHING_FOUND;
}

}  // namespace

int main(int argc, char** argv)
{
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  try
  {
    const int status = run(argc, argv);
    requireWritten(std::cout);
    return status;
  }
  catch (const std::exception& error)
  {
    std::cerr << "match_images: " << oneLine(error) << '\n';
  }
  return BAD_INPUT;
}
