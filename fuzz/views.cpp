// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/views/view_store.h"

#include <cstdio>
#include <stdexcept>

using namespace view_servo;

namespace
{
/** FNV-1a, 64 bits, in hexadecimal, as the store writes it. */
std::string checksum(const std::string& bytes)
{
  std::uint64_t sum = 0xcbf29ce484222325ULL;
  for (const char byte : bytes)
  {
    sum = (sum ^ static_cast<unsigned char>(byte)) * 0x100000001b3ULL;
  }
  char text[17];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(sum));
  return text;
}

/** A store whose one view has a good image; inputs name it fuzz.IMAGE.png, as PNG encoders differ. */
class Store
{
public:
  Store() : store_(directory_.path())
  {
    StoredView view;
    view.name = "fuzz";
    view.image = cv::Mat(MIN_SIDE, MIN_SIDE, CV_8UC1, cv::Scalar(90));
    store_.save(view, true);
    for (const auto& entry : std::filesystem::directory_iterator(directory_.path()))
    {
      if (entry.path().extension() == ".png")
      {
        image_ = entry.path().filename().string();
      }
    }
  }

  void read(std::string yaml) const
  {
    constexpr char PLACE[] = "fuzz.IMAGE.png";
    const std::size_t at = yaml.find(PLACE);
    if (at != std::string::npos)
    {
      yaml.replace(at, sizeof(PLACE) - 1, image_);
    }
    // With the checksum that belongs to it, as else nothing behind the check would be reached.
    directory_.write("fuzz.yaml", yaml + "checksum: " + checksum(yaml) + "\n");
    fuzz::readOrRefuse<ViewStoreError>([&] {
      const StoredView view = store_.load("fuzz");
      fuzz::require(view.image.type() == CV_8UC1, "an image is grey");
      const cv::Rect all(cv::Point(), view.image.size());
      fuzz::require(view.region.empty() || (view.region & all) == view.region, "a region is in the image");
    });
    for (const ViewStore::Damaged& damaged : store_.list().damaged)
    {
      fuzz::requireReason(damaged.reason);
    }
  }

private:
  static constexpr int MIN_SIDE = 32;  // [px]

  fuzz::Directory directory_;
  ViewStore store_;
  std::string image_;
};
}  // namespace

/** The yaml file of a stored view, without its checksum. */
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
  static const Store store;
  store.read(fuzz::toString(data, size));
  return 0;
}
