// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/textures.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace view_servo::sim
{
namespace
{
/** What a picture is drawn with. */
struct Sketch
{
  cv::Mat picture;
  double grey;
  int count;
  cv::RNG rng;

  int width() const
  {
    return picture.cols;
  }
  int height() const
  {
    return picture.rows;
  }
  cv::Scalar around(double spread)
  {
    return cv::Scalar(std::clamp(grey + rng.uniform(-spread, spread), 0.0, 255.0));
  }
};

/** Adds smooth noise of a deviation, whose blobs have a size [px]. */
void addBlotches(Sketch& sketch, double size, double deviation)
{
  // Noise on a coarse grid costs nothing and is smooth when enlarged.
  const cv::Size grid(std::max(2, static_cast<int>(sketch.width() / size)),
                      std::max(2, static_cast<int>(sketch.height() / size)));
  cv::Mat noise(grid, CV_32F);
  sketch.rng.fill(noise, cv::RNG::NORMAL, 0.0, deviation);
  cv::resize(noise, noise, sketch.picture.size(), 0.0, 0.0, cv::INTER_CUBIC);
  cv::Mat values;
  sketch.picture.convertTo(values, CV_32F);
  values += noise;
  values.convertTo(sketch.picture, CV_8U);
}

void drawChecker(Sketch& sketch)
{
  for (int row = 0; row < sketch.count; ++row)
  {
    for (int column = 0; column < sketch.count; ++column)
    {
      const cv::Point from(sketch.width() * column / sketch.count, sketch.height() * row / sketch.count);
      const cv::Point to(sketch.width() * (column + 1) / sketch.count, sketch.height() * (row + 1) / sketch.count);
      sketch.picture(cv::Rect(from, to)).setTo((row + column) % 2 == 0 ? 230 : 25);
    }
  }
}

void drawBlotches(Sketch& sketch)
{
  for (const double size : { 64.0, 24.0, 8.0 })
  {
    addBlotches(sketch, size, 22.0);
  }
}

void drawWood(Sketch& sketch)
{
  // Grain along the width.
  cv::Mat grain(sketch.height(), 6, CV_32F);
  sketch.rng.fill(grain, cv::RNG::NORMAL, 0.0, 9.0);
  cv::GaussianBlur(grain, grain, cv::Size(1, 5), 0.01, 1.2);
  cv::resize(grain, grain, sketch.picture.size(), 0.0, 0.0, cv::INTER_CUBIC);
  cv::Mat values;
  sketch.picture.convertTo(values, CV_32F);
  values += grain;
  values.convertTo(sketch.picture, CV_8U);
  addBlotches(sketch, 90.0, 6.0);
}

void drawBricks(Sketch& sketch)
{
  const double height = static_cast<double>(sketch.height()) / sketch.count;
  const double width = 2.2 * height;
  sketch.picture.setTo(std::clamp(sketch.grey + 45.0, 0.0, 255.0));
  const int joint = std::max(1, static_cast<int>(height / 10.0));
  for (int row = 0; row < sketch.count; ++row)
  {
    for (double u = row % 2 == 0 ? 0.0 : -0.5 * width; u < sketch.width(); u += width)
    {
      cv::rectangle(sketch.picture, cv::Point(static_cast<int>(u) + joint, static_cast<int>(row * height) + joint),
                    cv::Point(static_cast<int>(u + width) - joint, static_cast<int>((row + 1) * height) - joint),
                    sketch.around(25.0), cv::FILLED);
    }
  }
  addBlotches(sketch, 6.0, 5.0);
}

void drawPanel(Sketch& sketch)
{
  drawWood(sketch);
  const int unit = std::max(2, std::min(sketch.width(), sketch.height()) / 24);
  const cv::Rect outer(0, 0, sketch.width(), sketch.height());
  cv::rectangle(sketch.picture, outer, cv::Scalar(sketch.grey - 60.0), unit / 2);
  const cv::Rect inner(3 * unit, 3 * unit, sketch.width() - 6 * unit, sketch.height() - 6 * unit);
  cv::rectangle(sketch.picture, inner, cv::Scalar(sketch.grey - 45.0), std::max(1, unit / 2));
  cv::rectangle(sketch.picture, inner + cv::Point(unit / 2, unit / 2), cv::Scalar(sketch.grey + 30.0),
                std::max(1, unit / 4));
  // A handle on one side.
  const cv::Point handle(sketch.width() - 2 * unit, sketch.height() / 2);
  cv::rectangle(sketch.picture, handle - cv::Point(unit / 2, 2 * unit), handle + cv::Point(unit / 2, 2 * unit),
                cv::Scalar(40.0), cv::FILLED);
}

void drawPatches(Sketch& sketch, int patches, double largest)
{
  for (int i = 0; i < patches; ++i)
  {
    const cv::Point2f centre(static_cast<float>(sketch.rng.uniform(0.0, 1.0) * sketch.width()),
                             static_cast<float>(sketch.rng.uniform(0.0, 1.0) * sketch.height()));
    // Small ones are the more frequent.
    const double limit = largest * std::pow(1.0 - static_cast<double>(i) / patches, 2.0) + 3.0;
    const cv::Size2f size(static_cast<float>(sketch.rng.uniform(0.3, 1.0) * limit),
                          static_cast<float>(sketch.rng.uniform(0.3, 1.0) * limit));
    const cv::RotatedRect box(centre, size, static_cast<float>(sketch.rng.uniform(0.0, 180.0)));
    std::array<cv::Point2f, 4> corners;
    box.points(corners.data());
    const std::vector<cv::Point> polygon(corners.begin(), corners.end());
    cv::fillConvexPoly(sketch.picture, polygon, cv::Scalar(sketch.rng.uniform(15.0, 240.0)), cv::LINE_AA);
  }
}

void drawPoster(Sketch& sketch)
{
  addBlotches(sketch, 80.0, 30.0);
  drawPatches(sketch, 40 * sketch.count, 0.25 * std::min(sketch.width(), sketch.height()));
}

void drawPrint(Sketch& sketch)
{
  addBlotches(sketch, 120.0, 12.0);
  const int unit = std::max(4, std::min(sketch.width(), sketch.height()) / 20);
  // A band, a bowl, and lines of letters of several sizes.
  cv::rectangle(sketch.picture, cv::Rect(0, sketch.height() / 4, sketch.width(), 5 * unit), cv::Scalar(60.0),
                cv::FILLED);
  const cv::Point middle(sketch.width() / 2, 2 * sketch.height() / 3);
  cv::ellipse(sketch.picture, middle, cv::Size(6 * unit, 3 * unit), 12.0, 0.0, 360.0, cv::Scalar(220.0), cv::FILLED,
              cv::LINE_AA);
  cv::ellipse(sketch.picture, middle, cv::Size(6 * unit, 3 * unit), 12.0, 0.0, 360.0, cv::Scalar(40.0), unit / 4,
              cv::LINE_AA);
  for (int i = 0; i < 14 * sketch.count; ++i)
  {
    const double angle = sketch.rng.uniform(0.0, 2.0 * CV_PI);
    const double radius = std::sqrt(sketch.rng.uniform(0.0, 1.0));
    const cv::Point grain(middle.x + static_cast<int>(5.6 * unit * radius * std::cos(angle)),
                          middle.y + static_cast<int>(2.6 * unit * radius * std::sin(angle)));
    cv::ellipse(sketch.picture, grain, cv::Size(std::max(2, unit / 3), std::max(1, unit / 8)),
                sketch.rng.uniform(0.0, 180.0), 0.0, 360.0, cv::Scalar(sketch.rng.uniform(90.0, 250.0)), cv::FILLED,
                cv::LINE_AA);
  }
  for (int line = 0; line < 9; ++line)
  {
    std::string text;
    const int letters = sketch.rng.uniform(6, 14);
    for (int i = 0; i < letters; ++i)
    {
      text.push_back(static_cast<char>('A' + sketch.rng.uniform(0, 26)));
    }
    const double size = line == 0 ? 0.12 * unit : 0.035 * unit * sketch.rng.uniform(0.7, 1.3);
    const cv::Point at =
        line == 0 ? cv::Point(unit, sketch.height() / 4 + 4 * unit)
                  : cv::Point(unit + sketch.rng.uniform(0, 4 * unit),
                              line % 2 == 0 ? sketch.height() - line * unit / 2 : 2 * unit + line * unit / 3);
    cv::putText(sketch.picture, text, at, cv::FONT_HERSHEY_DUPLEX, size, cv::Scalar(line == 0 ? 235.0 : 30.0),
                std::max(1, unit / (line == 0 ? 4 : 12)), cv::LINE_AA);
  }
  drawPatches(sketch, 3 * sketch.count, 1.2 * unit);
}

using Drawing = void (*)(Sketch&);

const std::vector<std::pair<std::string, Drawing>>& drawings()
{
  static const std::vector<std::pair<std::string, Drawing>> all = { { "blotches", drawBlotches },
                                                                    { "bricks", drawBricks },
                                                                    { "checker", drawChecker },
                                                                    { "panel", drawPanel },
                                                                    { "plain",
                                                                      [](Sketch&) {
                                                                      } },
                                                                    { "poster", drawPoster },
                                                                    { "print", drawPrint },
                                                                    { "wood", drawWood } };
  return all;
}

}  // namespace

std::string textureKinds()
{
  std::string names;
  for (const auto& [name, draw] : drawings())
  {
    names += (names.empty() ? "" : ", ") + name;
  }
  return names;
}

cv::Mat drawTexture(const std::string& kind, const cv::Size& size, double grey, int count, std::uint64_t seed)
{
  const auto found =
      std::find_if(drawings().begin(), drawings().end(), [&](const auto& drawing) { return drawing.first == kind; });
  if (found == drawings().end())
  {
    throw std::invalid_argument("unknown kind of picture '" + kind + "', known: " + textureKinds());
  }
  if (size.width < 1 || size.height < 1)
  {
    throw std::invalid_argument("a picture of no size");
  }
  Sketch sketch{ cv::Mat(size, CV_8UC1, cv::Scalar(grey)), grey, count, cv::RNG(seed) };
  found->second(sketch);
  return sketch.picture;
}

}  // namespace view_servo::sim
