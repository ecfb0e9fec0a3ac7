// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/line_ground_truth.h"

#include "experiments/input_file.h"
#include "view_servo/images/image_io.h"
#include "view_servo/views/segment_io.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <regex>
#include <sstream>
#include <stdexcept>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

/** The files of a folder whose name matches a pattern, sorted. */
std::vector<fs::path> filesLike(const fs::path& folder, const std::string& pattern)
{
  const std::regex expression(pattern);
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
  {
    if (std::regex_match(entry.path().filename().string(), expression))
    {
      files.push_back(entry.path());
    }
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<int> indices(std::string list)
{
  std::replace(list.begin(), list.end(), ',', ' ');
  std::istringstream stream(list);
  std::vector<int> values;
  for (int value = 0; stream >> value;)
  {
    values.push_back(value);
  }
  return values;
}

LinePair readBenchmarkPair(const fs::path& folder)
{
  LinePair pair;
  pair.name = folder.filename().string();
  const std::vector<fs::path> images = filesLike(folder, ".*\\.(png|jpg|ppm)");
  const std::vector<fs::path> segments = filesLike(folder, "lsd[0-9]\\.txt");
  if (images.size() != 2 || segments.size() != 2)
  {
    throw std::runtime_error(folder.string() + ": two images and two files of segments expected");
  }
  pair.reference = readGreyImage(images[0].string());
  pair.current = readGreyImage(images[1].string());
  pair.reference_segments = readSegments(segments[0].string());
  pair.current_segments = readSegments(segments[1].string());
  std::ifstream truth = openForReading(folder / "lsd_GroundTruthMatches.txt");
  const std::regex groups("\\(([0-9,]*)\\)\\s*\\(([0-9,]*)\\)\\s*");
  std::smatch found;
  for (std::string line; std::getline(truth, line);)
  {
    if (std::regex_match(line, found, groups))
    {
      pair.truth.push_back({ indices(found[1]), indices(found[2]) });
    }
  }
  return pair;
}

}  // namespace

std::optional<fs::path> dataFolder()
{
  const char* folder = std::getenv("VIEW_SERVO_DATA");
  if (folder == nullptr || !fs::is_directory(folder))
  {
    std::cerr << "set VIEW_SERVO_DATA to the folder with the image pairs" << std::endl;
    return std::nullopt;
  }
  return fs::path(folder);
}

bool LinePair::areSame(int reference_index, int current_index) const
{
  const auto has = [](const std::vector<int>& values, int value) {
    return std::find(values.begin(), values.end(), value) != values.end();
  };
  return std::any_of(truth.begin(), truth.end(), [&](const LineGroupTruth& group) {
    return has(group.reference, reference_index) && has(group.current, current_index);
  });
}

std::vector<LinePair> readBenchmarkPairs(const fs::path& data, const std::vector<std::string>& only)
{
  std::vector<fs::path> folders;
  for (const fs::directory_entry& entry : fs::directory_iterator(data / "line_matching_benchmark"))
  {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() && (only.empty() || std::find(only.begin(), only.end(), name) != only.end()))
    {
      folders.push_back(entry.path());
    }
  }
  std::sort(folders.begin(), folders.end());
  std::vector<LinePair> pairs;
  pairs.reserve(folders.size());
  for (const fs::path& folder : folders)
  {
    pairs.push_back(readBenchmarkPair(folder));
  }
  return pairs;
}

LinePair readMertonPair(const fs::path& data, int reference_view, int current_view)
{
  const fs::path folder = data / "vgg_merton1";
  const auto name = [](int view) {
    return "00" + std::to_string(view);
  };
  LinePair pair;
  pair.name = "merton " + std::to_string(reference_view) + "-" + std::to_string(current_view);
  pair.reference = readGreyImage((folder / "images" / (name(reference_view) + ".jpg")).string());
  pair.current = readGreyImage((folder / "images" / (name(current_view) + ".jpg")).string());
  pair.reference_segments = readSegments((folder / "2D" / (name(reference_view) + ".lines")).string());
  pair.current_segments = readSegments((folder / "2D" / (name(current_view) + ".lines")).string());
  std::ifstream truth = openForReading(folder / "2D" / "nview-lines");
  for (int of[3]; truth >> of[0] >> of[1] >> of[2];)
  {
    pair.truth.push_back({ { of[reference_view - 1] }, { of[current_view - 1] } });
  }
  return pair;
}

}  // namespace view_servo
