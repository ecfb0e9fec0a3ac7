// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/matching/point_matcher.h"

#include "view_servo/matching/cyclic_alignment.h"

#include <opencv2/core.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
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

/** Calls visit(row, column, reference neighbour, current neighbour) for both ends of two matched profiles. */
template <typename Visit>
void visitEnds(const ProfileSet::Pair& reference, const ProfileSet::Pair& current, bool reversed, const Visit& visit)
{
  const int start = reversed ? reference.end : reference.start;
  const int end = reversed ? reference.start : reference.end;
  visit(start, current.start, end, current.end);
  visit(end, current.end, start, current.start);
}

float correlation(const float* a, const float* b, int columns, bool reversed)
{
  float ab = 0.0F;
  float aa = 0.0F;
  float bb = 0.0F;
  for (int c = 0; c < columns; ++c)
  {
    const float value = reversed ? a[c] * reversalSign(c) : a[c];
    ab += value * b[c];
    aa += value * value;
    bb += b[c] * b[c];
  }
  const float norm = std::sqrt(aa * bb);
  return norm > 0.0F ? ab / norm : 0.0F;
}

/**
 * A number that orders the profiles around a corner by their angle, and differs for different neighbours: the upper
 * half is the angle (as the monotonic and cheaper diamond angle, in 2^14 steps a quadrant), the lower the neighbour.
 */
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

/** Marks, in a rows x columns matrix, the `count` largest positive entries of each row and of each column; 0 = all. */
std::vector<char> strongestEntries(const std::vector<float>& matrix, std::size_t rows, std::size_t columns, int count)
{
  std::vector<char> chosen(matrix.size(), 0);
  // One pass over the rows, one over the columns; within a pass the lines share no entry.
  const auto mark = [&](std::size_t lines, std::size_t length, std::size_t line_stride, std::size_t stride) {
    cv::parallel_for_(cv::Range(0, static_cast<int>(lines)), [&](const cv::Range& range) {
      std::vector<std::pair<float, std::size_t>> line;
      for (std::size_t l = static_cast<std::size_t>(range.start); l < static_cast<std::size_t>(range.end); ++l)
      {
        line.clear();
        for (std::size_t k = 0; k < length; ++k)
        {
          const std::size_t place = l * line_stride + k * stride;
          if (matrix[place] > 0.0F)
          {
            line.emplace_back(-matrix[place], place);
          }
        }
        const std::size_t wanted = count > 0 ? std::min(line.size(), static_cast<std::size_t>(count)) : line.size();
        std::partial_sort(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(wanted), line.end());
        for (std::size_t k = 0; k < wanted; ++k)
        {
          chosen[line[k].second] = 1;
        }
      }
    });
  };
  mark(rows, columns, columns, 1);
  mark(columns, rows, 1, columns);
  return chosen;
}

/** For each current profile, the reference profiles similar to it. */
using SimilarProfiles = std::vector<std::vector<ProfileMatch>>;

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
      visitEnds(reference.profiles.pairs[static_cast<std::size_t>(match.reference)], current.profiles.pairs[p],
                match.reversed, [&](int row, int column, int, int) {
                  votes[static_cast<std::size_t>(row) * columns + static_cast<std::size_t>(column)] += vote;
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

/** Who voted for each of `count` entries; entry_of gives an entry's number, or -1, for each place of the matrix. */
GroupedVotes groupVotes(const PointFeatures& reference, const PointFeatures& current, const SimilarProfiles& similar,
                        const std::vector<int>& entry_of, std::size_t count, const PointMatcherParams& params)
{
  // Parts of the profiles are gone through side by side and joined in their order: the result is that of one pass.
  constexpr std::size_t PARTS = 8;
  std::vector<std::vector<std::pair<std::size_t, Vote>>> parts(PARTS);
  cv::parallel_for_(cv::Range(0, static_cast<int>(PARTS)), [&](const cv::Range& range) {
    for (std::size_t part = static_cast<std::size_t>(range.start); part < static_cast<std::size_t>(range.end); ++part)
    {
      for (std::size_t p = similar.size() * part / PARTS; p < similar.size() * (part + 1) / PARTS; ++p)
      {
        for (const ProfileMatch& match : similar[p])
        {
          const std::size_t r = static_cast<std::size_t>(match.reference);
          float weight = -1.0F;  // not yet computed
          visitEnds(
              reference.profiles.pairs[r], current.profiles.pairs[p], match.reversed,
              [&](int row, int column, int row_neighbour, int column_neighbour) {
                const int entry =
                    entry_of[static_cast<std::size_t>(row) * current.corners.size() + static_cast<std::size_t>(column)];
                if (entry < 0)
                {
                  return;
                }
                if (weight < 0.0F)
                {
                  weight = std::max(0.0F, correlation(reference.profiles.feature(r), current.profiles.feature(p),
                                                      current.profiles.coefficients, match.reversed));
                }
                if (weight > 0.0F && static_cast<double>(weight) >= params.min_correlation)
                {
                  parts[part].push_back({ static_cast<std::size_t>(entry),
                                          { directionKey(reference.corners, row, row_neighbour),
                                            directionKey(current.corners, column, column_neighbour), weight } });
                }
              });
        }
      }
    }
  });

  GroupedVotes grouped;
  grouped.begin.assign(count + 1, 0);
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
  return features;
}

AssociationMatrix associatePoints(const PointFeatures& reference, const ProfileIndex& index,
                                  const PointFeatures& current, const PointMatcherParams& params)
{
  const std::size_t rows = reference.corners.size();
  const std::size_t columns = current.corners.size();
  const SimilarProfiles similar = index.search(current.profiles, params.search);
  const std::vector<float> votes = countVotes(reference, current, similar);

  const std::vector<char> chosen =
      params.cyclic_order ? strongestEntries(votes, rows, columns, params.cyclic_entries) : std::vector<char>();
  std::vector<Association> entries;
  std::vector<int> entry_of(votes.size(), -1);
  for (std::size_t k = 0; k < votes.size(); ++k)
  {
    if (params.cyclic_order ? chosen[k] != 0 : votes[k] > 0.0F)
    {
      entry_of[k] = static_cast<int>(entries.size());
      entries.push_back(
          { static_cast<int>(k / columns), static_cast<int>(k % columns), static_cast<double>(votes[k]) });
    }
  }
  if (params.cyclic_order)
  {
    const GroupedVotes grouped = groupVotes(reference, current, similar, entry_of, entries.size(), params);
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
