// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace view_servo
{
/**
 * Kd-tree over vectors of a few numbers, whose count the compiler knows so that distances use SIMD. It is split in the
 * middle of the longest side of what is to be split; distances to cells grow by one coordinate with each step down (S.
 * Arya, D. Mount: Algorithms for fast vector quantization, 1993).
 */
template <int Columns>
class KdTree
{
public:
  struct Neighbour
  {
    std::uint32_t index;     ///< of the vector
    float squared_distance;  ///< to the query
  };

  /** An empty tree. */
  KdTree() = default;

  /** @param vectors `Columns` numbers each; they are copied. */
  explicit KdTree(const std::vector<float>& vectors) : index_(vectors.size() / Columns)
  {
    for (std::size_t i = 0; i < index_.size(); ++i)
    {
      index_[i] = static_cast<std::uint32_t>(i);
    }
    if (index_.empty())
    {
      return;
    }
    bounds_ = boundsOf(vectors, 0, index_.size());
    build(vectors, 0, index_.size());
    for (Node& node : nodes_)
    {
      if (node.column < 0)
      {
        storeLeaf(vectors, node);
      }
    }
  }

  /**
   * Sets `found` to the `wanted` nearest vectors, nearest first; fewer when there are not so many.
   * @param tolerance 0: exact; else each one found is at most 1 + tolerance times as far as the one that belongs there.
   */
  void findNearest(const float* query, std::size_t wanted, float tolerance, std::vector<Neighbour>& found) const
  {
    found.clear();
    Nearest nearest{ wanted, found };
    search(query, (1.0F + tolerance) * (1.0F + tolerance), nearest);
  }

  /**
   * The vectors, in no order, of the leaf that the query falls in: from the first of two pointers to before the second.
   */
  std::pair<const std::uint32_t*, const std::uint32_t*> leafOf(const float* query) const
  {
    if (nodes_.empty())
    {
      return { nullptr, nullptr };
    }
    std::size_t number = 0;
    while (nodes_[number].column >= 0)
    {
      number = leftIsNearer(nodes_[number], query) ? number + 1 : nodes_[number].right;
    }
    return { index_.data() + nodes_[number].begin, index_.data() + nodes_[number].end };
  }

  /** Sets `found` to all vectors nearer than a radius, nearest first. */
  void findWithin(const float* query, float radius, std::vector<Neighbour>& found) const
  {
    found.clear();
    Within within{ radius * radius, found };
    search(query, 1.0F, within);
    std::sort(found.begin(), found.end(),
              [](const Neighbour& a, const Neighbour& b) { return a.squared_distance < b.squared_distance; });
  }

private:
  using Vector = Eigen::Matrix<float, Columns, 1>;
  using Map = Eigen::Map<const Vector>;
  using Group = Eigen::Array<float, 4, Columns>;  // of vectors, a row each, whose distances are computed at once
  using Distances = Eigen::Array<float, 4, 1>;
  static constexpr std::size_t LEAF_SIZE = 12;

  struct Bounds
  {
    std::array<float, Columns> low;   // least number in each column
    std::array<float, Columns> high;  // largest number in each column
  };

  /** Its left child is the next node. */
  struct Node
  {
    int column = -1;          // that is split; -1: a leaf
    float left_high = 0.0F;   // largest number of that column on the left, ...
    float right_low = 0.0F;   // ... and smallest on the right
    std::uint32_t right = 0;  // child
    std::uint32_t begin = 0;  // of a leaf's vectors in index_, ...
    std::uint32_t end = 0;
    std::uint32_t group = 0;  // ... and of the groups that hold them
  };

  /** Collects the nearest, sorted. */
  struct Nearest
  {
    std::size_t wanted;
    std::vector<Neighbour>& found;

    /** Only what is nearer is collected [squared distance]; infinite while fewer than `wanted` are. */
    float reach() const
    {
      return found.size() < wanted ? std::numeric_limits<float>::infinity() : found.back().squared_distance;
    }
    void take(std::uint32_t index, float squared_distance)
    {
      if (found.size() < wanted)
      {
        found.emplace_back();
      }
      std::size_t place = found.size() - 1;
      for (; place > 0 && found[place - 1].squared_distance > squared_distance; --place)
      {
        found[place] = found[place - 1];
      }
      found[place] = { index, squared_distance };
    }
  };

  /** Collects all in reach. */
  struct Within
  {
    float squared_radius;
    std::vector<Neighbour>& found;

    /** Only what is nearer is collected [squared distance]. */
    float reach() const
    {
      return squared_radius;
    }
    void take(std::uint32_t index, float squared_distance)
    {
      found.push_back({ index, squared_distance });
    }
  };

  Bounds boundsOf(const std::vector<float>& vectors, std::size_t begin, std::size_t end) const
  {
    Vector low = Map(vectors.data() + static_cast<std::size_t>(index_[begin]) * Columns);
    Vector high = low;
    for (std::size_t i = begin + 1; i < end; ++i)
    {
      const Map vector(vectors.data() + static_cast<std::size_t>(index_[i]) * Columns);
      low = low.cwiseMin(vector);
      high = high.cwiseMax(vector);
    }
    Bounds bounds;
    std::copy_n(low.data(), Columns, bounds.low.begin());
    std::copy_n(high.data(), Columns, bounds.high.begin());
    return bounds;
  }

  /** Orders index_[begin, end) and appends the nodes over it. */
  void build(const std::vector<float>& vectors, std::size_t begin, std::size_t end)
  {
    const std::size_t node = nodes_.size();
    nodes_.emplace_back();
    if (end - begin <= LEAF_SIZE)
    {
      nodes_[node].begin = static_cast<std::uint32_t>(begin);
      nodes_[node].end = static_cast<std::uint32_t>(end);
      return;
    }
    const Bounds bounds = boundsOf(vectors, begin, end);
    std::size_t column = 0;
    for (std::size_t c = 1; c < Columns; ++c)
    {
      if (bounds.high[c] - bounds.low[c] > bounds.high[column] - bounds.low[column])
      {
        column = c;
      }
    }
    const auto value = [&](std::uint32_t i) {
      return vectors[static_cast<std::size_t>(i) * Columns + column];
    };
    const auto first = index_.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = index_.begin() + static_cast<std::ptrdiff_t>(end);
    const float middle = 0.5F * (bounds.low[column] + bounds.high[column]);
    auto split = std::partition(first, last, [&](std::uint32_t i) { return value(i) < middle; });
    if (split == first || split == last)
    {
      // They are all alike.
      split = first + (last - first) / 2;
      std::nth_element(first, split, last, [&](std::uint32_t a, std::uint32_t b) { return value(a) < value(b); });
    }
    const auto less = [&](std::uint32_t a, std::uint32_t b) {
      return value(a) < value(b);
    };
    nodes_[node].column = static_cast<int>(column);
    nodes_[node].left_high = value(*std::max_element(first, split, less));
    nodes_[node].right_low = value(*std::min_element(split, last, less));
    const std::size_t border = static_cast<std::size_t>(split - index_.begin());
    build(vectors, begin, border);
    nodes_[node].right = static_cast<std::uint32_t>(nodes_.size());
    build(vectors, border, end);
  }

  /** Appends the groups of a leaf; what is missing in the last one is infinitely far from all. */
  void storeLeaf(const std::vector<float>& vectors, Node& leaf)
  {
    leaf.group = static_cast<std::uint32_t>(groups_.size());
    for (std::size_t i = leaf.begin; i < leaf.end; i += 4)
    {
      groups_.emplace_back(Group::Constant(std::numeric_limits<float>::infinity()));
      for (std::size_t k = i; k < std::min<std::size_t>(i + 4, leaf.end); ++k)
      {
        groups_.back().row(static_cast<Eigen::Index>(k - i)) =
            Map(vectors.data() + static_cast<std::size_t>(index_[k]) * Columns).transpose();
      }
    }
  }

  /**
   * Whether the query is nearer to the vectors left of the split than to those right of it, by the column of the split.
   */
  static bool leftIsNearer(const Node& node, const float* query)
  {
    const float value = query[static_cast<std::size_t>(node.column)];
    return value - node.left_high < node.right_low - value;
  }

  /** Offers the vectors of a leaf that are in reach to the collector. */
  template <typename Collector>
  void takeLeaf(const Node& leaf, const float* query, Collector& collector) const
  {
    std::size_t group = leaf.group;
    for (std::size_t i = leaf.begin; i < leaf.end; i += 4, ++group)
    {
      const Group& vectors = groups_[group];
      Distances distances = Distances::Zero();
      for (int c = 0; c < Columns; ++c)
      {
        distances += (vectors.col(c) - query[c]).square();
      }
      for (int k = 0; k < 4; ++k)
      {
        if (distances[k] < collector.reach())
        {
          collector.take(index_[i + static_cast<std::size_t>(k)], distances[k]);
        }
      }
    }
  }

  /** @param squared_factor cells count as this many times as far as they are, squared; 1: exact. */
  template <typename Collector>
  void search(const float* query, float squared_factor, Collector& collector) const
  {
    if (nodes_.empty())
    {
      return;
    }
    std::array<float, Columns> offsets;  // squared, of the query from the cell, by column
    float squared_distance = 0.0F;
    for (std::size_t c = 0; c < Columns; ++c)
    {
      const float offset = std::max({ bounds_.low[c] - query[c], query[c] - bounds_.high[c], 0.0F });
      offsets[c] = offset * offset;
      squared_distance += offsets[c];
    }
    descend(0, query, squared_factor, squared_distance, offsets, collector);
  }

  /**
   * Searches below a node, the nearer child first.
   * @param squared_distance of the query from the node's cell. @param offsets its parts by column; the same after the
   * call.
   */
  template <typename Collector>
  void descend(std::size_t number, const float* query, float squared_factor, float squared_distance,
               std::array<float, Columns>& offsets, Collector& collector) const
  {
    const Node& node = nodes_[number];
    if (node.column < 0)
    {
      takeLeaf(node, query, collector);
      return;
    }
    const std::size_t column = static_cast<std::size_t>(node.column);
    const float beyond_left = query[column] - node.left_high;
    const float before_right = node.right_low - query[column];
    const bool left_first = leftIsNearer(node, query);
    const float offset = left_first ? before_right : beyond_left;
    descend(left_first ? number + 1 : node.right, query, squared_factor, squared_distance, offsets, collector);
    const float before = offsets[column];
    const float other_distance = squared_distance - before + offset * offset;
    if (other_distance * squared_factor <= collector.reach())
    {
      offsets[column] = offset * offset;
      descend(left_first ? node.right : number + 1, query, squared_factor, other_distance, offsets, collector);
      offsets[column] = before;
    }
  }

  std::vector<std::uint32_t> index_;                            // of the vectors, in the order of the leaves
  std::vector<Group, Eigen::aligned_allocator<Group>> groups_;  // the vectors in the same order
  std::vector<Node> nodes_;
  Bounds bounds_{};  // of all vectors
};

}  // namespace view_servo
