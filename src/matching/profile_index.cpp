// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/profile_index.h"

#include "kd_tree.h"

#include <opencv2/core.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>
#include <variant>

namespace view_servo
{
namespace
{
// A profile and its reverse differ in the sign of some features. The current profile is searched in the direction in
// which this one, the strongest of them (cos 1), is >= 0, ...
constexpr int DIRECTING_FEATURE = 1;
// ... and the tree holds each reference profile in the directions in which it is at least minus this. [deviations]
constexpr float DIRECTION_MARGIN = 0.5F;

void reverse(const float* feature, std::size_t columns, float* reversed)
{
  for (std::size_t c = 0; c < columns; ++c)
  {
    reversed[c] = feature[c] * reversalSign(static_cast<int>(c));
  }
}

/** Marks the given part of the profiles, those whose features have the largest norms. */
std::vector<char> largest(const ProfileSet& profiles, double share)
{
  std::vector<std::pair<float, std::size_t>> norms;
  for (std::size_t i = 0; i < profiles.pairs.size(); ++i)
  {
    norms.emplace_back(-Eigen::Map<const Eigen::VectorXf>(profiles.feature(i), profiles.coefficients).squaredNorm(), i);
  }
  const std::size_t count = static_cast<std::size_t>(std::ceil(share * static_cast<double>(norms.size())));
  std::nth_element(norms.begin(), norms.begin() + static_cast<std::ptrdiff_t>(count), norms.end());
  std::vector<char> marked(norms.size(), 0);
  for (std::size_t k = 0; k < count; ++k)
  {
    marked[norms[k].second] = 1;
  }
  return marked;
}

}  // namespace

std::vector<Parameter> parameters(ProfileSearchParams& params)
{
  return {
    choice<ProfileSearch>("search", params.search,
                          { { "nearest", ProfileSearch::NEAREST }, { "radius", ProfileSearch::RADIUS } },
                          "a profile votes for its nearest (K_v) or for all in a radius (D_v)"),
    integer("search_neighbours", params.neighbours, "", "[1, 1000]", "K_v: profiles that each votes for"),
    real("search_radius", params.radius, "standard deviations", "> 0", "D_v: distance of similar profiles"),
    real("search_epsilon", params.epsilon, "", ">= 0", "tolerance of the search for the nearest, 0 = exact"),
    real("search_share", params.share, "", "(0, 1]", "part of the profiles that votes, the most distinctive ones"),
  };
}

std::vector<std::string> ProfileSearchParams::validate() const
{
  return faultsOf(*this);
}

struct ProfileIndex::Tree
{
  std::size_t columns = 0;
  std::vector<ProfileMatch> source;  // of the tree's vectors
  std::variant<KdTree<4>, KdTree<6>, KdTree<8>> tree;

  /** Appends what is similar to a directed profile, nearest first. */
  void search(const float* query, const ProfileSearchParams& params, std::vector<ProfileMatch>& matches) const
  {
    std::visit(
        [&](const auto& typed_tree) {
          std::vector<typename std::decay_t<decltype(typed_tree)>::Neighbour> found;
          if (params.search == ProfileSearch::RADIUS)
          {
            typed_tree.findWithin(query, static_cast<float>(params.radius), found);
          }
          else
          {
            typed_tree.findNearest(query, static_cast<std::size_t>(params.neighbours),
                                   static_cast<float>(params.epsilon), found);
          }
          matches.reserve(found.size());
          for (const auto& neighbour : found)
          {
            matches.push_back(source[neighbour.index]);
          }
        },
        tree);
  }
};

ProfileIndex::ProfileIndex(const ProfileSet& profiles) : tree_(std::make_unique<Tree>())
{
  const std::size_t columns = static_cast<std::size_t>(profiles.coefficients);
  std::vector<float> vectors;
  std::vector<float> reversed(columns);
  for (std::size_t i = 0; i < profiles.pairs.size(); ++i)
  {
    const float* feature = profiles.feature(i);
    reverse(feature, columns, reversed.data());
    for (const float* directed : { feature, static_cast<const float*>(reversed.data()) })
    {
      if (directed[DIRECTING_FEATURE] >= -DIRECTION_MARGIN)
      {
        vectors.insert(vectors.end(), directed, directed + columns);
        tree_->source.push_back({ static_cast<int>(i), directed != feature });
      }
    }
  }
  tree_->columns = columns;
  switch (columns)
  {
    case 4:
      tree_->tree = KdTree<4>(vectors);
      break;
    case 6:
      tree_->tree = KdTree<6>(vectors);
      break;
    case 8:
      tree_->tree = KdTree<8>(vectors);
      break;
    default:
      throw std::invalid_argument("ProfileIndex: profiles must have 4, 6 or 8 features");
  }
}

ProfileIndex::~ProfileIndex() = default;
ProfileIndex::ProfileIndex(ProfileIndex&&) noexcept = default;
ProfileIndex& ProfileIndex::operator=(ProfileIndex&&) noexcept = default;

std::vector<std::vector<ProfileMatch>> ProfileIndex::search(const ProfileSet& current,
                                                            const ProfileSearchParams& params) const
{
  const std::size_t columns = tree_->columns;
  if (static_cast<std::size_t>(current.coefficients) != columns)
  {
    throw std::invalid_argument("ProfileIndex: the two images' profiles differ in their number of features");
  }
  std::vector<std::vector<ProfileMatch>> matches(current.pairs.size());
  const std::vector<char> wanted = largest(current, params.share);
  cv::parallel_for_(cv::Range(0, static_cast<int>(current.pairs.size())), [&](const cv::Range& range) {
    std::vector<float> reversed(columns);
    for (int i = range.start; i < range.end; ++i)
    {
      if (wanted[static_cast<std::size_t>(i)] == 0)
      {
        continue;
      }
      const float* query = current.feature(static_cast<std::size_t>(i));
      const bool turned = query[DIRECTING_FEATURE] < 0.0F;
      if (turned)
      {
        reverse(query, columns, reversed.data());
        query = reversed.data();
      }
      std::vector<ProfileMatch>& found = matches[static_cast<std::size_t>(i)];
      tree_->search(query, params, found);
      for (ProfileMatch& match : found)
      {
        match.reversed = match.reversed != turned;
      }
    }
  });
  return matches;
}

}  // namespace view_servo
