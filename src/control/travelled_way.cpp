// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/control/travelled_way.h"

#include <stdexcept>

namespace view_servo
{
TravelledWay::TravelledWay(double spacing, std::size_t most) : first_spacing_(spacing), most_(most), spacing_(spacing)
{
  if (!(spacing > 0.0) || most < 2)
  {
    throw std::logic_error("a travelled way needs a spacing above 0 and at least 2 places");
  }
}

void TravelledWay::add(const Eigen::Vector3d& place)
{
  if (!place.allFinite())
  {
    return;
  }
  newest_ = place;
  if (!kept_.empty() && (place - kept_.back()).norm() < spacing_)
  {
    return;
  }
  if (kept_.size() == most_)
  {
    std::size_t size = 0;
    for (std::size_t i = 0; i < kept_.size(); i += 2)
    {
      kept_[size++] = kept_[i];
    }
    kept_.resize(size);
    spacing_ *= 2.0;
  }
  kept_.push_back(place);
}

void TravelledWay::clear()
{
  kept_.clear();
  spacing_ = first_spacing_;
}

std::vector<Eigen::Vector3d> TravelledWay::places() const
{
  std::vector<Eigen::Vector3d> places = kept_;
  if (!places.empty() && places.back() != newest_)
  {
    places.push_back(newest_);
  }
  return places;
}

}  // namespace view_servo
