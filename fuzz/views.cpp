// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "fuzz.h"

#include "view_servo/views/view_store.h"

#include <stdexcept>

using namespace view_servo;

namespace
{
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
    directory_.write("fuzz.yaml", fuzz::withChecksum(yaml));
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
