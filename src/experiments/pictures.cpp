// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/pictures.h"

#include <algorithm>
#include <set>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

/** The scene that a picture shows: pairs are called nameA and nameB, all others of a folder are of one scene. */
std::string sceneOf(const fs::path& file)
{
  const std::string stem = file.stem().string();
  if (stem.size() > 1 && (stem.back() == 'A' || stem.back() == 'B'))
  {
    return stem.substr(0, stem.size() - 1);
  }
  const fs::path folder = file.parent_path();
  return (folder.filename() == "images" ? folder.parent_path() : folder).filename().string();
}

}  // namespace

std::map<std::string, std::vector<fs::path>> findPictures(const fs::path& data)
{
  const std::set<std::string> endings{ ".jpg", ".pgm", ".png", ".ppm" };
  std::map<std::string, std::vector<fs::path>> scenes;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(data))
  {
    if (entry.is_regular_file() && endings.count(entry.path().extension().string()) != 0)
    {
      scenes[sceneOf(entry.path())].push_back(entry.path());
    }
  }
  for (auto& [scene, files] : scenes)
  {
    std::sort(files.begin(), files.end());
  }
  return scenes;
}

}  // namespace view_servo
