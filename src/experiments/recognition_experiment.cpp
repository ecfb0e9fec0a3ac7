// Copyright (c) 2026, the view_servo authors
// SPDX-License-Identifier: BSD-3-Clause
#include "experiments/recognition_experiment.h"

#include "experiments/indoor_walk.h"
#include "experiments/input_file.h"
#include "experiments/parallel.h"
#include "experiments/pictures.h"
#include "experiments/statistics.h"
#include "view_servo/features/binary_features.h"
#include "view_servo/images/image_io.h"
#include "view_servo/matching/view_index.h"
#include "view_servo/robust/quantile.h"
#include "view_servo/robust/random.h"
#include "view_servo/views/prepared_image.h"
#include "view_servo/views/view_recognizer.h"

#include <Eigen/LU>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <ostream>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace view_servo
{
namespace
{
namespace fs = std::filesystem;

constexpr std::size_t ALL = std::numeric_limits<std::size_t>::max();

/** Processor time of this process [ms]. */
double processorMs()
{
  return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

/** Darker, and darkest at the right: gain 0.78 at the left to 0.42. */
cv::Mat inOtherLight(const cv::Mat& grey)
{
  cv::Mat gains(1, grey.cols, CV_32F);
  for (int u = 0; u < grey.cols; ++u)
  {
    gains.at<float>(u) = 0.6F * (1.3F - 0.6F * static_cast<float>(u) / static_cast<float>(grey.cols));
  }
  cv::Mat result;
  cv::multiply(grey, cv::repeat(gains, grey.rows, 1), result, 1.0, CV_8U);
  return result;
}

// ------------------------------------------------------------------------------------------------------- the methods

/** Ranks named views by what they have in common with an image. */
class Ranking
{
public:
  Ranking() = default;
  virtual ~Ranking() = default;
  Ranking(const Ranking&) = delete;
  Ranking& operator=(const Ranking&) = delete;
  virtual void add(const std::string& name, const cv::Mat& grey) = 0;
  virtual std::vector<std::string> query(const cv::Mat& grey) = 0;
};

class IndexRanking : public Ranking
{
public:
  void add(const std::string& name, const cv::Mat& grey) override
  {
    index_.add(name, detectBinaryFeatures(grey, cv::Rect(), params_));
  }
  std::vector<std::string> query(const cv::Mat& grey) override
  {
    std::vector<std::string> names;
    for (const ScoredView& view : index_.query(detectBinaryFeatures(grey, cv::Rect(), params_), ALL))
    {
      names.push_back(view.name);
    }
    return names;
  }

private:
  BinaryFeatureParams params_;
  ViewIndex index_;
};

/**
 * Words of the features that the view index has: 2,000 of them, learnt from the unrelated pictures, weighed by tf-idf,
 * compared by angles.
 */
class BagOfWords : public Ranking
{
public:
  explicit BagOfWords(const cv::Mat& vocabulary) : vocabulary_(vocabulary)
  {
    cv::multiply(vocabulary, vocabulary, squares_);
    cv::reduce(squares_, squares_, 1, cv::REDUCE_SUM);
    squares_ = squares_.t();
  }

  static cv::Mat learn(const std::vector<cv::Mat>& pictures)
  {
    constexpr int WORDS = 2000;
    constexpr int SHARE = 4;  // every fourth descriptor
    cv::theRNG().state = 1;
    cv::Mat some;
    for (const cv::Mat& picture : pictures)
    {
      const cv::Mat found = describe(picture);
      for (int i = 0; i < found.rows; i += SHARE)
      {
        some.push_back(found.row(i));
      }
    }
    cv::BOWKMeansTrainer trainer(std::min(WORDS, some.rows / 2), cv::TermCriteria(cv::TermCriteria::COUNT, 6, 0.0), 1,
                                 cv::KMEANS_PP_CENTERS);
    return trainer.cluster(some);
  }

  void add(const std::string& name, const cv::Mat& grey) override
  {
    views_.emplace_back(name, histogram(grey));
  }

  std::vector<std::string> query(const cv::Mat& grey) override
  {
    if (rarities_.empty())
    {
      weigh();
    }
    cv::Mat words = histogram(grey).mul(rarities_);
    cv::normalize(words, words);
    std::vector<std::pair<double, std::string>> ranked;
    for (const auto& [name, own] : views_)
    {
      ranked.emplace_back(-own.dot(words), name);
    }
    std::sort(ranked.begin(), ranked.end());
    std::vector<std::string> names;
    names.reserve(ranked.size());
    for (const auto& [score, name] : ranked)
    {
      names.push_back(name);
    }
    return names;
  }

private:
  /** Bits of the features that the view index has, as numbers, as the means of clusters are not binary. */
  static cv::Mat describe(const cv::Mat& grey)
  {
    const std::vector<BinaryFeature> features = detectBinaryFeatures(grey, cv::Rect(), BinaryFeatureParams());
    constexpr int BITS = 8 * sizeof(BinaryWord);
    cv::Mat bits(static_cast<int>(features.size()), BITS, CV_32F);
    for (int row = 0; row < bits.rows; ++row)
    {
      const BinaryWord& word = features[static_cast<std::size_t>(row)].word;
      for (int bit = 0; bit < BITS; ++bit)
      {
        bits.at<float>(row, bit) = static_cast<float>((word[static_cast<std::size_t>(bit / 64)] >> (bit % 64)) & 1U);
      }
    }
    return bits;
  }

  cv::Mat histogram(const cv::Mat& grey) const
  {
    cv::Mat counts(1, vocabulary_.rows, CV_32F, cv::Scalar(0.0));
    const cv::Mat bits = describe(grey);
    if (!bits.empty())
    {
      const cv::Mat products = bits * vocabulary_.t();
      for (int row = 0; row < products.rows; ++row)
      {
        cv::Point nearest;
        cv::minMaxLoc(squares_ - 2.0 * products.row(row), nullptr, nullptr, &nearest);
        counts.at<float>(nearest.x) += 1.0F;
      }
    }
    return counts;
  }

  void weigh()
  {
    cv::Mat holders(1, vocabulary_.rows, CV_32F, cv::Scalar(1.0));
    for (const auto& [name, words] : views_)
    {
      cv::add(holders, 1.0, holders, words > 0.0F);
    }
    cv::log(static_cast<double>(views_.size() + 1) / holders, rarities_);
    for (auto& [name, words] : views_)
    {
      words = words.mul(rarities_);
      cv::normalize(words, words);
    }
  }

  cv::Mat vocabulary_;
  cv::Mat squares_;  // of the norms of the words
  std::vector<std::pair<std::string, cv::Mat>> views_;
  cv::Mat rarities_;
};

// ---------------------------------------------------------------------------------------------------------- the data

/** Images of places, some stored and some to be recognized, beside unrelated pictures. */
struct Places
{
  std::string set;
  std::map<std::string, cv::Mat> stored;
  struct Query
  {
    cv::Mat image;
    std::set<std::string> right;    ///< stored views that show the place
    std::set<std::string> ignored;  ///< that may show some of it: they are neither right nor wrong
  };
  std::vector<Query> queries;
};

/** Share of an image's points, at depths that rooms have, that another camera sees. */
double shareSeen(const IndoorWalk& walk, const Eigen::Isometry3d& reference, const Eigen::Isometry3d& current,
                 const cv::Size& size)
{
  constexpr int COLUMNS = 12;
  constexpr int ROWS = 8;
  const Eigen::Isometry3d current_from_reference = current.inverse() * reference;
  const cv::Rect2d frame(0.0, 0.0, size.width, size.height);
  int seen = 0;
  int all = 0;
  for (int i = 0; i < ROWS * COLUMNS; ++i)
  {
    const int column = i % COLUMNS;
    const int row = i / COLUMNS;
    const Eigen::Vector2d at((column + 0.5) * size.width / COLUMNS, (row + 0.5) * size.height / ROWS);
    for (const double depth : { 2.0, 3.0, 4.5 })
    {
      const Eigen::Vector3d point = current_from_reference * (depth * (walk.camera.k.inverse() * at.homogeneous()));
      const Eigen::Vector2d pixel = (walk.camera.k * point).hnormalized();
      all += 1;
      seen += point.z() > 0.0 && frame.contains({ pixel.x(), pixel.y() }) ? 1 : 0;
    }
  }
  return static_cast<double>(seen) / all;
}

/** The walk: each fifth image is stored, others are queries; and its pairs of wide baseline, one view stored each. */
std::vector<Places> walkPlaces(const fs::path& data)
{
  constexpr std::size_t STEP = 5;
  constexpr double SAME = 0.3;  // of each image is seen in the other one
  const IndoorWalk walk = readIndoorWalk(data);
  std::map<std::string, cv::Mat> images;
  for (const auto& [name, pose] : walk.poses)
  {
    images[name] = readGreyImage((data / "hololens_indoor" / "images" / name).string());
  }
  const auto overlap = [&](const std::string& a, const std::string& b) {
    return std::min(shareSeen(walk, walk.poses.at(a), walk.poses.at(b), images.at(a).size()),
                    shareSeen(walk, walk.poses.at(b), walk.poses.at(a), images.at(b).size()));
  };
  Places along{ "hololens_indoor", {}, {} };
  std::size_t number = 0;
  for (const auto& [name, image] : images)
  {
    if (number++ % STEP == 0)
    {
      along.stored[name] = image;
    }
  }
  Places wide{ "hololens_indoor, wide baselines", {}, {} };
  for (const auto& [name, image] : images)
  {
    if (along.stored.count(name) == 0)
    {
      Places::Query query{ image, {}, {} };
      for (const auto& [stored, stored_image] : along.stored)
      {
        const double share = overlap(stored, name);
        if (share >= SAME)
        {
          query.right.insert(stored);
        }
        else if (share > 0.0)
        {
          query.ignored.insert(stored);
        }
      }
      if (!query.right.empty())
      {
        along.queries.push_back(query);
      }
    }
  }
  for (const IndoorWalk::Pair& pair : walk.pairs)
  {
    wide.stored[pair.reference] = images.at(pair.reference);
  }
  for (const IndoorWalk::Pair& pair : walk.pairs)
  {
    Places::Query query{ images.at(pair.current), { pair.reference }, { pair.current } };
    for (const auto& [stored, image] : wide.stored)
    {
      if (stored != pair.reference && overlap(stored, pair.current) > 0.0)
      {
        query.ignored.insert(stored);
      }
    }
    wide.queries.push_back(query);
  }
  return { along, wide };
}

/** A corridor driven twice: the first drive is stored. */
Places corridor(const fs::path& data)
{
  const fs::path folder = data / "vpr_corridor";
  const auto files = [&](const std::string& part) {
    std::vector<fs::path> found;
    for (const auto& entry : findPictures(folder / part))
    {
      found.insert(found.end(), entry.second.begin(), entry.second.end());
    }
    std::sort(found.begin(), found.end());
    return found;
  };
  Places places{ "vpr_corridor", {}, {} };
  const std::vector<fs::path> stored = files("ref");
  const std::vector<fs::path> queries = files("query");
  for (const fs::path& file : stored)
  {
    places.stored[file.filename().string()] = readGreyImage(file.string());
  }
  std::ifstream truth = openForReading(folder / "truth.txt");
  std::string line;
  while (std::getline(truth, line))
  {
    std::istringstream words(line);
    std::size_t number = 0;
    char colon = ' ';
    if (line.front() == '#' || !(words >> number >> colon))
    {
      continue;
    }
    Places::Query query{ readGreyImage(queries.at(number).string()), {}, {} };
    for (std::size_t right = 0; words >> right;)
    {
      query.right.insert(stored.at(right).filename().string());
    }
    places.queries.push_back(query);
  }
  return places;
}

/** Pictures of other scenes; all of one size or more. */
std::vector<cv::Mat> unrelatedPictures(const fs::path& data)
{
  constexpr int LEAST = 320;  // [px]
  std::vector<cv::Mat> pictures;
  for (const auto& [scene, files] : findPictures(data))
  {
    for (const fs::path& file : files)
    {
      const std::string path = file.string();
      if (path.find("hololens_indoor") == std::string::npos && path.find("vpr_corridor") == std::string::npos)
      {
        const cv::Mat picture = readGreyImage(path);
        if (std::min(picture.cols, picture.rows) >= LEAST)
        {
          pictures.push_back(picture);
        }
      }
    }
  }
  if (pictures.empty())
  {
    throw std::runtime_error("there are no pictures beside hololens_indoor in " + data.string());
  }
  return pictures;
}

/** A part of a picture, turned, larger or smaller, darker or brighter, with noise: all by chance. */
cv::Mat changed(const cv::Mat& picture, Rng& rng)
{
  const cv::Size size(540, 360);
  const double least =
      std::max(static_cast<double>(size.width) / picture.cols, static_cast<double>(size.height) / picture.rows);
  const double scale = least * uniform(rng, 1.0, 1.6);
  const cv::Point2f middle(static_cast<float>(uniform(rng, 0.4, 0.6) * picture.cols),
                           static_cast<float>(uniform(rng, 0.4, 0.6) * picture.rows));
  cv::Mat motion = cv::getRotationMatrix2D(middle, uniform(rng, -5.0, 5.0), scale);
  motion.at<double>(0, 2) += 0.5 * size.width - middle.x;
  motion.at<double>(1, 2) += 0.5 * size.height - middle.y;
  cv::Mat result;
  cv::warpAffine(picture, result, motion, size, cv::INTER_LINEAR, cv::BORDER_REFLECT);
  cv::Mat noise(size, CV_16SC1);
  cv::RNG(rng()).fill(noise, cv::RNG::NORMAL, 0.0, 3.0);
  result.convertTo(result, CV_8U, uniform(rng, 0.6, 1.2));
  cv::add(result, noise, result, cv::noArray(), CV_8U);
  return result;
}

// ---------------------------------------------------------------------------------------------------- what is counted

class Table
{
public:
  explicit Table(std::ostream& csv) : csv_(csv)
  {
    csv_ << "measure,set,method,light,count,value\n";
  }
  void add(const std::string& measure, const std::string& set, const std::string& method, const std::string& light,
           std::size_t count, double value)
  {
    csv_ << measure << ",\"" << set << "\"," << method << ',' << light << ',' << count << ',' << value << std::endl;
    std::cout << set << ", " << method << (light.empty() ? "" : ", " + light) << ": " << measure << ' ' << value
              << " of " << count << std::endl;
  }

private:
  std::ostream& csv_;
};

/** Place of the first right view among those that count; ALL when there is none. */
std::size_t rankOf(const std::vector<std::string>& names, const Places::Query& query)
{
  std::size_t rank = 0;
  for (const std::string& name : names)
  {
    if (query.right.count(name) != 0)
    {
      return rank;
    }
    rank += query.ignored.count(name) != 0 ? 0 : 1;
  }
  return ALL;
}

using MakeRanking = std::function<std::unique_ptr<Ranking>()>;

void measureRecall(const Places& places, const std::vector<cv::Mat>& unrelated, const std::string& method,
                   const MakeRanking& make, Table& table)
{
  const std::unique_ptr<Ranking> ranking = make();
  for (const auto& [name, image] : places.stored)
  {
    ranking->add(name, image);
  }
  for (std::size_t i = 0; i < unrelated.size(); ++i)
  {
    ranking->add("unrelated " + std::to_string(i), unrelated[i]);
  }
  for (const bool other_light : { false, true })
  {
    std::vector<std::size_t> ranks;
    std::vector<double> ms;
    for (const Places::Query& query : places.queries)
    {
      const cv::Mat image = other_light ? inOtherLight(query.image) : query.image;
      const double begin = processorMs();
      const std::vector<std::string> names = ranking->query(image);
      ms.push_back(processorMs() - begin);
      ranks.push_back(rankOf(names, query));
    }
    const std::string light = other_light ? "changed" : "same";
    for (const std::size_t most : { 1U, 5U, 10U })
    {
      const auto found = std::count_if(ranks.begin(), ranks.end(), [=](std::size_t rank) { return rank < most; });
      table.add("recall@" + std::to_string(most), places.set, method, light, ranks.size(),
                static_cast<double>(found) / static_cast<double>(ranks.size()));
    }
    table.add("query with features [ms]", places.set, method, light, ranks.size(), medianOf(ms));
  }
}

/** Views held in memory, as a recognizer's source. */
ViewSource heldViews(const std::map<std::string, cv::Mat>& images)
{
  const auto revisions = [&images] {
    std::map<std::string, std::string> all;
    for (const auto& [name, image] : images)
    {
      all[name] = "1";
    }
    return all;
  };
  const auto load = [&images](const std::string& name) {
    StoredView view;
    view.name = name;
    view.image = images.at(name);
    return view;
  };
  const auto structure = [](const std::string& /*name*/, const std::string& /*revision*/) {
    return ViewStructure();
  };
  return { {}, revisions, load, structure };
}

/** The walk's queries and changed pictures of unknown scenes, each verified. */
void measureVerification(const Places& places, const std::vector<cv::Mat>& unrelated, const ExperimentContext& context,
                         Table& table)
{
  std::map<std::string, cv::Mat> stored = places.stored;
  for (std::size_t i = 0; i < unrelated.size(); ++i)
  {
    stored["unrelated " + std::to_string(i)] = unrelated[i];
  }
  ViewRecognizer recognizer(heldViews(stored), ViewRecognizerParams());
  recognizer.update(ALL);
  const std::size_t queries = context.brief ? std::min<std::size_t>(4, places.queries.size()) : places.queries.size();
  for (const bool other_light : { false, true })
  {
    std::vector<int> right(queries, 0);
    std::vector<int> wrong(queries, 0);
    inParallel(queries, context.threads, [&](std::size_t i) {
      const Places::Query& query = places.queries[i];
      const PreparedImage image(other_light ? inOtherLight(query.image) : query.image, cv::Rect(),
                                recognizer.features());
      for (const CandidateView& view : recognizer.recognize(image, 1, true))
      {
        const bool known = query.ignored.count(view.name) != 0;
        right[i] += view.verified && query.right.count(view.name) != 0 ? 1 : 0;
        wrong[i] += view.verified && !known && query.right.count(view.name) == 0 ? 1 : 0;
      }
    });
    const std::string light = other_light ? "changed" : "same";
    const auto share = [&](const std::vector<int>& values) {
      return static_cast<double>(std::count(values.begin(), values.end(), 1)) / static_cast<double>(queries);
    };
    table.add("verified right", places.set, "view recognizer", light, queries, share(right));
    table.add("verified wrong", places.set, "view recognizer", light, queries, share(wrong));
  }

  // Only the walk is stored: nothing that the pictures show is known.
  ViewRecognizer walk(heldViews(places.stored), ViewRecognizerParams());
  walk.update(ALL);
  const auto unknown = static_cast<std::size_t>(context.runsOf(UNKNOWN_PICTURES));
  std::vector<int> wrong(unknown, 0);
  inParallel(unknown, context.threads, [&](std::size_t i) {
    Rng rng(context.seedOf(UNKNOWN_PICTURES, i));
    const cv::Mat picture = changed(unrelated[uniformIndex(rng, unrelated.size())], rng);
    const PreparedImage image(picture, cv::Rect(), walk.features());
    const std::vector<CandidateView> views = walk.recognize(image, 1, true);
    wrong[i] = !views.empty() && views.front().verified ? 1 : 0;
  });
  table.add("verified wrong", "unknown pictures", "view recognizer", "changed", unknown,
            static_cast<double>(std::count(wrong.begin(), wrong.end(), 1)) / static_cast<double>(unknown));
}

/** Changed pictures as views: what one more, and a query, cost among many. */
void measureCost(const std::vector<cv::Mat>& pictures, const ExperimentContext& context, Table& table)
{
  constexpr std::size_t QUERIES = 40;
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  Rng rng(context.seedOf(UNKNOWN_PICTURES, 1000003));
  const BinaryFeatureParams params;
  ViewIndex index;
  std::vector<double> add_ms;
  std::vector<double> detection_ms;
  const auto detect = [&] {
    const cv::Mat picture = changed(pictures[uniformIndex(rng, pictures.size())], rng);
    const double begin = processorMs();
    std::vector<BinaryFeature> features = detectBinaryFeatures(picture, cv::Rect(), params);
    detection_ms.push_back(processorMs() - begin);
    return features;
  };
  for (const std::size_t size :
       context.brief ? std::vector<std::size_t>{ 100 } : std::vector<std::size_t>{ 100, 1000, 10000 })
  {
    add_ms.clear();
    while (index.size() < size)
    {
      const std::vector<BinaryFeature> features = detect();
      const double begin = processorMs();
      index.add("view " + std::to_string(index.size()), features);
      add_ms.push_back(processorMs() - begin);
    }
    std::vector<double> query_ms;
    for (std::size_t i = 0; i < QUERIES; ++i)
    {
      const std::vector<BinaryFeature> features = detect();
      const double begin = processorMs();
      index.query(features, 10);
      query_ms.push_back(processorMs() - begin);
    }
    table.add("features [ms]", "cost", "view index", "", size, mean(detection_ms));
    table.add("add [ms]", "cost", "view index", "", size, mean(add_ms));
    table.add("query [ms]", "cost", "view index", "", size, mean(query_ms));
    table.add("memory [kB a view]", "cost", "view index", "", size,
              1e-3 * static_cast<double>(index.memory()) / static_cast<double>(size));
  }
  std::stringstream file;
  index.save(file);
  const double begin = processorMs();
  ViewIndex().load(file);
  table.add("load [ms]", "cost", "view index", "", index.size(), processorMs() - begin);
  cv::setNumThreads(threads);
}

}  // namespace

void runRecognitionExperiment(const ExperimentContext& context, std::ostream& csv)
{
  Table table(csv);
  std::vector<cv::Mat> unrelated = unrelatedPictures(context.data);
  std::vector<Places> sets = walkPlaces(context.data);
  sets.push_back(corridor(context.data));
  if (context.brief)
  {
    unrelated.resize(std::min<std::size_t>(unrelated.size(), 10));
    sets.resize(1);
  }
  const cv::Mat vocabulary = BagOfWords::learn(unrelated);
  for (const Places& places : sets)
  {
    measureRecall(
        places, unrelated, "view index", [] { return std::make_unique<IndexRanking>(); }, table);
    measureRecall(
        places, unrelated, "ORB words", [&] { return std::make_unique<BagOfWords>(vocabulary); }, table);
  }
  measureCost(unrelated, context, table);
  measureVerification(sets.front(), unrelated, context, table);
}

}  // namespace view_servo
