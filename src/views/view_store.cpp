// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/view_store.h"

#include "camera_yaml.h"
#include "stored_files.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/shown_text.h"
#include "view_servo/parameters/yaml_text.h"

#include <yaml-cpp/yaml.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

constexpr int FORMAT = 1;
constexpr std::size_t MAX_NAME_LENGTH = 64;

constexpr const char* STRUCTURE_ENDING = ".points";

fs::path structurePath(const fs::path& directory, const std::string& name, const std::string& revision)
{
  return directory / (name + "." + revision + STRUCTURE_ENDING);
}

std::string imageFileName(const std::string& name, std::string_view png)
{
  return name + "." + checksum(png) + ".png";
}

/** Empty when there is no such file. @throws Damage. */
std::optional<std::string> readFile(const fs::path& path)
{
  constexpr std::uintmax_t LARGEST = 4 * MAX_IMAGE_PIXELS;  // no view needs more [bytes]
  return readStoredFile(path, LARGEST);
}

/**
 * Whether a file is one that a view of this name had, or that was on its way to become one: all others are somebody
 * else's.
 */
bool isFileOf(const std::string& name, std::string file)
{
  constexpr std::string_view TEMPORARY = ".tmp";
  constexpr std::size_t DIGITS = 16;
  const auto ends_with = [&](std::string_view end) {
    return file.size() >= end.size() && file.compare(file.size() - end.size(), end.size(), end) == 0;
  };
  if (ends_with(TEMPORARY))
  {
    file.resize(file.size() - TEMPORARY.size());
    if (file == name + ".yaml")
    {
      return true;
    }
  }
  const std::string prefix = name + ".";
  return file.compare(0, prefix.size(), prefix) == 0 &&
         file.find_first_not_of("0123456789abcdef", prefix.size()) == prefix.size() + DIGITS &&
         (file.compare(prefix.size() + DIGITS, file.npos, ".png") == 0 ||
          file.compare(prefix.size() + DIGITS, file.npos, STRUCTURE_ENDING) == 0);
}

/** Removes the files of a view that its yaml file, if there is one, does not need. */
void removeLeftovers(const fs::path& directory, const std::string& name, const std::string& image_file)
{
  for (const fs::directory_entry& entry : fs::directory_iterator(directory))
  {
    const std::string file = entry.path().filename().string();
    if (file != image_file && isFileOf(name, file))
    {
      fs::remove(entry.path());
    }
  }
}

/** What comes after a view has been changed: it does not undo the change when it fails. @return the failure; or "". */
std::string finishChange(const fs::path& directory, const std::string& name, const std::string& image_file)
{
  try
  {
    syncDirectory(directory);
    removeLeftovers(directory, name, image_file);
    return "";
  }
  catch (const std::exception& error)
  {
    return std::string("its directory could not be put in order: ") + oneLine(error);
  }
}

void requireFinite(bool finite, const std::string& what)
{
  if (!finite)
  {
    throw std::invalid_argument(what + " has numbers that are not finite");
  }
}

/** Of a view whose image is 8-bit grey and of this size. @throws std::invalid_argument saying what cannot be stored. */
void check(const StoredView& view, const cv::Size& size)
{
  const std::int64_t pixels = static_cast<std::int64_t>(size.width) * size.height;
  if (std::min(size.width, size.height) < MIN_IMAGE_SIDE || pixels > MAX_IMAGE_PIXELS)
  {
    throw std::invalid_argument("its image is " + std::to_string(size.width) + " x " + std::to_string(size.height) +
                                " pixels, which is too " + (pixels > MAX_IMAGE_PIXELS ? "large" : "small"));
  }
  const cv::Rect& region = view.region;
  if (!region.empty() &&
      (region.x < 0 || region.y < 0 || region.width > size.width - region.x || region.height > size.height - region.y))
  {
    throw std::invalid_argument("its region of interest leaves the image");
  }
  requireFinite(std::isfinite(view.stamp), "its stamp");
  if (view.camera)
  {
    const Camera& camera = *view.camera;
    const bool finite = camera.k.allFinite() && camera.rectification.allFinite() && camera.projection.allFinite() &&
                        std::all_of(camera.distortion.begin(), camera.distortion.end(),
                                    [](double coefficient) { return std::isfinite(coefficient); });
    requireFinite(finite, "its camera");
  }
  if (view.pose)
  {
    requireFinite(view.pose->position.allFinite() && view.pose->orientation.coeffs().allFinite(), "its pose");
  }
}

/** @throws std::invalid_argument saying what cannot be stored. */
void check(const StoredView& view)
{
  if (view.image.empty() || view.image.type() != CV_8UC1)
  {
    throw std::invalid_argument("its image is not 8-bit grey");
  }
  check(view, view.image.size());
}

/** Row-major, as sensor_msgs/CameraInfo has them. */
template <typename Matrix>
std::vector<std::string> toList(const Matrix& matrix)
{
  std::vector<std::string> list;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
  {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
    {
      list.push_back(exactText(matrix(row, column)));
    }
  }
  return list;
}

template <typename Value>
void emit(YAML::Emitter& yaml, const std::string& key, const Value& value)
{
  yaml << YAML::Key << key << YAML::Value << value;
}

void emit(YAML::Emitter& yaml, const Camera& camera)
{
  yaml << YAML::Key << "camera" << YAML::Value << YAML::BeginMap;
  emit(yaml, "width", camera.width);
  emit(yaml, "height", camera.height);
  emit(yaml, "distortion_model", camera.distortion_model);
  emit(yaml, "D",
       toList(Eigen::Map<const Eigen::VectorXd>(camera.distortion.data(),
                                                static_cast<Eigen::Index>(camera.distortion.size()))));
  emit(yaml, "K", toList(camera.k));
  emit(yaml, "R", toList(camera.rectification));
  emit(yaml, "P", toList(camera.projection));
  yaml << YAML::EndMap;
}

void emit(YAML::Emitter& yaml, const ViewPose& pose)
{
  yaml << YAML::Key << "pose" << YAML::Value << YAML::BeginMap;
  emit(yaml, "frame", pose.frame);
  emit(yaml, "position", toList(pose.position));
  emit(yaml, "orientation", toList(pose.orientation.coeffs()));
  yaml << YAML::Comment("x, y, z, w") << YAML::EndMap;
}

ViewPose poseFromYaml(const YAML::Node& node)
{
  ViewPose pose;
  pose.frame = node["frame"].as<std::string>();
  fromList(node["position"], pose.position);
  fromList(node["orientation"], pose.orientation.coeffs());
  return pose;
}

/** All of a view but its pixels. */
std::string toYamlText(const StoredView& view, const std::string& image_file)
{
  const cv::Rect& region = view.region;
  YAML::Emitter yaml;
  yaml.SetSeqFormat(YAML::Flow);
  yaml << YAML::BeginMap;
  emit(yaml, "format", FORMAT);
  emit(yaml, "image", image_file);
  emit(yaml, "stamp", exactText(view.stamp));
  emit(yaml, "frame_id", view.frame_id);
  emit(yaml, "region", std::vector<int>{ region.x, region.y, region.width, region.height });
  yaml << YAML::Comment("x, y, width, height");
  if (view.camera)
  {
    emit(yaml, *view.camera);
  }
  if (view.pose)
  {
    emit(yaml, *view.pose);
  }
  yaml << YAML::EndMap << YAML::Newline;
  return withChecksum(std::string(yaml.c_str(), yaml.size()));
}

/** @throws Damage when the text is not, to the byte, what toYamlText() wrote. */
YAML::Node parseViewYaml(const std::string& text)
{
  const YAML::Node node = parseYaml(withoutChecksum(text, "its yaml file"));
  if (const int format = node["format"].as<int>(); format != FORMAT)
  {
    throw Damage("it has format " + std::to_string(format) + ", not " + std::to_string(FORMAT));
  }
  return node;
}

/** The view's fields but for image and name. */
StoredView fieldsFromYaml(const YAML::Node& node)
{
  StoredView view;
  view.stamp = node["stamp"].as<double>();
  view.frame_id = node["frame_id"].as<std::string>();
  Eigen::Vector4i region;
  fromList(node["region"], region);
  view.region = cv::Rect(region[0], region[1], region[2], region[3]);
  if (node["camera"])
  {
    view.camera = cameraFromYaml(node["camera"]);
  }
  if (node["pose"])
  {
    view.pose = poseFromYaml(node["pose"]);
  }
  return view;
}

/** The files of a view, both in agreement with their checksums, and all but the pixels of what they hold. */
struct ViewFiles
{
  StoredView view;
  std::string image_file;  ///< name of the image's file, which has its checksum
  std::string png;         ///< its bytes
};

/** Empty when there is no such view. @throws Damage, or what yaml-cpp throws. */
std::optional<ViewFiles> readFiles(const fs::path& directory, const std::string& name)
{
  std::optional<std::string> text = readFile(yamlPath(directory, name));
  while (text)
  {
    const YAML::Node node = parseViewYaml(*text);
    const auto image_file = node["image"].as<std::string>();
    if (std::optional<std::string> png = readFile(directory / image_file))
    {
      if (imageFileName(name, *png) != image_file)
      {
        throw Damage("its image " + image_file + " does not agree with the checksum in its name");
      }
      ViewFiles files{ fieldsFromYaml(node), image_file, *std::move(png) };
      files.view.name = name;
      return files;
    }
    // The image may be gone because the view was saved anew since its yaml file was read.
    std::optional<std::string> text_now = readFile(yamlPath(directory, name));
    if (text_now == text)
    {
      throw Damage("its image " + image_file + " is missing");
    }
    text = std::move(text_now);
  }
  return std::nullopt;
}

/**
 * @throws Damage, or the error of the library that could not make sense of a file; empty when there is no such view.
 */
std::optional<StoredView> readView(const fs::path& directory, const std::string& name)
{
  std::optional<ViewFiles> files = readFiles(directory, name);
  if (!files)
  {
    return std::nullopt;
  }
  files->view.image = decodeGreyImage(files->png, files->image_file);
  check(files->view);
  return std::move(files->view);
}

[[noreturn]] void fail(const std::string& action, const std::string& name, const std::string& reason)
{
  throw ViewStoreError("cannot " + action + " view '" + name + "': " + reason);
}

/** Sorted names of the views that have a yaml file, readable or not. @throws ViewStoreError. */
std::vector<std::string> findNames(const fs::path& directory)
{
  try
  {
    return namesOfYamlFiles(directory);
  }
  catch (const fs::filesystem_error& error)
  {
    throw ViewStoreError(std::string("cannot list views: ") + oneLine(error));
  }
}

void requireValidName(const std::string& action, const std::string& name)
{
  if (!isValidViewName(name))
  {
    fail(action, shown(name.substr(0, MAX_NAME_LENGTH)),
         "a name is 1 to 64 letters, digits, '_' and '-', and starts with a letter or digit");
  }
}

}  // namespace

Camera cameraOf(const StoredView& view, const Camera& current)
{
  const Camera& camera = view.camera ? *view.camera : current;
  const auto refuse = [&](const std::string& what) {
    throw std::runtime_error("view '" + view.name + "' " + what);
  };
  const auto size_of = [](int width, int height) {
    return std::to_string(width) + " x " + std::to_string(height);
  };
  if (view.image.size() != cv::Size(camera.width, camera.height))
  {
    refuse("has " + size_of(view.image.cols, view.image.rows) + " pixels, " +
           (view.camera ? "its calibration is for " : "no calibration, and the camera has ") +
           size_of(camera.width, camera.height) + ": store it anew");
  }
  const std::string fault = camera.fault();
  if (view.camera && !fault.empty())
  {
    refuse("was stored with a calibration that cannot be used, store it anew: " + fault);
  }
  return camera;
}

bool isValidViewName(const std::string& name)
{
  // Not std::isalnum(), which asks the locale.
  const auto is_alphanumeric = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
  };
  return !name.empty() && name.size() <= MAX_NAME_LENGTH && is_alphanumeric(name[0]) &&
         std::all_of(name.begin(), name.end(), [&](char c) { return is_alphanumeric(c) || c == '_' || c == '-'; });
}

ViewStore::ViewStore(std::filesystem::path directory) : directory_(std::move(directory))
{
}

std::string ViewStore::save(const StoredView& view, bool overwrite) const
{
  requireValidName("save", view.name);
  try
  {
    check(view);
    fs::create_directories(directory_);
    const DirectoryLock lock(directory_);
    const fs::path yaml = yamlPath(directory_, view.name);
    if (!overwrite && fs::exists(yaml))
    {
      fail("save", view.name, "there is one of that name; overwrite: true replaces it");
    }
    std::vector<unsigned char> encoded;
    cv::imencode(".png", view.image, encoded);
    const std::string_view png(reinterpret_cast<const char*>(encoded.data()), encoded.size());
    const std::string image_file = imageFileName(view.name, png);

    replaceFile(directory_ / image_file, png);
    syncDirectory(directory_);
    replaceFile(yaml, toYamlText(view, image_file));
    return finishChange(directory_, view.name, image_file);
  }
  catch (const ViewStoreError&)
  {
    throw;
  }
  catch (const std::exception& error)
  {
    fail("save", view.name, oneLine(error));
  }
}

StoredView ViewStore::load(const std::string& name) const
{
  requireValidName("load", name);
  try
  {
    if (std::optional<StoredView> view = readView(directory_, name))
    {
      return *std::move(view);
    }
  }
  catch (const std::exception& error)
  {
    fail("load", name, oneLine(error));
  }
  fail("load", name, "there is none of that name");
}

std::string ViewStore::revision(const std::string& name) const
{
  requireValidName("load", name);
  try
  {
    if (const std::optional<std::string> text = readFile(yamlPath(directory_, name)))
    {
      parseViewYaml(*text);
      return checksum(*text);
    }
  }
  catch (const std::exception& error)
  {
    fail("load", name, oneLine(error));
  }
  fail("load", name, "there is none of that name");
}

bool ViewStore::saveStructure(const std::string& name, const std::string& revision,
                              const ViewStructure& structure) const
{
  requireValidName("save the structure of", name);
  try
  {
    if (fs::exists(yamlPath(directory_, name)))
    {
      const DirectoryLock lock(directory_);
      if (this->revision(name) != revision)
      {
        return false;
      }
      replaceFile(structurePath(directory_, name, revision), withChecksum(toText(structure)));
      syncDirectory(directory_);
      return true;
    }
  }
  catch (const std::exception& error)
  {
    fail("save the structure of", name, oneLine(error));
  }
  fail("save the structure of", name, "there is none of that name");
}

ViewStructure ViewStore::loadStructure(const std::string& name) const
{
  const fs::path path = structurePath(directory_, name, revision(name));
  try
  {
    const std::optional<std::string> text = readFile(path);
    return text ? structureFromText(withoutChecksum(*text, path.filename().string())) : ViewStructure();
  }
  catch (const std::exception& error)
  {
    fail("load the structure of", name, oneLine(error));
  }
}

std::map<std::string, std::string> ViewStore::revisions() const
{
  std::map<std::string, std::string> revisions;
  for (const std::string& name : findNames(directory_))
  {
    try
    {
      const std::optional<std::string> text = readFile(yamlPath(directory_, name));
      if (text && hasGoodChecksum(*text))
      {
        revisions.emplace(name, checksum(*text));
      }
    }
    catch (const Damage&)
    {
      // It is not a view that can be read.
    }
  }
  return revisions;
}

std::vector<std::string> ViewStore::names() const
{
  return findNames(directory_);
}

ViewStore::Listing ViewStore::list() const
{
  Listing listing;
  const std::lock_guard<std::mutex> lock(decoded_->mutex);
  std::map<std::string, cv::Size> decoded;
  for (const std::string& name : findNames(directory_))
  {
    try
    {
      const std::optional<ViewFiles> files = readFiles(directory_, name);
      if (!files)
      {
        continue;  // it was removed meanwhile
      }
      const auto known = decoded_->sizes.find(files->image_file);
      const cv::Size size =
          known != decoded_->sizes.end() ? known->second : decodeGreyImage(files->png, files->image_file).size();
      check(files->view, size);
      decoded.emplace(files->image_file, size);
      listing.names.push_back(name);
    }
    catch (const std::exception& error)
    {
      listing.damaged.push_back({ name, oneLine(error) });
    }
  }
  decoded_->sizes = std::move(decoded);
  return listing;
}

std::string ViewStore::remove(const std::string& name) const
{
  requireValidName("remove", name);
  const fs::path yaml = yamlPath(directory_, name);
  try
  {
    if (fs::is_regular_file(yaml))
    {
      const DirectoryLock lock(directory_);
      if (fs::remove(yaml))
      {
        return finishChange(directory_, name, "");
      }
    }
  }
  catch (const std::exception& error)
  {
    fail("remove", name, oneLine(error));
  }
  fail("remove", name, fs::exists(yaml) ? yaml.string() + " is not a file" : "there is none of that name");
}

}  // namespace view_servo
