// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * Point matching against OpenCV's SIFT, AKAZE and ORB, in one run on the same images:
 *
 *     bench_points oxford|tilt|memory [--set name=value ...]
 *     bench_points time [--runs N] [--write FILE] [--check FILE] [--set name=value ...]
 *
 * - oxford: the sequences in the folder oxford_affine of VIEW_SERVO_DATA, image 1 against 2 .. 6. Solved means a mean
 *   error of the reference's four corners under 10 px; a match is correct within 4 px of the ground truth.
 * - tilt: planes textured with pictures of Debian's opencv-doc and visp-images-data, tilted 0 .. 80 degrees. Solved
 *   means a corner error under 5 px.
 * - time: medians of a match against a stored reference, of one of two fresh images, and of one where there is nothing
 *   to be found, in processor time, beside ORB, AKAZE and SIFT.
 */
#include "options.h"
#include "timing.h"

#include "experiments/peer_matches.h"
#include "view_servo/parameters/parameter.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/views/point_view_matcher.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace
{
using namespace view_servo;  // NOLINT(google-build-using-namespace): a program of its own

constexpr double CORRECT = 4.0;  // [px]

/** What a pipeline says of two images. */
struct Answer
{
  std::optional<Eigen::Matrix3d> h;
  Correspondences candidates;
  Correspondences inliers;
  double ms = 0.0;
};

/** Two images of a plane and the homography from the first to the second. */
struct Problem
{
  std::string name;
  cv::Mat reference;
  cv::Mat current;
  Eigen::Matrix3d truth;
};

double millisecondsSince(std::chrono::steady_clock::time_point start)
{
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

int correct(const Correspondences& pairs, const Eigen::Matrix3d& truth)
{
  return static_cast<int>(std::count_if(pairs.begin(), pairs.end(), [&](const Correspondence& pair) {
    return ((truth * pair.reference.homogeneous()).hnormalized() - pair.current).norm() < CORRECT;
  }));
}

/** Mean error of the reference's corners in the current image [px]; infinite without a homography. */
double cornerError(const Answer& answer, const Problem& problem)
{
  if (!answer.h)
  {
    return std::numeric_limits<double>::infinity();
  }
  const double right = problem.reference.cols - 1.0;
  const double bottom = problem.reference.rows - 1.0;
  double sum = 0.0;
  for (const Eigen::Vector2d& corner : Points{ { 0, 0 }, { right, 0 }, { right, bottom }, { 0, bottom } })
  {
    sum += ((*answer.h * corner.homogeneous()).hnormalized() - (problem.truth * corner.homogeneous()).hnormalized())
               .norm() /
           4.0;
  }
  return sum;
}

Answer fromMatch(const ViewMatch& match)
{
  Answer answer;
  for (const MatchedPoint& point : match.matches)
  {
    answer.candidates.push_back(point.position);
    if (point.inlier)
    {
      answer.inliers.push_back(point.position);
    }
  }
  if (match.outcome == MatchOutcome::MATCHED)
  {
    answer.h = match.matrix;
  }
  return answer;
}

Answer runOurs(const PointViewMatcherParams& params, const Problem& problem)
{
  const auto start = std::chrono::steady_clock::now();
  const PreparedImage reference(problem.reference, cv::Rect(), params.points);
  const PreparedImage current(problem.current, cv::Rect(), params.points);
  Answer answer = fromMatch(PointViewMatcher(params).match(reference, current, GeometryModel::HOMOGRAPHY));
  answer.ms = millisecondsSince(start);
  return answer;
}

/** Key points, ratio test at 0.8, RANSAC at 3 px. */
struct Peer
{
  std::string name;
  cv::Ptr<cv::Feature2D> detector;
  cv::Ptr<cv::DescriptorMatcher> matcher;

  PeerFeatures prepare(const cv::Mat& image) const
  {
    return featuresOfPeer(detector, image);
  }
  Answer match(const PeerFeatures& reference, const PeerFeatures& current) const
  {
    const auto [from, to] = matchesOfPeer(matcher, reference, current);
    Answer answer;
    cv::Mat h;
    std::vector<unsigned char> mask;
    if (from.size() >= 4)
    {
      h = cv::findHomography(from, to, cv::RANSAC, 3.0, mask, 2000, 0.995);
    }
    if (!h.empty())
    {
      Eigen::Matrix3d matrix;
      cv::cv2eigen(h, matrix);
      answer.h = matrix;
    }
    for (std::size_t i = 0; i < from.size(); ++i)
    {
      answer.candidates.push_back({ { from[i].x, from[i].y }, { to[i].x, to[i].y } });
      if (answer.h && mask[i] != 0)
      {
        answer.inliers.push_back(answer.candidates.back());
      }
    }
    return answer;
  }
};

Peer makeSift(int count)
{
  return { "SIFT " + std::to_string(count), cv::SIFT::create(count), cv::makePtr<cv::FlannBasedMatcher>() };
}
Peer makeAkaze()
{
  return { "AKAZE", cv::AKAZE::create(), cv::makePtr<cv::BFMatcher>(cv::NORM_HAMMING) };
}
Peer makeOrb(int count)
{
  return { "ORB " + std::to_string(count), cv::ORB::create(count), cv::makePtr<cv::BFMatcher>(cv::NORM_HAMMING) };
}

Answer runPeer(const Peer& peer, const Problem& problem)
{
  const auto start = std::chrono::steady_clock::now();
  Answer answer = peer.match(peer.prepare(problem.reference), peer.prepare(problem.current));
  answer.ms = millisecondsSince(start);
  return answer;
}

Answer runSift(const Problem& problem)
{
  return runPeer(makeSift(500), problem);
}

Answer runAkaze(const Problem& problem)
{
  return runPeer(makeAkaze(), problem);
}

std::optional<Problem> loadProblem(const std::filesystem::path& sequence, int number)
{
  Problem problem;
  problem.name = sequence.filename().string() + " 1-" + std::to_string(number);
  for (const char* extension : { ".ppm", ".pgm", ".png" })
  {
    const std::filesystem::path reference = sequence / ("img1" + std::string(extension));
    if (std::filesystem::exists(reference))
    {
      problem.reference = cv::imread(reference.string(), cv::IMREAD_GRAYSCALE);
      problem.current =
          cv::imread((sequence / ("img" + std::to_string(number) + extension)).string(), cv::IMREAD_GRAYSCALE);
    }
  }
  std::ifstream file(sequence / ("H1to" + std::to_string(number) + "p"));
  for (int i = 0; i < 9; ++i)
  {
    file >> problem.truth(i / 3, i % 3);
  }
  if (problem.reference.empty() || problem.current.empty() || !file)
  {
    return std::nullopt;
  }
  return problem;
}

int oxford(const PointViewMatcherParams& params)
{
  const char* data = std::getenv("VIEW_SERVO_DATA");
  if (data == nullptr)
  {
    std::cout << "oxford: skipped, VIEW_SERVO_DATA does not name a folder with oxford_affine\n";
    return 0;
  }
  std::vector<std::filesystem::path> sequences;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(data) / "oxford_affine"))
  {
    sequences.push_back(entry.path());
  }
  std::sort(sequences.begin(), sequences.end());
  std::printf("%-12s | %-31s | %-31s | %-31s\n", "", "view_servo", "SIFT 500", "AKAZE");
  std::printf(
      "%-12s | cand  inl correct  corner     ms | cand  inl correct  corner     ms | cand  inl correct  corner"
      "     ms\n",
      "pair");
  int solved[3] = {};
  int more_than_sift = 0;
  int total = 0;
  for (const std::filesystem::path& sequence : sequences)
  {
    for (int number = 2; number <= 6; ++number)
    {
      const std::optional<Problem> problem = loadProblem(sequence, number);
      if (!problem)
      {
        continue;
      }
      const Answer answers[3] = { runOurs(params, *problem), runSift(*problem), runAkaze(*problem) };
      std::printf("%-12s", problem->name.c_str());
      for (int i = 0; i < 3; ++i)
      {
        const double error = cornerError(answers[i], *problem);
        solved[i] += error < 10.0 ? 1 : 0;
        std::printf(" | %4d %4zu    %4d %7.2f %6.0f", correct(answers[i].candidates, problem->truth),
                    answers[i].inliers.size(), correct(answers[i].inliers, problem->truth), error, answers[i].ms);
      }
      std::printf("\n");
      ++total;
      more_than_sift +=
          correct(answers[0].inliers, problem->truth) > correct(answers[1].inliers, problem->truth) ? 1 : 0;
    }
  }
  std::printf("solved of %d: view_servo %d, SIFT 500 %d, AKAZE %d; more correct inliers than SIFT 500: %d\n", total,
              solved[0], solved[1], solved[2], more_than_sift);
  return total > 0 ? 0 : 2;
}

/** A texture of Debian's packages; empty when the package is not installed. */
cv::Mat loadTexture(const std::string& name)
{
  for (const char* folder :
       { "/usr/share/doc/opencv-doc/examples/data", "/usr/share/doc/opencv-doc/opencv4/samples/data",
         "/usr/share/visp-images-data/ViSP-images" })
  {
    if (!std::filesystem::exists(folder))
    {
      continue;
    }
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    {
      if (entry.path().filename() == name)
      {
        return cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
      }
    }
  }
  return {};
}

/**
 * The plane with the texture on it, facing the camera and filling the reference; then turned about `axis` (0: the
 * image's vertical, 1: its horizontal one) and rolled by 10 degrees. 768x576, f = 800 px.
 */
Problem tiltedPlane(const std::string& name, const cv::Mat& texture, double tilt, int axis, std::uint64_t seed)
{
  const cv::Size size(768, 576);
  Eigen::Matrix3d k;
  k << 800.0, 0.0, 0.5 * (size.width - 1), 0.0, 800.0, 0.5 * (size.height - 1), 0.0, 0.0, 1.0;
  const Eigen::Matrix3d rotation =
      (Eigen::AngleAxisd(10.0 * M_PI / 180.0, Eigen::Vector3d::UnitZ()) *
       Eigen::AngleAxisd(tilt * M_PI / 180.0, axis == 0 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  // The plane z = 1 of the reference camera turns about its centre: X_cur = R (X_ref - c) + c, n = c, d = 1.
  const Eigen::Vector3d centre = Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d translation = centre - rotation * centre;
  Problem problem;
  problem.name = name;
  problem.truth = k * (rotation + translation * centre.transpose()) * k.inverse();

  // Both views are drawn from the texture at four times the resolution, then averaged.
  const int over = 4;
  Eigen::Matrix3d fit = Eigen::Matrix3d::Identity();
  fit(0, 0) = static_cast<double>(size.width) / texture.cols;
  fit(1, 1) = static_cast<double>(size.height) / texture.rows;
  fit(0, 2) = 0.5 * (fit(0, 0) - 1.0);
  fit(1, 2) = 0.5 * (fit(1, 1) - 1.0);
  Eigen::Matrix3d enlarge = Eigen::Matrix3d::Identity();
  enlarge(0, 0) = over;
  enlarge(1, 1) = over;
  enlarge(0, 2) = 0.5 * (over - 1);
  enlarge(1, 2) = 0.5 * (over - 1);
  cv::RNG noise(seed);
  const auto draw = [&](const Eigen::Matrix3d& h, double gain, double offset, double sigma) {
    const Eigen::Matrix3d map = enlarge * h * fit;
    cv::Mat map_cv;
    cv::eigen2cv(map, map_cv);
    cv::Mat large;
    cv::warpPerspective(texture, large, map_cv, size * over, cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(128));
    cv::Mat view;
    cv::resize(large, view, size, 0.0, 0.0, cv::INTER_AREA);
    view.convertTo(view, CV_32F, gain, offset);
    cv::Mat grain(size, CV_32F);
    noise.fill(grain, cv::RNG::NORMAL, 0.0, sigma);
    view += grain;
    view.convertTo(view, CV_8U);
    return view;
  };
  problem.reference = draw(Eigen::Matrix3d::Identity(), 1.0, 0.0, 2.0);
  problem.current = draw(problem.truth, 0.8, 10.0, 2.0);
  return problem;
}

int tilt(const PointViewMatcherParams& params)
{
  PointViewMatcherParams cyclic = params;
  cyclic.guided = false;
  cyclic.first_share = 1.0;  // so that both look at the same profiles
  cyclic.points.cyclic_order = true;
  PointViewMatcherParams votes = cyclic;
  votes.points.cyclic_order = false;
  const std::vector<std::pair<std::string, std::function<Answer(const Problem&)>>> pipelines = {
    { "view_servo",
      [&](const Problem& p) {
        return runOurs(params, p);
      } },
    { "not guided",
      [&](const Problem& p) {
        return runOurs(cyclic, p);
      } },
    { "nor cyclic order",
      [&](const Problem& p) {
        return runOurs(votes, p);
      } },
    { "SIFT 500", runSift },
    { "AKAZE", runAkaze },
  };
  const std::vector<int> angles = { 0, 30, 45, 50, 55, 60, 65, 70, 75, 80, 82, 84 };
  std::vector<std::vector<int>> solved(pipelines.size(), std::vector<int>(angles.size(), 0));
  std::vector<std::vector<int>> sums(pipelines.size(), std::vector<int>(angles.size(), 0));
  int problems = 0;
  const auto header = [&](const std::string& title) {
    std::printf("%s\n%-20s", title.c_str(), "  tilt");
    for (const int angle : angles)
    {
      std::printf("%9d ", angle);
    }
    std::printf("\n");
  };
  std::printf("correct candidates/correct inliers, * = corner error under 5 px\n");
  for (const std::string name : { "graf1.png", "Klimt.ppm", "Solvay_conference_1927_Version2_1024x705.png",
                                  "starry_night.jpg", "baboon.jpg", "board.jpg", "building.jpg" })
  {
    const cv::Mat texture = loadTexture(name);
    if (texture.empty())
    {
      continue;
    }
    for (int axis = 0; axis < 2; ++axis, ++problems)
    {
      header(name + (axis == 0 ? ", vertical axis" : ", horizontal axis"));
      for (std::size_t i = 0; i < pipelines.size(); ++i)
      {
        std::printf("  %-18s", pipelines[i].first.c_str());
        for (std::size_t k = 0; k < angles.size(); ++k)
        {
          const Problem problem =
              tiltedPlane(name, texture, angles[k], axis, static_cast<std::uint64_t>(angles[k]) + 1);
          const Answer answer = pipelines[i].second(problem);
          const int candidates = correct(answer.candidates, problem.truth);
          const bool good = cornerError(answer, problem) < 5.0;
          solved[i][k] += good ? 1 : 0;
          sums[i][k] += candidates;
          std::printf("%4d/%4d%c", candidates, correct(answer.inliers, problem.truth), good ? '*' : ' ');
        }
        std::printf("\n");
      }
    }
  }
  if (problems == 0)
  {
    std::cout << "tilt: skipped, neither opencv-doc nor visp-images-data is installed\n";
    return 0;
  }
  header("all: solved of " + std::to_string(problems) + ", mean correct candidates");
  for (std::size_t i = 0; i < pipelines.size(); ++i)
  {
    std::printf("  %-18s", pipelines[i].first.c_str());
    for (std::size_t k = 0; k < angles.size(); ++k)
    {
      std::printf("%4d/%4d ", solved[i][k], sums[i][k] / problems);
    }
    std::printf("\n");
  }
  return 0;
}

/** What a matcher takes for one problem, again and again [ms]. */
struct Timing
{
  std::string name;
  std::function<void(const cv::Mat&)> store;    // prepares a reference
  std::function<Answer(const cv::Mat&)> match;  // the stored reference with an image
  std::vector<double> fresh;                    // processor time of both
  std::vector<double> stored;                   // of `match` alone
  std::vector<double> nothing;                  // of `match` with an image of something else
  Answer answer;

  /** @param wanted whether this run counts. */
  void run(const Problem& problem, const cv::Mat& unrelated, bool wanted)
  {
    const double start = processorTime();
    store(problem.reference);
    const double prepared = processorTime();
    answer = match(problem.current);
    const double matched = processorTime();
    match(unrelated);  // prepares what is only needed then
    const double looked = processorTime();
    match(unrelated);
    const double failed = processorTime();
    if (wanted)
    {
      fresh.push_back(matched - start);
      stored.push_back(matched - prepared);
      nothing.push_back(failed - looked);
    }
  }
};

Timing timingOf(const Peer& peer)
{
  const auto stored = std::make_shared<PeerFeatures>();
  Timing timing;
  timing.name = peer.name;
  timing.store = [=](const cv::Mat& image) {
    *stored = peer.prepare(image);
  };
  timing.match = [=](const cv::Mat& image) {
    return peer.match(*stored, peer.prepare(image));
  };
  return timing;
}

/** @param stages of the last match. */
Timing timingOfOurs(const PointViewMatcherParams& params, std::vector<StageTime>& stages)
{
  const auto stored = std::make_shared<std::unique_ptr<PreparedImage>>();
  const auto matcher = std::make_shared<PointViewMatcher>(params);
  Timing timing;
  timing.name = "view_servo";
  timing.store = [=](const cv::Mat& image) {
    *stored = std::make_unique<PreparedImage>(image, cv::Rect(), matcher->params().points);
    (*stored)->profileIndex(0);
  };
  timing.match = [=, &stages](const cv::Mat& image) {
    const PreparedImage current(image, cv::Rect(), matcher->params().points);
    const ViewMatch match = matcher->match(**stored, current, GeometryModel::HOMOGRAPHY);
    stages = match.outcome == MatchOutcome::MATCHED ? match.stages : stages;
    return fromMatch(match);
  };
  return timing;
}

Ratios timing(const PointViewMatcherParams& params, int runs)
{
  Ratios ratios;
  const cv::Mat texture = loadTexture("graf1.png");
  const cv::Mat other = loadTexture("building.jpg");
  if (texture.empty() || other.empty())
  {
    std::cout << "time: skipped, opencv-doc is not installed\n";
    return ratios;
  }
  const Problem problem = tiltedPlane("graf1.png", texture, 45.0, 0, 1);
  const Problem unrelated = tiltedPlane("building.jpg", other, 0.0, 0, 1);
  for (const int threads : { 1, 2 })
  {
    cv::setNumThreads(threads);
    std::vector<StageTime> stages;
    std::vector<std::vector<StageTime>> all_stages;
    std::vector<Timing> timings = { timingOfOurs(params, stages), timingOf(makeOrb(1000)), timingOf(makeOrb(2000)),
                                    timingOf(makeAkaze()),        timingOf(makeSift(500)), timingOf(makeSift(2000)) };
    for (int run = 0; run < runs + 1; ++run)  // the first warms up
    {
      for (Timing& timing : timings)
      {
        timing.run(problem, unrelated.reference, run > 0);
      }
      all_stages.push_back(stages);
    }
    std::printf(
        "%s tilted by 45 degrees, 768x576, threads: %d, processor time, medians of %d runs in ms\n"
        "%-12s%9s%9s%9s%18s\n",
        problem.name.c_str(), threads, runs, "", "stored", "fresh", "nothing", "correct inliers");
    for (const Timing& timing : timings)
    {
      std::printf("%-12s%9.1f%9.1f%9.1f%18d\n", timing.name.c_str(), medianOf(timing.stored), medianOf(timing.fresh),
                  medianOf(timing.nothing), correct(timing.answer.inliers, problem.truth));
    }
    const Timing& ours = timings.front();
    const std::string mode = ", " + std::to_string(threads) + (threads == 1 ? " thread, of " : " threads, of ");
    for (auto peer = timings.begin() + 1; peer != timings.end(); ++peer)
    {
      ratios.add("stored" + mode + peer->name, medianQuotient(ours.stored, peer->stored));
      ratios.add("fresh" + mode + peer->name, medianQuotient(ours.fresh, peer->fresh));
    }
    ratios.add("nothing" + mode + "stored", medianQuotient(ours.nothing, ours.stored));
    std::printf("stages of view_servo, by the clock:\n");
    for (std::size_t i = 0; i < stages.size(); ++i)
    {
      std::vector<double> ms(all_stages.size());
      std::transform(all_stages.begin(), all_stages.end(), ms.begin(),
                     [i](const std::vector<StageTime>& run) { return run[i].ms; });
      std::printf("  %-20s%7.1f\n", stages[i].name.c_str(), medianOf(ms));
    }
  }
  return ratios;
}

/** Peak memory of the process after one match [MB]; a mode of its own, as the peers need more. */
int memory(const PointViewMatcherParams& params)
{
  const cv::Mat texture = loadTexture("graf1.png");
  if (texture.empty())
  {
    std::cout << "memory: skipped, opencv-doc is not installed\n";
    return 0;
  }
  cv::Mat reference;
  cv::resize(texture, reference, cv::Size(768, 576), 0.0, 0.0, cv::INTER_AREA);
  Problem problem{ "graf1.png", reference, reference.clone(), Eigen::Matrix3d::Identity() };
  runOurs(params, problem);
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf("peak memory %.0f MB\n", static_cast<double>(usage.ru_maxrss) / 1024.0);
  return 0;
}

}  // namespace

int main(int argc, char** argv)
{
  PointViewMatcherParams params;
  constexpr int RUNS = 15;
  try
  {
    const BenchOptions options = readOptions(argc, argv, RUNS, parameters(params));
    cv::setNumThreads(2);
    const std::string& mode = options.mode;
    requireNoRatios(options, mode != "time");
    if (mode == "oxford")
    {
      return oxford(params);
    }
    if (mode == "tilt")
    {
      return tilt(params);
    }
    if (mode == "time")
    {
      return finish(timing(params, options.runs), options);
    }
    if (mode == "memory")
    {
      return memory(params);
    }
  }
  catch (const std::exception& error)
  {
    std::cerr << error.what() << "\n";
    return 2;
  }
  std::cerr << "usage: bench_points oxford|tilt|memory [--set name=value ...]\n"
               "       bench_points time [--runs N] [--write FILE] [--check FILE] [--set name=value ...]\n";
  return 2;
}
