// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/geometry/correspondence.h"
#include "view_servo/views/image_io.h"
#include "view_servo/views/matcher_parameters.h"
#include "view_servo/views/overlay.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_matcher.h"

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

/** @file
 * `match_images points REF CUR`: matches two image files from the command line. Exit status: 0 a geometry was found,
 * 1 none was found, 2 bad input, with one line on standard error that names the file or option.
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

struct Options
{
  std::string reference;
  std::string current;
  std::string model = "homography";
  std::string overlay;
  std::string truth;
  std::vector<std::string> settings;
  int threads = 0;
  bool json = false;
};

/** Keeps standard error quiet: image decoders write there on their own, and users are promised one line. */
class QuietStandardError
{
public:
  QuietStandardError() : standard_error_(dup(STDERR_FILENO))
  {
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    dup2(nowhere, STDERR_FILENO);
    close(nowhere);
  }
  ~QuietStandardError()
  {
    std::cerr.flush();
    std::fflush(stderr);
    dup2(standard_error_, STDERR_FILENO);
    close(standard_error_);
  }
  QuietStandardError(const QuietStandardError&) = delete;
  QuietStandardError& operator=(const QuietStandardError&) = delete;

private:
  int standard_error_;
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
  const double right = size.width - 1.0;
  const double bottom = size.height - 1.0;
  double sum = 0.0;
  for (const Eigen::Vector2d& corner : Points{ { 0.0, 0.0 }, { right, 0.0 }, { right, bottom }, { 0.0, bottom } })
  {
    const Eigen::Vector3d x = corner.homogeneous();
    sum += ((h * x).hnormalized() - (truth * x).hnormalized()).norm();
  }
  return sum / 4.0;
}

ViewMatcher makeMatcher(const std::vector<std::string>& settings)
{
  ViewMatcherParams params;
  for (const std::string& setting : settings)
  {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos)
    {
      throw BadInput("--set: '" + setting + "' is not of the form name=value");
    }
    try
    {
      setParameter(params, setting.substr(0, equals), setting.substr(equals + 1));
    }
    catch (const std::invalid_argument& error)
    {
      throw BadInput(std::string("--set: ") + error.what());
    }
  }
  try
  {
    return ViewMatcher(params);
  }
  catch (const std::invalid_argument& error)
  {
    throw BadInput(std::string("--set: ") + error.what());
  }
}

void checkOverlayPath(const std::string& path)
{
  if (!cv::haveImageWriter(path))
  {
    throw BadInput("--overlay: '" + path + "' has no ending that says which kind of image to write, such as .png");
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

nlohmann::json toJson(const Eigen::Vector2d& point)
{
  return { point.x(), point.y() };
}

/** Numbers that are not finite become null. */
nlohmann::ordered_json toJson(const ViewMatch& match, const std::string& model,
                              const std::optional<double>& corner_error)
{
  nlohmann::ordered_json json;
  json["success"] = match.outcome == MatchOutcome::MATCHED;
  json["message"] = match.message;
  json["model"] = model;
  json["matrix"] = nullptr;
  if (match.outcome == MatchOutcome::MATCHED)
  {
    json["matrix"] = std::vector<double>();
    for (int i = 0; i < 9; ++i)
    {
      json["matrix"].push_back(match.matrix(i / 3, i % 3));
    }
  }
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
  json["matches"] = nlohmann::json::array();
  for (const MatchedPoint& point : match.matches)
  {
    json["matches"].push_back({ { "reference", toJson(point.position.reference) },
                                { "current", toJson(point.position.current) },
                                { "score", point.score },
                                { "inlier", point.inlier } });
  }
  return json;
}

void printText(const ViewMatch& match, const Options& options, const std::optional<double>& corner_error)
{
  std::cout << match.message << '\n';
  if (match.outcome == MatchOutcome::MATCHED)
  {
    std::cout << options.model << " (reference -> current):\n" << match.matrix << '\n';
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

ExitStatus matchPoints(const Options& options)
{
  const GeometryModel model = MODELS.at(options.model);
  if (options.threads > 0)
  {
    cv::setNumThreads(options.threads);
  }
  const ViewMatcher matcher = makeMatcher(options.settings);
  if (!options.overlay.empty())
  {
    checkOverlayPath(options.overlay);
  }
  std::optional<Eigen::Matrix3d> truth;
  if (!options.truth.empty())
  {
    truth = readHomography(options.truth);
  }
  const PreparedImage reference(readImage(options.reference), cv::Rect(), matcher.params().points);
  const PreparedImage current(readImage(options.current), cv::Rect(), matcher.params().points);

  const ViewMatch match = matcher.match(reference, current, model);
  const bool found = match.outcome == MatchOutcome::MATCHED;
  if (!options.overlay.empty())
  {
    writeOverlay(options.overlay, drawOverlay(reference, current, match));
  }
  std::optional<double> corner_error;
  if (truth && found)
  {
    corner_error = meanCornerError(match.matrix, *truth, reference.grey().size());
  }
  if (options.json)
  {
    std::cout << toJson(match, options.model, corner_error) << '\n';
  }
  else
  {
    printText(match, options, corner_error);
  }
  return found ? FOUND : NOTHING_FOUND;
}

void listParameters()
{
  ViewMatcherParams defaults;
  for (const Parameter& parameter : matcherParameters(defaults))
  {
    std::cout << parameter.name << " (" << parameter.type << ", default " << parameter.get()
              << "): " << parameter.description << '\n';
  }
}

/** Messages may have several lines; the user is promised one. */
std::string oneLine(const std::string& text)
{
  std::istringstream lines(text);
  std::string joined;
  for (std::string line; std::getline(lines >> std::ws, line);)
  {
    joined += (joined.empty() ? "" : " ") + line;
  }
  return joined;
}

}  // namespace

int main(int argc, char** argv)
{
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);

  Options options;
  bool list_parameters = false;
  CLI::App app("Matches two images of a scene, over wide changes of viewpoint.", "match_images");
  app.footer("Exit status: 0 a geometry was found, 1 none was found, 2 bad input.");
  app.add_flag("--list-parameters", list_parameters, "Print the names that --set knows, and end");
  CLI::App* points = app.add_subcommand("points", "By the intensity profiles between corners");
  points->add_option("REF", options.reference, "Reference image: the stored view")->required();
  points->add_option("CUR", options.current, "Current image: what the camera sees now")->required();
  points->add_option("--model", options.model, "homography: the scene is a plane; fundamental: it has depth")
      ->check(CLI::IsMember(MODELS))
      ->capture_default_str();
  points->add_option("--overlay", options.overlay, "Write a picture of the matches to this file");
  points->add_flag("--json", options.json, "Print the result as one JSON object");
  points->add_option("--threads", options.threads, "Threads to use; 0: one a core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  points->add_option("--set", options.settings, "name=value: another value for a parameter; see --list-parameters")
      ->allow_extra_args(false);  // else it would take REF and CUR when it comes before them
  std::vector<std::string> more_settings;
  points->add_option("SETTING", more_settings, "More name=value after --set");
  points->add_option("--truth", options.truth,
                     "File with the true homography; prints the mean error at the reference's corners");
  try
  {
    app.parse(argc, argv);
    if (list_parameters)
    {
      listParameters();
      return FOUND;
    }
    if (!points->parsed())
    {
      throw BadInput("say what to match, such as: match_images points REF CUR");
    }
    if (!options.truth.empty() && options.model != "homography")
    {
      throw BadInput("--truth: only homographies can be compared");
    }
    options.settings.insert(options.settings.end(), more_settings.begin(), more_settings.end());
    return matchPoints(options);
  }
  catch (const CLI::ParseError& error)
  {
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success))
    {
      return app.exit(error);  // --help
    }
    std::cerr << "match_images: " << oneLine(error.what()) << '\n';
  }
  catch (const std::exception& error)
  {
    std::cerr << "match_images: " << oneLine(error.what()) << '\n';
  }
  return BAD_INPUT;
}
