// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "tools/match_options.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_match.h"

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include <optional>
#include <string>
#include <vector>

namespace view_servo
{
/** @file What `match_images` says of two matched images. Numbers that are not finite become null in JSON. */

nlohmann::json toJson(const Eigen::Vector2d& point);

nlohmann::json toJson(const std::vector<MatchedPoint>& points);

nlohmann::json toJson(const std::vector<MatchedLine>& lines);

/** Row by row. */
nlohmann::json toJson(const Eigen::Matrix3d& matrix);

nlohmann::json toJson(const std::vector<Eigen::Matrix3d>& matrices);

class MatchReport
{
public:
  /**
   * Looks at what can be told from the options alone, before the images are read.
   * @param options must outlive the report. @throws std::runtime_error when the overlay's name has no ending of an
   * image, or the true homography cannot be read.
   */
  explicit MatchReport(const MatchOptions& options);

  /**
   * Writes the overlay and prints the result, in JSON with `more` at its end. @return whether a geometry was found.
   * @throws std::runtime_error when the overlay cannot be written.
   */
  bool write(const ViewMatch& match, const PreparedImage& reference, const PreparedImage& current,
             const nlohmann::json& more) const;

private:
  const MatchOptions& options_;
  std::optional<Eigen::Matrix3d> truth_;
};

}  // namespace view_servo
