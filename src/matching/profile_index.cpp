// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/profile_index.h"

#include "kd_tree.h"

#include <opencv2/core.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <type_traits>
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
constexpr std::size_t MOST_SIMILAR = 1000;  // profiles that one votes for

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
    choice<ProfileSearch>(
        "search", params.search,
        { { "nearest", ProfileSearch::NEAREST }, { "radius", ProfileSearch::RADIUS }, { "leaf", ProfileSearch::LEAF } },
        "a profile votes for its nearest (K_v), for all in a radius (D_v), or for those that the index keeps where it "
        "belongs"),
    integer("search_neighbours", params.neighbours, "", "[1, 1000]", "K_v: profiles that each votes for"),
    real("search_radius", params.radius, "standard deviations", "> 0",
         "D_v: distance of similar profiles, of which the 1000 nearest count"),
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

  /** Searches for some of the current profiles; appends what is similar to each, and how many these are. */
  void search(const ProfileSet& current, std::size_t begin, std::size_t end, const std::vector<char>& wanted,
              const ProfileSearchParams& params, std::vector<ProfileMatch>& matches, std::size_t* counts) const
  {
    std::visit(
        [&](const auto& typed_tree) {
          std::vector<typename std::decay_t<decltype(typed_tree)>::Neighbour> found;
          std::vector<float> reversed(columns);
          for (std::size_t i = begin; i < end; ++i)
          {
            counts[i] = 0;
            if (wanted[i] == 0)
            {
              continue;
            }
            const float* query = current.feature(i);
            const bool turned = query[DIRECTING_FEATURE] < 0.0F;
            if (turned)
            {
              reverse(query, columns, reversed.data());
              query = reversed.data();
            }
            const std::size_t before = matches.size();
            const auto take = [&](std::uint32_t number) {
              matches.push_back({ source[number].reference, source[number].reversed != turned });
            };
            if (params.search == ProfileSearch::LEAF)
            {
              const auto [first, last] = typed_tree.leafOf(query);
              std::for_each(first, last, take);
            }
            else
            {
              find(typed_tree, query, params, found);
              std::for_each(found.begin(), found.end(), [&](const auto& neighbour) { take(neighbour.index); });
            }
            counts[i] = matches.size() - before;
          }
        },
        tree);
  }

  /** What is similar to a directed profile, nearest first. */
  template <typename TypedTree>
  static void find(const TypedTree& tree, const float* query, const ProfileSearchParams& params,
                   std::vector<typename TypedTree::Neighbour>& found)
  {
    if (params.search == ProfileSearch::RADIUS)
    {
      tree.findWithin(query, static_cast<float>(params.radius), found);
      found.resize(std::min(found.size(), MOST_SIMILAR));  // on a repeated pattern all are similar to all
    }
    else
    {
      tree.findNearest(query, static_cast<std::size_t>(params.neighbours), static_cast<float>(params.epsilon), found);
    }
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

SimilarProfiles ProfileIndex::search(const ProfileSet& current, const ProfileSearchParams& params) const
{
  constexpr std::size_t PARTS = 8;  // that threads share
  if (static_cast<std::size_t>(current.coefficients) != tree_->columns)
  {
    throw std::invalid_argument("ProfileIndex: the two images' profiles differ in their number of features");
  }
  const std::size_t count = current.pairs.size();
  const std::vector<char> wanted = largest(current, params.share);
  std::vector<std::vector<ProfileMatch>> parts(PARTS);
  std::vector<std::size_t> begin(count + 1, 0);  // first the numbers of similar profiles, each at the next one's place
  cv::parallel_for_(cv::Range(0, static_cast<int>(PARTS)), [&](const cv::Range& range) {
    for (std::size_t part = static_cast<std::size_t>(range.start); part < static_cast<std::size_t>(range.end); ++part)
    {
      tree_->search(current, count * part / PARTS, count * (part + 1) / PARTS, wanted, params, parts[part],
                    begin.data() + 1);
    }
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<ProfileMatch> matches;
  matches.reserve(begin.back());
  for (const std::vector<ProfileMatch>& part : parts)
  {
    matches.insert(matches.end(), part.begin(), part.end());
  }
  return SimilarProfiles(std::move(matches), std::move(begin));
}

}  // namespace view_servo
