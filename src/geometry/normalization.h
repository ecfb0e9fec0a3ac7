// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "view_servo/geometry/correspondence.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>

namespace view_servo
{
using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Vector9d = Eigen::Matrix<double, 9, 1>;

/** A similarity without rotation: p -> scale (p - centre). */
struct Normalization
{
  Eigen::Vector2d centre;  ///< in the units of the points
  double scale;            ///< > 0

  Eigen::Vector2d operator()(const Eigen::Vector2d& point) const
  {
    return scale * (point - centre);
  }

  /** The similarity as a matrix of homogeneous points. */
  Eigen::Matrix3d matrix() const
  {
    Eigen::Matrix3d t;
    t << scale, 0.0, -scale * centre.x(), 0.0, scale, -scale * centre.y(), 0.0, 0.0, 1.0;
    return t;
  }

  Eigen::Matrix3d inverseMatrix() const
  {
    Eigen::Matrix3d t;
    t << 1.0 / scale, 0.0, centre.x(), 0.0, 1.0 / scale, centre.y(), 0.0, 0.0, 1.0;
    return t;
  }
};

/** The normalisations of the two images of a set of correspondences. */
struct PairNormalization
{
  Normalization reference;
  Normalization current;

  Correspondence operator()(const Correspondence& pair) const
  {
    return { reference(pair.reference), current(pair.current) };
  }
};

/**
 * Isotropic normalisation of one image's points (Hartley 1997): centroid 0, RMS distance sqrt(2). Empty when there are
 * no points, they all coincide, or one is not finite.
 */
inline std::optional<Normalization> isotropicNormalization(const Correspondences& pairs,
                                                           Eigen::Vector2d Correspondence::*side)
{
  constexpr double COINCIDENT = 1e-12;  // of the distance from the origin: below double precision's reach
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (const Correspondence& pair : pairs)
  {
    centre += pair.*side;
  }
  centre /= static_cast<double>(pairs.size());
  double sum = 0.0;
  for (const Correspondence& pair : pairs)
  {
    sum += (pair.*side - centre).squaredNorm();
  }
  const double rms = std::sqrt(sum / static_cast<double>(pairs.size()));
  if (!std::isfinite(rms) || !(rms > COINCIDENT * (1.0 + centre.norm())))
  {
    return std::nullopt;
  }
  return Normalization{ centre, std::sqrt(2.0) / rms };
}

/** Isotropic normalisation of each image by itself, for linear estimates. */
inline std::optional<PairNormalization> isotropicNormalization(const Correspondences& pairs)
{
  const auto reference = isotropicNormalization(pairs, &Correspondence::reference);
  const auto current = isotropicNormalization(pairs, &Correspondence::current);
  if (!reference || !current)
  {
    return std::nullopt;
  }
  return PairNormalization{ *reference, *current };
}

/**
 * Normalisation with one scale for both images, for refinement: it conditions the equations as well, and distances in
 * the two images keep their ratio, so that a geometric error is only multiplied by that scale.
 */
inline std::optional<PairNormalization> commonNormalization(const Correspondences& pairs)
{
  auto normalization = isotropicNormalization(pairs);
  if (normalization)
  {
    const double scale = std::sqrt(normalization->reference.scale * normalization->current.scale);
    normalization->reference.scale = scale;
    normalization->current.scale = scale;
  }
  return normalization;
}

/** What a refinement works on: pairs in normalised coordinates, and what maps them back. */
struct RefinablePairs
{
  Correspondences pairs;  ///< those of finite error, each image's points normalised, see commonNormalization()
  PairNormalization normalization;  ///< that they were normalised by
};

/**
 * The pairs that a refinement can use, normalised.
 * @param least number of pairs that the refinement needs. @param error double(const Correspondence&), not finite for a
 * pair that has no gradient to follow and is left out. @return empty when too few remain or they cannot be normalised.
 */
template <typename Error>
std::optional<RefinablePairs> refinablePairs(const Correspondences& pairs, std::size_t least, const Error& error)
{
  Correspondences usable;
  usable.reserve(pairs.size());
  std::copy_if(pairs.begin(), pairs.end(), std::back_inserter(usable),
               [&](const Correspondence& pair) { return std::isfinite(error(pair)); });
  const auto normalization = commonNormalization(usable);
  if (usable.size() < least || !normalization)
  {
    return std::nullopt;
  }
  std::transform(usable.begin(), usable.end(), usable.begin(), *normalization);
  return RefinablePairs{ std::move(usable), *normalization };
}

/**
 * Adds the lower block triangle of the Kronecker product a (x) b, a and b symmetric: for a row u (x) v of a linear
 * system, a = u u^T and b = v v^T give its share of A^T A.
 */
inline void addKronecker(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b, Matrix9d& sum)
{
  for (int j = 0; j < 3; ++j)
  {
    for (int i = j; i < 3; ++i)
    {
      sum.block<3, 3>(3 * i, 3 * j) += a(i, j) * b;
    }
  }
}

/** The whole matrix of its lower triangle. */
inline Matrix9d symmetric(const Matrix9d& lower)
{
  return lower.selfadjointView<Eigen::Lower>();
}

/** The nine entries of a 3x3 matrix, row by row. */
inline Vector9d rowMajor(const Eigen::Matrix3d& m)
{
  Vector9d v;
  v << m.row(0).transpose(), m.row(1).transpose(), m.row(2).transpose();
  return v;
}

/** 3x3 matrix of nine row-major entries. */
inline Eigen::Matrix3d matrixFromRows(const Vector9d& v)
{
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(v.data());
}

}  // namespace view_servo
