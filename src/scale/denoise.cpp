// SPDX-License-Identifier: Apache-2.0
#include "scale/denoise.hpp"

#include <algorithm>
#include <future>
#include <limits>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include "seam/outlier_tally.hpp"
#include "tiles/choice.hpp"
#include "tiles/tile_run.hpp"

namespace pointfair::scale {
namespace {

// Who has moved in the first iteration has not kept its place.
PointsHeader header_of(const Counts& counts, const std::optional<Counts>& first_counts) {
  PointsHeader header{.counts = {first_counts.value_or(counts)}};
  header.counts.points.short_neighborhoods = counts.short_neighborhoods;
  return header;
}

// A stored point that moved as far as one did that was `before` relative to another origin.
Point moved(const Point& stored, const Point& before, const Point& now) {
  const auto along = [](float s, float b, float n) { return s == b ? n : n == b ? s : float(s + (double(n) - b)); };
  if (!is_indexed(now)) return now;
  return {along(stored.x, before.x, now.x), along(stored.y, before.y, now.y), along(stored.z, before.z, now.z)};
}

// A tile on its way to its file. One call after the other, each on any thread.
class Tile final : private PointStore {
 public:
  Tile(const TileWork& work, std::stop_token stop)
      : work_(work),
        stop_(std::move(stop)),
        leaves_(work.input.leaves_of(work.leaves)),
        origins_(origins_of(work, leaves_)) {
    if (work.input.count_of(leaves_) > std::numeric_limits<std::uint32_t>::max())
      throw Error(ErrorKind::memory, "a tile has too many points; plan with less --memory, or more --tiles");
  }

  // The tile and what is likely to be needed around it.
  void read() {
    if (origins_.empty()) return;
    enter(origins_.front());
    if (!has_points()) return;
    const double halo = first_halo(seen_->bounds(), stages_, bounds_);  // as run_tiles() begins
    fits_ = load(region_around(seen_->bounds(), bounds_, halo), ahead_.numbers, ahead_.known_copies);
  }

  void compute(Backend& backend) {
    TileWorker worker(backend);
    const ForEach for_each = backend.sampling().on_host();
    results_ = own_;  // outliers of iterations before stay as they are
    find_known_copies();
    if (work_.input.zones().are_several()) work_.input.read_stored(leaves_, &results_, nullptr);
    for (const Position& origin : origins_) {
      if (origin != origins_.front()) enter(origin);
      if (!has_points()) continue;
      const point::Cell all{{-kUnbounded, -kUnbounded, -kUnbounded}, {kUnbounded, kUnbounded, kUnbounded}};
      const auto run = [&](const FramedSettings& stages) {
        return run_tiles({.store = *this, .stages = stages, .for_each = for_each, .least_split = kLeastTile},
                         {&worker, 1}, {{all, {}, bounds_}}, stop_);
      };
      if (stages_.fairing.pull_outliers && !stages_.fairing.is_further) {  // who is pulled in is not told apart
        FramedSettings leaving = stages_;
        leaving.fairing.pull_outliers = false;
        only_counts_ = true;
        run(leaving);
        only_counts_ = false;
      }
      add(counts_, run(stages_));
    }
    counts_.pulled = pulled_.counts();
    seen_.reset();
    own_ = {};
    loaded_ = {};
  }

  void write() {
    std::vector<std::uint64_t> indices;
    work_.input.read_stored(leaves_, nullptr, &indices);
    work_.chunks ? write_by_chunk(indices) : write_by_leaf(indices);
    results_ = {};
  }

 private:
  // Those of the zones that have points of the tile. The points of each are computed by themselves.
  static std::vector<Position> origins_of(const TileWork& work, const LeafRange& leaves) {
    if (!work.input.zones().are_several()) return {work.input.zones().origin};
    std::set<Position> origins;
    for (std::uint32_t leaf = leaves.begin; leaf < leaves.end; ++leaf) origins.insert(work.input.origin_for(leaf));
    return {origins.begin(), origins.end()};
  }

  void enter(const Position& origin) {
    seen_.emplace(work_.input.seen_from(origin));
    stages_ = relative_to(origin, work_.stages, seen_->zones());
    bounds_ = kNoBounds;
    seen_->read(leaves_, own_);
    auto at = own_.begin();
    for (std::uint32_t leaf = leaves_.begin; leaf < leaves_.end; ++leaf) {
      const Bounds& its = seen_->leaves()[leaf];
      const auto begin = std::exchange(at, at + std::ptrdiff_t(its.valid));
      if (seen_->origin_for(leaf) == origin)
        unite(bounds_, its);
      else  // only lie around the others, and are loaded as such
        std::fill(begin, at, Point{kNan, kNan, kNan});
    }
  }

  // They stay such, so that later iterations go by places alone.
  void find_known_copies() {
    is_copy_.assign(own_.size(), 0);
    auto end = is_copy_.begin();
    for (std::uint32_t leaf = leaves_.begin; leaf < leaves_.end; ++leaf) {
      end += std::ptrdiff_t(work_.input.leaves()[leaf].valid);
      std::fill_n(end - std::ptrdiff_t(work_.input.copies_of(leaf)), work_.input.copies_of(leaf), std::uint8_t{1});
    }
  }

  bool has_points() const { return std::ranges::any_of(own_, is_indexed); }

  const Bounds& bounds() const override { return seen_->bounds(); }
  std::span<const Point> points() const override { return own_; }

  bool load(const point::Region& region, TileWorker& worker) override {
    if (fits_) {  // read() has it
      worker.numbers.swap(ahead_.numbers);
      worker.known_copies.swap(ahead_.known_copies);
    }
    const bool fits = fits_ ? *std::exchange(fits_, std::nullopt) : load(region, worker.numbers, worker.known_copies);
    worker.points = worker.results = loaded_;  // what was uploaded is not needed any more
    return fits;
  }
  bool load(const point::Region& region, Indices& numbers, Indices& known_copies) {
    loaded_.clear();
    numbers.clear();
    known_copies.clear();
    loaded_.reserve(own_.size() + own_.size() / 4);
    numbers.reserve(own_.size());
    std::size_t at = 0;
    for (std::uint32_t leaf = leaves_.begin; leaf < leaves_.end; ++leaf) {
      const std::size_t end = at + seen_->leaves()[leaf].valid, copies = end - seen_->copies_of(leaf);
      for (; at < end; ++at) {
        if (!point::is_inside(region, to_vec3(own_[at]))) continue;
        if (at >= copies) known_copies.push_back(std::uint32_t(loaded_.size()));
        loaded_.push_back(own_[at]);
        numbers.push_back(std::uint32_t(at));
      }
    }
    return loaded_.size() <= work_.most_points &&
           seen_->append(region, leaves_, work_.most_points, loaded_, known_copies);
  }

  double load_nearest(const Point& to, TileWorker& worker) override {
    loaded_.clear();
    worker.numbers.clear();
    worker.known_copies.clear();
    const double known = seen_->append_nearest(to, work_.most_points, loaded_, worker.known_copies);
    worker.points = worker.results = loaded_;
    return known;
  }

  void keep(std::span<const std::uint32_t> numbers, std::span<const Point> results,
            std::span<const unsigned char> outcomes) override {
    if (only_counts_) return count_outliers(results, outcomes);
    for (std::size_t i = 0; i < numbers.size(); ++i)
      if (outcomes[i] != 0) {
        Point& to = results_[numbers[i]];
        to = moved(to, own_[numbers[i]], results[i]);
        if ((outcomes[i] & point::kIsCopy) != 0) is_copy_[numbers[i]] = 1;
      }
  }

  void count_outliers(std::span<const Point> results, std::span<const unsigned char> outcomes) {
    OutlierCounts here;
    for (std::size_t i = 0; i < results.size(); ++i)
      if (outcomes[i] != 0 && !is_indexed(results[i])) count(point::outlier_at(results[i].x), here);
    pulled_.add(here);
  }

  Error does_not_fit(std::size_t number) const override {
    std::vector<std::uint64_t> indices;
    work_.input.read_stored(leaves_, nullptr, &indices);
    return {ErrorKind::memory, "point " + std::to_string(indices[number]) +
                                   " (from 0) has a neighbourhood that does not fit into --memory, since it lies far "
                                   "from others or many share its place; give more memory, or leave it out"};
  }

  // By leaf, for the next iteration, the copies of each last. Outliers are written too, as a NaN that tells the reason.
  void write_by_leaf(const std::vector<std::uint64_t>& indices) const {
    std::vector<Section> sections;
    std::vector<std::uint32_t> order(results_.size());
    std::iota(order.begin(), order.end(), 0u);
    std::span<std::uint32_t> left(order);
    for (std::uint32_t leaf = leaves_.begin; leaf < leaves_.end; ++leaf) {
      const std::span<std::uint32_t> its = left.first(work_.input.leaves()[leaf].valid);
      left = left.subspan(its.size());
      Bounds b = kNoBounds;
      for (const std::uint32_t i : its)
        if (is_indexed(results_[i])) include(b, results_[i]);
      const auto copies = std::ranges::stable_partition(its, [&](std::uint32_t i) { return !is_copy_[i]; });
      if (!its.empty())
        sections.push_back({work_.input.tree_leaf(leaf), work_.input.zone_of(leaf), its.size(), b.min, b.max,
                            std::uint64_t(copies.size())});
    }
    PointsHeader header = header_of(counts_, work_.first_counts);
    header.index_bytes = sizeof(std::uint64_t);
    PointsWriter writer(work_.path, header, sections, {});
    writer.write<Point>(order, [&](std::uint32_t i) { return results_[i]; });
    writer.write<std::uint64_t>(order, [&](std::uint32_t i) { return indices[i]; });
    writer.finish();
  }

  // By chunk of the input, with indices in it, for the last step.
  void write_by_chunk(const std::vector<std::uint64_t>& indices) const {
    const std::vector<InputChunk>& chunks = *work_.chunks;
    std::vector<std::uint32_t> chunk_of_each;
    chunk_of_each.reserve(indices.size());
    for (const std::uint64_t index : indices) chunk_of_each.push_back(std::uint32_t(chunk_of(chunks, index)));
    const Grouped by_chunk(chunk_of_each, chunks.size());
    std::vector<Section> sections;
    for (std::uint32_t c = 0; c < chunks.size(); ++c)
      if (by_chunk.count(c) > 0) sections.push_back({c, {}, by_chunk.count(c), {}, {}});
    PointsWriter writer(work_.path, header_of(counts_, work_.first_counts), sections, {});
    writer.write<Point>(by_chunk.order, [&](std::uint32_t i) { return results_[i]; });
    writer.write<std::uint32_t>(by_chunk.order, [&](std::uint32_t i) {
      return std::uint32_t(indices[i] - chunks[chunk_of_each[i]].first_point);
    });
    writer.finish();
  }

  TileWork work_;
  std::stop_token stop_;
  LeafRange leaves_;
  std::vector<Position> origins_;
  std::optional<StoredCloud> seen_;  // from the origin that is computed around; what follows is relative to it
  FramedSettings stages_;
  Bounds bounds_;             // of the tile's points that are computed now
  std::optional<bool> fits_;  // what read() loaded; nothing once it is taken
  struct {
    Indices numbers, known_copies;
  } ahead_;                            // its, as of TileWorker
  std::vector<Point> own_;             // all of the tile
  std::vector<Point> results_;         // each relative to the middle of its own zone
  std::vector<std::uint8_t> is_copy_;  // of the results
  std::vector<Point> loaded_;          // points that are computed, those of the tile first; then their results
  Counts counts_;
  bool only_counts_ = false;  // of results, which outliers there are
  OutlierTally pulled_;
};

}  // namespace

void denoise_all(const std::function<std::optional<TileWork>()>& next, Backend& backend, const std::stop_token& stop) {
  const auto next_tile = [&] {
    const std::optional<TileWork> work = next();
    return work ? std::make_shared<Tile>(*work, stop) : nullptr;
  };
  std::shared_ptr<Tile> present = next_tile();
  if (present) present->read();
  while (present) {
    std::shared_ptr<Tile> coming = next_tile();
    std::future<void> reading;  // a future of std::async waits in its destructor
    if (coming) reading = std::async(std::launch::async, [coming] { coming->read(); });
    present->compute(backend);
    present->write();  // before anything is computed that a kill would cost as well
    if (reading.valid()) reading.get();
    present = std::move(coming);
  }
}

}  // namespace pointfair::scale
