// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/view_index.h"

#include "view_servo/parameters/faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <istream>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <type_traits>
#include <utility>

namespace view_servo
{
namespace
{
constexpr std::size_t TURNS = 16;  // intervals of a whole turn in which votes are counted
constexpr std::uint32_t NONE = std::numeric_limits<std::uint32_t>::max();

/** The index of the centre nearest to a word; of equally near ones the first. */
template <typename Centre>
std::size_t nearest(const BinaryWord& word, std::size_t count, const Centre& centre)
{
  std::size_t best = 0;
  int least = std::numeric_limits<int>::max();
  for (std::size_t i = 0; i < count; ++i)
  {
    const int distance = hammingDistance(word, centre(i));
    if (distance < least)
    {
      least = distance;
      best = i;
    }
  }
  return best;
}

/** Each bit as most of the words have it. */
class Majority
{
public:
  void add(const BinaryWord& word)
  {
    ++words_;
    for (std::size_t bit = 0; bit < counts_.size(); ++bit)
    {
      counts_[bit] += static_cast<int>((word[bit / 64] >> (bit % 64)) & 1U);
    }
  }

  /** `otherwise` when there was no word. */
  BinaryWord word(const BinaryWord& otherwise) const
  {
    if (words_ == 0)
    {
      return otherwise;
    }
    BinaryWord result{};
    for (std::size_t bit = 0; bit < counts_.size(); ++bit)
    {
      result[bit / 64] |= static_cast<std::uint64_t>(2 * counts_[bit] > words_) << (bit % 64);
    }
    return result;
  }

private:
  std::array<int, 256> counts_{};
  int words_ = 0;
};

/** Words far from each other, as the first centres of clusters: each the one farthest from those before. */
template <typename Entry>
std::vector<BinaryWord> spread(const std::vector<Entry>& entries, std::size_t count)
{
  std::vector<BinaryWord> centres{ entries.front().word };
  std::vector<int> distances(entries.size(), std::numeric_limits<int>::max());
  while (centres.size() < count)
  {
    std::size_t farthest = 0;
    for (std::size_t i = 0; i < entries.size(); ++i)
    {
      distances[i] = std::min(distances[i], hammingDistance(entries[i].word, centres.back()));
      if (distances[i] > distances[farthest])
      {
        farthest = i;
      }
    }
    if (distances[farthest] == 0)
    {
      break;  // there are no more different words
    }
    centres.push_back(entries[farthest].word);
  }
  return centres;
}

}  // namespace

std::vector<Parameter> parameters(ViewIndexParams& params)
{
  return {
    integer("leaf_words", params.leaf_words, "", "[2, 10000]", "words of one leaf above which it is divided"),
    integer("branches", params.branches, "", "[2, 64]", "parts that a leaf is divided into"),
    integer("checked_words", params.checked_words, "", "[1, 1000000]",
            "stored words that each word of an image is compared with"),
    integer("max_distance", params.max_distance, "bits", "[1, 128]", "largest difference of words of one patch"),
  };
}

std::vector<std::string> ViewIndexParams::validate() const
{
  return faultsOf(*this);
}

ViewIndex::ViewIndex(const ViewIndexParams& params) : params_(params), nodes_(1), leaves_(1)
{
  requireNoFaults("parameters of the view index", params.validate());
  leaves_.front().limit = static_cast<std::uint32_t>(params_.leaf_words);
}

std::uint32_t ViewIndex::leafOf(const BinaryWord& word) const
{
  std::uint32_t at = 0;
  while (nodes_[at].first_child != 0)
  {
    const Node& node = nodes_[at];
    at = node.first_child +
         static_cast<std::uint32_t>(nearest(word, node.children, [&](std::size_t i) -> const BinaryWord& {
           return nodes_[node.first_child + i].centre;
         }));
  }
  return at;
}

void ViewIndex::insert(std::uint32_t leaf, const Entry& entry)
{
  constexpr std::size_t STEP = 4;  // memory for this many words is allocated at a time: doubling would waste too much
  std::vector<Entry>& entries = leaves_[leaf].entries;
  if (entries.size() == entries.capacity())
  {
    entries.reserve(entries.size() + std::max(STEP, entries.size() / 8));
  }
  entries.push_back(entry);
}

void ViewIndex::divide(std::uint32_t leaf)
{
  constexpr int ROUNDS = 3;
  const std::vector<Entry>& entries = leaves_[leaf].entries;
  std::vector<BinaryWord> centres = spread(entries, static_cast<std::size_t>(params_.branches));
  const auto centre = [&](std::size_t i) -> const BinaryWord& {
    return centres[i];
  };
  for (int round = 0; round < ROUNDS && centres.size() > 1; ++round)
  {
    std::vector<Majority> parts(centres.size());
    for (const Entry& entry : entries)
    {
      parts[nearest(entry.word, centres.size(), centre)].add(entry.word);
    }
    for (std::size_t i = 0; i < centres.size(); ++i)
    {
      centres[i] = parts[i].word(centres[i]);
    }
  }
  std::vector<std::size_t> part_of;
  std::vector<std::size_t> sizes(centres.size(), 0);
  for (const Entry& entry : entries)
  {
    part_of.push_back(nearest(entry.word, centres.size(), centre));
    sizes[part_of.back()] += 1;
  }
  if (*std::max_element(sizes.begin(), sizes.end()) == entries.size())
  {
    leaves_[leaf].limit *= 2;  // equal words, or nearly: there is nothing to divide before there are many more
    return;
  }
  const std::vector<Entry> divided = std::move(leaves_[leaf].entries);
  leaves_[leaf].entries = std::vector<Entry>();
  const auto first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[leaf].first_child = first;
  nodes_[leaf].children = static_cast<std::uint32_t>(centres.size());
  for (std::size_t i = 0; i < centres.size(); ++i)
  {
    nodes_.emplace_back();
    nodes_.back().centre = centres[i];
    leaves_.emplace_back();
    leaves_.back().limit = static_cast<std::uint32_t>(params_.leaf_words);
    leaves_.back().entries.reserve(sizes[i]);
  }
  for (std::size_t i = 0; i < divided.size(); ++i)
  {
    leaves_[first + part_of[i]].entries.push_back(divided[i]);
  }
}

std::uint32_t ViewIndex::freeSlot()
{
  if (!free_.empty())
  {
    const std::uint32_t slot = free_.back();
    free_.pop_back();
    return slot;
  }
  if (views_.size() >= NONE - 1)
  {
    throw std::length_error("the index is full");
  }
  views_.emplace_back();
  return static_cast<std::uint32_t>(views_.size() - 1);
}

void ViewIndex::add(const std::string& name, const std::vector<BinaryFeature>& features)
{
  remove(name);
  const std::uint32_t slot = freeSlot();
  views_[slot] = { name, static_cast<std::uint32_t>(features.size()) };
  slots_[name] = slot;
  for (const BinaryFeature& feature : features)
  {
    const std::uint32_t leaf = leafOf(feature.word);
    insert(leaf, { feature.word, slot, feature.angle });
    if (leaves_[leaf].entries.size() > leaves_[leaf].limit)
    {
      divide(leaf);
    }
  }
}

bool ViewIndex::remove(const std::string& name)
{
  const auto found = slots_.find(name);
  if (found == slots_.end())
  {
    return false;
  }
  const std::uint32_t slot = found->second;
  for (Leaf& leaf : leaves_)
  {
    leaf.entries.erase(std::remove_if(leaf.entries.begin(), leaf.entries.end(),
                                      [slot](const Entry& entry) { return entry.view == slot; }),
                       leaf.entries.end());
  }
  slots_.erase(found);
  views_[slot] = View();
  free_.push_back(slot);
  return true;
}

/**
 * What the features of one query find. In a large index nearly all of the time is spent on waiting for memory. So the
 * ways of several words through the tree alternate, and what each reads next is fetched meanwhile.
 */
class ViewIndex::Search
{
public:
  explicit Search(const ViewIndex& index)
    : index_(index), weights_(weights(index.params_)), votes_(index.views_.size()), nearest_(index.views_.size())
  {
  }

  void add(const std::vector<BinaryFeature>& features)
  {
    for (std::size_t begin = 0; begin < features.size(); begin += walks_.size())
    {
      const std::size_t count = std::min(walks_.size(), features.size() - begin);
      findLeaves(&features[begin], count);
      for (std::size_t i = 0; i < count; ++i)
      {
        seen_.clear();
        compare(features[begin + i], walks_[i].leaves);
        vote();
      }
    }
  }

  /** The votes that agree on a turn of the image. */
  double score(std::uint32_t view) const
  {
    const std::array<float, TURNS>& votes = votes_[view];
    float most = 0.0F;
    for (std::size_t i = 0; i < TURNS; ++i)
    {
      most = std::max(most, votes[i] + votes[(i + 1) % TURNS] + votes[(i + 2) % TURNS]);
    }
    return most;
  }

private:
  static constexpr std::uint8_t FAR = std::numeric_limits<std::uint8_t>::max();  // farther than any max_distance

  struct Similar
  {
    std::uint8_t distance = FAR;
    std::uint8_t turn = 0;
  };

  /** Nodes that wait, with their distances; a heap. */
  using Queue = std::vector<std::pair<int, std::uint32_t>>;

  /** The way of one word through the tree. */
  struct Walk
  {
    std::uint32_t at = 0;  // the node where it is
    bool ended = false;
    std::size_t words = 0;              // in `leaves`
    std::vector<std::uint32_t> leaves;  // the nearest ones, nearest first
    Queue queue;

    void restart()
    {
      at = 0;
      ended = false;
      words = 0;
      leaves.clear();
      queue.clear();
    }
  };

  /** What a word counts by its distance, up to the largest one. */
  static std::vector<double> weights(const ViewIndexParams& params)
  {
    const double deviation = params.max_distance / 3.0;  // of the distances of words of one patch [bits]
    std::vector<double> result;
    for (int distance = 0; distance <= params.max_distance; ++distance)
    {
      const double ratio = distance / deviation;
      result.push_back(std::exp(-0.5 * ratio * ratio));
    }
    return result;
  }

  /** Has memory read ahead of its use; changes no result. */
  static void fetch(const void* data, std::size_t bytes)
  {
    constexpr std::size_t CACHE_LINE = 64;
    for (std::size_t at = 0; at < bytes; at += CACHE_LINE)
    {
      __builtin_prefetch(static_cast<const char*>(data) + at);
    }
  }

  /** Finds the nearest leaves of `count` words, each as many as have enough words to compare with. */
  void findLeaves(const BinaryFeature* features, std::size_t count)
  {
    std::for_each(walks_.begin(), walks_.end(), [](Walk& walk) { walk.restart(); });
    for (bool all_ended = false; !all_ended;)
    {
      all_ended = true;
      for (std::size_t i = 0; i < count; ++i)
      {
        if (!walks_[i].ended)
        {
          step(features[i].word, walks_[i]);
          all_ended = false;
        }
      }
    }
  }

  /** Goes to the nearest child of a node, or from a leaf to the nearest node that waits. */
  void step(const BinaryWord& word, Walk& walk) const
  {
    const Node& node = index_.nodes_[walk.at];
    if (node.first_child != 0)
    {
      walk.at = descend(word, node, walk.queue);
    }
    else
    {
      walk.leaves.push_back(walk.at);
      walk.words += index_.leaves_[walk.at].entries.size();
      walk.ended = walk.queue.empty() || walk.words >= static_cast<std::size_t>(index_.params_.checked_words);
      if (walk.ended)
      {
        return;
      }
      std::pop_heap(walk.queue.begin(), walk.queue.end(), std::greater<>());
      walk.at = walk.queue.back().second;
      walk.queue.pop_back();
    }
    const Node& next = index_.nodes_[walk.at];
    fetch(&index_.nodes_[next.first_child], next.children * sizeof(Node));
  }

  /** The nearest child; the others are put in the queue. */
  std::uint32_t descend(const BinaryWord& word, const Node& node, Queue& queue) const
  {
    std::uint32_t best = NONE;
    int least = std::numeric_limits<int>::max();
    for (std::uint32_t child = node.first_child; child < node.first_child + node.children; ++child)
    {
      const int distance = hammingDistance(word, index_.nodes_[child].centre);
      std::pair<int, std::uint32_t> other(distance, child);
      if (distance < least)
      {
        std::swap(other.first, least);
        std::swap(other.second, best);
      }
      if (other.second != NONE)
      {
        queue.push_back(other);
        std::push_heap(queue.begin(), queue.end(), std::greater<>());
      }
    }
    return best;
  }

  /** Compares a word with those of leaves. */
  void compare(const BinaryFeature& feature, const std::vector<std::uint32_t>& leaves)
  {
    constexpr std::size_t AHEAD = 2;  // so many leaves are fetched ahead
    const BinaryWord word = feature.word;
    const int most = index_.params_.max_distance;
    for (std::size_t i = 0; i < leaves.size(); ++i)
    {
      if (i + AHEAD < leaves.size())
      {
        const std::vector<Entry>& later = index_.leaves_[leaves[i + AHEAD]].entries;
        fetch(later.data(), later.size() * sizeof(Entry));
      }
      for (const Entry& entry : index_.leaves_[leaves[i]].entries)
      {
        const int distance = hammingDistance(word, entry.word);
        if (distance > most)
        {
          continue;
        }
        Similar& nearest = nearest_[entry.view];
        if (nearest.distance == FAR)
        {
          seen_.push_back(entry.view);
          fetch(&votes_[entry.view], 1);
        }
        if (distance < nearest.distance)
        {
          nearest = { static_cast<std::uint8_t>(distance), static_cast<std::uint8_t>(entry.angle - feature.angle) };
        }
      }
    }
  }

  void vote()
  {
    const double rarity =
        std::log(1.0 + static_cast<double>(index_.slots_.size()) / (1.0 + static_cast<double>(seen_.size())));
    for (const std::uint32_t view : seen_)
    {
      const Similar nearest = nearest_[view];
      votes_[view][nearest.turn * TURNS / 256] += static_cast<float>(rarity * rarity * weights_[nearest.distance]);
      nearest_[view] = Similar();
    }
  }

  const ViewIndex& index_;
  const std::vector<double> weights_;
  std::array<Walk, 8> walks_;
  std::vector<std::array<float, TURNS>> votes_;  // of each view, by the turn between the images
  std::vector<Similar> nearest_;                 // of each view: its most similar word
  std::vector<std::uint32_t> seen_;              // views with a similar word
};

std::vector<ScoredView> ViewIndex::query(const std::vector<BinaryFeature>& features, std::size_t most) const
{
  Search search(*this);
  search.add(features);
  std::vector<std::pair<double, std::uint32_t>> found;
  for (std::uint32_t view = 0; view < views_.size(); ++view)
  {
    const double score = search.score(view);
    if (score > 0.0)
    {
      // A view with many features has some in common with any image.
      found.emplace_back(score / std::sqrt(static_cast<double>(views_[view].features)), view);
    }
  }
  const std::size_t count = std::min(most, found.size());
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count), found.end(),
                    [this](const auto& a, const auto& b) {
                      return a.first != b.first ? a.first > b.first : views_[a.second].name < views_[b.second].name;
                    });
  std::vector<ScoredView> best;
  for (std::size_t i = 0; i < count; ++i)
  {
    best.push_back({ views_[found[i].second].name, found[i].first });
  }
  return best;
}

bool ViewIndex::contains(const std::string& name) const
{
  return slots_.count(name) != 0;
}

std::vector<std::string> ViewIndex::names() const
{
  std::vector<std::string> names;
  for (const auto& [name, slot] : slots_)
  {
    names.push_back(name);
  }
  return names;
}

std::size_t ViewIndex::size() const
{
  return slots_.size();
}

std::size_t ViewIndex::memory() const
{
  std::size_t bytes =
      nodes_.capacity() * sizeof(Node) + leaves_.capacity() * sizeof(Leaf) + views_.capacity() * sizeof(View);
  for (const Leaf& leaf : leaves_)
  {
    bytes += leaf.entries.capacity() * sizeof(Entry);
  }
  return bytes;
}

// --------------------------------------------------------------------------------------------------------- files

namespace
{
constexpr char MAGIC[] = "view_servo ViewIndex 1\n";
constexpr std::uint64_t BYTE_ORDER_MARK = 0x0102030405060708;

/** FNV-1a by words of 64 bits: of hundreds of megabytes, it has to be quick. */
class Checksum
{
public:
  void add(const char* data, std::size_t size)
  {
    for (std::size_t at = 0; at < size; at += sizeof(std::uint64_t))
    {
      std::uint64_t word = 0;
      std::memcpy(&word, data + at, std::min(sizeof(word), size - at));
      value_ = (value_ ^ word) * 0x100000001b3U;
      value_ ^= value_ >> 32;
    }
  }
  std::uint64_t value() const
  {
    return value_;
  }

private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

class Writer
{
public:
  explicit Writer(std::ostream& stream) : stream_(stream)
  {
  }
  template <typename T>
  void put(const T* values, std::size_t count)
  {
    static_assert(std::is_trivially_copyable_v<T> && std::has_unique_object_representations_v<T>);
    const char* bytes = reinterpret_cast<const char*>(values);
    stream_.write(bytes, static_cast<std::streamsize>(count * sizeof(T)));
    sum_.add(bytes, count * sizeof(T));
  }
  template <typename T>
  void put(const T& value)
  {
    put(&value, 1);
  }
  std::uint64_t sum() const
  {
    return sum_.value();
  }

private:
  std::ostream& stream_;
  Checksum sum_;
};

class Reader
{
public:
  explicit Reader(std::istream& stream) : stream_(stream)
  {
  }
  template <typename T>
  void get(T* values, std::size_t count)
  {
    static_assert(std::is_trivially_copyable_v<T>);
    char* bytes = reinterpret_cast<char*>(values);
    if (!stream_.read(bytes, static_cast<std::streamsize>(count * sizeof(T))))
    {
      throw std::runtime_error("the view index ends early");
    }
    sum_.add(bytes, count * sizeof(T));
  }
  template <typename T>
  T get()
  {
    T value{};
    get(&value, 1);
    return value;
  }
  /** Many values; a wrong count ends with an error before it takes much memory. */
  template <typename List>
  void getList(List& list, std::size_t count)
  {
    constexpr std::size_t PORTION = 1 << 16;
    list.reserve(std::min(count, PORTION));
    while (list.size() < count)
    {
      const std::size_t begin = list.size();
      list.resize(begin + std::min(PORTION, count - begin));
      get(list.data() + begin, list.size() - begin);
    }
  }
  std::uint64_t sum() const
  {
    return sum_.value();
  }

private:
  std::istream& stream_;
  Checksum sum_;
};

}  // namespace

void ViewIndex::save(std::ostream& stream) const
{
  Writer out(stream);
  out.put(MAGIC, sizeof(MAGIC));
  out.put(BYTE_ORDER_MARK);
  for (const int value : { params_.leaf_words, params_.branches })
  {
    out.put(value);
  }
  out.put(static_cast<std::uint32_t>(views_.size()));
  for (const View& view : views_)
  {
    out.put(static_cast<std::uint32_t>(view.name.size()));
    out.put(view.name.data(), view.name.size());
    out.put(view.features);
  }
  out.put(static_cast<std::uint32_t>(free_.size()));
  out.put(free_.data(), free_.size());
  out.put(static_cast<std::uint32_t>(nodes_.size()));
  for (std::size_t at = 0; at < nodes_.size(); ++at)
  {
    const Node& node = nodes_[at];
    const Leaf& leaf = leaves_[at];
    out.put(node.centre);
    out.put(node.first_child);
    out.put(node.children);
    out.put(leaf.limit);
    out.put(static_cast<std::uint32_t>(leaf.entries.size()));
    out.put(leaf.entries.data(), leaf.entries.size());
  }
  const std::uint64_t sum = out.sum();
  out.put(sum);
  if (!stream)
  {
    throw std::runtime_error("the view index cannot be written");
  }
}

void ViewIndex::load(std::istream& stream)
{
  Reader in(stream);
  std::array<char, sizeof(MAGIC)> magic{};
  in.get(magic.data(), magic.size());
  if (std::memcmp(magic.data(), MAGIC, sizeof(MAGIC)) != 0 || in.get<std::uint64_t>() != BYTE_ORDER_MARK)
  {
    throw std::runtime_error("this is no view index, or one of another version or kind of machine");
  }
  for (const int value : { params_.leaf_words, params_.branches })
  {
    if (in.get<int>() != value)
    {
      throw std::runtime_error("the view index was made with other parameters");
    }
  }
  ViewIndex read(params_);
  constexpr const char* DAMAGED = "the view index is damaged";
  const auto views = in.get<std::uint32_t>();
  for (std::uint32_t slot = 0; slot < views; ++slot)
  {
    View view;
    in.getList(view.name, in.get<std::uint32_t>());
    view.features = in.get<std::uint32_t>();
    if (!view.name.empty() && !read.slots_.emplace(view.name, slot).second)
    {
      throw std::runtime_error(DAMAGED);
    }
    read.views_.push_back(std::move(view));
  }
  in.getList(read.free_, in.get<std::uint32_t>());
  const auto nodes = in.get<std::uint32_t>();
  read.nodes_.clear();
  read.leaves_.clear();
  for (std::uint32_t at = 0; at < nodes; ++at)
  {
    Node node;
    node.centre = in.get<BinaryWord>();
    node.first_child = in.get<std::uint32_t>();
    node.children = in.get<std::uint32_t>();
    Leaf leaf;
    leaf.limit = in.get<std::uint32_t>();
    in.getList(leaf.entries, in.get<std::uint32_t>());
    read.nodes_.push_back(node);
    read.leaves_.push_back(std::move(leaf));
  }
  const std::uint64_t expected = in.sum();
  if (in.get<std::uint64_t>() != expected || !read.isConsistent())
  {
    throw std::runtime_error(DAMAGED);
  }
  *this = std::move(read);
}

bool ViewIndex::isConsistent() const
{
  const auto is_free = [&](std::uint32_t slot) {
    return slot < views_.size() && views_[slot].name.empty();
  };
  if (nodes_.empty() || slots_.size() + free_.size() != views_.size() ||
      !std::all_of(free_.begin(), free_.end(), is_free))
  {
    return false;
  }
  for (std::size_t at = 0; at < nodes_.size(); ++at)
  {
    const Node& node = nodes_[at];
    const bool leaf = node.first_child == 0;
    // Children lie behind their parents: so no walk through the tree goes round in circles.
    const bool placed = leaf ? node.children == 0
                             : node.first_child > at && node.children > 0 &&
                                   std::size_t{ node.first_child } + node.children <= nodes_.size();
    if (!placed || !std::all_of(leaves_[at].entries.begin(), leaves_[at].entries.end(), [&](const Entry& entry) {
          return entry.view < views_.size() && !views_[entry.view].name.empty();
        }))
    {
      return false;
    }
  }
  return true;
}

}  // namespace view_servo
