// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "repetition.h"

#include "view_servo/geometry/correspondence.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/line_homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/matching/guided_matching.h"
#include "view_servo/views/self_repetition.h"

#include <Eigen/LU>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace view_servo
{
namespace
{
constexpr double RADIUS = 4.0;           // around where a homography sends a corner [px]
constexpr double MIN_CORRELATION = 0.7;  // of a corner's patch that is found
constexpr double LEAST_FOUND = 0.4;      // of the matches: too few tell nothing
constexpr double APART = 8.0;            // nearer places are one [px]
constexpr double EVERYWHERE = 1e5;       // [px]

Eigen::Matrix3d shift(const Eigen::Vector2d& by)
{
  Eigen::Matrix3d result = Eigen::Matrix3d::Identity();
  result.topRightCorner<2, 1>() = by;
  return result;
}

/** Patches of an image of half the size, around some of its places: 34 px wide and high in the full image. */
class Surroundings
{
public:
  Surroundings(const cv::Mat& image, const std::vector<Corner>& corners)
  {
    cv::resize(image, half_, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
    patches_.resize(SIZE, static_cast<Eigen::Index>(corners.size()));
    for (const Corner& corner : corners)
    {
      const auto column = static_cast<Eigen::Index>(places_.size());
      if (draw(corner.position, patches_.col(column)))
      {
        places_.push_back(corner.position);
      }
    }
  }

  /** Those of the places that look most like another one, and lie APART from it and each other; the nearest first. */
  std::vector<Eigen::Vector2d> like(const Eigen::Vector2d& site) const
  {
    constexpr float ALIKE = 0.8F;     // least correlation
    constexpr float AS_WELL = 0.05F;  // within this of the best
    constexpr std::size_t MOST = 4;   // the lines of one thing look alike, and are nearer than the next such thing
    Eigen::VectorXf here(SIZE);
    if (!draw(site, here))
    {
      return {};
    }
    Eigen::VectorXf correlations = patches_.leftCols(static_cast<Eigen::Index>(places_.size())).transpose() * here;
    float least = ALIKE;
    for (std::size_t i = 0; i < places_.size(); ++i)
    {
      float& correlation = correlations[static_cast<Eigen::Index>(i)];
      correlation = (places_[i] - site).norm() >= APART ? correlation : 0.0F;
      least = std::max(least, correlation - AS_WELL);
    }
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < places_.size(); ++i)
    {
      if (correlations[static_cast<Eigen::Index>(i)] >= least)
      {
        order.push_back(i);
      }
    }
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return correlations[static_cast<Eigen::Index>(a)] > correlations[static_cast<Eigen::Index>(b)];
    });
    std::vector<Eigen::Vector2d> alike;
    for (const std::size_t i : order)
    {
      if (alike.size() < MOST && std::all_of(alike.begin(), alike.end(), [&](const Eigen::Vector2d& other) {
            return (places_[i] - other).norm() >= APART;
          }))
      {
        alike.push_back(places_[i]);
      }
    }
    std::stable_sort(alike.begin(), alike.end(), [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
      return (a - site).squaredNorm() < (b - site).squaredNorm();
    });
    return alike;
  }

private:
  static constexpr int REACH = 8;  // [px of the half image]
  static constexpr int SIDE = 2 * REACH + 1;
  static constexpr int SIZE = SIDE * SIDE;

  /** Draws a patch with zero mean and unit norm; false when it leaves the image or is flat. */
  bool draw(const Eigen::Vector2d& place, Eigen::Ref<Eigen::VectorXf> patch) const
  {
    constexpr float LEAST = SIDE * 2.0F;  // two grey levels of deviation
    const int u = static_cast<int>(std::lround(0.5 * place.x() - 0.25));
    const int v = static_cast<int>(std::lround(0.5 * place.y() - 0.25));
    if (u < REACH || v < REACH || u + REACH >= half_.cols || v + REACH >= half_.rows)
    {
      return false;
    }
    for (int row = 0; row < SIDE; ++row)
    {
      const unsigned char* pixels = half_.ptr<unsigned char>(v - REACH + row) + (u - REACH);
      for (int column = 0; column < SIDE; ++column)
      {
        patch[row * SIDE + column] = pixels[column];
      }
    }
    patch.array() -= patch.mean();
    const float norm = patch.norm();
    patch /= std::max(norm, LEAST);
    return norm > LEAST;
  }

  cv::Mat half_;
  Eigen::MatrixXf patches_;  ///< a column each; those beyond the number of places are not used
  std::vector<Eigen::Vector2d> places_;
};

/** How another place grows from what is next to it. */
struct Search
{
  std::vector<double> reaches;  ///< from the place [px]: what is so near is found first, then more
  bool slanted;                 ///< neither image need show the plane from straight ahead: the period changes across it
};

/**
 * Some matches that are found along one homography, to be found again along another. Those that are not found there
 * would not be found elsewhere either, and tell nothing.
 */
class Matches
{
public:
  Matches(const cv::Mat& reference, const cv::Mat& current, const Correspondences& all, const Eigen::Matrix3d& h,
          double nearly, const Search& search)
    : reference_(reference), current_(current), nearly_(nearly), search_(search)
  {
    constexpr std::size_t MOST = 150;
    guidance_.min_correlation = MIN_CORRELATION;
    const std::size_t count = std::min(MOST, all.size());
    std::vector<Corner> some;
    some.reserve(count);
    for (std::size_t i = 0; i < count; ++i)
    {
      some.push_back({ all[i * all.size() / count].reference, 0.0F });
    }
    for (const Correspondence& match : find(some, h, RADIUS))
    {
      corners_.push_back({ match.reference, 0.0F });
      here_.push_back(match.current);
    }
  }

  /** The homography that sends what is seen at `from` to `to`, and the rest to where it is found from there. */
  std::optional<Eigen::Matrix3d> moved(const Eigen::Matrix3d& h, const Eigen::Vector2d& from,
                                       const Eigen::Vector2d& to) const
  {
    constexpr double WIDER = 6.0;  // than RADIUS: the period is not the same everywhere [px]
    constexpr std::size_t FEWEST = 6;
    constexpr std::size_t MOST = 20;
    std::vector<Corner> around = near(from, search_.reaches.front());
    around.resize(std::min(around.size(), MOST));
    const double here = static_cast<double>(find(around, h, RADIUS).size());
    // Either image may show the plane from straight ahead, where a period is the same everywhere.
    const Eigen::Matrix3d inverse = h.inverse();
    const Eigen::Matrix3d in_current = shift(to - from) * h;
    const Eigen::Matrix3d in_reference = h * shift(transfer(inverse, to) - transfer(inverse, from));
    Eigen::Matrix3d other;
    Correspondences found;
    for (const Eigen::Matrix3d* start : { &in_reference, &in_current })
    {
      other = *start;
      found = find(around, other, WIDER);
      if (found.size() >= FEWEST && static_cast<double>(found.size()) >= nearly_ * here)
      {
        break;
      }
    }
    if (found.size() < FEWEST || static_cast<double>(found.size()) < nearly_ * here)
    {
      return std::nullopt;
    }
    for (std::size_t i = 1; i < search_.reaches.size(); ++i)
    {
      other = improved(other, found);
      const std::vector<Corner> within = near(from, search_.reaches[i]);
      found = find(within, other, RADIUS);
      if (found.size() < FEWEST || static_cast<double>(found.size()) < LEAST_FOUND * static_cast<double>(within.size()))
      {
        return std::nullopt;
      }
    }
    return improved(other, found);
  }

  /** Whether nearly as large a part is found along another homography as along `h`, and elsewhere. */
  bool areAlong(const Eigen::Matrix3d& other, const Eigen::Matrix3d& h) const
  {
    const auto apart = std::count_if(corners_.begin(), corners_.end(), [&](const Corner& corner) {
      return (transfer(other, corner.position) - transfer(h, corner.position)).norm() >= APART;
    });
    const std::size_t found = find(corners_, other, RADIUS).size();
    return static_cast<double>(found) >= LEAST_FOUND * static_cast<double>(corners_.size()) &&
           2 * static_cast<std::size_t>(apart) >= corners_.size() &&
           partFound(other, found) >= nearly_ * partFound(h, find(corners_, h, RADIUS).size());
  }

private:
  /** The homography that fits best to where corners are found, or, to a few of them, that is moved best. */
  Eigen::Matrix3d improved(const Eigen::Matrix3d& h, const Correspondences& found) const
  {
    constexpr std::size_t ENOUGH = 16;
    if (found.size() >= ENOUGH)
    {
      return refineHomography(h, found, FIT_HUBER_WIDTH);
    }
    if (search_.slanted)
    {
      Points from;
      Points to;
      for (const Correspondence& pair : found)
      {
        from.push_back(transfer(h, pair.reference));
        to.push_back(pair.current);
      }
      const std::vector<double> weights(found.size(), 1.0);
      const auto affinity =
          plausibleAffinity(from.data(), to.data(), weights.data(), static_cast<int>(found.size()), AffinityLimits());
      return affinity ? Eigen::Matrix3d(*affinity * h) : h;
    }
    Eigen::Vector2d off = Eigen::Vector2d::Zero();
    for (const Correspondence& pair : found)
    {
      off += (pair.current - transfer(h, pair.reference)) / static_cast<double>(found.size());
    }
    return shift(off) * h;
  }

  /** Those that are seen within so many pixels of a place in the current image. */
  std::vector<Corner> near(const Eigen::Vector2d& place, double reach) const
  {
    std::vector<Corner> corners;
    for (std::size_t i = 0; i < corners_.size(); ++i)
    {
      if ((here_[i] - place).norm() < reach)
      {
        corners.push_back(corners_[i]);
      }
    }
    return corners;
  }

  Correspondences find(const std::vector<Corner>& corners, const Eigen::Matrix3d& h, double radius) const
  {
    Correspondences pairs;
    for (const GuidedMatch& match : searchAlongHomography(reference_, corners, current_, h, radius, guidance_))
    {
      pairs.push_back({ corners[static_cast<std::size_t>(match.reference)].position, match.current });
    }
    return pairs;
  }

  /** Of those that a homography sends to where their patch lies in the current image. */
  double partFound(const Eigen::Matrix3d& h, std::size_t found) const
  {
    const double margin = RADIUS + guidance_.patch_radius;
    const auto seen = std::count_if(corners_.begin(), corners_.end(), [&](const Corner& corner) {
      const Eigen::Vector2d at = transfer(h, corner.position);
      return at.x() >= margin && at.y() >= margin && at.x() < current_.cols - 1.0 - margin &&
             at.y() < current_.rows - 1.0 - margin;
    });
    return static_cast<double>(found) / std::max(1.0, static_cast<double>(seen));
  }

  const cv::Mat& reference_;
  const cv::Mat& current_;
  double nearly_;  ///< see otherPlace()
  const Search& search_;
  GuidedParams guidance_;
  std::vector<Corner> corners_;        ///< where they are in the reference image
  std::vector<Eigen::Vector2d> here_;  ///< where they are in the current image
};

/** Places in the current image, far from each other and within its borders. */
std::vector<Eigen::Vector2d> spread(const Correspondences& matches, const cv::Size& image, std::size_t count)
{
  constexpr double BORDER = 32.0;  // beside a border too little is seen to be compared [px]
  std::vector<Eigen::Vector2d> places;
  for (const Correspondence& match : matches)
  {
    const Eigen::Vector2d& at = match.current;
    if (at.x() >= BORDER && at.y() >= BORDER && at.x() <= image.width - BORDER && at.y() <= image.height - BORDER)
    {
      places.push_back(at);
    }
  }
  std::vector<double> distances(places.size(), std::numeric_limits<double>::infinity());
  std::vector<Eigen::Vector2d> chosen;
  std::size_t next = 0;
  while (chosen.size() < std::min(count, places.size()))
  {
    chosen.push_back(places[next]);
    for (std::size_t i = 0; i < places.size(); ++i)
    {
      distances[i] = std::min(distances[i], (places[i] - chosen.back()).squaredNorm());
    }
    next = static_cast<std::size_t>(std::max_element(distances.begin(), distances.end()) - distances.begin());
  }
  return chosen;
}

std::optional<Eigen::Matrix3d> searchOtherPlace(const cv::Mat& reference, const cv::Mat& current,
                                                const Correspondences& matches,
                                                const std::vector<Corner>& current_corners, const Eigen::Matrix3d& h,
                                                double nearly, const Search& search)
{
  constexpr std::size_t FEWEST = 20;  // matches that can tell anything
  constexpr std::size_t SITES = 8;    // places from which another is looked for
  if (matches.size() < FEWEST)
  {
    return std::nullopt;
  }
  const Surroundings surroundings(current, current_corners);
  const Matches tried(reference, current, matches, h, nearly, search);
  for (const Eigen::Vector2d& site : spread(matches, current.size(), SITES))
  {
    for (const Eigen::Vector2d& place : surroundings.like(site))
    {
      auto other = tried.moved(h, site, place);
      if (other && tried.areAlong(*other, h))
      {
        return other;
      }
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<Eigen::Matrix3d> otherPlace(const cv::Mat& reference, const cv::Mat& current,
                                          const Correspondences& matches, const std::vector<Corner>& current_corners,
                                          const Eigen::Matrix3d& h, double nearly)
{
  const Search search{ { 120.0, 240.0, EVERYWHERE, EVERYWHERE }, false };
  return searchOtherPlace(reference, current, matches, current_corners, h, nearly, search);
}

std::optional<Eigen::Vector2d> otherPlaceInPicture(const cv::Mat& grey, const cv::Rect& region)
{
  constexpr std::size_t MOST = 500;          // corners of the region
  constexpr std::size_t MOST_PLACES = 1500;  // in the picture
  const cv::Rect everywhere({ 0, 0 }, grey.size());
  const cv::Rect part = region.empty() ? everywhere : region & everywhere;
  std::vector<Corner> places = detectCorners(grey, CornerParams());
  Correspondences pairs;
  for (const Corner& corner : places)  // strongest first
  {
    if (pairs.size() < MOST && part.contains(cv::Point(cvRound(corner.position.x()), cvRound(corner.position.y()))))
    {
      pairs.push_back({ corner.position, corner.position });
    }
  }
  places.resize(std::min(places.size(), MOST_PLACES));
  constexpr double NEARLY = 0.85;  // as in otherPlace()
  const Search search{ { 60.0, 100.0, 160.0, 260.0, EVERYWHERE, EVERYWHERE }, true };
  const std::optional<Eigen::Matrix3d> other =
      searchOtherPlace(grey, grey, pairs, places, Eigen::Matrix3d::Identity(), NEARLY, search);
  if (!other)
  {
    return std::nullopt;
  }
  const Eigen::Vector2d middle = middleOf(part);
  return transfer(*other, middle) - middle;
}

}  // namespace view_servo
