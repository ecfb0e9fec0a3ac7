// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * Line matching against OpenCV's binary descriptor (LBD with cross-checked brute force), in one run on the same images:
 *
 *     bench_lines benchmark|roll|merton|time [--runs N] [--set name=value ...]
 *
 * - benchmark: the pairs in the folder line_matching_benchmark of VIEW_SERVO_DATA with their own LSD segments; a match
 *   is correct when the ground truth has it. LBD gets the segments of 20 px and more, as it does better with them.
 * - roll: the same, with the current image turned by 30, 90 and 180 degrees, segments with it.
 * - merton: three views of a building from the images alone; what F from line intersections makes of the corners that
 *   are labelled there, none of which took part.
 * - time: medians of everything from two images to matches, and of one live image against a stored one, for images of
 *   640x480 with about 300 segments, as ratios to LSD with LBD.
 */
#include "experiments/line_ground_truth.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/views/line_view_matcher.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/line_descriptor.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace
{
using namespace view_servo;  // NOLINT(google-build-using-namespace): a program of its own

using IndexPairs = std::vector<std::pair<int, int>>;

double millisecondsSince(std::chrono::steady_clock::time_point start)
{
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

double median(std::vector<double> values)
{
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

cv::line_descriptor::KeyLine toKeyLine(const Segment& segment, int id, const cv::Size& size)
{
  const Eigen::Vector2f start = segment.start.cast<float>();
  const Eigen::Vector2f end = segment.end.cast<float>();
  cv::line_descriptor::KeyLine line;
  line.startPointX = line.sPointInOctaveX = start.x();
  line.startPointY = line.sPointInOctaveY = start.y();
  line.endPointX = line.ePointInOctaveX = end.x();
  line.endPointY = line.ePointInOctaveY = end.y();
  line.lineLength = (end - start).norm();
  line.numOfPixels = static_cast<int>(std::lround(line.lineLength)) + 1;
  line.angle = std::atan2(end.y() - start.y(), end.x() - start.x());
  line.class_id = id;
  line.octave = 0;
  line.size = std::abs((end - start).prod());
  line.response = line.lineLength / static_cast<float>(std::max(size.width, size.height));
  line.pt = cv::Point2f(0.5F * (start.x() + end.x()), 0.5F * (start.y() + end.y()));
  return line;
}

/** LBD's matches of the segments of at least `min_length`. */
IndexPairs matchByLbd(const cv::Mat& reference, const Segments& reference_segments, const cv::Mat& current,
                      const Segments& current_segments, double min_length)
{
  const auto describe = [&](const cv::Mat& image, const Segments& segments, cv::Mat& descriptors) {
    std::vector<cv::line_descriptor::KeyLine> lines;
    std::vector<int> ids;
    for (std::size_t i = 0; i < segments.size(); ++i)
    {
      if (segments[i].length() >= min_length)
      {
        lines.push_back(toKeyLine(segments[i], static_cast<int>(lines.size()), image.size()));
        ids.push_back(static_cast<int>(i));
      }
    }
    if (!lines.empty())
    {
      cv::line_descriptor::BinaryDescriptor::createBinaryDescriptor()->compute(image, lines, descriptors);
    }
    return ids;
  };
  cv::Mat from;
  cv::Mat to;
  const std::vector<int> from_ids = describe(reference, reference_segments, from);
  const std::vector<int> to_ids = describe(current, current_segments, to);
  IndexPairs matches;
  if (from.empty() || to.empty())
  {
    return matches;
  }
  // Cross-checked by hand: each the other's nearest.
  const auto nearest = [](const cv::Mat& of, const cv::Mat& among) {
    std::vector<int> best(static_cast<std::size_t>(of.rows));
    for (int i = 0; i < of.rows; ++i)
    {
      double least = 1e9;
      for (int k = 0; k < among.rows; ++k)
      {
        const double distance = cv::norm(of.row(i), among.row(k), cv::NORM_HAMMING);
        if (distance < least)
        {
          least = distance;
          best[static_cast<std::size_t>(i)] = k;
        }
      }
    }
    return best;
  };
  const std::vector<int> forward = nearest(from, to);
  const std::vector<int> backward = nearest(to, from);
  for (std::size_t i = 0; i < forward.size(); ++i)
  {
    const std::size_t k = static_cast<std::size_t>(forward[i]);
    if (backward[k] == static_cast<int>(i))
    {
      matches.emplace_back(from_ids[i], to_ids[k]);
    }
  }
  return matches;
}

LineFeatures features(const cv::Mat& image, const Segments& segments, const LineMatcherParams& params)
{
  return { image, directedByContrast(image, segments), params.features };
}

IndexPairs matchByStructure(const LinePair& pair, const LineViewMatcher& matcher)
{
  const ViewMatch result = matcher.match(features(pair.reference, pair.reference_segments, matcher.params()),
                                         features(pair.current, pair.current_segments, matcher.params()),
                                         GeometryModel::HOMOGRAPHY, LineGrouping::TRIPLETS);
  IndexPairs matches;
  for (const MatchedLine& line : result.lines)
  {
    matches.emplace_back(line.reference_index, line.current_index);
  }
  return matches;
}

int correct(const IndexPairs& matches, const LinePair& pair)
{
  return static_cast<int>(std::count_if(matches.begin(), matches.end(), [&](const std::pair<int, int>& match) {
    return pair.areSame(match.first, match.second);
  }));
}

int runBenchmark(const std::filesystem::path& data, const LineViewMatcher& matcher)
{
  constexpr double LBD_MIN_LENGTH = 20.0;  // [px]
  std::printf("%-20s %10s %16s %16s\n", "pair", "segments", "LBD correct/all", "ours correct/all");
  int sum_lbd = 0;
  int sum_ours = 0;
  for (const LinePair& pair : readBenchmarkPairs(data))
  {
    const IndexPairs lbd =
        matchByLbd(pair.reference, pair.reference_segments, pair.current, pair.current_segments, LBD_MIN_LENGTH);
    const IndexPairs ours = matchByStructure(pair, matcher);
    const int lbd_correct = correct(lbd, pair);
    const int ours_correct = correct(ours, pair);
    sum_lbd += lbd_correct;
    sum_ours += ours_correct;
    std::printf("%-20s %5zu %4zu %11d/%-4zu %11d/%-4zu  precision %.2f\n", pair.name.c_str(),
                pair.reference_segments.size(), pair.current_segments.size(), lbd_correct, lbd.size(), ours_correct,
                ours.size(), ours.empty() ? 1.0 : static_cast<double>(ours_correct) / static_cast<double>(ours.size()));
  }
  std::printf("sum: LBD %d, ours %d, ratio %.2f\n", sum_lbd, sum_ours, sum_ours / std::max(1.0, 1.0 * sum_lbd));
  return 0;
}

/** The pair with its current image turned about its middle, on a canvas that holds it. */
LinePair turned(LinePair pair, double degrees)
{
  const cv::Size size = pair.current.size();
  cv::Mat map = cv::getRotationMatrix2D(cv::Point2f(0.5F * (size.width - 1), 0.5F * (size.height - 1)), degrees, 1.0);
  const double radians = degrees * M_PI / 180.0;
  const cv::Size canvas(
      static_cast<int>(std::ceil(std::abs(size.width * std::cos(radians)) + std::abs(size.height * std::sin(radians)))),
      static_cast<int>(
          std::ceil(std::abs(size.width * std::sin(radians)) + std::abs(size.height * std::cos(radians)))));
  map.at<double>(0, 2) += 0.5 * (canvas.width - size.width);
  map.at<double>(1, 2) += 0.5 * (canvas.height - size.height);
  cv::Mat image;
  cv::warpAffine(pair.current, image, map, canvas, cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  pair.current = image;
  const auto turn = [&](const Eigen::Vector2d& x) {
    const double* m = map.ptr<double>();
    return Eigen::Vector2d(m[0] * x.x() + m[1] * x.y() + m[2], m[3] * x.x() + m[4] * x.y() + m[5]);
  };
  for (Segment& segment : pair.current_segments)
  {
    segment = { turn(segment.start), turn(segment.end) };
  }
  return pair;
}

int runRoll(const std::filesystem::path& data, const LineViewMatcher& matcher)
{
  std::printf("%-20s %12s %12s %12s %12s\n", "pair", "0", "30", "90", "180 degrees");
  for (const LinePair& pair : readBenchmarkPairs(data))
  {
    std::printf("%-20s", pair.name.c_str());
    for (const double degrees : { 0.0, 30.0, 90.0, 180.0 })
    {
      const LinePair rolled = turned(pair, degrees);
      const IndexPairs matches = matchByStructure(rolled, matcher);
      std::printf(" %6d/%-5zu", correct(matches, rolled), matches.size());
    }
    std::printf("\n");
  }
  return 0;
}

/** A table of numbers, '*' read as -1. */
std::vector<std::vector<double>> readTable(const std::filesystem::path& file)
{
  std::ifstream stream(file);
  if (!stream)
  {
    throw std::runtime_error("cannot read " + file.string());
  }
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(stream, line);)
  {
    std::istringstream words(line);
    std::vector<double> row;
    for (std::string word; words >> word;)
    {
      row.push_back(word == "*" ? -1.0 : std::stod(word));
    }
    rows.push_back(row);
  }
  return rows;
}

int runMerton(const std::filesystem::path& data, const LineViewMatcher& matcher)
{
  const std::filesystem::path folder = data / "vgg_merton1" / "2D";
  const auto tracks = readTable(folder / "nview-corners");
  std::printf("%-12s %9s %6s %14s %14s %28s\n", "views", "segments", "lines", "points", "residual px",
              "epipolar error of corners px");
  for (const auto& [first, second] : { std::pair(1, 2), std::pair(1, 3), std::pair(2, 3) })
  {
    const LinePair pair = readMertonPair(data, first, second);
    const LineFeatures reference(pair.reference, detectLineSegments(pair.reference, matcher.params().segments),
                                 matcher.params().features);
    const LineFeatures current(pair.current, detectLineSegments(pair.current, matcher.params().segments),
                               matcher.params().features);
    const ViewMatch result = matcher.match(reference, current, GeometryModel::FUNDAMENTAL, LineGrouping::TRIPLETS);
    double residuals = 0.0;
    for (const MatchedPoint& point : result.matches)
    {
      residuals += point.inlier ? std::sqrt(sampsonError(result.fundamental, point.position)) : 0.0;
    }
    const auto a = readTable(folder / ("00" + std::to_string(first) + ".corners"));
    const auto b = readTable(folder / ("00" + std::to_string(second) + ".corners"));
    std::vector<double> errors;
    for (const std::vector<double>& track : tracks)
    {
      const double i = track[static_cast<std::size_t>(first - 1)];
      const double k = track[static_cast<std::size_t>(second - 1)];
      if (i >= 0.0 && k >= 0.0)
      {
        const std::vector<double>& x = a[static_cast<std::size_t>(i)];
        const std::vector<double>& y = b[static_cast<std::size_t>(k)];
        const Eigen::Vector3d line = result.fundamental * Eigen::Vector3d(x[0], x[1], 1.0);
        errors.push_back(std::abs(line.dot(Eigen::Vector3d(y[0], y[1], 1.0))) / line.head<2>().norm());
      }
    }
    std::printf("%-12s %4zu %4zu %6zu %7d of %3zu %13.2f   median %.2f of %zu, planes of", pair.name.c_str(),
                reference.segments().size(), current.segments().size(), result.lines.size(), result.inliers,
                result.matches.size(), residuals / std::max(1, result.inliers), median(errors), errors.size());
    for (std::size_t k = 0; k < result.planes.size(); ++k)
    {
      std::printf(" %ld", std::count_if(result.lines.begin(), result.lines.end(),
                                        [k](const MatchedLine& line) { return line.plane == static_cast<int>(k); }));
    }
    std::printf(" lines\n");
  }
  return 0;
}

int runTime(const std::filesystem::path& data, LineMatcherParams params, int runs)
{
  cv::setNumThreads(2);
  params.segments.max_segments = 300;
  const LineViewMatcher matcher(params);
  const auto longest = [](Segments segments) {
    std::stable_sort(segments.begin(), segments.end(),
                     [](const Segment& a, const Segment& b) { return a.length() > b.length(); });
    segments.resize(std::min<std::size_t>(segments.size(), 300));
    return segments;
  };
  std::printf("%-20s %9s %10s %10s %10s %7s %7s\n", "640x480, 2 threads", "segments", "LSD+LBD ms", "ours ms",
              "stored ms", "ratio", "stored");
  for (LinePair pair : readBenchmarkPairs(data))
  {
    const cv::Size size(640, 480);
    cv::resize(pair.reference, pair.reference, size, 0.0, 0.0, cv::INTER_AREA);
    cv::resize(pair.current, pair.current, size, 0.0, 0.0, cv::INTER_AREA);
    LineSegmentParams lsd;
    lsd.detector = SegmentDetector::LSD;
    lsd.max_segments = 300;
    std::vector<double> theirs;
    std::vector<double> ours;
    std::vector<double> stored;
    std::size_t count = 0;
    for (int run = 0; run < runs; ++run)
    {
      auto start = std::chrono::steady_clock::now();
      const Segments a = longest(detectLineSegments(pair.reference, lsd));
      const Segments b = longest(detectLineSegments(pair.current, lsd));
      matchByLbd(pair.reference, a, pair.current, b, 0.0);
      theirs.push_back(millisecondsSince(start));

      start = std::chrono::steady_clock::now();
      Segments segments[2];
      cv::parallel_for_(cv::Range(0, 2), [&](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i)
        {
          segments[i] = detectLineSegments(i == 0 ? pair.reference : pair.current, params.segments);
        }
      });
      const LineFeatures reference(pair.reference, segments[0], params.features);
      const LineFeatures current(pair.current, segments[1], params.features);
      matcher.match(reference, current, GeometryModel::HOMOGRAPHY, LineGrouping::TRIPLETS);
      ours.push_back(millisecondsSince(start));
      count = reference.segments().size();

      start = std::chrono::steady_clock::now();
      const LineFeatures live(pair.current, detectLineSegments(pair.current, params.segments), params.features);
      matcher.match(reference, live, GeometryModel::HOMOGRAPHY, LineGrouping::TRIPLETS);
      stored.push_back(millisecondsSince(start));
    }
    std::printf("%-20s %9zu %10.0f %10.0f %10.0f %7.2f %7.2f\n", pair.name.c_str(), count, median(theirs), median(ours),
                median(stored), median(ours) / median(theirs), median(stored) / median(theirs));
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv)
{
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  LineMatcherParams params;
  int runs = 7;
  try
  {
    for (std::size_t i = 1; i + 1 < arguments.size(); i += 2)
    {
      const std::string& value = arguments[i + 1];
      const std::size_t equals = value.find('=');
      if (arguments[i] == "--runs")
      {
        runs = std::stoi(value);
      }
      else if (arguments[i] == "--set" && equals != std::string::npos)
      {
        setParameter(parameters(params), value.substr(0, equals), value.substr(equals + 1));
      }
      else
      {
        throw std::invalid_argument("unknown option " + arguments[i]);
      }
    }
    const auto data = dataFolder();
    if (!data)
    {
      return 2;
    }
    const std::string mode = arguments.empty() ? "" : arguments.front();
    if (mode == "benchmark")
    {
      return runBenchmark(*data, LineViewMatcher(params));
    }
    if (mode == "roll")
    {
      return runRoll(*data, LineViewMatcher(params));
    }
    if (mode == "merton")
    {
      return runMerton(*data, LineViewMatcher(params));
    }
    if (mode == "time")
    {
      return runTime(*data, params, runs);
    }
    std::cerr << "usage: bench_lines benchmark|roll|merton|time [--runs N] [--set name=value ...]" << std::endl;
  }
  catch (const std::exception& error)
  {
    std::cerr << error.what() << std::endl;
  }
  return 2;
}
