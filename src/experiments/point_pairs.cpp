// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/point_pairs.h"

#include "experiments/input_file.h"
#include "view_servo/geometry/fundamental.h"
#include "view_servo/geometry/homography.h"
#include "view_servo/geometry/region.h"
#include "view_servo/images/image_io.h"

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

constexpr double CORRECT = 4.0;  // [px]

/** The file of that name with one of the endings images have. */
fs::path imageFile(const fs::path& stem)
{
  for (const char* ending : { ".ppm", ".pgm", ".png", ".jpg" })
  {
    fs::path file = stem;
    file += ending;
    if (fs::exists(file))
    {
      return file;
    }
  }
  throw std::runtime_error("there is no image " + stem.string() + ".*");
}

/** The ground truth of a scene with depth: the fundamental matrix of its points. */
void relateByPoints(PointPair& pair)
{
  const std::optional<Eigen::Matrix3d> linear = fundamentalFromPoints(pair.points);
  if (!linear)
  {
    throw std::runtime_error(pair.name + ": its points determine no fundamental matrix");
  }
  pair.model = GeometryModel::FUNDAMENTAL;
  pair.error = [f = refineFundamental(*linear, pair.points)](const Correspondence& match) {
    return std::sqrt(sampsonError(f, match));
  };
}

}  // namespace

bool PointPair::isCorrect(const Correspondence& match) const
{
  return error(match) < CORRECT;
}

int PointPair::countCorrect(const Correspondences& matches) const
{
  return static_cast<int>(
      std::count_if(matches.begin(), matches.end(), [&](const Correspondence& match) { return isCorrect(match); }));
}

double PointPair::geometryError(GeometryModel kind, const Eigen::Matrix3d& matrix) const
{
  double sum = 0.0;
  for (const Correspondence& point : points)
  {
    sum += kind == GeometryModel::HOMOGRAPHY ? (transfer(matrix, point.reference) - point.current).norm()
                                             : std::sqrt(sampsonError(matrix, point));
  }
  return sum / static_cast<double>(points.size());
}

const std::vector<std::string>& oxfordSequences()
{
  static const std::vector<std::string> names = { "graf", "boat", "bikes", "leuven" };
  return names;
}

const std::vector<std::string>& kusvodPairs()
{
  static const std::vector<std::string> names = { "booksh", "box",   "castle",   "corr",
                                                  "kampa",  "plant", "valbonne", "wash" };
  return names;
}

const std::vector<std::string>& adelaidePairs(GeometryModel model)
{
  static const std::vector<std::string> planes = { "barrsmith", "bonhall", "elderhalla", "johnssona",
                                                   "ladysymon", "library", "napiera",    "sene" };
  static const std::vector<std::string> motions = { "biscuitbookbox", "book", "cubetoy" };
  return model == GeometryModel::HOMOGRAPHY ? planes : motions;
}

PointPair readOxfordPair(const fs::path& data, const std::string& sequence, int number)
{
  const fs::path folder = data / "oxford_affine" / sequence;
  PointPair pair;
  pair.name = sequence + " 1-" + std::to_string(number);
  pair.reference = readGreyImage(imageFile(folder / "img1").string());
  pair.current = readGreyImage(imageFile(folder / ("img" + std::to_string(number))).string());
  pair.model = GeometryModel::HOMOGRAPHY;
  const fs::path truth_file = folder / ("H1to" + std::to_string(number) + "p");
  std::ifstream stream = openForReading(truth_file);
  Eigen::Matrix3d h;
  for (int i = 0; i < 9; ++i)
  {
    stream >> h(i / 3, i % 3);
  }
  if (!stream)
  {
    throw std::runtime_error("not a homography: " + truth_file.string());
  }
  h /= h(2, 2);  // some are negative
  pair.error = [h](const Correspondence& match) {
    return (transfer(h, match.reference) - match.current).norm();
  };
  for (const Eigen::Vector2d& corner : cornersOf(pair.reference.size()))
  {
    pair.points.push_back({ corner, transfer(h, corner) });
  }
  return pair;
}

PointPair readKusvodPair(const fs::path& data, const std::string& name)
{
  const fs::path folder = data / "kusvod2";
  PointPair pair;
  pair.name = name;
  pair.reference = readGreyImage(imageFile(folder / (name + "A")).string());
  pair.current = readGreyImage(imageFile(folder / (name + "B")).string());
  std::ifstream stream = openForReading(folder / (name + "_vpts.txt"));
  Correspondence point;
  while (stream >> point.reference.x() >> point.reference.y() >> point.current.x() >> point.current.y())
  {
    pair.points.push_back(point);
  }
  relateByPoints(pair);
  return pair;
}

PointPair readMertonPoints(const fs::path& data, int reference_view, int current_view)
{
  const fs::path folder = data / "vgg_merton1";
  const auto name = [](int view) {
    return "00" + std::to_string(view);
  };
  const auto corners_of = [&](int view) {
    std::ifstream stream = openForReading(folder / "2D" / (name(view) + ".corners"));
    Points corners;
    for (Eigen::Vector2d corner; stream >> corner.x() >> corner.y();)
    {
      corners.push_back(corner);
    }
    return corners;
  };
  PointPair pair;
  pair.name = "merton " + std::to_string(reference_view) + "-" + std::to_string(current_view);
  pair.reference = readGreyImage(imageFile(folder / "images" / name(reference_view)).string());
  pair.current = readGreyImage(imageFile(folder / "images" / name(current_view)).string());
  const Points reference = corners_of(reference_view);
  const Points current = corners_of(current_view);
  std::ifstream tracks = openForReading(folder / "2D" / "nview-corners");
  for (std::string of[3]; tracks >> of[0] >> of[1] >> of[2];)
  {
    const std::string& from = of[reference_view - 1];
    const std::string& to = of[current_view - 1];
    if (from != "*" && to != "*")
    {
      pair.points.push_back({ reference.at(std::stoul(from)), current.at(std::stoul(to)) });
    }
  }
  relateByPoints(pair);
  return pair;
}

std::vector<PointPair> readAdelaidePairs(const fs::path& data, GeometryModel model, const std::string& name)
{
  constexpr std::size_t ENOUGH = 12;   // points of a structure
  constexpr double HUBER_WIDTH = 1.0;  // [px]
  const bool planes = model == GeometryModel::HOMOGRAPHY;
  const fs::path folder = data / "adelaidermf" / (planes ? "homography" : "fundamental");
  const fs::path points_file = folder / (name + "_pts.txt");
  std::ifstream stream = openForReading(points_file);
  std::map<int, Correspondences> structures;
  Correspondence point;
  double one = 0.0;
  int label = 0;
  while (stream >> point.reference.x() >> point.reference.y() >> one >> point.current.x() >> point.current.y() >> one >>
         label)
  {
    structures[label].push_back(point);
  }
  structures.erase(0);  // outliers
  PointPair pair;
  pair.name = name;
  pair.reference = readGreyImage(imageFile(folder / (name + "A")).string());
  pair.current = readGreyImage(imageFile(folder / (name + "B")).string());
  pair.model = model;
  std::vector<PointPair> pairs;
  for (const auto& [number, points] : structures)
  {
    const std::optional<Eigen::Matrix3d> linear = planes ? homographyFromPoints(points) : fundamentalFromPoints(points);
    if (points.size() < ENOUGH || !linear)
    {
      continue;
    }
    pair.points = points;
    if (planes)
    {
      pair.error = [h = refineHomography(*linear, points, HUBER_WIDTH)](const Correspondence& match) {
        return (transfer(h, match.reference) - match.current).norm();
      };
    }
    else
    {
      pair.error = [f = refineFundamental(*linear, points, HUBER_WIDTH)](const Correspondence& match) {
        return std::sqrt(sampsonError(f, match));
      };
    }
    pairs.push_back(pair);
  }
  if (pairs.empty())
  {
    throw std::runtime_error("no structure with enough points in " + points_file.string());
  }
  return pairs;
}

namespace
{
/** The surface and its picture, in metres; it faces the camera at angle 0, z away from it. */
class Scene
{
public:
  Scene(Surface surface, const cv::Size& picture) : surface_(surface), picture_(picture)
  {
    k_ << FOCAL_LENGTH, 0.0, 0.5 * (WIDTH - 1), 0.0, FOCAL_LENGTH, 0.5 * (HEIGHT - 1), 0.0, 0.0, 1.0;
  }

  static constexpr int WIDTH = 768;  // [px]
  static constexpr int HEIGHT = 576;

  /** Camera from object. */
  Eigen::Isometry3d pose(double angle, double roll) const
  {
    return Eigen::Translation3d(0.0, 0.0, surface_ == Surface::PLANE ? PLANE_DISTANCE : CYLINDER_DISTANCE) *
           Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY());
  }

  /** The first point of the surface on a pixel's ray; empty where there is none. */
  std::optional<Eigen::Vector3d> hit(const Eigen::Isometry3d& pose, const Eigen::Vector2d& pixel) const
  {
    const Eigen::Vector3d in_camera((pixel.x() - k_(0, 2)) / FOCAL_LENGTH, (pixel.y() - k_(1, 2)) / FOCAL_LENGTH, 1.0);
    const Eigen::Vector3d direction = pose.linear().transpose() * in_camera;
    const Eigen::Vector3d origin = -(pose.linear().transpose() * pose.translation());
    double along = -origin.z() / direction.z();
    if (surface_ == Surface::CYLINDER)
    {
      const double a = direction.x() * direction.x() + direction.z() * direction.z();
      const double b = origin.x() * direction.x() + origin.z() * direction.z();
      const double c = origin.x() * origin.x() + origin.z() * origin.z() - RADIUS * RADIUS;
      along = (-b - std::sqrt(b * b - a * c)) / a;  // NaN where the ray misses it
    }
    const Eigen::Vector3d point = origin + along * direction;
    const bool inside = along > 0.0 && std::abs(point.y()) <= 0.5 * height() &&
                        (surface_ == Surface::CYLINDER || std::abs(point.x()) <= 0.5 * width());
    return inside ? std::optional<Eigen::Vector3d>(point) : std::nullopt;
  }

  /** Where the picture shows what a point of the surface shows [px]. */
  cv::Point2f onPicture(const Eigen::Vector3d& point) const
  {
    const double across = surface_ == Surface::PLANE ? point.x() : RADIUS * std::atan2(point.x(), -point.z());
    return { static_cast<float>((across / width() + 0.5) * picture_.width - 0.5),
             static_cast<float>((point.y() / height() + 0.5) * picture_.height - 0.5) };
  }

  /** NaN where the surface hides the point. */
  Eigen::Vector2d project(const Eigen::Isometry3d& pose, const Eigen::Vector3d& point) const
  {
    if (surface_ == Surface::CYLINDER)
    {
      const Eigen::Vector3d normal(point.x(), 0.0, point.z());
      const Eigen::Vector3d to_camera = -(pose.linear().transpose() * pose.translation()) - point;
      constexpr double STEEPEST = 0.1;  // cosine: nothing is matched at the very rim
      if (normal.normalized().dot(to_camera.normalized()) < STEEPEST)
      {
        return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
      }
    }
    return (k_ * (pose * point)).hnormalized();
  }

private:
  static constexpr double FOCAL_LENGTH = 800.0;  // [px]
  static constexpr double PLANE_DISTANCE = 1.0;
  static constexpr double RADIUS = 1.0;
  static constexpr double CYLINDER_DISTANCE = 3.0;  // of its axis
  static constexpr double CYLINDER_HEIGHT = 1.4;

  double width() const
  {
    return surface_ == Surface::PLANE ? WIDTH * PLANE_DISTANCE / FOCAL_LENGTH : 2.0 * M_PI * RADIUS;
  }
  double height() const
  {
    return surface_ == Surface::PLANE ? HEIGHT * PLANE_DISTANCE / FOCAL_LENGTH : CYLINDER_HEIGHT;
  }

  Surface surface_;
  cv::Size picture_;
  Eigen::Matrix3d k_;
};

/** The scene on grey ground, at four times the resolution and averaged, then with light and noise. */
cv::Mat draw(const Scene& scene, const cv::Mat& picture, const Eigen::Isometry3d& pose, double gain, double offset,
             std::uint64_t seed)
{
  constexpr int OVER = 4;
  constexpr double NOISE = 2.0;  // [grey levels]
  const cv::Size size(Scene::WIDTH, Scene::HEIGHT);
  cv::Mat map(size * OVER, CV_32FC2, cv::Scalar::all(-10.0));
  cv::parallel_for_(cv::Range(0, map.rows), [&](const cv::Range& rows) {
    for (int row = rows.start; row < rows.end; ++row)
    {
      for (int column = 0; column < map.cols; ++column)
      {
        const Eigen::Vector2d pixel((column + 0.5) / OVER - 0.5, (row + 0.5) / OVER - 0.5);
        if (const std::optional<Eigen::Vector3d> point = scene.hit(pose, pixel))
        {
          map.at<cv::Point2f>(row, column) = scene.onPicture(*point);
        }
      }
    }
  });
  cv::Mat large;
  cv::remap(picture, large, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_CONSTANT, cv::Scalar(128));
  cv::Mat view;
  cv::resize(large, view, size, 0.0, 0.0, cv::INTER_AREA);
  view.convertTo(view, CV_32F, gain, offset);
  cv::Mat noise(size, CV_32F);
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0.0, NOISE);
  view += noise;
  view.convertTo(view, CV_8U);
  return view;
}

}  // namespace

PointPair renderPair(Surface surface, const cv::Mat& picture, double angle, std::uint64_t seed)
{
  constexpr double ROLL = 10.0 * M_PI / 180.0;
  constexpr double GRID = 32.0;  // [px]
  const Scene scene(surface, picture.size());
  const Eigen::Isometry3d reference = scene.pose(0.0, 0.0);
  const Eigen::Isometry3d current = scene.pose(angle, ROLL);
  const auto place = [=](const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
    const std::optional<Eigen::Vector3d> point = scene.hit(reference, pixel);
    return point ? scene.project(current, *point) : Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  };
  PointPair pair;
  pair.name = surface == Surface::PLANE ? "plane" : "cylinder";
  pair.model = surface == Surface::PLANE ? GeometryModel::HOMOGRAPHY : GeometryModel::FUNDAMENTAL;
  pair.reference = draw(scene, picture, reference, 1.0, 0.0, 2 * seed);
  pair.current = draw(scene, picture, current, 0.8, 10.0, 2 * seed + 1);
  pair.error = [place](const Correspondence& match) {
    return (place(match.reference) - match.current).norm();
  };
  const std::array<Eigen::Vector2d, 4> corners = cornersOf(pair.reference.size());
  Points pixels(corners.begin(), corners.end());
  if (surface == Surface::CYLINDER)
  {
    pixels.clear();
    for (double v = GRID; v < Scene::HEIGHT; v += GRID)
    {
      for (double u = GRID; u < Scene::WIDTH; u += GRID)
      {
        pixels.emplace_back(u, v);
      }
    }
  }
  for (const Eigen::Vector2d& pixel : pixels)
  {
    const Eigen::Vector2d seen = place(pixel);
    if (seen.allFinite())
    {
      pair.points.push_back({ pixel, seen });
    }
  }
  return pair;
}

}  // namespace view_servo
