// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/point_matcher.h"

#include "view_servo/matching/cyclic_alignment.h"

#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <utility>

namespace view_servo
{
namespace
{
/** A similar pair of profiles, as it votes for a pair of corners: the directions in which the profiles leave them. */
struct Vote
{
  std::uint32_t reference_direction;
  std::uint32_t current_direction;
  float correlation;
};

/** Calls visit(row, column, reference direction, current direction) for both ends of two matched profiles. */
template <typename Visit>
void visitEnds(const PointFeatures& reference, const ProfileMatch& match, const PointFeatures& current,
               std::size_t profile, const Visit& visit)
{
  ProfileEnds from = reference.ends[static_cast<std::size_t>(match.reference)];
  const ProfileEnds& to = current.ends[profile];
  if (match.reversed)
  {
    std::swap(from.from_start, from.from_end);
  }
  visit(from.start(), to.start(), from.from_start, to.from_start);
  visit(from.end(), to.end(), from.from_end, to.from_end);
}

/** reversalSign() of each feature. */
constexpr float SIGNS[] = { reversalSign(0), reversalSign(1), reversalSign(2), reversalSign(3),
                            reversalSign(4), reversalSign(5), reversalSign(6), reversalSign(7) };

float correlation(const PointFeatures& reference, const ProfileMatch& match, const PointFeatures& current,
                  std::size_t profile)
{
  const auto r = static_cast<std::size_t>(match.reference);
  const float* a = reference.profiles.feature(r);
  const float* b = current.profiles.feature(profile);
  float product = 0.0F;
  for (int c = 0; c < current.profiles.coefficients; ++c)
  {
    product += match.reversed ? a[c] * b[c] * SIGNS[c] : a[c] * b[c];
  }
  return product * reference.ends[r].inverse_length * current.ends[profile].inverse_length;
}

/** See ProfileEnds. */
std::uint32_t directionKey(const std::vector<Corner>& corners, int corner, int neighbour)
{
  const Eigen::Vector2d d =
      corners[static_cast<std::size_t>(neighbour)].position - corners[static_cast<std::size_t>(corner)].position;
  const double length = std::abs(d.x()) + std::abs(d.y());
  const double slope = length > 0.0 ? d.y() / length : 0.0;       // -1 .. 1
  const double angle = d.x() >= 0.0 ? 1.0 + slope : 3.0 - slope;  // 0 .. 4, from straight up to straight up
  const std::uint32_t steps = static_cast<std::uint32_t>(angle * 16383.0);
  return steps << 16U | static_cast<std::uint32_t>(neighbour);
}

/** An entry of a matrix. */
struct Entry
{
  float value = 0.0F;
  std::size_t place = 0;
};

/**
 * Puts an entry among the largest of its row or column, largest first; it is larger than the last; those found first
 * stay.
 */
void addToLargest(const Entry& entry, Entry* largest, std::size_t count)
{
  std::size_t k = count - 1;
  for (; k > 0 && largest[k - 1].value < entry.value; --k)
  {
    largest[k] = largest[k - 1];
  }
  largest[k] = entry;
}

/**
 * The places, in order, of the `count` largest positive entries of each row and of each column of a matrix; 0 = of all.
 */
std::vector<std::size_t> strongestEntries(const std::vector<float>& matrix, std::size_t rows, std::size_t columns,
                                          int count)
{
  std::vector<std::size_t> places;
  if (count == 0)
  {
    for (std::size_t place = 0; place < matrix.size(); ++place)
    {
      if (matrix[place] > 0.0F)
      {
        places.push_back(place);
      }
    }
    return places;
  }
  const std::size_t most = std::min(static_cast<std::size_t>(count), std::max(rows, columns));
  std::vector<Entry> of_row(most);
  std::vector<Entry> of_columns(columns * most);
  std::vector<float> least_of_columns(columns, 0.0F);  // of those of a column
  const auto take = [&](const std::vector<Entry>& entries) {
    for (const Entry& entry : entries)
    {
      if (entry.value > 0.0F)
      {
        places.push_back(entry.place);
      }
    }
  };
  for (std::size_t row = 0; row < rows; ++row)
  {
    std::fill(of_row.begin(), of_row.end(), Entry());
    const float* values = matrix.data() + row * columns;
    for (std::size_t column = 0; column < columns; ++column)
    {
      const Entry entry{ values[column], row * columns + column };
      if (entry.value > of_row.back().value)
      {
        addToLargest(entry, of_row.data(), most);
      }
      if (entry.value > least_of_columns[column])
      {
        Entry* of_column = of_columns.data() + column * most;
        addToLargest(entry, of_column, most);
        least_of_columns[column] = of_column[most - 1].value;
      }
    }
    take(of_row);
  }
  take(of_columns);
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  return places;
}

/** The association by votes alone (eq. 7.3), rows x columns. */
std::vector<float> countVotes(const PointFeatures& reference, const PointFeatures& current,
                              const SimilarProfiles& similar)
{
  const std::size_t columns = current.corners.size();
  std::vector<float> votes(reference.corners.size() * columns, 0.0F);
  for (std::size_t p = 0; p < similar.size(); ++p)
  {
    const float vote = similar[p].empty() ? 0.0F : 1.0F / static_cast<float>(similar[p].size());
    for (const ProfileMatch& match : similar[p])
    {
      visitEnds(reference, match, current, p, [&](std::size_t row, std::size_t column, std::uint32_t, std::uint32_t) {
        votes[row * columns + column] += vote;
      });
    }
  }
  return votes;
}

/** Votes ordered by their entry: those of entry e are votes[begin[e]] .. votes[begin[e + 1]]. */
struct GroupedVotes
{
  std::vector<Vote> votes;
  std::vector<std::size_t> begin;
};

/** Who voted for each of the entries at `places` of the matrix of votes. */
GroupedVotes groupVotes(const PointFeatures& reference, const PointFeatures& current, const SimilarProfiles& similar,
                        const std::vector<std::size_t>& places, const PointMatcherParams& params)
{
  const std::size_t columns = current.corners.size();
  std::vector<int> entry_of(reference.corners.size() * columns, -1);
  for (std::size_t e = 0; e < places.size(); ++e)
  {
    entry_of[places[e]] = static_cast<int>(e);
  }
  // Parts of the profiles are gone through side by side and joined in their order: the result is that of one pass.
  constexpr std::size_t PARTS = 8;
  std::vector<std::vector<std::pair<std::uint32_t, Vote>>> parts(PARTS);
  cv::parallel_for_(cv::Range(0, static_cast<int>(PARTS)), [&](const cv::Range& range) {
    for (std::size_t part = static_cast<std::size_t>(range.start); part < static_cast<std::size_t>(range.end); ++part)
    {
      for (std::size_t p = similar.size() * part / PARTS; p < similar.size() * (part + 1) / PARTS; ++p)
      {
        for (const ProfileMatch& match : similar[p])
        {
          float weight = -1.0F;  // not yet computed
          visitEnds(reference, match, current, p,
                    [&](std::size_t row, std::size_t column, std::uint32_t from, std::uint32_t to) {
                      const int entry = entry_of[row * columns + column];
                      if (entry < 0)
                      {
                        return;
                      }
                      if (weight < 0.0F)
                      {
                        weight = std::max(0.0F, correlation(reference, match, current, p));
                      }
                      if (weight > 0.0F && static_cast<double>(weight) >= params.min_correlation)
                      {
                        parts[part].push_back({ static_cast<std::uint32_t>(entry), { from, to, weight } });
                      }
                    });
        }
      }
    }
  });

  GroupedVotes grouped;
  grouped.begin.assign(places.size() + 1, 0);
  for (const auto& part : parts)
  {
    for (const auto& [entry, vote] : part)
    {
      ++grouped.begin[entry + 1];
    }
  }
  std::partial_sum(grouped.begin.begin(), grouped.begin.end(), grouped.begin.begin());
  grouped.votes.resize(grouped.begin.back());
  std::vector<std::size_t> next(grouped.begin.begin(), grouped.begin.end() - 1);
  for (const auto& part : parts)
  {
    for (const auto& [entry, vote] : part)
    {
      grouped.votes[next[entry]++] = vote;
    }
  }
  return grouped;
}

/** Eq. 7.4 for one entry: the votes as a matrix between the profiles in angular order, aligned cyclically. */
class EntryAligner
{
public:
  float align(const Vote* begin, const Vote* end)
  {
    rows_.clear();
    columns_.clear();
    for (const Vote* vote = begin; vote != end; ++vote)
    {
      rows_.push_back(vote->reference_direction);
      columns_.push_back(vote->current_direction);
    }
    const auto unique = [](std::vector<std::uint32_t>& keys) {
      std::sort(keys.begin(), keys.end());
      keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
    };
    unique(rows_);
    unique(columns_);
    weights_.assign(rows_.size() * columns_.size(), 0.0F);
    for (const Vote* vote = begin; vote != end; ++vote)
    {
      weights_[place(rows_, vote->reference_direction) * columns_.size() + place(columns_, vote->current_direction)] =
          vote->correlation;
    }
    return aligner_.align(weights_.data(), static_cast<int>(rows_.size()), static_cast<int>(columns_.size()));
  }

private:
  static std::size_t place(const std::vector<std::uint32_t>& keys, std::uint32_t key)
  {
    return static_cast<std::size_t>(std::lower_bound(keys.begin(), keys.end(), key) - keys.begin());
  }

  std::vector<std::uint32_t> rows_;
  std::vector<std::uint32_t> columns_;
  std::vector<float> weights_;
  CyclicAligner aligner_;
};

}  // namespace

std::vector<Parameter> parameters(PointMatcherParams& params)
{
  return joined(
      { parameters(params.corners),
        parameters(params.profiles),
        parameters(params.search),
        {
            choice<AssignmentMethod>("assignment", params.assignment,
                                     { { "exact", AssignmentMethod::EXACT }, { "greedy", AssignmentMethod::GREEDY } },
                                     "how candidates are taken from the association"),
            boolean("cyclic_order", params.cyclic_order, "align the profiles around corners in cyclic order"),
            real("cyclic_correlation", params.min_correlation, "", "[0, 1)", "least correlation of aligned profiles"),
            integer("cyclic_entries", params.cyclic_entries, "", ">= 0",
                    "entries aligned in each row and column, 0 = all"),
        } });
}

std::vector<std::string> PointMatcherParams::validate() const
{
  return faultsOf(*this);
}

PointFeatures extractPointFeatures(const cv::Mat& image, const PointMatcherParams& params, const cv::Mat& mask)
{
  PointFeatures features;
  features.corners = detectCorners(image, params.corners, mask);
  features.profiles = extractProfiles(image, features.corners, params.profiles);
  features.ends = profileEnds(features.corners, features.profiles);
  return features;
}

std::vector<ProfileEnds> profileEnds(const std::vector<Corner>& corners, const ProfileSet& profiles)
{
  constexpr std::size_t MOST = 65536;
  if (corners.size() > MOST)
  {
    throw std::invalid_argument("profileEnds: too many corners");
  }
  std::vector<ProfileEnds> ends;
  ends.reserve(profiles.pairs.size());
  for (std::size_t i = 0; i < profiles.pairs.size(); ++i)
  {
    const ProfileSet::Pair& pair = profiles.pairs[i];
    const float length = Eigen::Map<const Eigen::VectorXf>(profiles.feature(i), profiles.coefficients).norm();
    ends.push_back({ directionKey(corners, pair.start, pair.end), directionKey(corners, pair.end, pair.start),
                     length > 0.0F ? 1.0F / length : 0.0F });
  }
  return ends;
}

AssociationMatrix associatePoints(const PointFeatures& reference, const ProfileIndex& index,
                                  const PointFeatures& current, const PointMatcherParams& params)
{
  const std::size_t rows = reference.corners.size();
  const std::size_t columns = current.corners.size();
  const SimilarProfiles similar = index.search(current.profiles, params.search);
  const std::vector<float> votes = countVotes(reference, current, similar);

  const std::vector<std::size_t> places =
      strongestEntries(votes, rows, columns, params.cyclic_order ? params.cyclic_entries : 0);
  std::vector<Association> entries;
  entries.reserve(places.size());
  for (const std::size_t place : places)
  {
    entries.push_back(
        { static_cast<int>(place / columns), static_cast<int>(place % columns), static_cast<double>(votes[place]) });
  }
  if (params.cyclic_order)
  {
    const GroupedVotes grouped = groupVotes(reference, current, similar, places, params);
    cv::parallel_for_(cv::Range(0, static_cast<int>(entries.size())), [&](const cv::Range& range) {
      EntryAligner aligner;
      for (std::size_t e = static_cast<std::size_t>(range.start); e < static_cast<std::size_t>(range.end); ++e)
      {
        entries[e].weight = static_cast<double>(
            aligner.align(grouped.votes.data() + grouped.begin[e], grouped.votes.data() + grouped.begin[e + 1]));
      }
    });
  }
  return AssociationMatrix(static_cast<int>(rows), static_cast<int>(columns), std::move(entries));
}

std::vector<Association> candidateMatches(const AssociationMatrix& association, AssignmentMethod method)
{
  return method == AssignmentMethod::EXACT ? maximumWeightMatching(association) : greedyMatching(association);
}

}  // namespace view_servo
