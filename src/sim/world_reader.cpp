// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/world_reader.h"

#include "sim/textures.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/numbers.h"
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <stdexcept>
#include <utility>
#include <vector>

namespace view_servo::sim
{
namespace
{
/** Things whose lowest point is above this are no obstacle for the base [m]. */
constexpr double ROBOT_HEIGHT = 1.3;

[[noreturn]] void fail(const YAML::Node& node, const std::string& what)
{
  const int line = node.Mark().line;
  throw std::invalid_argument((line >= 0 ? "line " + std::to_string(line + 1) + ": " : "") + what);
}

/** A map of which only the named keys may occur. */
const YAML::Node& requireKeys(const YAML::Node& node, const std::string& what, std::initializer_list<const char*> known)
{
  if (!node.IsMap())
  {
    fail(node, what + " must be a map");
  }
  for (const auto& entry : node)
  {
    const auto key = entry.first.as<std::string>();
    if (std::find(known.begin(), known.end(), key) == known.end())
    {
      fail(entry.first, std::string("unknown key '").append(key).append("' of ").append(what));
    }
  }
  return node;
}

/** The entries of a key that may be left out, which are a list. */
YAML::Node listOf(const YAML::Node& map, const std::string& key)
{
  const YAML::Node node = map[key];
  if (node && !node.IsSequence())
  {
    fail(node, "'" + key + "' must be a list");
  }
  return node;
}

/** The same, but a map of names. */
YAML::Node namesOf(const YAML::Node& map, const std::string& key)
{
  const YAML::Node node = map[key];
  if (node && !node.IsMap())
  {
    fail(node, "'" + key + "' must be a map of names");
  }
  return node;
}

template <typename Value>
Value convert(const YAML::Node& node, const std::string& what)
{
  try
  {
    return node.as<Value>();
  }
  catch (const YAML::Exception&)
  {
    fail(node, what + " cannot be read");
  }
}

double finite(const YAML::Node& node, const std::string& what)
{
  const auto value = convert<double>(node, what);
  if (!std::isfinite(value))
  {
    fail(node, what + " must be finite");
  }
  return value;
}

template <int SIZE>
Eigen::Matrix<double, SIZE, 1> vector(const YAML::Node& node, const std::string& what)
{
  if (!node.IsSequence() || node.size() != SIZE)
  {
    fail(node, what + " must be a list of " + std::to_string(SIZE) + " numbers");
  }
  Eigen::Matrix<double, SIZE, 1> values;
  for (int i = 0; i < SIZE; ++i)
  {
    values(i) = finite(node[i], what);
  }
  return values;
}

YAML::Node required(const YAML::Node& map, const std::string& key, const std::string& what)
{
  if (!map[key])
  {
    fail(map, what + " needs '" + key + "'");
  }
  return map[key];
}

double numberOr(const YAML::Node& map, const std::string& key, double otherwise)
{
  return map[key] ? finite(map[key], key) : otherwise;
}

double positive(const YAML::Node& map, const std::string& key, double otherwise)
{
  const double value = numberOr(map, key, otherwise);
  if (!(value > 0.0))
  {
    fail(map[key], key + " must be positive");
  }
  return value;
}

/** World from a frame whose z axis points along `facing` and whose y axis as far as possible along `up`. */
Eigen::Matrix3d facing(const YAML::Node& node, const Eigen::Vector3d& z, const Eigen::Vector3d& up)
{
  const Eigen::Vector3d x = up.cross(z);
  if (!(x.norm() > 1e-6 * up.norm() * z.norm()))
  {
    fail(node, "'facing' must not be zero nor parallel to 'up'");
  }
  Eigen::Matrix3d axes;
  axes.col(2) = z.normalized();
  axes.col(0) = x.normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  return axes;
}

class WorldReader
{
public:
  WorldReader(const YAML::Node& root, std::filesystem::path folder) : root_(root), folder_(std::move(folder))
  {
  }

  World read()
  {
    requireKeys(root_, "a world",
                { "robot", "camera", "light", "background", "textures", "rectangles", "boxes", "goal", "region",
                  "starts", "trajectories" });
    readRobot(required(root_, "robot", "a world"));
    readCamera(required(root_, "camera", "a world"));
    if (root_["light"])
    {
      readLight(root_["light"]);
    }
    world_.background = numberOr(root_, "background", world_.background);
    required(root_, "textures", "a world");
    for (const auto& entry : namesOf(root_, "textures"))
    {
      addTexture(convert<std::string>(entry.first, "a texture's name"), entry.second);
    }
    for (const auto& node : listOf(root_, "rectangles"))
    {
      forCopies(node, [&](const Eigen::Vector3d& offset) { addRectangle(node, offset); });
    }
    for (const auto& node : listOf(root_, "boxes"))
    {
      forCopies(node, [&](const Eigen::Vector3d& offset) { addBox(node, offset); });
    }
    if (world_.surfaces.empty())
    {
      fail(root_, "a world needs 'rectangles' or 'boxes'");
    }
    world_.goal = pose(required(root_, "goal", "a world"));
    if (root_["region"])
    {
      readRegion(root_["region"]);
    }
    for (const auto& entry : namesOf(root_, "starts"))
    {
      world_.starts[convert<std::string>(entry.first, "a start's name")] = pose(entry.second);
    }
    for (const auto& entry : namesOf(root_, "trajectories"))
    {
      addTrajectory(convert<std::string>(entry.first, "a trajectory's name"), entry.second);
    }
    return std::move(world_);
  }

private:
  void readRobot(const YAML::Node& node)
  {
    requireKeys(node, "'robot'", { "kind", "camera_height", "camera_ahead", "position", "yaw_deg" });
    const auto kind = convert<std::string>(required(node, "kind", "'robot'"), "kind");
    if (kind == "nomad")
    {
      world_.robot = RobotKind::NOMAD;
      world_.camera_on_base.translation().z() = positive(node, "camera_height", 1.0);
      world_.camera_on_base.translation().x() = numberOr(node, "camera_ahead", 0.0);
      // Optical: z forward, x right, y down, of a base with x forward, y left, z up.
      world_.camera_on_base.linear() << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
    }
    else if (kind == "puma")
    {
      world_.robot = RobotKind::PUMA;
      const Eigen::Vector3d at =
          node["position"] ? vector<3>(node["position"], "position") : Eigen::Vector3d(Eigen::Vector3d::Zero());
      world_.robot_base = planarPose(at.x(), at.y(), numberOr(node, "yaw_deg", 0.0) * DEGREE);
      world_.robot_base.translation().z() = at.z();
    }
    else
    {
      fail(node["kind"], "unknown kind of robot '" + kind + "', known: nomad, puma");
    }
  }

  void readRegion(const YAML::Node& node)
  {
    const Eigen::Vector4d values = vector<4>(node, "'region'");
    const bool whole = values.array().round().matrix() == values;
    if (!whole || values.minCoeff() < 0.0 || values(2) < 1.0 || values(3) < 1.0 ||
        values(0) + values(2) > world_.camera.width || values(1) + values(3) > world_.camera.height)
    {
      fail(node, "'region' must be [x, y, width, height] in whole pixels, within the image");
    }
    const Eigen::Vector4i pixels = values.cast<int>();
    world_.region = cv::Rect(pixels(0), pixels(1), pixels(2), pixels(3));
  }

  void readCamera(const YAML::Node& node)
  {
    requireKeys(node, "'camera'",
                { "width", "height", "fx", "fy", "cx", "cy", "distortion_model", "distortion", "rate", "noise",
                  "exposure", "supersampling" });
    Camera& camera = world_.camera;
    constexpr double MAX_SIDE = 4096.0;
    const double width = positive(node, "width", 640.0);
    const double height = positive(node, "height", 480.0);
    if (width > MAX_SIDE || height > MAX_SIDE || width != std::floor(width) || height != std::floor(height))
    {
      fail(node, "width and height must be whole numbers up to " + std::to_string(static_cast<int>(MAX_SIDE)));
    }
    camera.width = static_cast<int>(width);
    camera.height = static_cast<int>(height);
    const double fx = positive(node, "fx", width);
    const double fy = positive(node, "fy", fx);
    camera.k << fx, 0.0, numberOr(node, "cx", 0.5 * (width - 1.0)), 0.0, fy, numberOr(node, "cy", 0.5 * (height - 1.0)),
        0.0, 0.0, 1.0;
    camera.projection.leftCols<3>() = camera.k;
    camera.distortion_model =
        node["distortion_model"] ? convert<std::string>(node["distortion_model"], "distortion_model") : "plumb_bob";
    constexpr std::size_t PLUMB_BOB = 5;  // coefficients
    camera.distortion = node["distortion"] ? convert<std::vector<double>>(node["distortion"], "distortion")
                                           : std::vector<double>(node["distortion_model"] ? 0 : PLUMB_BOB, 0.0);
    const std::string fault = camera.fault();
    if (!fault.empty())
    {
      fail(node, "the camera cannot be used: " + fault);
    }
    world_.camera_rate = positive(node, "rate", world_.camera_rate);
    world_.quality.noise = numberOr(node, "noise", 0.0);
    world_.quality.exposure = numberOr(node, "exposure", 0.0);
    if (world_.quality.noise < 0.0 || world_.quality.exposure < 0.0)
    {
      fail(node, "noise and exposure must not be negative");
    }
    world_.quality.supersampling =
        node["supersampling"] ? convert<int>(node["supersampling"], "supersampling") : world_.quality.supersampling;
    if (world_.quality.supersampling < 1 || world_.quality.supersampling > 4)
    {
      fail(node["supersampling"], "supersampling must lie in [1, 4]");
    }
  }

  void readLight(const YAML::Node& node)
  {
    requireKeys(node, "'light'", { "gain", "offset", "gradient" });
    world_.light.gain = positive(node, "gain", 1.0);
    world_.light.offset = numberOr(node, "offset", 0.0);
    world_.light.gradient = numberOr(node, "gradient", 0.0);
    if (!(std::abs(world_.light.gradient) < 2.0))
    {
      fail(node, "gradient must lie in (-2, 2)");
    }
  }

  void addTexture(const std::string& name, const YAML::Node& node)
  {
    requireKeys(node, "texture '" + name + "'", { "file", "kind", "size", "grey", "contrast", "count", "seed" });
    cv::Mat picture;
    try
    {
      if (node["file"])
      {
        picture = readGreyImage((folder_ / convert<std::string>(node["file"], "file")).string());
      }
      else
      {
        const auto kind = convert<std::string>(required(node, "kind", "texture '" + name + "'"), "kind");
        const auto size =
            node["size"] ? vector<2>(node["size"], "size") : Eigen::Vector2d(Eigen::Vector2d::Constant(512.0));
        constexpr double MAX_SIDE = 4096.0;
        if (!(size.minCoeff() >= 1.0 && size.maxCoeff() <= MAX_SIDE))
        {
          fail(node["size"], "a picture's sides must lie in [1, 4096] px");
        }
        const int count = node["count"] ? convert<int>(node["count"], "count") : 8;
        if (count < 1 || count > 1000)
        {
          fail(node["count"], "count must lie in [1, 1000]");
        }
        const auto seed = node["seed"] ? convert<std::uint64_t>(node["seed"], "seed") : 1U;
        const double grey = numberOr(node, "grey", 128.0);
        picture =
            drawTexture(kind, cv::Size(static_cast<int>(size.x()), static_cast<int>(size.y())), grey, count, seed);
        const double contrast = numberOr(node, "contrast", 1.0);
        picture.convertTo(picture, CV_8U, contrast, (1.0 - contrast) * grey);
      }
    }
    catch (const std::exception& error)
    {
      fail(node, "texture '" + name + "': " + oneLine(error));
    }
    texture_of_[name] = static_cast<int>(world_.textures.size());
    world_.textures.push_back(picture);
  }

  int texture(const YAML::Node& node) const
  {
    const auto name = convert<std::string>(node, "texture");
    const auto found = texture_of_.find(name);
    if (found == texture_of_.end())
    {
      fail(node, "there is no texture '" + name + "'");
    }
    return found->second;
  }

  static std::string nameOf(const YAML::Node& node)
  {
    return node["name"] ? convert<std::string>(node["name"], "name") : "";
  }

  /** Calls `add` with the offset of each copy that an entry asks for. */
  template <typename Add>
  static void forCopies(const YAML::Node& node, const Add& add)
  {
    if (!node.IsMap())
    {
      fail(node, "a rectangle or box must be a map");
    }
    const YAML::Node copies = node["copies"];
    if (!copies)
    {
      add(Eigen::Vector3d::Zero());
      return;
    }
    requireKeys(copies, "'copies'", { "count", "step" });
    const auto count = convert<int>(required(copies, "count", "'copies'"), "count");
    if (count < 1 || count > 1000)
    {
      fail(copies, "count must lie in [1, 1000]");
    }
    const Eigen::Vector3d step = vector<3>(required(copies, "step", "'copies'"), "step");
    for (int i = 0; i < count; ++i)
    {
      add(i * step);
    }
  }

  void addRectangle(const YAML::Node& node, const Eigen::Vector3d& offset)
  {
    requireKeys(node, "a rectangle",
                { "name", "group", "size", "position", "facing", "up", "texture", "repeat", "brightness", "copies" });
    Surface surface;
    surface.name = nameOf(node);
    surface.group = node["group"] ? convert<std::string>(node["group"], "group") : "";
    surface.size = vector<2>(required(node, "size", "a rectangle"), "size");
    if (!(surface.size.minCoeff() > 0.0))
    {
      fail(node["size"], "a rectangle's sides must be positive");
    }
    const Eigen::Vector3d z = vector<3>(required(node, "facing", "a rectangle"), "facing");
    const bool lies = z.head<2>().norm() < 1e-6 * z.norm();
    const Eigen::Vector3d up = node["up"] ? Eigen::Vector3d(vector<3>(node["up"], "up"))
                                          : (lies ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ());
    surface.pose = Eigen::Isometry3d::Identity();
    surface.pose.linear() = facing(node, z, up);
    surface.pose.translation() = vector<3>(required(node, "position", "a rectangle"), "position") + offset;
    surface.texture = texture(required(node, "texture", "a rectangle"));
    surface.repeat = node["repeat"] ? vector<2>(node["repeat"], "repeat") : Eigen::Vector2d(Eigen::Vector2d::Ones());
    surface.brightness = positive(node, "brightness", 1.0);
    world_.surfaces.push_back(surface);
  }

  void addBox(const YAML::Node& node, const Eigen::Vector3d& offset)
  {
    requireKeys(node, "a box",
                { "name", "group", "size", "position", "yaw_deg", "texture", "faces", "repeat", "brightness", "solid",
                  "copies" });
    const Eigen::Vector3d size = vector<3>(required(node, "size", "a box"), "size");
    if (!(size.minCoeff() > 0.0))
    {
      fail(node["size"], "a box's sides must be positive");
    }
    const Eigen::Vector3d bottom = vector<3>(required(node, "position", "a box"), "position") + offset;
    Eigen::Isometry3d middle = planarPose(bottom.x(), bottom.y(), numberOr(node, "yaw_deg", 0.0) * DEGREE);
    middle.translation().z() = bottom.z() + 0.5 * size.z();
    const YAML::Node faces = node["faces"];
    if (faces)
    {
      requireKeys(faces, "'faces'", { "front", "back", "left", "right", "top", "bottom" });
    }
    const YAML::Node all = required(node, "texture", "a box");
    struct Face
    {
      const char* name;
      Eigen::Vector3d normal;
      Eigen::Vector3d up;
      Eigen::Vector2d size;
    };
    const std::array<Face, 6> sides = { {
        { "front", Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitZ(), { size.y(), size.z() } },
        { "back", -Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitZ(), { size.y(), size.z() } },
        { "left", Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ(), { size.x(), size.z() } },
        { "right", -Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ(), { size.x(), size.z() } },
        { "top", Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX(), { size.y(), size.x() } },
        { "bottom", -Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX(), { size.y(), size.x() } },
    } };
    for (const Face& face : sides)
    {
      Surface surface;
      surface.name = nameOf(node);
      surface.group = node["group"] ? convert<std::string>(node["group"], "group") : "";
      surface.size = face.size;
      Eigen::Isometry3d on_box = Eigen::Isometry3d::Identity();
      on_box.linear() = facing(node, face.normal, face.up);
      on_box.translation() = 0.5 * size.cwiseProduct(face.normal);
      surface.pose = middle * on_box;
      surface.texture = texture(faces && faces[face.name] ? faces[face.name] : all);
      surface.repeat = node["repeat"] ? vector<2>(node["repeat"], "repeat") : Eigen::Vector2d(Eigen::Vector2d::Ones());
      surface.brightness = positive(node, "brightness", 1.0);
      world_.surfaces.push_back(surface);
    }
    const bool solid = node["solid"] ? convert<bool>(node["solid"], "solid") : true;
    if (solid && bottom.z() < ROBOT_HEIGHT && bottom.z() + size.z() > 0.0)
    {
      Obstacle obstacle{ nameOf(node), {}, node["group"] ? convert<std::string>(node["group"], "group") : "" };
      for (const auto& [x, y] :
           { std::pair(0.5, 0.5), std::pair(-0.5, 0.5), std::pair(-0.5, -0.5), std::pair(0.5, -0.5) })
      {
        const Eigen::Vector3d corner = middle * Eigen::Vector3d(x * size.x(), y * size.y(), 0.0);
        obstacle.outline.emplace_back(corner.head<2>());
      }
      world_.obstacles.push_back(obstacle);
    }
  }

  /** The base's or the camera's, whichever the robot moves. */
  Eigen::Isometry3d pose(const YAML::Node& node) const
  {
    if (world_.robot == RobotKind::NOMAD)
    {
      requireKeys(node, "a pose of the base", { "x", "y", "yaw_deg", "time" });
      return planarPose(finite(required(node, "x", "a pose of the base"), "x"),
                        finite(required(node, "y", "a pose of the base"), "y"),
                        numberOr(node, "yaw_deg", 0.0) * DEGREE);
    }
    requireKeys(node, "a pose of the camera", { "position", "look_at", "roll_deg", "time" });
    const Eigen::Vector3d position = vector<3>(required(node, "position", "a pose of the camera"), "position");
    const Eigen::Vector3d target = vector<3>(required(node, "look_at", "a pose of the camera"), "look_at");
    if (!((target - position).norm() > 1e-6))
    {
      fail(node, "a camera cannot look at where it is");
    }
    return lookingAt(position, target, numberOr(node, "roll_deg", 0.0) * DEGREE);
  }

  void addTrajectory(const std::string& name, const YAML::Node& node)
  {
    std::vector<Waypoint> waypoints;
    if (!node.IsSequence())
    {
      fail(node, "trajectory '" + name + "' must be a list of waypoints");
    }
    for (const auto& entry : node)
    {
      Waypoint waypoint{ finite(required(entry, "time", "a waypoint"), "time"), pose(entry) };
      if (!waypoints.empty() && !(waypoint.time > waypoints.back().time))
      {
        fail(entry, "the times of trajectory '" + name + "' must increase");
      }
      waypoints.push_back(waypoint);
    }
    if (waypoints.empty())
    {
      fail(node, "trajectory '" + name + "' has no waypoints");
    }
    world_.trajectories[name] = std::move(waypoints);
  }

  YAML::Node root_;
  std::filesystem::path folder_;
  World world_;
  std::map<std::string, int> texture_of_;
};

}  // namespace

World readWorld(const std::string& file)
{
  const std::filesystem::path path(file);
  std::error_code unknown;
  if (!std::filesystem::is_regular_file(path, unknown))
  {
    throw std::invalid_argument(file + ": cannot be read");
  }
  try
  {
    World world = WorldReader(loadSmallYamlFile(file), path.parent_path()).read();
    world.name = path.stem().string();
    return world;
  }
  catch (const std::exception& error)
  {
    throw std::invalid_argument(file + ": " + oneLine(error));
  }
}

World findWorld(const std::string& file_or_name, const std::filesystem::path& directory)
{
  if (std::filesystem::exists(file_or_name))
  {
    return readWorld(file_or_name);
  }
  const std::filesystem::path file = directory / (file_or_name + ".yaml");
  if (!std::filesystem::exists(file))
  {
    throw std::invalid_argument("there is no world '" + file_or_name + "': neither a file nor one in '" +
                                directory.string() + "'");
  }
  return readWorld(file.string());
}

}  // namespace view_servo::sim
