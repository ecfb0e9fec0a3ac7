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
 * - time: processor time of everything from two images to matches, and of one live image against a stored one, for
 *   images of 640x480 with at most 300 segments, beside LSD with LBD and EDLines with LBD.
 */
#include "options.h"
#include "timing.h"

#include "experiments/line_ground_truth.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/views/line_view_matcher.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/line_descriptor.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace
{
using namespace view_servo;  // NOLINT(google-build-using-namespace): a program of its own

using IndexPairs = std::vector<std::pair<int, int>>;

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

/** Segments of an image with LBD's descriptors. */
struct LbdLines
{
  std::vector<int> indices;  ///< of the segment of each row
  cv::Mat descriptors;
};

/** Those of at least `min_length` [px]. */
LbdLines describeByLbd(const cv::Mat& image, const Segments& segments, double min_length)
{
  LbdLines described;
  std::vector<cv::line_descriptor::KeyLine> lines;
  for (std::size_t i = 0; i < segments.size(); ++i)
  {
    if (segments[i].length() >= min_length)
    {
      lines.push_back(toKeyLine(segments[i], static_cast<int>(lines.size()), image.size()));
      described.indices.push_back(static_cast<int>(i));
    }
  }
  if (!lines.empty())
  {
    cv::line_descriptor::BinaryDescriptor::createBinaryDescriptor()->compute(image, lines, described.descriptors);
  }
  return described;
}

/** Those that are each other's nearest. */
IndexPairs matchByLbd(const LbdLines& reference, const LbdLines& current)
{
  IndexPairs matches;
  if (reference.descriptors.empty() || current.descriptors.empty())
  {
    return matches;
  }
  std::vector<cv::DMatch> mutual;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(reference.descriptors, current.descriptors, mutual);
  for (const cv::DMatch& match : mutual)
  {
    matches.emplace_back(reference.indices[static_cast<std::size_t>(match.queryIdx)],
                         current.indices[static_cast<std::size_t>(match.trainIdx)]);
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
    const IndexPairs lbd = matchByLbd(describeByLbd(pair.reference, pair.reference_segments, LBD_MIN_LENGTH),
                                      describeByLbd(pair.current, pair.current_segments, LBD_MIN_LENGTH));
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
                result.matches.size(), residuals / std::max(1, result.inliers), medianOf(errors), errors.size());
    for (std::size_t k = 0; k < result.planes.size(); ++k)
    {
      std::printf(" %ld", std::count_if(result.lines.begin(), result.lines.end(),
                                        [k](const MatchedLine& line) { return line.plane == static_cast<int>(k); }));
    }
    std::printf(" lines\n");
  }
  return 0;
}

/** One way from two images to matches of lines. */
struct Timing
{
  std::string name;
  std::function<void(const LinePair&)> prepare;  ///< what is done once for a stored reference
  std::function<void(const LinePair&)> match;    ///< of a stored reference with a live image
  std::vector<double> fresh{};                   ///< processor time of both, for each run [ms]
  std::vector<double> stored{};                  ///< of `match` alone [ms]
};

/** Segments by `detect`, LBD's descriptors and cross-checked matches. */
Timing timingOfLbd(const std::string& name, const std::function<Segments(const cv::Mat&)>& detect)
{
  const auto descriptors = std::make_shared<LbdLines>();
  return { name,
           [=](const LinePair& pair) { *descriptors = describeByLbd(pair.reference, detect(pair.reference), 0.0); },
           [=](const LinePair& pair) {
             matchByLbd(*descriptors, describeByLbd(pair.current, detect(pair.current), 0.0));
           } };
}

/** The segments that come with LBD: EDLines of the image itself, without its pyramid. */
Segments detectByEdLines(const cv::Mat& image)
{
  std::vector<cv::line_descriptor::KeyLine> lines;
  const auto params = [] {
    cv::line_descriptor::BinaryDescriptor::Params one_octave;
    one_octave.numOfOctave_ = 1;
    return one_octave;
  }();
  cv::line_descriptor::BinaryDescriptor::createBinaryDescriptor(params)->detect(image, lines);
  Segments segments;
  for (const cv::line_descriptor::KeyLine& line : lines)
  {
    segments.push_back({ { line.startPointX, line.startPointY }, { line.endPointX, line.endPointY } });
  }
  return segments;
}

constexpr std::size_t MOST_SEGMENTS = 300;  // in an image whose time is taken

Segments longest(Segments segments)
{
  std::stable_sort(segments.begin(), segments.end(),
                   [](const Segment& a, const Segment& b) { return a.length() > b.length(); });
  segments.resize(std::min(segments.size(), MOST_SEGMENTS));
  return segments;
}

std::shared_ptr<LineFeatures> indexedFeatures(const cv::Mat& image, const LineMatcherParams& params)
{
  auto result = std::make_shared<LineFeatures>(image, detectLineSegments(image, params.segments), params.features);
  result->index(LineGrouping::TRIPLETS);
  return result;
}

/** Ours first. @param matcher has to outlive them. @param reference is set to ours; likewise. */
std::vector<Timing> waysToTime(const LineViewMatcher& matcher, std::shared_ptr<LineFeatures>& reference)
{
  LineSegmentParams lsd;
  lsd.detector = SegmentDetector::LSD;
  lsd.max_segments = MOST_SEGMENTS;
  return {
    { "view_servo",
      [&matcher, &reference](const LinePair& of) { reference = indexedFeatures(of.reference, matcher.params()); },
      [&matcher, &reference](const LinePair& of) {
        matcher.match(*reference, *indexedFeatures(of.current, matcher.params()), GeometryModel::HOMOGRAPHY,
                      LineGrouping::TRIPLETS);
      } },
    timingOfLbd("LSD+LBD", [lsd](const cv::Mat& image) { return longest(detectLineSegments(image, lsd)); }),
    timingOfLbd("EDLines+LBD", [](const cv::Mat& image) { return longest(detectByEdLines(image)); }),
  };
}

/** Takes the times of some runs with a pair, in place of those that were taken before. */
void takeTimes(const LinePair& pair, int runs, std::vector<Timing>& timings)
{
  for (Timing& timing : timings)
  {
    timing.fresh.clear();
    timing.stored.clear();
  }
  for (int run = 0; run < runs + 1; ++run)  // the first warms up
  {
    for (Timing& timing : timings)
    {
      const double start = processorTime();
      timing.prepare(pair);
      const double stored = processorTime();
      timing.match(pair);
      const double end = processorTime();
      if (run > 0)
      {
        timing.fresh.push_back(end - start);
        timing.stored.push_back(end - stored);
      }
    }
  }
}

/** One row of the table: of each way, its two numbers. */
void printRow(const std::string& name, const std::string& segments, const std::vector<double>& numbers, int decimals)
{
  std::printf("%-20s %8s", name.c_str(), segments.c_str());
  for (std::size_t i = 0; i < numbers.size(); ++i)
  {
    std::printf(" %*.*f", i % 2 == 0 ? 12 : 8, decimals, numbers[i]);
  }
  std::printf("\n");
}

Ratios runTime(const std::filesystem::path& data, LineMatcherParams params, int runs)
{
  Ratios all;
  const cv::Size size(640, 480);
  params.segments.max_segments = MOST_SEGMENTS;
  const LineViewMatcher matcher(params);
  std::shared_ptr<LineFeatures> reference;
  std::vector<Timing> timings = waysToTime(matcher, reference);
  for (const int threads : { 1, 2 })
  {
    cv::setNumThreads(threads);
    std::printf("640x480, threads: %d, processor time, medians of %d runs in ms\n%-20s %8s", threads, runs, "",
                "segments");
    for (const Timing& timing : timings)
    {
      std::printf(" %12s %8s", timing.name.c_str(), "stored");
    }
    std::printf("\n");
    std::vector<double> sums(2 * timings.size(), 0.0);
    for (LinePair pair : readBenchmarkPairs(data))
    {
      cv::resize(pair.reference, pair.reference, size, 0.0, 0.0, cv::INTER_AREA);
      cv::resize(pair.current, pair.current, size, 0.0, 0.0, cv::INTER_AREA);
      takeTimes(pair, runs, timings);
      std::vector<double> medians;
      for (const Timing& timing : timings)
      {
        medians.push_back(medianOf(timing.fresh));
        medians.push_back(medianOf(timing.stored));
      }
      printRow(pair.name, std::to_string(reference->segments().size()), medians, 1);
      std::transform(sums.begin(), sums.end(), medians.begin(), sums.begin(), std::plus<>());
    }
    printRow("together", "", sums, 1);
    std::vector<double> ratios;
    for (std::size_t i = 0; i < sums.size(); ++i)
    {
      ratios.push_back(sums[i] / sums[2 + i % 2]);
    }
    printRow("of LSD+LBD", "", ratios, 2);
    for (std::size_t peer = 2; peer < sums.size(); ++peer)
    {
      all.add((peer % 2 == 0 ? "fresh, " : "stored, ") + std::to_string(threads) +
                  (threads == 1 ? " thread, of " : " threads, of ") + timings[peer / 2].name,
              sums[peer % 2] / sums[peer]);
    }
  }
  return all;
}

}  // namespace

int main(int argc, char** argv)
{
  LineMatcherParams params;
  constexpr int RUNS = 7;
  try
  {
    const BenchOptions options = readOptions(argc, argv, RUNS, parameters(params));
    const auto data = dataFolder();
    if (!data)
    {
      return 2;
    }
    const std::string& mode = options.mode;
    requireNoRatios(options, mode != "time");
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
      return finish(runTime(*data, params, options.runs), options);
    }
    std::cerr << "usage: bench_lines benchmark|roll|merton [--set name=value ...]\n"
                 "       bench_lines time [--runs N] [--write FILE] [--check FILE] [--set name=value ...]"
              << std::endl;
  }
  catch (const std::exception& error)
  {
    std::cerr << error.what() << std::endl;
  }
  return 2;
}
