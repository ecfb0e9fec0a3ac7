// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "tools/find_view.h"

#include "tools/command_line.h"
#include "tools/json_text.h"
#include "tools/stopwatch.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_recognizer.h"
#include "view_servo/views/view_store.h"

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include <cstddef>
#include <filesystem>
#include <iostream>
#include <limits>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

namespace view_servo
{
namespace
{
/** Views of a ViewStore when there are any, else the image files. */
ViewSource viewsIn(const std::string& directory)
{
  std::error_code missing;
  if (!std::filesystem::is_directory(directory, missing))
  {
    throw std::runtime_error("'" + directory + "' is no folder: DIR holds stored views or image files");
  }
  const ViewStore store(directory);
  return store.revisions().empty() ? imageFiles(directory) : storedViews(store);
}

nlohmann::json resultOf(const CandidateView& view)
{
  return { { "view", view.name },
           { "score", view.score },
           { "verified", view.verified },
           { "inliers", view.inliers },
           { "log_significance", view.log_significance } };
}

void printText(const std::vector<CandidateView>& views, std::size_t indexed)
{
  if (views.empty())
  {
    std::cout << "none of " << indexed << " views has anything in common with the image\n";
  }
  for (const CandidateView& view : views)
  {
    std::cout << view.name << ": score " << view.score;
    if (view.verified)
    {
      std::cout << ", verified by " << view.inliers << " matches, significance " << view.log_significance;
    }
    else
    {
      std::cout << ", not verified";
    }
    std::cout << '\n';
  }
}

}  // namespace

bool findView(const FindOptions& options)
{
  const Stopwatch stopwatch;
  const auto params = paramsWith<ViewRecognizerParams>(options.settings);
  if (const std::vector<std::string> faults = params.validate(); !faults.empty())
  {
    throw std::runtime_error("--set: " + faults.front());
  }
  ViewRecognizer recognizer(viewsIn(options.directory), params);
  const PreparedImage current(readImage(options.current), cv::Rect(), recognizer.features());
  recognizer.loadIndex();  // without one, update() reads all views
  const ViewRecognizer::Update update = [&] {
    const QuietStandardError quiet;
    return recognizer.update(std::numeric_limits<std::size_t>::max());
  }();
  if (recognizer.size() == 0)
  {
    throw std::runtime_error("'" + options.directory + "' holds no stored view and no image file that can be read" +
                             (update.unreadable.empty() ? "" : ": " + update.unreadable.front()));
  }
  const double indexed_ms = stopwatch.elapsedMs();
  const std::vector<CandidateView> views = recognizer.recognize(current, static_cast<std::size_t>(options.most), true);
  const bool found = !views.empty() && views.front().verified;
  if (options.json)
  {
    nlohmann::json json = { { "success", found },
                            { "message", found ? "the image shows " + views.front().name : "no view is verified" },
                            { "indexed", recognizer.size() },
                            { "unreadable", update.unreadable },
                            { "elapsed_ms",
                              { { "total", stopwatch.elapsedMs() },
                                { "index", indexed_ms },
                                { "recognition", stopwatch.elapsedMs() - indexed_ms } } },
                            { "views", nlohmann::json::array() } };
    for (const CandidateView& view : views)
    {
      json["views"].push_back(resultOf(view));
    }
    std::cout << jsonText(json) << '\n';
  }
  else
  {
    for (const std::string& reason : update.unreadable)
    {
      std::cout << "left out: " << reason << '\n';
    }
    printText(views, recognizer.size());
  }
  return found;
}

}  // namespace view_servo
