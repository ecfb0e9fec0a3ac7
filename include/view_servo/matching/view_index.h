// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/features/binary_features.h"
#include "view_servo/parameters/parameter.h"

#include <array>
#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <map>
#include <string>
#include <vector>

namespace view_servo
{
/** Options of a ViewIndex. */
struct ViewIndexParams
{
  int leaf_words = 64;  ///< a leaf with more words is divided into `branches` new ones
  int branches = 4;     ///< number of children of a node
  int checked_words =
      1000;               ///< number of stored words that each word of a query is compared with, if there are so many
  int max_distance = 64;  ///< largest hammingDistance() of words that count as similar [bits]

  /** Each fault in one line; empty when the parameters are usable. */
  std::vector<std::string> validate() const;
};

/** Names, units and ranges of these parameters, by which validate() checks them. */
std::vector<Parameter> parameters(ViewIndexParams& params);

/** A view that an image may show. */
struct ScoredView
{
  std::string name;
  double score;  ///< > 0, larger is more likely; comparable within one query only
};

/**
 * Finds the views that an image may show among thousands, by the binary words of their corners. There is no vocabulary
 * to be learnt before: the words of all views lie in the leaves of one tree, which grows as they are added, and each
 * word of an image is compared with the stored words of the nearest leaves.
 *
 * Each feature of an image votes for the views that have a similar word: the more, the more similar it is and the fewer
 * views have such words. In each view it votes for the most similar word only, so that a pattern that repeats is not
 * counted again and again. A view's score is of the votes that agree on how the image is turned about the optical axis,
 * divided by the root of the view's number of features.
 *
 * The same calls in the same order give the same results. Not safe to use from several threads while one of them
 * changes it.
 */
class ViewIndex
{
public:
  /** @throws std::invalid_argument with all faults of the parameters. */
  explicit ViewIndex(const ViewIndexParams& params = ViewIndexParams());

  /**
   * Adds a view; one of this name is replaced. A view without features is never found.
   * @throws std::length_error beyond 2^32 - 2 views.
   */
  void add(const std::string& name, const std::vector<BinaryFeature>& features);

  /** Removes a view; false when there is none of this name. Takes time in proportion to the size of the index. */
  bool remove(const std::string& name);

  /**
   * The most likely views, best first, `most` at most; equal scores by name. Views without a similar word are left out.
   */
  std::vector<ScoredView> query(const std::vector<BinaryFeature>& features, std::size_t most) const;

  /** Whether there is a view of this name. */
  bool contains(const std::string& name) const;
  std::vector<std::string> names() const;  ///< names of all views, sorted
  std::size_t size() const;                ///< number of views

  /** Bytes of memory that the words and the tree take. */
  std::size_t memory() const;

  /**
   * Writes the index in the byte order and layout of this machine, with a checksum.
   * @throws std::runtime_error when the stream fails.
   */
  void save(std::ostream& stream) const;

  /**
   * Replaces the index by one that save() wrote on a machine of this kind, with these parameters.
   * @throws std::runtime_error, with the index unchanged, when the stream holds none, another version's, one made with
   * other parameters or a damaged one.
   */
  void load(std::istream& stream);

private:
  struct Entry
  {
    BinaryWord word;
    std::uint32_t view;                    ///< index into views_
    std::uint8_t angle;                    ///< BinaryFeature::angle
    std::array<std::uint8_t, 3> unused{};  // files hold entries as they are in memory
  };
  struct Node
  {
    BinaryWord centre{};            ///< the word that those below this node resemble
    std::uint32_t first_child = 0;  ///< index into nodes_, where the children lie side by side; 0: this is a leaf
    std::uint32_t children = 0;     ///< number of children
  };
  /** The words of a node; apart from it, as a query visits many more nodes than it reads the words of. */
  struct Leaf
  {
    std::uint32_t limit = 0;     ///< number of words above which it is divided
    std::vector<Entry> entries;  ///< its words; none unless the node is a leaf
  };
  struct View
  {
    std::string name;            ///< empty: this place is free
    std::uint32_t features = 0;  ///< number of its features
  };
  class Search;

  std::uint32_t leafOf(const BinaryWord& word) const;
  void insert(std::uint32_t leaf, const Entry& entry);
  void divide(std::uint32_t leaf);
  std::uint32_t freeSlot();
  bool isConsistent() const;

  ViewIndexParams params_;
  std::vector<Node> nodes_;
  std::vector<Leaf> leaves_;  // by index of the node
  std::vector<View> views_;
  std::vector<std::uint32_t> free_;             // indices of free places in views_
  std::map<std::string, std::uint32_t> slots_;  // index into views_ by name
};

}  // namespace view_servo
