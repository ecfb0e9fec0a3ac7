// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause

/** @file
 * Homography tracking beside other means, on sequences of a plane, one thread, in one run:
 *
 *     bench_tracking speeds|ecc|hardships [PICTURE]
 *     bench_tracking video [FILE [X Y WIDTH HEIGHT]]
 *
 * speeds: 200 frames of 640x480, full 6-dof motion at 2 to 40 px a frame (mean of the image's corners), noise of 2 grey
 * levels; then the same while the light changes by 40 %, in gain and across the image. Told are the frames before it is
 * lost (an error over 10 px), the error at the corners of the stored view, and the median processor time a
 * frame, which other programs disturb less than that of the clock:
 * - odometry: the tracker, predicted by the true motion with noise of 1 %;
 * - alone: the tracker from the last homography;
 * - KLT: the stored view warped by the last homography, Lucas-Kanade flow of 200 points against it, RANSAC, twice;
 * - ViSP SSD: ViSP's inverse compositional template tracker from the last homography.
 * ecc: the same sequences with cv::findTransformECC from the last homography, which takes minutes.
 * hardships, what a tracker has to bear: 40 % of the plane covered by something that moves, and jumps of 150 px that
 * odometry tells of.
 * video: drift over bruegel.mp4 in the folder visp_planar_videos of VIEW_SERVO_DATA, from frame 0 alone; errors are
 * those of the corners of the region of interest, against a registration of each frame with frame 0. Of a FILE of one's
 * own the region is said, or the middle of frame 0; it has to show a plane. Its frames, 300 at most, are registered with
 * frame 0 by key points and findTransformECC; those for which that does not succeed are tracked, and not judged.
 */
#include "view_servo/geometry/homography.h"
#include "view_servo/images/image_io.h"
#include "view_servo/robust/random.h"
#include "view_servo/tracking/homography_aligner.h"

#include "sim/textures.h"
#include "tools/video.h"

#include <visp3/core/vpException.h>
#include <visp3/tt/vpTemplateTrackerSSDInverseCompositional.h>
#include <visp3/tt/vpTemplateTrackerWarpHomography.h>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace
{
using namespace view_servo;  // NOLINT(google-build-using-namespace): a program of its own

constexpr int WIDTH = 640;
constexpr int HEIGHT = 480;
constexpr int FRAMES = 200;
constexpr double LOST = 10.0;  // [px]

using Tracker = std::function<std::optional<Eigen::Matrix3d>(const cv::Mat& image, const Eigen::Matrix3d& predicted)>;

/** A camera that swings about a plane 1 m away: x_cur ~ H x_ref at a place along its way. */
Eigen::Matrix3d homographyAt(double place)
{
  const auto swing = [place](double amplitude, double rate, double phase) {
    return amplitude * (std::sin(rate * place + phase) - std::sin(phase));
  };
  Eigen::Matrix3d k;
  k << 600.0, 0.0, 319.5, 0.0, 600.0, 239.5, 0.0, 0.0, 1.0;
  const double pitch = swing(0.3, 1.0, 0.3);
  const double yaw = swing(0.3, 0.8, 1.1);
  const Eigen::Matrix3d rotation =
      (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
       Eigen::AngleAxisd(swing(0.5, 0.6, 0.7), Eigen::Vector3d::UnitZ()))
          .toRotationMatrix();
  // It keeps looking at the middle, more or less.
  const Eigen::Vector3d translation(-yaw + swing(0.05, 1.3, 2.0), pitch + swing(0.05, 1.1, 0.4), swing(0.15, 0.5, 0.2));
  return k * (rotation + translation * Eigen::RowVector3d::UnitZ()) * k.inverse();
}

/** The stored view's corners [px]. */
const Points& viewCorners()
{
  static const Points all{ { 0.0, 0.0 }, { WIDTH - 1.0, 0.0 }, { WIDTH - 1.0, HEIGHT - 1.0 }, { 0.0, HEIGHT - 1.0 } };
  return all;
}

/** How far apart two homographies send some corners [px]. */
struct CornerDistance
{
  double mean = 0.0;
  double largest = 0.0;
};

CornerDistance cornerDistance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b, const Points& corners)
{
  CornerDistance result;
  for (const Eigen::Vector2d& corner : corners)
  {
    const double distance = (transfer(a, corner) - transfer(b, corner)).norm();
    result.mean += distance / static_cast<double>(corners.size());
    result.largest = std::max(result.largest, distance);
  }
  return result;
}

/** Places along the way at equal speed in the image. */
std::vector<Eigen::Matrix3d> sequence(double speed)
{
  constexpr int HALVINGS = 30;
  std::vector<Eigen::Matrix3d> all;
  double place = 0.0;
  while (static_cast<int>(all.size()) < FRAMES)
  {
    const Eigen::Matrix3d last = homographyAt(place);
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < HALVINGS; ++i)
    {
      const double middle = 0.5 * (low + high);
      (cornerDistance(homographyAt(place + middle), last, viewCorners()).mean < speed ? low : high) = middle;
    }
    place += low;
    all.push_back(homographyAt(place));
  }
  return all;
}

/** A picture that is larger than the stored view, which is its middle. */
class Scene
{
public:
  explicit Scene(const cv::Mat& picture)
  {
    cv::resize(picture, picture_, cv::Size(2 * WIDTH, 2 * HEIGHT), 0.0, 0.0, cv::INTER_AREA);
    to_reference_ << 1.0, 0.0, -0.5 * WIDTH, 0.0, 1.0, -0.5 * HEIGHT, 0.0, 0.0, 1.0;
  }

  cv::Mat image(const Eigen::Matrix3d& h, std::uint64_t seed, double gain = 1.0, double slope = 0.0) const
  {
    constexpr double NOISE = 2.0;  // [grey levels]
    cv::Mat matrix;
    cv::eigen2cv(Eigen::Matrix3d(h * to_reference_), matrix);
    cv::Mat seen;
    cv::warpPerspective(picture_, seen, matrix, cv::Size(WIDTH, HEIGHT), cv::INTER_LINEAR, cv::BORDER_REFLECT);
    cv::Mat values;
    seen.convertTo(values, CV_32F);
    for (int v = 0; v < HEIGHT; ++v)
    {
      for (int u = 0; u < WIDTH; ++u)
      {
        values.at<float>(v, u) *= static_cast<float>(gain * (1.0 + slope * (static_cast<double>(u) / WIDTH - 0.5)));
      }
    }
    cv::Mat noise(values.size(), CV_32F);
    cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0.0, NOISE);
    values += noise;
    values.convertTo(seen, CV_8U);
    return seen;
  }

private:
  cv::Mat picture_;
  Eigen::Matrix3d to_reference_;
};

/** @param region of the reference that shows the plane [px]; empty = everywhere, here and below. */
Tracker ours(const cv::Mat& reference, const cv::Rect& region = cv::Rect())
{
  auto tracker = std::make_shared<HomographyAligner>(reference, region, HomographyAlignerParams());
  return [tracker](const cv::Mat& image, const Eigen::Matrix3d& predicted) {
    const TrackedHomography found = tracker->track(image, predicted);
    return found.found ? std::optional<Eigen::Matrix3d>(found.h) : std::nullopt;
  };
}

/** The strongest of the simple ones. */
Tracker patchFlow(const cv::Mat& reference, const cv::Rect& region = cv::Rect())
{
  cv::Mat mask(reference.size(), CV_8U, cv::Scalar(region.empty() ? 255 : 0));
  mask(region) = 255;
  std::vector<cv::Point2f> points;
  cv::goodFeaturesToTrack(reference, points, 200, 0.01, 8, mask);
  return [reference, points](const cv::Mat& image, const Eigen::Matrix3d& predicted) -> std::optional<Eigen::Matrix3d> {
    constexpr double MARGIN = 10.0;  // [px]
    constexpr std::size_t FEWEST = 20;
    Eigen::Matrix3d h = predicted;
    for (int round = 0; round < 2; ++round)
    {
      cv::Mat matrix;
      cv::eigen2cv(h, matrix);
      cv::Mat warped;
      cv::warpPerspective(reference, warped, matrix, image.size());
      std::vector<cv::Point2f> stored;
      std::vector<cv::Point2f> from;
      for (const cv::Point2f& point : points)
      {
        const Eigen::Vector2d x = transfer(h, { point.x, point.y });
        if (x.x() > MARGIN && x.y() > MARGIN && x.x() < image.cols - MARGIN && x.y() < image.rows - MARGIN)
        {
          stored.push_back(point);
          from.emplace_back(static_cast<float>(x.x()), static_cast<float>(x.y()));
        }
      }
      if (from.size() < FEWEST)
      {
        return std::nullopt;
      }
      std::vector<cv::Point2f> to;
      std::vector<unsigned char> status;
      std::vector<float> errors;
      cv::calcOpticalFlowPyrLK(warped, image, from, to, status, errors, cv::Size(21, 21), 3);
      std::vector<cv::Point2f> a;
      std::vector<cv::Point2f> b;
      for (std::size_t i = 0; i < to.size(); ++i)
      {
        if (status[i] != 0)
        {
          a.push_back(stored[i]);
          b.push_back(to[i]);
        }
      }
      const cv::Mat found = a.size() < FEWEST ? cv::Mat() : cv::findHomography(a, b, cv::RANSAC, 2.0);
      if (found.empty())
      {
        return std::nullopt;
      }
      cv::cv2eigen(found, h);
    }
    return h;
  };
}

class VispTracker
{
public:
  VispTracker(const cv::Mat& reference, const cv::Rect& region) : tracker_(&warp_)
  {
    tracker_.setSampling(SAMPLING, SAMPLING);
    tracker_.setUseTemplateSelect(true);  // pixels of strong gradient only
    tracker_.setGaussianFilterSize(FILTER_SIZE);
    tracker_.setPyramidal(LEVELS, LAST_LEVEL);
    tracker_.setIterationMax(ITERATIONS);
    tracker_.setThresholdResidualDifference(LEAST_PROGRESS);
    tracker_.setLambda(0.001);
    const cv::Rect all = region.empty() ? cv::Rect(cv::Point(), reference.size()) : region;
    const vpImagePoint top_left(all.y, all.x);
    const vpImagePoint top_right(all.y, all.x + all.width - 1);
    const vpImagePoint bottom_left(all.y + all.height - 1, all.x);
    const vpImagePoint bottom_right(all.y + all.height - 1, all.x + all.width - 1);
    tracker_.initFromPoints(view(reference),
                            { top_left, bottom_left, bottom_right, bottom_right, top_right, top_left });
  }

  std::optional<Eigen::Matrix3d> track(const cv::Mat& image, const Eigen::Matrix3d& predicted)
  {
    vpHomography h;
    for (unsigned int i = 0; i < 9; ++i)
    {
      h[i / 3][i % 3] = predicted(i / 3, i % 3) / predicted(2, 2);
    }
    vpColVector parameters(tracker_.getNbParam());
    warp_.getParam(h, parameters);
    tracker_.setp(parameters);
    try
    {
      tracker_.track(view(image));
      h = warp_.getHomography(tracker_.getp());
      Eigen::Matrix3d found;
      for (unsigned int i = 0; i < 9; ++i)
      {
        found(i / 3, i % 3) = h[i / 3][i % 3];
      }
      return found;
    }
    catch (const vpException&)
    {
      return std::nullopt;
    }
  }

private:
  // More pixels or a wider filter take two to five times the time and make errors little smaller. Fewer pixels, no
  // filter, or an end on the next level or earlier save up to half of it and make them two to five times as large.
  static constexpr int SAMPLING = 4;              // [px] of a level
  static constexpr unsigned int FILTER_SIZE = 3;  // [px]
  static constexpr unsigned int LEVELS = 4;
  static constexpr unsigned int LAST_LEVEL = 0;
  static constexpr unsigned int ITERATIONS = 50;
  static constexpr double LEAST_PROGRESS = 1e-3;

  static vpImage<unsigned char> view(const cv::Mat& image)
  {
    vpImage<unsigned char> result(static_cast<unsigned int>(image.rows), static_cast<unsigned int>(image.cols));
    image.copyTo(cv::Mat(image.size(), CV_8U, result.bitmap));
    return result;
  }

  vpTemplateTrackerWarpHomography warp_;
  vpTemplateTrackerSSDInverseCompositional tracker_;
};

Tracker visp(const cv::Mat& reference, const cv::Rect& region = cv::Rect())
{
  auto tracker = std::make_shared<VispTracker>(reference, region);
  return [tracker](const cv::Mat& image, const Eigen::Matrix3d& predicted) {
    return tracker->track(image, predicted);
  };
}

Tracker ecc(const cv::Mat& reference)
{
  return [reference](const cv::Mat& image, const Eigen::Matrix3d& predicted) -> std::optional<Eigen::Matrix3d> {
    cv::Mat matrix;
    cv::eigen2cv(Eigen::Matrix3d(predicted / predicted(2, 2)), matrix);
    matrix.convertTo(matrix, CV_32F);
    try
    {
      cv::findTransformECC(reference, image, matrix, cv::MOTION_HOMOGRAPHY,
                           cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 1e-4));
    }
    catch (const cv::Exception&)
    {
      return std::nullopt;
    }
    Eigen::Matrix3d h;
    matrix.convertTo(matrix, CV_64F);
    cv::cv2eigen(matrix, h);
    return h;
  };
}

struct Score
{
  int frames = 0;             // before it is lost
  int judged = 0;             // of these
  double error = 0.0;         // mean of all corners and frames [px]
  double worst_frame = 0.0;   // mean of its corners [px]
  double worst_corner = 0.0;  // [px]
  double ms = 0.0;            // median
};

/** How an image comes to be, of a frame and what is really there. */
using Camera = std::function<cv::Mat(int frame, const Eigen::Matrix3d& h)>;

/**
 * @param truth of each frame; not finite where it is not known.
 * @param odometry noise of the predicted motion, as a part of it; negative: no prediction.
 * @param corners of the stored view, where errors are measured [px].
 */
Score run(const Tracker& tracker, const std::vector<Eigen::Matrix3d>& truth, const Camera& camera, double odometry,
          const Points& corners = viewCorners())
{
  Score score;
  std::vector<double> times;
  Rng rng(5);
  Eigen::Matrix3d last = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d last_truth = Eigen::Matrix3d::Identity();
  for (int frame = 0; frame < static_cast<int>(truth.size()); ++frame)
  {
    const Eigen::Matrix3d& h = truth[static_cast<std::size_t>(frame)];
    const cv::Mat image = camera(frame, h);
    Eigen::Matrix3d predicted = last;
    if (odometry >= 0.0)
    {
      Eigen::Matrix3d motion = h * last_truth.inverse();
      motion /= motion(2, 2);
      for (int i = 0; i < 9; ++i)
      {
        const double still = i % 4 == 0 ? 1.0 : 0.0;
        motion(i / 3, i % 3) = still + (motion(i / 3, i % 3) - still) * (1.0 + odometry * gaussian(rng));
      }
      predicted = motion * last;
    }
    const std::clock_t start = std::clock();
    const std::optional<Eigen::Matrix3d> found = tracker(image, predicted);
    times.push_back(1e3 * static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC);
    if (found && !h.allFinite())
    {
      ++score.frames;
      last = *found;
      continue;
    }
    const CornerDistance error = found ? cornerDistance(*found, h, corners) : CornerDistance{ LOST, LOST };
    if (!(error.mean < LOST))
    {
      break;
    }
    ++score.frames;
    ++score.judged;
    score.error += error.mean;
    score.worst_frame = std::max(score.worst_frame, error.mean);
    score.worst_corner = std::max(score.worst_corner, error.largest);
    last = *found;
    last_truth = h;
  }
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::nth_element(times.begin(), middle, times.end());
  score.ms = times.empty() ? 0.0 : *middle;
  score.error /= std::max(1, score.judged);
  return score;
}

void print(const std::string& name, const Score& score)
{
  std::printf("  %-8s  %3d frames  %7.3f px, worst frame %7.3f, worst corner %7.3f  %6.1f ms\n", name.c_str(),
              score.frames, score.error, score.worst_frame, score.worst_corner, score.ms);
  std::fflush(stdout);
}

/** @param only_ecc instead of all others. */
void runSpeeds(const Scene& scene, const cv::Mat& reference, bool light, bool only_ecc)
{
  for (const double speed : { 2.0, 5.0, 10.0, 20.0, 40.0 })
  {
    std::printf("%g px a frame%s\n", speed, light ? ", light changes" : "");
    const std::vector<Eigen::Matrix3d> truth = sequence(speed);
    const Camera camera = [&](int frame, const Eigen::Matrix3d& h) {
      const double gain = light ? 1.0 - 0.4 * std::abs(std::sin(0.05 * frame)) : 1.0;
      return scene.image(h, static_cast<std::uint64_t>(frame) + 1, gain, light ? 0.4 * std::sin(0.03 * frame) : 0.0);
    };
    if (only_ecc)
    {
      print("ECC", run(ecc(reference), truth, camera, -1.0));
      continue;
    }
    print("odometry", run(ours(reference), truth, camera, 0.01));
    print("alone", run(ours(reference), truth, camera, -1.0));
    print("KLT", run(patchFlow(reference), truth, camera, -1.0));
    print("ViSP SSD", run(visp(reference), truth, camera, -1.0));
  }
}

void runHardships(const Scene& scene, const cv::Mat& reference)
{
  const std::vector<Eigen::Matrix3d> truth = sequence(5.0);
  const Scene other(sim::drawTexture("poster", cv::Size(2 * WIDTH, 2 * HEIGHT), 128.0, 20, 99));
  std::printf("40 %% covered by something that moves, 5 px a frame\n");
  const Camera covered = [&](int frame, const Eigen::Matrix3d& h) {
    cv::Mat image = scene.image(h, static_cast<std::uint64_t>(frame) + 1);
    const int left = (7 * frame) % (WIDTH * 6 / 10);
    const cv::Rect part(left, 0, WIDTH * 4 / 10, HEIGHT);
    other.image(Eigen::Matrix3d::Identity(), 7)(part).copyTo(image(part));
    return image;
  };
  print("odometry", run(ours(reference), truth, covered, 0.01));
  print("alone", run(ours(reference), truth, covered, -1.0));
  print("KLT", run(patchFlow(reference), truth, covered, -1.0));

  std::printf("a jump of 150 px that odometry tells of, every 20 frames\n");
  std::vector<Eigen::Matrix3d> jumping = sequence(2.0);
  for (std::size_t i = 0; i < jumping.size(); ++i)
  {
    Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
    shift(0, 2) = (i / 20) % 2 == 1 ? 150.0 : 0.0;
    jumping[i] = shift * jumping[i];
  }
  const Camera plain = [&](int frame, const Eigen::Matrix3d& h) {
    return scene.image(h, static_cast<std::uint64_t>(frame) + 1);
  };
  print("odometry", run(ours(reference), jumping, plain, 0.01));
  print("KLT", run(patchFlow(reference), jumping, plain, 0.01));
}

/** What there is of the video: where frame 0's region of interest is, and where each frame shows it. */
struct VideoTruth
{
  Points corners;                  // of the region, in frame 0 [px]
  std::vector<Eigen::Matrix3d> h;  // x_frame ~ H x_0
};

VideoTruth readVideoTruth(const std::filesystem::path& file)
{
  VideoTruth truth;
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);)
  {
    // The number of the frame, H row by row, the four corners in this frame, and more.
    std::istringstream words(line);
    int frame = 0;
    Eigen::Matrix<double, 9, 1> h;
    Eigen::Matrix<double, 8, 1> corners;
    words >> frame;
    for (Eigen::Index i = 0; i < h.size(); ++i)
    {
      words >> h(i);
    }
    for (Eigen::Index i = 0; i < corners.size(); ++i)
    {
      words >> corners(i);
    }
    if (!words || frame != static_cast<int>(truth.h.size()))
    {
      continue;  // a comment
    }
    for (int i = 0; i < 8 && frame == 0; i += 2)
    {
      truth.corners.emplace_back(corners(i), corners(i + 1));
    }
    truth.h.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(h.data()));
  }
  if (truth.h.empty())
  {
    throw std::runtime_error("cannot read " + file.string());
  }
  return truth;
}

/** The frames of a video, `most` at most; 0: all. */
std::vector<cv::Mat> readFrames(const std::filesystem::path& file, std::size_t most)
{
  Video video(file.string());
  std::vector<cv::Mat> frames;
  for (cv::Mat frame = video.next(); !frame.empty() && frames.size() < most; frame = video.next())
  {
    frames.push_back(frame);
  }
  return frames;
}

/** Drift over a real video, whose frames are all tracked from frame 0. */
void printDrift(const std::string& name, const std::vector<cv::Mat>& frames, const cv::Rect& region,
                const VideoTruth& truth)
{
  const Camera camera = [&](int frame, const Eigen::Matrix3d& /*h*/) {
    return frames[static_cast<std::size_t>(frame)];
  };
  const auto drift = [&](const Tracker& tracker) {
    return run(tracker, truth.h, camera, -1.0, truth.corners);
  };
  const auto judged =
      std::count_if(truth.h.begin(), truth.h.end(), [](const Eigen::Matrix3d& h) { return h.allFinite(); });
  std::printf("%s, %zu frames, %td of them with a registration\n", name.c_str(), frames.size(), judged);
  print("alone", drift(ours(frames[0], region)));
  print("KLT", drift(patchFlow(frames[0], region)));
  print("ViSP SSD", drift(visp(frames[0], region)));
}

void runSharedVideo()
{
  const char* data = std::getenv("VIEW_SERVO_DATA");
  const std::filesystem::path folder = std::filesystem::path(data == nullptr ? "" : data) / "visp_planar_videos";
  if (data == nullptr || !std::filesystem::exists(folder))
  {
    std::printf("video: skipped, VIEW_SERVO_DATA does not name a folder with visp_planar_videos\n");
    return;
  }
  const VideoTruth truth = readVideoTruth(folder / "bruegel_pseudo_gt.txt");
  const std::vector<cv::Mat> frames = readFrames(folder / "bruegel.mp4", truth.h.size());
  if (frames.size() < truth.h.size())
  {
    throw std::runtime_error("cannot read all frames of " + (folder / "bruegel.mp4").string());
  }
  std::vector<cv::Point2f> corners;
  for (const Eigen::Vector2d& corner : truth.corners)
  {
    corners.emplace_back(static_cast<float>(corner.x()), static_cast<float>(corner.y()));
  }
  printDrift("bruegel.mp4", frames, cv::boundingRect(corners) & cv::Rect(cv::Point(), frames[0].size()), truth);
}

/** Finds a region of frame 0 in other frames, by none of the means that are compared here. */
class Registration
{
public:
  Registration(const cv::Mat& reference, const cv::Rect& region) : region_(region), view_(reference(region).clone())
  {
    detector_->detectAndCompute(view_, cv::noArray(), points_, descriptors_);
    offset_(0, 2) = region.x;
    offset_(1, 2) = region.y;
  }

  /** x_frame ~ H x_0; not finite when it is not found. */
  Eigen::Matrix3d find(const cv::Mat& frame)
  {
    constexpr double LEAST_CORRELATION = 0.9;
    Eigen::Matrix3d unknown = Eigen::Matrix3d::Constant(std::nan(""));
    cv::Mat h = byKeyPoints(frame);
    if (h.empty())
    {
      return unknown;
    }
    h.convertTo(h, CV_32F);
    try
    {
      const cv::TermCriteria end(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-5);
      if (!(cv::findTransformECC(view_, frame, h, cv::MOTION_HOMOGRAPHY, end) > LEAST_CORRELATION))
      {
        return unknown;
      }
    }
    catch (const cv::Exception&)
    {
      return unknown;  // it does not converge
    }
    h.convertTo(h, CV_64F);
    Eigen::Matrix3d found;
    cv::cv2eigen(h, found);
    return found * offset_.inverse();
  }

private:
  /** Of the region's picture; empty when too few agree. */
  cv::Mat byKeyPoints(const cv::Mat& frame) const
  {
    constexpr std::size_t FEWEST = 20;
    std::vector<cv::KeyPoint> points;
    cv::Mat descriptors;
    detector_->detectAndCompute(frame, cv::noArray(), points, descriptors);
    if (descriptors_.empty() || descriptors.empty())
    {
      return {};
    }
    std::vector<cv::DMatch> matches;
    cv::BFMatcher(cv::NORM_HAMMING, true).match(descriptors_, descriptors, matches);
    std::vector<cv::Point2f> from;
    std::vector<cv::Point2f> to;
    for (const cv::DMatch& match : matches)
    {
      from.push_back(points_[static_cast<std::size_t>(match.queryIdx)].pt);
      to.push_back(points[static_cast<std::size_t>(match.trainIdx)].pt);
    }
    if (from.size() < FEWEST)
    {
      return {};
    }
    std::vector<unsigned char> inliers;
    cv::Mat h = cv::findHomography(from, to, cv::RANSAC, 2.0, inliers);
    return cv::countNonZero(inliers) < static_cast<int>(FEWEST) ? cv::Mat() : h;
  }

  cv::Ptr<cv::ORB> detector_ = cv::ORB::create(2000);
  cv::Rect region_;
  cv::Mat view_;
  std::vector<cv::KeyPoint> points_;
  cv::Mat descriptors_;
  Eigen::Matrix3d offset_ = Eigen::Matrix3d::Identity();  // x_0 ~ offset x_view
};

/** @param region empty: the middle of frame 0. */
void runOwnVideo(const std::string& file, cv::Rect region)
{
  constexpr std::size_t MOST_FRAMES = 300;
  const std::vector<cv::Mat> frames = readFrames(file, MOST_FRAMES);
  if (frames.empty())
  {
    throw std::runtime_error("'" + file + "' has no frame that can be read");
  }
  const cv::Rect image(cv::Point(), frames[0].size());
  if (region.empty())
  {
    region = cv::Rect(image.width / 4, image.height / 4, image.width / 2, image.height / 2);
  }
  if ((region & image) != region)
  {
    throw std::runtime_error("the region is not within the frames, which are " + std::to_string(image.width) + " x " +
                             std::to_string(image.height));
  }
  VideoTruth truth;
  for (const cv::Point& corner : { region.tl(), cv::Point(region.br().x - 1, region.y), region.br() - cv::Point(1, 1),
                                   cv::Point(region.x, region.br().y - 1) })
  {
    truth.corners.emplace_back(corner.x, corner.y);
  }
  Registration registration(frames[0], region);
  for (const cv::Mat& frame : frames)
  {
    truth.h.push_back(registration.find(frame));
  }
  printDrift(file, frames, region, truth);
}

/** The words after `video`: nothing, a file, or a file and four whole numbers. */
int runVideo(const std::vector<std::string>& words)
{
  if (words.empty())
  {
    runSharedVideo();
    return 0;
  }
  cv::Rect region;
  if (words.size() == 5)
  {
    std::istringstream numbers(words[1] + " " + words[2] + " " + words[3] + " " + words[4]);
    numbers >> region.x >> region.y >> region.width >> region.height;
    if (!numbers || !(numbers >> std::ws).eof() || region.empty())
    {
      std::fprintf(stderr, "bench_tracking: the region must be four whole numbers, X Y WIDTH HEIGHT\n");
      return 2;
    }
  }
  else if (words.size() != 1)
  {
    std::fprintf(stderr, "usage: bench_tracking video [FILE [X Y WIDTH HEIGHT]]\n");
    return 2;
  }
  runOwnVideo(words[0], region);
  return 0;
}

}  // namespace

int main(int argc, char** argv)
{
  const std::string part = argc > 1 ? argv[1] : "";
  if (part != "speeds" && part != "ecc" && part != "hardships" && part != "video")
  {
    std::fprintf(stderr,
                 "usage: bench_tracking speeds|ecc|hardships [PICTURE]\n       bench_tracking video [FILE [X Y WIDTH "
                 "HEIGHT]]\n");
    return 2;
  }
  cv::setNumThreads(1);
  try
  {
    if (part == "video")
    {
      return runVideo({ argv + 2, argv + argc });
    }
    const cv::Mat picture =
        argc > 2 ? readGreyImage(argv[2]) : sim::drawTexture("poster", cv::Size(2 * WIDTH, 2 * HEIGHT), 128.0, 20, 5);
    const Scene scene(picture);
    const cv::Mat reference = scene.image(Eigen::Matrix3d::Identity(), 1000);
    if (part == "hardships")
    {
      runHardships(scene, reference);
      return 0;
    }
    for (const bool light : { false, true })
    {
      runSpeeds(scene, reference, light, part == "ecc");
    }
    return 0;
  }
  catch (const std::exception& error)
  {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
