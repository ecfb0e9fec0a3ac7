// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "sim/renderer.h"

// OSMesa first: what follows might bring another OpenGL.
#include <GL/osmesa.h>

#include <GL/gl.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <mutex>
#include <set>
#include <stdexcept>
#include <utility>

namespace view_servo::sim
{
namespace
{
constexpr double NEAREST = 0.02;   // of what is drawn [m]
constexpr double FARTHEST = 60.0;  // [m]
/** The light comes from above, from one side, and from all around; faces of a box differ in brightness. */
const Eigen::Vector3d LIGHT_DIRECTION = Eigen::Vector3d(-0.35, 0.55, 0.75).normalized();
constexpr double AMBIENT = 0.62;

double shade(const Surface& surface)
{
  const Eigen::Vector3d normal = surface.pose.linear().col(2);
  return surface.brightness * (AMBIENT + (1.0 - AMBIENT) * (0.5 + 0.5 * normal.dot(LIGHT_DIRECTION)));
}

/** For calls of OSMesa's own: Mesa 20 changes lists there that all threads share. */
std::mutex& mesaMutex()
{
  static std::mutex mutex;
  return mutex;
}

/**
 * A number of columns beside the picture's that no other context of the process has meanwhile. Mesa 20 has contexts of
 * the same size draw into one buffer, from whatever threads they draw: so no two are to be of the same size. Not of
 * rows, as Mesa counts these from the far end, and rounds otherwise then.
 */
class OwnColumns
{
public:
  OwnColumns()
  {
    const std::lock_guard<std::mutex> lock(mesaMutex());
    while (!taken().insert(count_).second)
    {
      ++count_;
    }
  }

  ~OwnColumns()
  {
    const std::lock_guard<std::mutex> lock(mesaMutex());
    taken().erase(count_);
  }

  OwnColumns(const OwnColumns&) = delete;
  OwnColumns& operator=(const OwnColumns&) = delete;

  int count() const
  {
    return count_;
  }

private:
  static std::set<int>& taken()
  {
    static std::set<int> counts;
    return counts;
  }

  int count_ = 0;
};

}  // namespace

struct SimulatedCamera::Context
{
  OwnColumns own_columns;
  OSMesaContext context = nullptr;
  std::vector<unsigned char> buffer;  // RGBA
  cv::Size size;
  GLuint list = 0;

  explicit Context(const cv::Size& wanted) : size(wanted)
  {
    constexpr int DEPTH_BITS = 24;
    // Mesa's threads, by default one for each core, wait for each other at every picture: where other nodes use the
    // cores, too, one is quicker. Who sets the variable has the last word.
    constexpr int KEEP_WHAT_IS_SET = 0;
    setenv("LP_NUM_THREADS", "1", KEEP_WHAT_IS_SET);
    {
      const std::lock_guard<std::mutex> lock(mesaMutex());
      context = OSMesaCreateContextExt(OSMESA_RGBA, DEPTH_BITS, 0, 0, nullptr);
    }
    buffer.resize(4 * static_cast<std::size_t>(size.height) * (size.width + own_columns.count()));
    if (context == nullptr)
    {
      throw std::runtime_error("OSMesa gives no OpenGL context");
    }
  }

  ~Context()
  {
    const std::lock_guard<std::mutex> lock(mesaMutex());
    OSMesaDestroyContext(context);
  }

  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  /** To be called when done: the next call may come from another thread. */
  static void release()
  {
    const std::lock_guard<std::mutex> lock(mesaMutex());
    OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
  }

  void makeCurrent()
  {
    const std::lock_guard<std::mutex> lock(mesaMutex());
    const int columns = size.width + own_columns.count();
    if (OSMesaMakeCurrent(context, buffer.data(), GL_UNSIGNED_BYTE, columns, size.height) != GL_TRUE)
    {
      throw std::runtime_error("OSMesa refuses an image of " + std::to_string(size.width) + " x " +
                               std::to_string(size.height) + " pixels");
    }
  }

  static std::vector<GLuint> loadTextures(const std::vector<cv::Mat>& pictures)
  {
    std::vector<GLuint> names(pictures.size());
    glGenTextures(static_cast<GLsizei>(names.size()), names.data());
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    for (std::size_t i = 0; i < pictures.size(); ++i)
    {
      const cv::Mat picture = pictures[i].isContinuous() ? pictures[i] : pictures[i].clone();
      glBindTexture(GL_TEXTURE_2D, names[i]);
      glTexParameteri(GL_TEXTURE_2D, GL_GENERATE_MIPMAP, GL_TRUE);
      glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR_MIPMAP_LINEAR);
      glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
      glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_REPEAT);
      glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_REPEAT);
      glTexImage2D(GL_TEXTURE_2D, 0, GL_LUMINANCE8, picture.cols, picture.rows, 0, GL_LUMINANCE, GL_UNSIGNED_BYTE,
                   picture.data);
    }
    return names;
  }

  void load(const World& world, const std::vector<std::string>& groups)
  {
    makeCurrent();
    const std::vector<GLuint> textures = loadTextures(world.textures);
    glEnable(GL_DEPTH_TEST);
    glEnable(GL_TEXTURE_2D);
    glTexEnvi(GL_TEXTURE_ENV, GL_TEXTURE_ENV_MODE, GL_MODULATE);
    const auto background = static_cast<GLfloat>(world.background / 255.0);
    glClearColor(background, background, background, 1.0F);
    list = glGenLists(1);
    glNewList(list, GL_COMPILE);
    // Boxes come after walls in a world and stand before them: what is hidden need not be drawn.
    for (auto next = world.surfaces.rbegin(); next != world.surfaces.rend(); ++next)
    {
      const Surface& surface = *next;
      if (!surface.group.empty() && std::find(groups.begin(), groups.end(), surface.group) == groups.end())
      {
        continue;
      }
      glBindTexture(GL_TEXTURE_2D, textures[static_cast<std::size_t>(surface.texture)]);
      const auto grey = static_cast<GLfloat>(std::min(1.0, shade(surface)));
      glColor3f(grey, grey, grey);
      glBegin(GL_QUADS);
      for (const auto& [x, y] :
           { std::pair(-0.5, -0.5), std::pair(0.5, -0.5), std::pair(0.5, 0.5), std::pair(-0.5, 0.5) })
      {
        // The picture's first row is at the top, y = 0.5.
        glTexCoord2d((x + 0.5) * surface.repeat.x(), (0.5 - y) * surface.repeat.y());
        const Eigen::Vector3d corner = surface.pose * Eigen::Vector3d(x * surface.size.x(), y * surface.size.y(), 0.0);
        glVertex3d(corner.x(), corner.y(), corner.z());
      }
      glEnd();
    }
    glEndList();
    release();
  }

  /** The picture drawn last, RGBA, in this context's memory. */
  cv::Mat drawn()
  {
    return cv::Mat(size.height, size.width + own_columns.count(), CV_8UC4, buffer.data()).colRange(0, size.width);
  }

  /** The first row of the image ends up first in the buffer: OpenGL's lowest. */
  void draw(const Eigen::Matrix3d& k, const Eigen::Isometry3d& camera)
  {
    makeCurrent();
    glViewport(0, 0, size.width, size.height);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
    // A pixel's centre is at whole numbers in K's coordinates, at halves in OpenGL's.
    Eigen::Matrix4d projection = Eigen::Matrix4d::Zero();
    projection.row(0) << 2.0 * k(0, 0) / size.width, 0.0, 2.0 * (k(0, 2) + 0.5) / size.width - 1.0, 0.0;
    projection.row(1) << 0.0, 2.0 * k(1, 1) / size.height, 2.0 * (k(1, 2) + 0.5) / size.height - 1.0, 0.0;
    projection.row(2) << 0.0, 0.0, (FARTHEST + NEAREST) / (FARTHEST - NEAREST),
        -2.0 * FARTHEST * NEAREST / (FARTHEST - NEAREST);
    projection.row(3) << 0.0, 0.0, 1.0, 0.0;
    const Eigen::Matrix4d view = camera.inverse().matrix();
    glMatrixMode(GL_PROJECTION);
    glLoadMatrixd(projection.data());
    glMatrixMode(GL_MODELVIEW);
    glLoadMatrixd(view.data());
    glCallList(list);
    glFinish();
    release();
  }
};

SimulatedCamera::SimulatedCamera(const World& world, const std::vector<std::string>& groups, std::uint64_t seed)
  : quality_(world.quality),
    light_(world.light),
    size_(world.camera.width, world.camera.height),
    noise_(seed),
    pinhole_(world.camera.k),
    pinhole_size_(size_)
{
  for (const std::string& group : groups)
  {
    if (std::none_of(world.surfaces.begin(), world.surfaces.end(),
                     [&](const Surface& surface) { return surface.group == group; }))
    {
      throw std::invalid_argument("world '" + world.name + "' has no group '" + group + "'");
    }
  }
  if (!world.camera.isPinhole())
  {
    map_u_.create(size_, CV_32F);
    map_v_.create(size_, CV_32F);
    Points pixels;
    for (int v = 0; v < size_.height; ++v)
    {
      for (int u = 0; u < size_.width; ++u)
      {
        pixels.emplace_back(u, v);
      }
    }
    const Points points = world.camera.normalized(pixels);
    auto next = points.begin();
    for (int v = 0; v < size_.height; ++v)
    {
      for (int u = 0; u < size_.width; ++u)
      {
        const Eigen::Vector2d& at = *next++;
        if (!at.allFinite())
        {
          throw std::invalid_argument("the distortion of world '" + world.name + "' has no inverse within the image");
        }
        map_u_.at<float>(v, u) = static_cast<float>(pinhole_(0, 0) * at.x() + pinhole_(0, 2));
        map_v_.at<float>(v, u) = static_cast<float>(pinhole_(1, 1) * at.y() + pinhole_(1, 2));
      }
    }
    const auto extent = [](const cv::Mat& map) {
      double low = 0.0;
      double high = 0.0;
      cv::minMaxLoc(map, &low, &high);
      return std::pair(std::floor(low) - 1.0, std::ceil(high) + 1.0);
    };
    const auto [left, right] = extent(map_u_);
    const auto [top, bottom] = extent(map_v_);
    constexpr double LARGEST = 2.5;  // of the image's side
    if (right - left > LARGEST * size_.width || bottom - top > LARGEST * size_.height)
    {
      throw std::invalid_argument("the distortion of world '" + world.name + "' is too strong");
    }
    map_u_ -= left;
    map_v_ -= top;
    pinhole_(0, 2) -= left;
    pinhole_(1, 2) -= top;
    pinhole_size_ = cv::Size(static_cast<int>(right - left) + 1, static_cast<int>(bottom - top) + 1);
  }
  context_ = std::make_unique<Context>(pinhole_size_ * quality_.supersampling);
  context_->load(world, groups);
}

SimulatedCamera::~SimulatedCamera() = default;

void SimulatedCamera::setLight(const Light& light)
{
  light_ = light;
}

cv::Mat SimulatedCamera::render(const Eigen::Isometry3d& camera)
{
  // Each pixel's samples: K of an image so many times as large, whose pixels' centres lie around the pixel's.
  const double s = quality_.supersampling;
  Eigen::Matrix3d k = s * pinhole_;
  k(0, 2) += 0.5 * (s - 1.0);
  k(1, 2) += 0.5 * (s - 1.0);
  context_->draw(k, camera);
  cv::Mat grey;
  cv::extractChannel(context_->drawn(), grey, 0);
  if (quality_.supersampling > 1)
  {
    cv::resize(grey, grey, pinhole_size_, 0.0, 0.0, cv::INTER_AREA);
  }
  cv::Mat radiance;
  grey.convertTo(radiance, CV_32F);
  if (!map_u_.empty())
  {
    cv::remap(radiance, radiance, map_u_, map_v_, cv::INTER_LINEAR);
  }
  return radiance;
}

cv::Mat SimulatedCamera::capture(const Eigen::Isometry3d& camera)
{
  return capture(std::vector<Eigen::Isometry3d>{ camera });
}

cv::Mat SimulatedCamera::capture(const std::vector<Eigen::Isometry3d>& during_exposure)
{
  if (during_exposure.empty())
  {
    throw std::invalid_argument("SimulatedCamera: no pose to capture from");
  }
  cv::Mat sum;
  for (const Eigen::Isometry3d& camera : during_exposure)
  {
    const cv::Mat radiance = render(camera);
    if (sum.empty())
    {
      sum = radiance;
    }
    else
    {
      sum += radiance;
    }
  }
  sum *= light_.gain / static_cast<double>(during_exposure.size());
  if (light_.gradient != 0.0)
  {
    for (int v = 0; v < sum.rows; ++v)
    {
      auto* row = sum.ptr<float>(v);
      for (int u = 0; u < sum.cols; ++u)
      {
        row[u] *= static_cast<float>(1.0 + light_.gradient * (static_cast<double>(u) / (sum.cols - 1) - 0.5));
      }
    }
  }
  if (quality_.noise > 0.0)
  {
    cv::Mat noise(sum.size(), CV_32F);
    noise_.fill(noise, cv::RNG::NORMAL, 0.0, quality_.noise);
    sum += noise;
  }
  cv::Mat image;
  sum.convertTo(image, CV_8U, 1.0, light_.offset);
  return image;
}

}  // namespace view_servo::sim
