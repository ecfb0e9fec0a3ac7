// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/indoor_walk.h"

#include "experiments/input_file.h"

#include <sstream>
#include <utility>

namespace view_servo
{
IndoorWalk readIndoorWalk(const std::filesystem::path& data)
{
  const std::filesystem::path folder = data / "hololens_indoor";
  IndoorWalk walk;
  std::ifstream k = openForReading(folder / "K.txt");
  for (int i = 0; i < 9; ++i)
  {
    k >> walk.camera.k(i / 3, i % 3);
  }
  std::string line;
  std::ifstream poses = openForReading(folder / "poses.txt");
  while (std::getline(poses, line))
  {
    std::istringstream words(line);
    std::string name;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    words >> name;
    for (int i = 0; i < 16; ++i)
    {
      words >> pose.matrix()(i / 4, i % 4);
    }
    if (words && name.front() != '#')
    {
      walk.poses[name] = pose;
    }
  }
  std::ifstream pairs = openForReading(folder / "pairs_wide_baseline.txt");
  while (std::getline(pairs, line))
  {
    std::istringstream words(line);
    IndoorWalk::Pair pair;
    if (words >> pair.reference >> pair.current >> pair.baseline >> pair.rotation >> pair.overlap)
    {
      walk.pairs.push_back(pair);
      std::swap(pair.reference, pair.current);
      walk.pairs.push_back(pair);
    }
  }
  return walk;
}

}  // namespace view_servo
