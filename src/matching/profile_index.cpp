// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/profile_index.h"

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <nanoflann.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
// A profile and its reverse differ in the sign of some features. The current profile is searched in the direction in
// which this one, the strongest of them (cos 1), is >= 0, ...
constexpr int DIRECTING_FEATURE = 1;
// ... and the tree holds each reference profile in the directions in which it is at least minus this. [deviations]
constexpr float DIRECTION_MARGIN = 0.5F;
constexpr std::size_t LEAF_SIZE = 32;

#if NANOFLANN_VERSION >= 0x150
using SearchParams = nanoflann::SearchParameters;
SearchParams searchParams(float epsilon)
{
  return SearchParams(epsilon, true);
}
#else
using SearchParams = nanoflann::SearchParams;
SearchParams searchParams(float epsilon)
{
  return SearchParams(32, epsilon, true);
}
#endif

/** Vectors of the tree, in the layout that nanoflann asks for. */
struct Cloud
{
  std::size_t columns = 0;
  std::vector<float> values;
  std::vector<ProfileMatch> source;

  std::size_t kdtree_get_point_count() const  // NOLINT(readability-identifier-naming): nanoflann's name
  {
    return source.size();
  }
  float kdtree_get_pt(std::size_t i, std::size_t column) const  // NOLINT(readability-identifier-naming)
  {
    return values[i * columns + column];
  }
  template <class Box>
  bool kdtree_get_bbox(Box& /*box*/) const  // NOLINT(readability-identifier-naming)
  {
    return false;
  }
};

/** Squared distance for nanoflann, with the number of columns known to the compiler so that it uses SIMD. */
template <int Columns>
struct SquaredDistance
{
  using ElementType = float;
  using DistanceType = float;
  using Vector = Eigen::Map<const Eigen::Matrix<float, Columns, 1>>;

  explicit SquaredDistance(const Cloud& vectors) : cloud(vectors)
  {
  }
  float evalMetric(const float* query, std::size_t i, std::size_t /*columns*/) const
  {
    return (Vector(query) - Vector(cloud.values.data() + i * static_cast<std::size_t>(Columns))).squaredNorm();
  }
  template <typename A, typename B>
  float accum_dist(A a, B b, std::size_t /*column*/) const  // NOLINT(readability-identifier-naming)
  {
    return (a - b) * (a - b);
  }

  const Cloud& cloud;
};

template <int Columns>
using KdTree = nanoflann::KDTreeSingleIndexAdaptor<SquaredDistance<Columns>, Cloud, Columns, std::uint32_t>;

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
  Cloud cloud;
  std::unique_ptr<KdTree<4>> tree4;
  std::unique_ptr<KdTree<6>> tree6;
  std::unique_ptr<KdTree<8>> tree8;

  template <int Columns>
  void build(std::unique_ptr<KdTree<Columns>>& tree)
  {
    tree = std::make_unique<KdTree<Columns>>(Columns, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(LEAF_SIZE));
    tree->buildIndex();
  }

  /** Appends what is similar to a directed profile: [begin, end) of the cloud's vectors. */
  template <int Columns>
  void search(const KdTree<Columns>& tree, const float* query, const ProfileSearchParams& params,
              std::vector<std::pair<std::uint32_t, float>>& found) const
  {
    found.clear();
    if (params.search == ProfileSearch::RADIUS)
    {
      const float radius = static_cast<float>(params.radius);
      tree.radiusSearch(query, radius * radius, found, searchParams(0.0F));
      return;
    }
    const std::size_t wanted = static_cast<std::size_t>(params.neighbours);
    std::uint32_t indices[1000];
    float distances[1000];
    nanoflann::KNNResultSet<float, std::uint32_t> result(wanted);
    result.init(indices, distances);
    // nanoflann compares squared distances, so its tolerance is (1 + epsilon)² - 1.
    tree.findNeighbors(result, query, searchParams(static_cast<float>(params.epsilon * (params.epsilon + 2.0))));
    for (std::size_t i = 0; i < result.size(); ++i)
    {
      found.emplace_back(indices[i], distances[i]);
    }
  }

  void search(const float* query, const ProfileSearchParams& params,
              std::vector<std::pair<std::uint32_t, float>>& found) const
  {
    switch (cloud.columns)
    {
      case 4:
        search(*tree4, query, params, found);
        break;
      case 6:
        search(*tree6, query, params, found);
        break;
      default:
        search(*tree8, query, params, found);
        break;
    }
  }
};

ProfileIndex::ProfileIndex(const ProfileSet& profiles) : tree_(std::make_unique<Tree>())
{
  Cloud& cloud = tree_->cloud;
  cloud.columns = static_cast<std::size_t>(profiles.coefficients);
  if (cloud.columns != 4 && cloud.columns != 6 && cloud.columns != 8)
  {
    throw std::invalid_argument("ProfileIndex: profiles must have 4, 6 or 8 features");
  }
  std::vector<float> reversed(cloud.columns);
  for (std::size_t i = 0; i < profiles.pairs.size(); ++i)
  {
    const float* feature = profiles.feature(i);
    reverse(feature, cloud.columns, reversed.data());
    for (const float* directed : { feature, static_cast<const float*>(reversed.data()) })
    {
      if (directed[DIRECTING_FEATURE] >= -DIRECTION_MARGIN)
      {
        cloud.values.insert(cloud.values.end(), directed, directed + cloud.columns);
        cloud.source.push_back({ static_cast<int>(i), directed != feature });
      }
    }
  }
  switch (cloud.columns)
  {
    case 4:
      tree_->build(tree_->tree4);
      break;
    case 6:
      tree_->build(tree_->tree6);
      break;
    default:
      tree_->build(tree_->tree8);
      break;
  }
}

ProfileIndex::~ProfileIndex() = default;
ProfileIndex::ProfileIndex(ProfileIndex&&) noexcept = default;
ProfileIndex& ProfileIndex::operator=(ProfileIndex&&) noexcept = default;

std::vector<std::vector<ProfileMatch>> ProfileIndex::search(const ProfileSet& current,
                                                            const ProfileSearchParams& params) const
{
  const Cloud& cloud = tree_->cloud;
  if (static_cast<std::size_t>(current.coefficients) != cloud.columns)
  {
    throw std::invalid_argument("ProfileIndex: the two images' profiles differ in their number of features");
  }
  std::vector<std::vector<ProfileMatch>> matches(current.pairs.size());
  if (cloud.source.empty())
  {
    return matches;
  }
  const std::vector<char> wanted = largest(current, params.share);
  cv::parallel_for_(cv::Range(0, static_cast<int>(current.pairs.size())), [&](const cv::Range& range) {
    std::vector<std::pair<std::uint32_t, float>> found;
    std::vector<float> reversed(cloud.columns);
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
        reverse(query, cloud.columns, reversed.data());
        query = reversed.data();
      }
      tree_->search(query, params, found);
      std::vector<ProfileMatch>& out = matches[static_cast<std::size_t>(i)];
      out.reserve(found.size());
      for (const auto& [index, distance] : found)
      {
        ProfileMatch match = cloud.source[index];
        match.reversed = match.reversed != turned;
        out.push_back(match);
      }
    }
  });
  return matches;
}

}  // namespace view_servo
