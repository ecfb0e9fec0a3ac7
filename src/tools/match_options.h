// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/matching/line_groups.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/views/view_match.h"

#include <opencv2/core.hpp>

#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace view_servo
{
/** Geometries by the names that --model knows. */
extern const std::map<std::string, GeometryModel> MODELS;

/** Groups of segments by the names that --groups knows. */
extern const std::map<std::string, LineGrouping> GROUPS;

/** By what two images are matched. */
enum class MatchSubcommand
{
  POINTS,
  LINES,
  SCENE
};

/**
 * What the user of `match_images points|lines|scene REF CUR` wants. The name of a file is empty where none was given.
 */
struct MatchOptions
{
  std::string reference;              ///< image file of the stored view
  std::string current;                ///< image file of what the camera sees now
  std::string model;                  ///< one of MODELS
  std::string groups = "triplets";    ///< one of GROUPS
  std::string reference_segments;     ///< file with the segments of the reference, x1 y1 x2 y2 each [px]
  std::string current_segments;       ///< the same for the current image
  std::string reference_camera;       ///< file with the calibration of the reference's camera
  std::string current_camera;         ///< the same for the current image
  std::string overlay;                ///< image file to write the matches to
  std::string truth;                  ///< file with the true homography, from the reference to the current image
  std::vector<std::string> settings;  ///< other values of parameters, NAME=VALUE each
  int threads = 0;                    ///< 0: one a core
  bool json = false;                  ///< print one JSON object instead of text
};

/** What the user of `match_images find DIR CUR` wants. */
struct FindOptions
{
  std::string directory;              ///< folder of stored views or of image files
  std::string current;                ///< image file of what the camera sees now
  std::vector<std::string> settings;  ///< other values of parameters, NAME=VALUE each
  int most = 5;                       ///< views to name at most
  int threads = 0;                    ///< 0: one a core
  bool json = false;                  ///< print one JSON object instead of text
};

/**
 * Reads what follows the name of a subcommand, which is argv[0]. @return nothing when help was asked for, and has been
 * printed. @throws std::runtime_error naming what is wrong, in one line.
 */
std::optional<MatchOptions> readMatchOptions(MatchSubcommand subcommand, int argc, const char* const* argv);

/** The same for what follows `find`. */
std::optional<FindOptions> readFindOptions(int argc, const char* const* argv);

/**
 * For a command line without a subcommand: prints help, or the list of parameters, when it is asked for.
 * @throws std::runtime_error when it asks for neither.
 */
void runWithoutSubcommand(int argc, const char* const* argv);

/** The grey image of a file; what decoders write on standard error is discarded. @throws std::runtime_error. */
cv::Mat readImage(const std::string& path);

/**
 * Parameters with the values of --set. @throws std::runtime_error when a name is unknown or a value is out of range.
 */
template <typename Params>
Params paramsWith(const std::vector<std::string>& settings)
{
  Params params;
  for (const std::string& setting : settings)
  {
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos)
    {
      throw std::runtime_error("--set: '" + setting + "' is not of the form name=value");
    }
    try
    {
      setParameter(parameters(params), setting.substr(0, equals), setting.substr(equals + 1));
    }
    catch (const std::invalid_argument& error)
    {
      throw std::runtime_error(std::string("--set: ") + error.what());
    }
  }
  return params;
}

}  // namespace view_servo
