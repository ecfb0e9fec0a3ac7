// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/command_line.h"
#include "view_servo/features/line_segments.h"
#include "view_servo/geometry/camera.h"
#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/region.h"
#include "view_servo/images/image_io.h"
#include "view_servo/matching/line_features.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/views/camera_file.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/overlay.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/scene_matcher.h"
#include "view_servo/views/scene_motion.h"
#include "view_servo/views/segment_io.h"
#include "view_servo/views/view_recognizer.h"
#include "view_servo/views/view_store.h"

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

/** @file
 * `match_images points|lines|scene REF CUR` matches two image files from the command line; `match_images find DIR CUR`
 * says which of many views an image shows. Exit status: 0 a geometry or a view was found, 1 none was found, 2 bad input,
 * with one line on standard error that names the file or option.
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

/** Something the user can put right; what() names the file or option. */
class BadInput : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

const std::map<std::string, GeometryModel> MODELS{ { "homography", GeometryModel::HOMOGRAPHY },
                                                   { "fundamental", GeometryModel::FUNDAMENTAL } };
const std::map<std::string, LineGrouping> GROUPS{ { "triplets", LineGrouping::TRIPLETS },
                                                  { "pairs", LineGrouping::PAIRS } };

std::string nameOf(GeometryModel model)
{
  const auto known =
      std::find_if(MODELS.begin(), MODELS.end(), [=](const auto& entry) { return entry.second == model; });
  return known->first;
}

/** By what the images are matched. */
enum class Subcommand
{
  POINTS,
  LINES,
  SCENE
};
const std::map<std::string, Subcommand> SUBCOMMANDS{ { "points", Subcommand::POINTS },
                                                     { "lines", Subcommand::LINES },
                                                     { "scene", Subcommand::SCENE } };

struct Options
{
  std::string reference;
  std::string current;
  std::string model;
  std::string groups = "triplets";
  std::string reference_segments;
  std::string current_segments;
  std::string reference_camera;
  std::string current_camera;
  std::string overlay;
  std::string truth;
  std::vector<std::string> settings;
  int threads = 0;
  bool json = false;
};

cv::Mat readImage(const std::string& path)
{
  const QuietStandardError quiet;
  return readGreyImage(path);
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
  throw BadInput("--truth: cannot read a 3 x 3 matrix from '" + path + "'");
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

/** The parameters with the values of --set, checked. */
template <typename Params>
Params paramsWith(const std::vector<std::string>& settings)
{
  Params params;
  for (const std::string& setting : settings)
  {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos)
    {
      throw BadInput("--set: '" + setting + "' is not of the form name=value");
    }
    try
    {
      setParameter(parameters(params), setting.substr(0, equals), setting.substr(equals + 1));
    }
    catch (const std::invalid_argument& error)
    {
      throw BadInput(std::string("--set: ") + error.what());
    }
  }
  return params;
}

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
    throw BadInput(std::string("--set: ") + error.what());
  }
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
    throw BadInput("--overlay: cannot write '" + path + "'");
  }
}

/** Null when it is not finite. */
nlohmann::json toJson(const Eigen::Vector2d& point)
{
  return point.allFinite() ? nlohmann::json{ point.x(), point.y() } : nlohmann::json();
}

nlohmann::json toJson(const Segment& segment)
{
  return { segment.start.x(), segment.start.y(), segment.end.x(), segment.end.y() };
}

/** Row by row; null when it is not finite. */
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
    json.push_back({ { "reference", toJson(line.reference) },
                     { "current", toJson(line.current) },
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

/** What all kinds of matches have in common. Numbers that are not finite become null. */
nlohmann::json toJson(const ViewMatch& match, const std::optional<double>& corner_error)
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

void printText(const ViewMatch& match, const Options& options, const std::optional<double>& corner_error)
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

/** What can be told from the options alone, before the images are read. */
class Report
{
public:
  explicit Report(const Options& options) : options_(options)
  {
    if (!options.overlay.empty() && !cv::haveImageWriter(options.overlay))
    {
      throw BadInput("--overlay: '" + options.overlay +
                     "' has no ending that says which kind of image to write, such as .png");
    }
    if (!options.truth.empty())
    {
      if (options.model != "homography")
      {
        throw BadInput("--truth: only homographies can be compared");
      }
      truth_ = readHomography(options.truth);
    }
  }

  /** Writes the picture and prints the result, in JSON with `more` at its end. */
  ExitStatus write(const ViewMatch& match, const PreparedImage& reference, const PreparedImage& current,
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
      nlohmann::json json = toJson(match, corner_error);
      json.update(more);
      std::cout << json << '\n';
    }
    else
    {
      printText(match, options_, corner_error);
    }
    return found ? FOUND : NOTHING_FOUND;
  }

private:
  const Options& options_;
  std::optional<Eigen::Matrix3d> truth_;
};

ExitStatus matchPoints(const Options& options)
{
  const auto matcher = makeMatcher<PointViewMatcher, PointViewMatcherParams>(options.settings);
  const Report report(options);
  const PreparedImage reference(readImage(options.reference), cv::Rect(), matcher.params().points);
  const PreparedImage current(readImage(options.current), cv::Rect(), matcher.params().points);
  const ViewMatch match = matcher.match(reference, current, MODELS.at(options.model));
  return report.write(match, reference, current, { { "matches", toJson(match.matches) } });
}

/** Runs from its construction on. */
class Stopwatch
{
public:
  double elapsedMs() const
  {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }

private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

/** From the file, directed as detected ones are; without a file those detected. */
Segments segmentsOf(const cv::Mat& grey, const std::string& file, const LineSegmentParams& params)
{
  return file.empty() ? detectLineSegments(grey, params) : directedByContrast(grey, readSegments(file));
}

ExitStatus matchLines(const Options& options)
{
  const auto matcher = makeMatcher<LineViewMatcher, LineMatcherParams>(options.settings);
  const LineMatcherParams& params = matcher.params();
  const Report report(options);
  const PreparedImage reference(readImage(options.reference), cv::Rect(), {});
  const PreparedImage current(readImage(options.current), cv::Rect(), {});

  const Stopwatch stopwatch;
  Segments reference_segments = segmentsOf(reference.grey(), options.reference_segments, params.segments);
  Segments current_segments = segmentsOf(current.grey(), options.current_segments, params.segments);
  const double segments_ms = stopwatch.elapsedMs();
  const LineFeatures reference_lines(reference.grey(), std::move(reference_segments), params.features);
  const LineFeatures current_lines(current.grey(), std::move(current_segments), params.features);
  const double prepared_ms = stopwatch.elapsedMs();
  ViewMatch match = matcher.match(reference_lines, current_lines, MODELS.at(options.model), GROUPS.at(options.groups));
  match.stages.insert(match.stages.begin(),
                      { { "segments", segments_ms }, { "neighbours", prepared_ms - segments_ms } });
  match.elapsed_ms += prepared_ms;

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
    throw BadInput(option + ": " + error.what());
  }
}

nlohmann::json toJson(const SceneMotion& motion)
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
  constexpr double DEGREES = 180.0 / M_PI;
  const Eigen::AngleAxisd turn(motion.pose.rotation);
  std::cout << "motion, X_cur = R X_ref + t: a turn of " << turn.angle() * DEGREES << " degrees about "
            << turn.axis().transpose() << ", t along " << motion.pose.translation.transpose()
            << " (standard deviations: " << std::sqrt(motion.covariance.topLeftCorner<3, 3>().trace() / 3.0) * DEGREES
            << " and " << std::sqrt(motion.covariance.bottomRightCorner<3, 3>().trace() / 2.0) * DEGREES
            << " degrees)\n";
}

ExitStatus matchScene(const Options& options)
{
  const auto matcher = makeMatcher<SceneMatcher, SceneMatcherParams>(options.settings);
  const Report report(options);
  if (options.reference_camera.empty() != options.current_camera.empty())
  {
    throw BadInput(options.reference_camera.empty() ? "--camera-ref is missing: give it as well as --camera-cur"
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
    { "epipole_current", nullptr },       { "motion", motion ? toJson(*motion) : nlohmann::json() }
  };
  if (match.outcome == MatchOutcome::MATCHED && match.model == GeometryModel::FUNDAMENTAL)
  {
    more["epipole_reference"] = toJson(epipolePixel(referenceEpipole(match.matrix)));
    more["epipole_current"] = toJson(epipolePixel(currentEpipole(match.matrix)));
  }
  const ExitStatus status = report.write(match, reference, current, more);
  if (cameras[0] && status == FOUND && !options.json)
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
  return status;
}

struct FindOptions
{
  std::string directory;
  std::string current;
  std::vector<std::string> settings;
  int most = 5;
  int threads = 0;
  bool json = false;
};

/** Views of a ViewStore when there are any, else the image files. */
ViewSource viewsIn(const std::string& directory)
{
  std::error_code missing;
  if (!std::filesystem::is_directory(directory, missing))
  {
    throw BadInput("'" + directory + "' is no folder: DIR holds stored views or image files");
  }
  const ViewStore store(directory);
  return store.revisions().empty() ? imageFiles(directory) : storedViews(store);
}

nlohmann::json toJson(const CandidateView& view)
{
  return { { "view", view.name },
           { "score", view.score },
           { "verified", view.verified },
           { "inliers", view.inliers },
           { "log_significance", view.log_significance } };
}

void printText(const std::vector<CandidateView>& views, std::size_t indexed)
{
  if (views.empty())
  {
    std::cout << "none of " << indexed << " views has anything in common with the image\n";
  }
  for (const CandidateView& view : views)
  {
    std::cout << view.name << ": score " << view.score;
    if (view.verified)
    {
      std::cout << ", verified by " << view.inliers << " matches, significance " << view.log_significance;
    }
    else
    {
      std::cout << ", not verified";
    }
    std::cout << '\n';
  }
}

ExitStatus findView(const FindOptions& options)
{
  const Stopwatch stopwatch;
  const auto params = paramsWith<ViewRecognizerParams>(options.settings);
  if (const std::vector<std::string> faults = params.validate(); !faults.empty())
  {
    throw BadInput("--set: " + faults.front());
  }
  ViewRecognizer recognizer(viewsIn(options.directory), params);
  const PreparedImage current(readImage(options.current), cv::Rect(), recognizer.features());
  recognizer.loadIndex();  // without one, update() reads all views
  const ViewRecognizer::Update update = [&] {
    const QuietStandardError quiet;
    return recognizer.update(std::numeric_limits<std::size_t>::max());
  }();
  if (recognizer.size() == 0)
  {
    throw BadInput("'" + options.directory + "' holds no stored view and no image file that can be read" +
                   (update.unreadable.empty() ? "" : ": " + update.unreadable.front()));
  }
  const double indexed_ms = stopwatch.elapsedMs();
  const std::vector<CandidateView> views = recognizer.recognize(current, static_cast<std::size_t>(options.most), true);
  const bool found = !views.empty() && views.front().verified;
  if (options.json)
  {
    nlohmann::json json = { { "success", found },
                            { "message", found ? "the image shows " + views.front().name : "no view is verified" },
                            { "indexed", recognizer.size() },
                            { "unreadable", update.unreadable },
                            { "elapsed_ms",
                              { { "total", stopwatch.elapsedMs() },
                                { "index", indexed_ms },
                                { "recognition", stopwatch.elapsedMs() - indexed_ms } } },
                            { "views", nlohmann::json::array() } };
    for (const CandidateView& view : views)
    {
      json["views"].push_back(toJson(view));
    }
    std::cout << json << '\n';
  }
  else
  {
    for (const std::string& reason : update.unreadable)
    {
      std::cout << "left out: " << reason << '\n';
    }
    printText(views, recognizer.size());
  }
  return found ? FOUND : NOTHING_FOUND;
}

void listParameters(const std::vector<Parameter>& table)
{
  for (const Parameter& parameter : table)
  {
    std::cout << "  " << parameter.name << " (" << parameter.type << ", default " << parameter.get()
              << (parameter.unit.empty() ? "" : " " + parameter.unit)
              << (parameter.range.empty() ? "" : ", " + parameter.range) << "): " << parameter.description << '\n';
  }
}

template <typename Params>
void listParameters(const std::string& subcommand)
{
  Params defaults;
  std::cout << subcommand << ":\n";
  listParameters(parameters(defaults));
}

constexpr char STATUSES[] = "Exit status: 0 a geometry was found, 1 none was found, 2 bad input.";
constexpr char FIND_STATUSES[] = "Exit status: 0 a view was found and verified, 1 none was, 2 bad input.";

template <typename Map>
std::vector<std::string> namesOf(const Map& map)
{
  std::vector<std::string> names;
  names.reserve(map.size());
  for (const auto& [name, value] : map)
  {
    names.push_back(name);
  }
  return names;
}

/** Reads what follows the name of a subcommand; nothing when help was asked for. */
std::optional<Options> readOptions(Subcommand subcommand, int argc, const char* const* argv)
{
  const std::map<Subcommand, std::string> about{
    { Subcommand::POINTS,
      "match_images points REF CUR [OPTIONS]: matches two images by the intensity profiles between "
      "corners." },
    { Subcommand::LINES,
      "match_images lines REF CUR [OPTIONS]: matches two images by the structure of groups of line "
      "segments." },
    { Subcommand::SCENE,
      "match_images scene REF CUR [OPTIONS]: matches two images of a scene with depth by corners and "
      "line segments together. The answer is a fundamental matrix or, where all lies on one plane, "
      "a homography." }
  };
  Options options;
  CommandLine line(about.at(subcommand) + "\nREF is the stored view, CUR what the camera sees now.", STATUSES);
  options.model = subcommand == Subcommand::SCENE ? "fundamental" : "homography";
  line.choice("model", options.model, namesOf(MODELS), "homography: the scene is a plane; fundamental: it has depth");
  line.text("truth", options.truth, "File with the true homography; prints the mean error at the reference's corners");
  line.text("overlay", options.overlay, "Write a picture of the matches to this file");
  line.flag("json", options.json, "Print the result as one JSON object");
  line.number("threads", options.threads, { 0.0, 1024.0 }, "Threads to use; 0: one a core");
  line.list("set", options.settings,
            "name=value: another value for a parameter; more may follow. See match_images --list-parameters");
  if (subcommand == Subcommand::LINES)
  {
    line.choice("groups", options.groups, namesOf(GROUPS), "Groups of segments that vote: three lines or two");
    line.text("segments-ref", options.reference_segments,
              "File with the reference's segments, a line x1 y1 x2 y2 each; else they are detected");
    line.text("segments-cur", options.current_segments, "File with the current image's segments");
  }
  if (subcommand == Subcommand::SCENE)
  {
    line.text("camera-ref", options.reference_camera,
              "Calibration of the reference's camera, a file of camera_calibration or of a stored view; with both "
              "cameras the answer has the motion between the views");
    line.text("camera-cur", options.current_camera, "Calibration of the current image's camera");
  }
  const std::optional<std::vector<std::string>> words = line.parse(argc, argv);
  if (!words)
  {
    return std::nullopt;
  }
  if (words->size() < 2)
  {
    throw BadInput(words->empty() ? "REF and CUR, the two images, are missing" : "CUR, the current image, is missing");
  }
  options.reference = (*words)[0];
  options.current = (*words)[1];
  for (std::size_t i = 2; i < words->size(); ++i)
  {
    if (options.settings.empty())
    {
      throw BadInput("'" + (*words)[i] + "' is one word too many: REF and CUR are two images");
    }
    options.settings.push_back((*words)[i]);
  }
  return options;
}

/** What follows `find`; nothing when help was asked for. */
std::optional<FindOptions> readFindOptions(int argc, const char* const* argv)
{
  FindOptions options;
  CommandLine line(
      "match_images find DIR CUR [OPTIONS]: says which of many views an image shows.\n"
      "DIR is a folder of stored views, or of image files; CUR is what the camera sees now. Of the most likely views "
      "those "
      "that the matcher verifies come first.",
      FIND_STATUSES);
  line.number("max", options.most, { 1.0, 1000.0 }, "Views to name at most; default: 5");
  line.flag("json", options.json, "Print the result as one JSON object");
  line.number("threads", options.threads, { 0.0, 1024.0 }, "Threads to use; 0: one a core");
  line.list("set", options.settings,
            "name=value: another value for a parameter; more may follow. See match_images --list-parameters");
  const std::optional<std::vector<std::string>> words = line.parse(argc, argv);
  if (!words)
  {
    return std::nullopt;
  }
  if (words->size() < 2)
  {
    throw BadInput(words->empty() ? "DIR, a folder of views, and CUR, the current image, are missing"
                                  : "CUR, the current image, is missing");
  }
  options.directory = (*words)[0];
  options.current = (*words)[1];
  for (std::size_t i = 2; i < words->size(); ++i)
  {
    if (options.settings.empty())
    {
      throw BadInput("'" + (*words)[i] + "' is one word too many: DIR is a folder and CUR an image");
    }
    options.settings.push_back((*words)[i]);
  }
  return options;
}

/** Without a subcommand. */
ExitStatus runWithoutImages(int argc, const char* const* argv)
{
  bool list_parameters = false;
  CommandLine line(
      "Matches two images of a scene, over wide changes of viewpoint:\n"
      "  match_images points REF CUR [OPTIONS]   by the intensity profiles between corners\n"
      "  match_images lines REF CUR [OPTIONS]    by the structure of groups of line segments\n"
      "  match_images scene REF CUR [OPTIONS]    by both together, for scenes with depth\n"
      "Says which of many views an image shows:\n"
      "  match_images find DIR CUR [OPTIONS]\n"
      "  match_images points --help              says which options there are",
      STATUSES);
  line.flag("list-parameters", list_parameters, "Print the names that --set knows, and end");
  const std::optional<std::vector<std::string>> words = line.parse(argc, argv);
  if (!words)
  {
    return FOUND;
  }
  if (!words->empty())
  {
    throw BadInput("'" + words->front() +
                   "' is unknown: match_images points REF CUR, or lines, or scene, or find DIR CUR, is known");
  }
  if (!list_parameters)
  {
    throw BadInput("say what to match, such as: match_images points REF CUR");
  }
  listParameters<PointViewMatcherParams>("points");
  listParameters<LineMatcherParams>("lines");
  listParameters<SceneMatcherParams>("scene");
  ViewRecognizerParams recognition;
  std::cout << "find, beside those of scene:\n";
  listParameters(recognitionParameters(recognition));
  return FOUND;
}

ExitStatus run(int argc, const char* const* argv)
{
  if (argc > 1 && std::string(argv[1]) == "find")
  {
    const std::optional<FindOptions> options = readFindOptions(argc - 1, argv + 1);
    if (options && options->threads > 0)
    {
      cv::setNumThreads(options->threads);
    }
    return options ? findView(*options) : FOUND;
  }
  const auto subcommand = SUBCOMMANDS.find(argc > 1 ? argv[1] : "");
  if (subcommand == SUBCOMMANDS.end())
  {
    return runWithoutImages(argc, argv);
  }
  const std::optional<Options> options = readOptions(subcommand->second, argc - 1, argv + 1);
  if (!options)
  {
    return FOUND;  // --help
  }
  if (options->threads > 0)
  {
    cv::setNumThreads(options->threads);
  }
  switch (subcommand->second)
  {
    case Subcommand::LINES:
      return matchLines(*options);
    case Subcommand::SCENE:
      return matchScene(*options);
    case Subcommand::POINTS:
      break;
  }
  return matchPoints(*options);
}

}  // namespace

int main(int argc, char** argv)
{
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  try
  {
    return run(argc, argv);
  }
  catch (const std::exception& error)
  {
    std::cerr << "match_images: " << oneLine(error) << '\n';
  }
  return BAD_INPUT;
}
