// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/tracking/view_tracker.h"

#include "view_servo/parameters/faults.h"
#include "view_servo/robust/planar_motion_estimator.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"
#include "view_servo/robust/ransac.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace view_servo
{
namespace
{
constexpr double MAX_SCALE = 3.0;   // between the sizes of things in the two images
constexpr double SAME_POINT = 1.5;  // matches this close to a landmark are of it [px]

/** Local mean and contrast taken out, so that neither gain, offset nor gradients of light matter; 8-bit. */
cv::Mat normalizedAgainstLight(const cv::Mat& grey)
{
  constexpr int WINDOW = 31;         // [px]
  constexpr double SMOOTHING = 0.8;  // against noise [px]
  constexpr double LEAST_SD = 6.0;   // contrast below is not amplified further [grey levels]
  constexpr double GREYS_PER_SD = 40.0;
  cv::Mat values;
  cv::Mat mean;
  cv::Mat squares;
  cv::GaussianBlur(grey, values, cv::Size(5, 5), SMOOTHING);
  values.convertTo(values, CV_32F);
  cv::boxFilter(values, mean, CV_32F, cv::Size(WINDOW, WINDOW));
  cv::sqrBoxFilter(values, squares, CV_32F, cv::Size(WINDOW, WINDOW));
  cv::Mat variance = squares - mean.mul(mean) + LEAST_SD * LEAST_SD;
  cv::Mat sd;
  cv::sqrt(cv::max(variance, LEAST_SD * LEAST_SD), sd);
  cv::Mat normalized;
  cv::divide(values - mean, sd, normalized, GREYS_PER_SD);
  cv::Mat result;
  normalized.convertTo(result, CV_8U, 1.0, 128.0);
  return result;
}

/** An image reduced in size, on a canvas of the size it had. */
class Shrunk
{
public:
  /** @param scale at most 1; near 1 the image stays as it is. */
  Shrunk(const cv::Mat& image, double scale) : image_(image)
  {
    constexpr double NEARLY_FULL = 0.96;
    if (scale > NEARLY_FULL)
    {
      return;
    }
    cv::Mat small;
    const cv::Size size(static_cast<int>(std::lround(scale * image.cols)),
                        static_cast<int>(std::lround(scale * image.rows)));
    cv::resize(image, small, size, 0.0, 0.0, cv::INTER_AREA);  // by the ratios of whole pixels, not exactly `scale`
    scale_u_ = static_cast<double>(small.cols) / image.cols;
    scale_v_ = static_cast<double>(small.rows) / image.rows;
    image_ = cv::Mat();  // a buffer of its own
    cv::copyMakeBorder(small, image_, 0, image.rows - small.rows, 0, image.cols - small.cols, cv::BORDER_REPLICATE);
  }

  const cv::Mat& image() const
  {
    return image_;
  }
  // cv::resize() keeps the corners of the outermost pixels, not their centres.
  cv::Point2f toSmall(const Eigen::Vector2d& pixel) const
  {
    return { static_cast<float>((pixel.x() + 0.5) * scale_u_ - 0.5),
             static_cast<float>((pixel.y() + 0.5) * scale_v_ - 0.5) };
  }
  Eigen::Vector2d toFull(const cv::Point2f& point) const
  {
    return { (point.x + 0.5) / scale_u_ - 0.5, (point.y + 0.5) / scale_v_ - 0.5 };
  }

private:
  cv::Mat image_;
  double scale_u_ = 1.0;
  double scale_v_ = 1.0;
};

/** Of where a landmark is seen, by (x, y, yaw) of the pose. */
Eigen::Matrix<double, 2, 3> derivative(const Landmark& landmark, const PlanarPose& pose)
{
  constexpr double STEP = 1e-5;
  Eigen::Matrix<double, 2, 3> result;
  const auto difference = [&](const PlanarPose& step) -> Eigen::Vector2d {
    const PlanarPose ahead{ pose.x + step.x, pose.y + step.y, pose.yaw + step.yaw };
    const PlanarPose back{ pose.x - step.x, pose.y - step.y, pose.yaw - step.yaw };
    return (project(landmark, ahead) - project(landmark, back)) / (2.0 * STEP);
  };
  result << difference({ STEP, 0.0, 0.0 }), difference({ 0.0, STEP, 0.0 }), difference({ 0.0, 0.0, STEP });
  return result;
}

/** The depth of a landmark in the current camera divided by that in the stored view. */
double depthRatio(const Landmark& landmark, const PlanarPose& pose)
{
  return std::sin(pose.yaw) * landmark.reference.x() + std::cos(pose.yaw) + landmark.inverse_depth * pose.x;
}

}  // namespace

std::vector<Parameter> parameters(ViewTrackerParams& params)
{
  return {
    integer("max_landmarks", params.max_landmarks, "", ">= 8", "points of the view that are tracked"),
    integer("tracking_window", params.window, "px", "odd, >= 5", "side of the patches around the points"),
    integer("tracking_levels", params.levels, "", "[0, 6]", "levels of the pyramid besides the image"),
    real("tracking_max_residual", params.max_residual, "px", "> 0", "largest error of a point that supports the pose"),
    integer("tracking_min_supporting", params.min_supporting, "", ">= 4", "least number of points that support a pose"),
    real("tracking_min_support", params.min_support, "", "(0, 1]",
         "least part of the points looked for that has to support a pose"),
    real("tracking_max_scale_difference", params.max_scale_difference, "", "> 0",
         "largest difference between a point's change of size and the typical one"),
    real("assumed_depth", params.assumed_depth, "m", "> 0", "depth of the points when nothing is known"),
  };
}

std::vector<std::string> ViewTrackerParams::validate() const
{
  std::vector<std::string> faults = faultsOf(*this);
  if (max_landmarks < min_supporting)
  {
    faults.emplace_back("max_landmarks must not be below tracking_min_supporting");
  }
  return faults;
}

ViewTracker::ViewTracker(const cv::Mat& reference, const Camera& camera, const CameraMount& mount,
                         const ViewTrackerParams& params)
  : camera_(camera), mount_(mount), params_(params), reference_(normalizedAgainstLight(reference))
{
}

Eigen::Vector2d ViewTracker::pixelOf(const Eigen::Vector2d& level_point) const
{
  return camera_.project(mount_.unlevel(level_point).homogeneous());
}

Eigen::Vector2d ViewTracker::levelOf(const Eigen::Vector2d& pixel) const
{
  return mount_.level(camera_.normalized(pixel));
}

bool ViewTracker::insideReference(const Eigen::Vector2d& pixel) const
{
  const double margin = 0.5 * params_.window;
  return pixel.x() >= margin && pixel.y() >= margin && pixel.x() < reference_.cols - margin &&
         pixel.y() < reference_.rows - margin;
}

const ViewTracker::Point* ViewTracker::nearest(const Eigen::Vector2d& level_point) const
{
  const double limit = SAME_POINT / camera_.k(0, 0);
  const Point* best = nullptr;
  double least = limit * limit;
  for (const Point& point : landmarks_)
  {
    const double squared = (point.landmark.reference - level_point).squaredNorm();
    if (squared < least)
    {
      least = squared;
      best = &point;
    }
  }
  return best;
}

bool ViewTracker::start(const Correspondences& matches, const PlanarPose& pose)
{
  // Depths are known when moving by the pose's length displaces a fifth of the points by more than this: those in the
  // direction of a corridor hardly move however far one goes.
  constexpr double MIN_PARALLAX = 15.0;  // [px]
  constexpr double QUANTILE = 0.8;
  std::vector<double> parallaxes;
  for (const Correspondence& match : matches)
  {
    const InverseDepth depth = inverseDepth(match, pose);
    parallaxes.push_back(std::abs(depth.value) * std::sqrt(depth.information) * camera_.k(0, 0));
  }
  if (static_cast<int>(matches.size()) < params_.min_supporting)
  {
    return false;
  }
  ViewTracker fresh(*this);
  fresh.landmarks_.clear();
  fresh.depths_known_ = quantileOf(parallaxes, QUANTILE) >= MIN_PARALLAX;
  fresh.extend(matches, pose);
  if (static_cast<int>(fresh.landmarks_.size()) < params_.min_supporting)
  {
    return false;
  }
  landmarks_ = std::move(fresh.landmarks_);
  depths_known_ = fresh.depths_known_;
  return true;
}

bool ViewTracker::restore(const std::vector<Point>& points)
{
  std::vector<Point> inside;
  for (Point point : points)
  {
    point.pixel = pixelOf(point.landmark.reference);
    if (insideReference(point.pixel) && static_cast<int>(inside.size()) < params_.max_landmarks)
    {
      inside.push_back(point);
    }
  }
  if (static_cast<int>(inside.size()) < params_.min_supporting)
  {
    return false;
  }
  landmarks_ = std::move(inside);
  depths_known_ = true;
  return true;
}

void ViewTracker::extend(const Correspondences& matches, const PlanarPose& pose)
{
  constexpr double MIN_INFORMATION = 1e-4;  // squared motion in the image for a unit of inverse depth
  constexpr double BETTER = 1.2;            // an observation this much more informative replaces the depth
  for (const Correspondence& match : matches)
  {
    InverseDepth depth = inverseDepth(match, pose);
    if (!depths_known_)
    {
      depth = { 1.0 / params_.assumed_depth, 0.0 };
    }
    else if (!(depth.value > 0.0) || depth.information < MIN_INFORMATION)
    {
      continue;
    }
    const Eigen::Vector2d pixel = pixelOf(match.reference);
    if (!insideReference(pixel))
    {
      continue;
    }
    if (const Point* known = nearest(match.reference))
    {
      if (depth.information > BETTER * known->information)
      {
        Point& point = landmarks_[static_cast<std::size_t>(known - landmarks_.data())];
        point.landmark.inverse_depth = depth.value;
        point.information = depth.information;
      }
    }
    else if (static_cast<int>(landmarks_.size()) < params_.max_landmarks)
    {
      landmarks_.push_back({ { match.reference, depth.value }, depth.information, pixel });
    }
  }
}

ViewTracker::Result ViewTracker::fit(const std::vector<Sighting>& sightings, double max_residual) const
{
  constexpr double LEAST_SD = 0.1;      // of where a point is found [px]
  constexpr double INDEPENDENT = 25.0;  // points near each other err alike: no more than so many count
  const double focal = camera_.k(0, 0);
  Result result;
  result.looked_for = static_cast<int>(sightings.size());
  RansacParams ransac_params;
  ransac_params.inlier_threshold = max_residual / focal;
  ransac_params.sampling = Sampling::UNIFORM;
  // The refinement below takes the rest of the way.
  ransac_params.min_iterations = 20;
  ransac_params.local_optimizations = 1;
  Rng rng(1);
  const auto found = ransac(PlanarPoseEstimator(sightings, ransac_params.inlier_threshold), ransac_params, rng);
  if (!found.model)
  {
    return result;
  }
  result.pose = refinePlanarPose(*found.model, sightings, params_.max_residual / focal);
  double squares = 0.0;
  std::vector<double> displacements;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  // for residuals of a pixel
  for (const Sighting& sighting : sightings)
  {
    const double residual = focal * (project(sighting.landmark, result.pose) - sighting.current).norm();
    if (residual <= max_residual)
    {
      ++result.supporting;
      result.supporters.push_back(sighting.landmark.reference);
      squares += residual * residual;
      displacements.push_back(focal * (sighting.current - sighting.landmark.reference).norm());
      const Eigen::Matrix<double, 2, 3> jacobian = focal * derivative(sighting.landmark, result.pose);
      information += jacobian.transpose() * jacobian;
    }
  }
  if (result.supporting > 0)
  {
    result.rms = std::sqrt(squares / result.supporting);
    result.displacement = medianOf(displacements);
    const double sd = std::max(result.rms, LEAST_SD);
    result.covariance = sd * sd * std::max(1.0, result.supporting / INDEPENDENT) * information.inverse();
  }
  result.found = result.supporting >= params_.min_supporting;
  return result;
}

ViewTracker::Result ViewTracker::track(const cv::Mat& current, const PlanarPose& predicted) const
{
  if (current.size() != reference_.size())
  {
    throw std::invalid_argument("the image has another size than the stored view");
  }
  Result result;
  std::vector<const Point*> points;
  std::vector<Eigen::Vector2d> expected;
  std::vector<double> ratios;
  for (const Point& point : landmarks_)
  {
    const Eigen::Vector2d pixel = pixelOf(project(point.landmark, predicted));
    if (insideReference(pixel))
    {
      points.push_back(&point);
      expected.push_back(pixel);
      ratios.push_back(1.0 / depthRatio(point.landmark, predicted));
    }
  }
  if (static_cast<int>(points.size()) < params_.min_supporting)
  {
    return result;
  }
  // Both images with things as large as in the one where they are smaller.
  const double scale = std::clamp(medianOf(ratios), 1.0 / MAX_SCALE, MAX_SCALE);
  const Shrunk from_image(reference_, std::min(scale, 1.0));
  const Shrunk to_image(normalizedAgainstLight(current), std::min(1.0 / scale, 1.0));
  std::vector<cv::Point2f> from;
  std::vector<cv::Point2f> to;
  std::vector<const Point*> tracked;
  for (std::size_t i = 0; i < points.size(); ++i)
  {
    if (std::abs(ratios[i] / scale - 1.0) <= params_.max_scale_difference)
    {
      tracked.push_back(points[i]);
      from.push_back(from_image.toSmall(points[i]->pixel));
      to.push_back(to_image.toSmall(expected[i]));
    }
  }
  if (static_cast<int>(tracked.size()) < params_.min_supporting)
  {
    return result;
  }

  std::vector<unsigned char> status;
  std::vector<float> errors;
  const cv::TermCriteria criteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 20, 0.01);
  cv::calcOpticalFlowPyrLK(from_image.image(), to_image.image(), from, to, status, errors,
                           cv::Size(params_.window, params_.window), params_.levels, criteria,
                           cv::OPTFLOW_USE_INITIAL_FLOW);
  // A patch that looks otherwise is hidden: unrelated normalised patches differ by about 1.1 standard deviations.
  constexpr float MAX_DIFFERENCE = 26.0F;  // mean, of the normalised greys
  std::vector<Sighting> sightings;
  for (std::size_t i = 0; i < tracked.size(); ++i)
  {
    const Eigen::Vector2d pixel = to_image.toFull(to[i]);
    if (status[i] != 0 && errors[i] <= MAX_DIFFERENCE && insideReference(pixel))
    {
      sightings.push_back({ tracked[i]->landmark, levelOf(pixel) });
    }
  }
  result = fit(sightings, params_.max_residual);
  result.looked_for = static_cast<int>(tracked.size());
  result.found = result.found && result.supporting >= params_.min_support * result.looked_for;
  return result;
}

double ViewTracker::shareInSight(const PlanarPose& view_in_camera) const
{
  constexpr std::size_t ENOUGH = 48;  // for a share to some per cent
  constexpr int COLUMNS = 8;
  constexpr int ROWS = 6;
  const auto sees = [this](const Landmark& landmark, const PlanarPose& pose) {
    const double size = 1.0 / depthRatio(landmark, pose);
    return size > 1.0 / MAX_SCALE && size < MAX_SCALE && insideReference(pixelOf(project(landmark, pose)));
  };
  const PlanarPose turned{ 0.0, 0.0, view_in_camera.yaw };
  int by_turn = 0;
  int by_motion = 0;
  for (int i = 0; i < COLUMNS * ROWS; ++i)
  {
    const int column = i % COLUMNS;
    const int row = i / COLUMNS;
    const Eigen::Vector2d pixel((column + 0.5) / COLUMNS * reference_.cols, (row + 0.5) / ROWS * reference_.rows);
    const Landmark point{ levelOf(pixel), 1.0 / params_.assumed_depth };
    by_turn += sees(point, turned) ? 1 : 0;
    by_motion += sees(point, view_in_camera) ? 1 : 0;
  }
  constexpr double ALL = COLUMNS * ROWS;
  if (landmarks_.empty())
  {
    return by_motion / ALL;
  }
  const std::size_t stride = std::max<std::size_t>(1, landmarks_.size() / ENOUGH);
  double known = 0.0;
  double in_sight = 0.0;
  for (std::size_t i = 0; i < landmarks_.size(); i += stride)
  {
    known += 1.0;
    in_sight += sees(landmarks_[i].landmark, view_in_camera) ? 1.0 : 0.0;
  }
  return std::min(in_sight / known, by_turn / ALL);
}

ViewTracker::Result ViewTracker::locate(const Correspondences& matches) const
{
  constexpr double COARSE = 2.0;  // times max_residual: matches are less exact than tracked patches
  std::vector<Sighting> sightings;
  for (const Correspondence& match : matches)
  {
    if (const Point* point = nearest(match.reference))
    {
      sightings.push_back({ point->landmark, match.current });
    }
  }
  Result result = fit(sightings, COARSE * params_.max_residual);
  result.found = result.found && result.supporting >= params_.min_support * result.looked_for;
  return result;
}

}  // namespace view_servo
