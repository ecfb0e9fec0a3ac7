// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "view_servo/views/view_recognizer.h"

#include "stored_files.h"
#include "view_servo/images/image_io.h"
#include "view_servo/parameters/error_text.h"
#include "view_servo/parameters/faults.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

constexpr char INDEX_FILE[] = "views.index";

bool isImageFile(const fs::path& file)
{
  static const std::set<std::string> endings{ ".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff" };
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return endings.count(ending) != 0;
}

/** Changes whenever the file is written. */
std::string stateOf(const fs::directory_entry& file)
{
  return std::to_string(file.file_size()) + "-" + std::to_string(file.last_write_time().time_since_epoch().count());
}

}  // namespace

std::vector<Parameter> recognitionParameters(ViewRecognizerParams& params)
{
  return joined({
      { integer("candidates", params.candidates, "", "[1, 1000]", "most likely views, which are verified") },
      prefixed("index_", joined({ parameters(params.features), parameters(params.index) })),
  });
}

std::vector<Parameter> parameters(ViewRecognizerParams& params)
{
  return joined({ recognitionParameters(params), parameters(params.matching) });
}

std::vector<std::string> ViewRecognizerParams::validate() const
{
  ViewRecognizerParams copy = *this;
  Faults faults;
  faults.add(faultsOf(recognitionParameters(copy)));
  faults.add(matching.validate());
  return faults.list();
}

ViewSource storedViews(const ViewStore& store)
{
  struct Listed
  {
    std::mutex mutex;
    std::optional<fs::file_time_type> changed;  // when the directory had changed last; empty: list it again
    std::map<std::string, std::string> revisions;
  };
  const auto listed = std::make_shared<Listed>();
  const auto revisions = [store, listed] {
    // Each change of a store renames or removes a file, by which the directory's time changes. It is believed once it
    // is so old that a change after the listing has another time.
    constexpr std::chrono::seconds SETTLED(2);
    const std::lock_guard<std::mutex> lock(listed->mutex);
    std::error_code missing;
    const fs::file_time_type changed = fs::last_write_time(store.directory(), missing);
    if (missing || listed->changed != changed)
    {
      const fs::file_time_type now = fs::file_time_type::clock::now();
      listed->revisions = store.revisions();
      listed->changed = std::nullopt;
      if (!missing && now - changed > SETTLED)
      {
        listed->changed = changed;
      }
    }
    return listed->revisions;
  };
  const auto load = [store](const std::string& name) {
    return store.load(name);
  };
  const auto structure = [store](const std::string& name, const std::string& revision) {
    return store.revision(name) == revision ? store.loadStructure(name) : ViewStructure();
  };
  return { store.directory(), revisions, load, structure };
}

ViewSource imageFiles(const fs::path& directory)
{
  const auto revisions = [directory] {
    std::map<std::string, std::string> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(directory))
    {
      if (isImageFile(entry.path()) && entry.is_regular_file())
      {
        files[entry.path().filename().string()] = stateOf(entry);
      }
    }
    return files;
  };
  const auto load = [directory](const std::string& name) {
    StoredView view;
    view.name = name;
    view.image = readGreyImage((directory / name).string());
    return view;
  };
  const auto structure = [](const std::string& /*name*/, const std::string& /*revision*/) {
    return ViewStructure();
  };
  return { directory, revisions, load, structure };
}

ViewRecognizer::ViewRecognizer(ViewSource source, const ViewRecognizerParams& params)
  : params_((requireNoFaults("parameters of the view recognizer", params.validate()), params)),
    source_(std::move(source)),
    matcher_(params.matching),
    index_(params.index)
{
}

std::size_t ViewRecognizer::size() const
{
  const std::lock_guard<std::mutex> lock(mutex_);
  return index_.size();
}

ViewRecognizer::Update ViewRecognizer::update(std::size_t most, std::chrono::steady_clock::time_point now)
{
  const std::lock_guard<std::mutex> updating(update_mutex_);
  const std::map<std::string, std::string> wanted = source_.revisions();
  if (wanted.empty() && size() > 0 && !fs::exists(source_.directory))
  {
    throw std::runtime_error("the directory " + source_.directory.string() + " is not there any more");
  }
  Update update;
  std::vector<std::pair<std::string, std::string>> to_read;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (auto known = revisions_.begin(); known != revisions_.end();)
    {
      if (wanted.count(known->first) == 0)
      {
        index_.remove(known->first);
        known = revisions_.erase(known);
        update.removed += 1;
      }
      else
      {
        ++known;
      }
    }
    for (auto known = unreadable_.begin(); known != unreadable_.end();)
    {
      known = wanted.count(known->first) == 0 ? unreadable_.erase(known) : std::next(known);
    }
    for (const auto& [name, revision] : wanted)
    {
      const auto known = revisions_.find(name);
      const auto unreadable = unreadable_.find(name);
      const bool is_known = known != revisions_.end() && known->second == revision && doubtful_.count(name) == 0;
      const bool is_given_up =
          unreadable != unreadable_.end() && unreadable->second.revision == revision && now < unreadable->second.next;
      if (!is_known && !is_given_up)
      {
        to_read.emplace_back(name, revision);
      }
    }
    update.waiting = to_read.size() - std::min(most, to_read.size());
    to_read.resize(to_read.size() - update.waiting);
    for (const auto& [name, revision] : to_read)
    {
      doubtful_.erase(name);
    }
    for (auto doubtful = doubtful_.begin(); doubtful != doubtful_.end();)
    {
      doubtful = wanted.count(*doubtful) == 0 ? doubtful_.erase(doubtful) : std::next(doubtful);
    }
  }
  for (const auto& [name, revision] : to_read)
  {
    try
    {
      const StoredView view = source_.load(name);
      const std::vector<BinaryFeature> features = detectBinaryFeatures(view.image, view.region, params_.features);
      const std::lock_guard<std::mutex> lock(mutex_);
      index_.add(name, features);
      revisions_[name] = revision;
      unreadable_.erase(name);
      update.added += 1;
    }
    catch (const std::exception& error)
    {
      // Perhaps its picture is still on its way: the text file, which comes with it, will not change any more.
      constexpr std::chrono::seconds UNTIL_NEXT(30);
      const std::lock_guard<std::mutex> lock(mutex_);
      update.removed += revisions_.erase(name);
      index_.remove(name);
      Unreadable& unreadable = unreadable_[name];
      const std::string reason = oneLine(error);
      if (unreadable.reason != reason)
      {
        update.unreadable.push_back(reason);
      }
      unreadable = { revision, reason, now + UNTIL_NEXT };
    }
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  update.unusable = unreadable_.size();
  return update;
}

ViewRecognizer::Prepared::Prepared(StoredView&& stored, std::string stored_revision, const FeatureParams& features)
  : revision(std::move(stored_revision)), image(stored.image, stored.region, features), view(std::move(stored))
{
  view.image = cv::Mat();
}

std::shared_ptr<const ViewRecognizer::Prepared> ViewRecognizer::prepared(const std::string& name) const
{
  std::string revision;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto known = revisions_.find(name);
    if (known == revisions_.end())
    {
      return nullptr;
    }
    revision = known->second;
    const auto found = std::find_if(prepared_.begin(), prepared_.end(), [&](const auto& entry) {
      return entry->view.name == name && entry->revision == revision;
    });
    if (found != prepared_.end())
    {
      prepared_.splice(prepared_.begin(), prepared_, found);
      return prepared_.front();
    }
  }
  std::shared_ptr<const Prepared> entry;
  try
  {
    StoredView view = source_.load(name);
    view.name = name;
    entry = std::make_shared<const Prepared>(std::move(view), std::move(revision), features());
  }
  catch (const std::exception&)
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    doubtful_.insert(name);  // update() will say why
    return nullptr;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  prepared_.push_front(entry);
  if (prepared_.size() > static_cast<std::size_t>(params_.candidates))
  {
    prepared_.pop_back();
  }
  return entry;
}

std::optional<StructurePose> ViewRecognizer::poseIn(const Prepared& reference, const ViewMatch& match,
                                                    const Camera& camera) const
{
  try
  {
    return structurePose(match, reference.view, source_.structure(reference.view.name, reference.revision), camera);
  }
  catch (const std::exception&)
  {
    return std::nullopt;  // damaged, or removed meanwhile: as if nothing were known
  }
}

std::vector<CandidateView> ViewRecognizer::recognize(const PreparedImage& image, std::size_t most, bool verify,
                                                     const std::function<bool()>& given_up,
                                                     const std::optional<Camera>& camera) const
{
  const bool is_calibrated = camera && camera->fault().empty();
  const std::vector<BinaryFeature> features = detectBinaryFeatures(image.grey(), image.region(), params_.features);
  const auto candidates = static_cast<std::size_t>(params_.candidates);
  std::vector<ScoredView> likely;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    likely = index_.query(features, verify ? std::max(most, candidates) : most);
  }
  std::vector<CandidateView> views;
  std::size_t verified = 0;
  for (const ScoredView& candidate : likely)
  {
    CandidateView view;
    view.name = candidate.name;
    view.score = candidate.score;
    const bool over = verified >= most || views.size() >= candidates || (given_up && given_up());
    const std::shared_ptr<const Prepared> reference = verify && !over ? prepared(candidate.name) : nullptr;
    if (reference)
    {
      const ViewMatch match = matcher_.match(reference->image, image, GeometryModel::FUNDAMENTAL, given_up);
      if (match.outcome == MatchOutcome::MATCHED)
      {
        view.verified = true;
        view.inliers = match.inliers;
        view.log_significance = match.log_significance;
        view.pose = is_calibrated ? poseIn(*reference, match, *camera) : std::nullopt;
        verified += 1;
      }
    }
    views.push_back(std::move(view));
  }
  std::stable_partition(views.begin(), views.end(), [](const CandidateView& view) { return view.verified; });
  views.resize(std::min(most, views.size()));
  return views;
}

// ---------------------------------------------------------------------------------------------------- the index's file

fs::path ViewRecognizer::indexFile() const
{
  return source_.directory / INDEX_FILE;
}

/** What has to be the same for a saved index to be of use. */
std::string ViewRecognizer::header() const
{
  ViewRecognizerParams copy = params_;
  std::string text = "view_servo views.index 1";
  for (const Parameter& parameter : parameters(copy.features))
  {
    text += " " + parameter.name + " " + parameter.get();
  }
  return text;
}

void ViewRecognizer::saveIndex() const
{
  const fs::path file = indexFile();
  try
  {
    std::ostringstream stream;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stream << header() << '\n' << revisions_.size() << '\n';
      for (const auto& [name, revision] : revisions_)
      {
        stream << revision << ' ' << name << '\n';
      }
      index_.save(stream);
    }
    const DirectoryLock lock(source_.directory);
    replaceFile(file, stream.str());
  }
  catch (const std::exception& error)
  {
    throw std::runtime_error("the index " + file.string() + " is not saved: " + oneLine(error));
  }
}

std::string ViewRecognizer::loadIndex()
{
  const std::lock_guard<std::mutex> updating(update_mutex_);
  const fs::path file = indexFile();
  try
  {
    if (!fs::is_regular_file(file))
    {
      return "there is no index " + file.string();
    }
    std::ifstream stream(file, std::ios::binary);
    std::string line;
    if (!std::getline(stream, line) || line != header())
    {
      throw std::runtime_error("it is of another version or was made with other parameters");
    }
    std::size_t count = 0;
    stream >> count;
    std::map<std::string, std::string> revisions;
    for (std::size_t i = 0; i < count && stream; ++i)
    {
      std::string revision;
      std::string name;
      stream >> revision;
      stream.get();
      std::getline(stream, name);
      revisions[name] = revision;
    }
    if (count == 0)
    {
      stream.get();
    }
    ViewIndex index(params_.index);
    index.load(stream);
    const auto agrees = [&](const auto& view) {
      return index.contains(view.first);
    };
    if (revisions.size() != index.size() || !std::all_of(revisions.begin(), revisions.end(), agrees))
    {
      throw std::runtime_error("it is damaged");
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    index_ = std::move(index);
    revisions_ = std::move(revisions);
    return "";
  }
  catch (const std::exception& error)
  {
    return "the index " + file.string() + " is made anew: " + oneLine(error);
  }
}

}  // namespace view_servo
