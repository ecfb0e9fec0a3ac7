// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/match_options.h"

#include "tools/command_line.h"
#include "view_servo/images/image_io.h"
#include "view_servo/views/line_view_matcher.h"
#include "view_servo/views/point_view_matcher.h"
#include "view_servo/views/scene_matcher.h"
#include "view_servo/views/view_recognizer.h"

#include <cstddef>
#include <iostream>
#include <tuple>
#include <utility>

namespace view_servo
{
namespace
{
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

/**
 * The two words that a subcommand takes. What follows them belongs to --set, where it was given.
 * @param none what to say when there is no word.
 */
std::pair<std::string, std::string> takeTwoWords(const std::vector<std::string>& words,
                                                 std::vector<std::string>& settings, const std::string& none)
{
  if (words.size() < 2)
  {
    throw std::runtime_error(words.empty() ? none : "CUR, the current image, is missing");
  }
  if (words.size() > 2 && settings.empty())
  {
    throw std::runtime_error("'" + words[2] + "' is one word too many after '" + words[0] + "' and '" + words[1] + "'");
  }
  settings.insert(settings.end(), words.begin() + 2, words.end());
  return { words[0], words[1] };
}

}  // namespace

const std::map<std::string, GeometryModel> MODELS{ { "homography", GeometryModel::HOMOGRAPHY },
                                                   { "fundamental", GeometryModel::FUNDAMENTAL } };
const std::map<std::string, LineGrouping> GROUPS{ { "triplets", LineGrouping::TRIPLETS },
                                                  { "pairs", LineGrouping::PAIRS } };

cv::Mat readImage(const std::string& path)
{
  const QuietStandardError quiet;
  return readGreyImage(path);
}

std::optional<MatchOptions> readMatchOptions(MatchSubcommand subcommand, int argc, const char* const* argv)
{
  const std::map<MatchSubcommand, std::string> about{
    { MatchSubcommand::POINTS,
      "match_images points REF CUR [OPTIONS]: matches two images by the intensity profiles between "
      "corners." },
    { MatchSubcommand::LINES,
      "match_images lines REF CUR [OPTIONS]: matches two images by the structure of groups of line "
      "segments." },
    { MatchSubcommand::SCENE,
      "match_images scene REF CUR [OPTIONS]: matches two images of a scene with depth by corners and "
      "line segments together. The answer is a fundamental matrix or, where all lies on one plane, "
      "a homography." }
  };
  MatchOptions options;
  CommandLine line(about.at(subcommand) + "\nREF is the stored view, CUR what the camera sees now.", STATUSES);
  options.model = subcommand == MatchSubcommand::SCENE ? "fundamental" : "homography";
  line.choice("model", options.model, namesOf(MODELS), "homography: the scene is a plane; fundamental: it has depth");
  line.text("truth", options.truth, "File with the true homography; prints the mean error at the reference's corners");
  line.text("overlay", options.overlay, "Write a picture of the matches to this file");
  line.flag("json", options.json, "Print the result as one JSON object");
  line.number("threads", options.threads, { 0.0, 1024.0 }, "Threads to use; 0: one a core");
  line.list("set", options.settings,
            "name=value: another value for a parameter; more may follow. See match_images --list-parameters");
  if (subcommand == MatchSubcommand::LINES)
  {
    line.choice("groups", options.groups, namesOf(GROUPS), "Groups of segments that vote: three lines or two");
    line.text("segments-ref", options.reference_segments,
              "File with the reference's segments, a line x1 y1 x2 y2 each; else they are detected");
    line.text("segments-cur", options.current_segments, "File with the current image's segments");
  }
  if (subcommand == MatchSubcommand::SCENE)
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
  std::tie(options.reference, options.current) =
      takeTwoWords(*words, options.settings, "REF and CUR, the two images, are missing");
  return options;
}

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
  std::tie(options.directory, options.current) =
      takeTwoWords(*words, options.settings, "DIR, a folder of views, and CUR, the current image, are missing");
  return options;
}

void runWithoutSubcommand(int argc, const char* const* argv)
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
    return;
  }
  if (!words->empty())
  {
    throw std::runtime_error(
        "'" + words->front() +
        "' is unknown: match_images points REF CUR, or lines, or scene, or find DIR CUR, is known");
  }
  if (!list_parameters)
  {
    throw std::runtime_error("say what to match, such as: match_images points REF CUR");
  }
  listParameters<PointViewMatcherParams>("points");
  listParameters<LineMatcherParams>("lines");
  listParameters<SceneMatcherParams>("scene");
  ViewRecognizerParams recognition;
  std::cout << "find, beside those of scene:\n";
  listParameters(recognitionParameters(recognition));
}

}  // namespace view_servo
