// SPDX-License-Identifier: Apache-2.0
#include "scale/denoise.hpp"

#include <algorithm>
#include <deque>
#include <future>
#include <limits>
#include <new>
#include <optional>
#include <span>
#include <utility>

#include "seam/exactness.hpp"
#include "seam/stop.hpp"
#include "tiles/halo.hpp"
#include "tiles/halves.hpp"

namespace pointfair::scale {
namespace {

using Places = std::vector<std::uint32_t>;  // of points among those of the tile

// Points of the tile whose results are wanted.
struct Wanted {
  bool all = false;
  Places places;  // ascending; unless all
  Bounds bounds;
  double halo = 0;  // 0: as first thought
};

// Who has moved in the first iteration has not kept its place.
PointsHeader header_of(const Counts& counts, const std::optional<TaskCounts>& first_counts) {
  PointsHeader header;
  header.counts[kTooFewCount] = counts.unmoved.too_few_neighbors;
  header.counts[kNoNormalCount] = counts.unmoved.no_normal;
  header.counts[kShortCount] = counts.short_neighborhoods;
  if (first_counts)
    for (const std::size_t kind : {kTooFewCount, kNoNormalCount}) header.counts[kind] = (*first_counts)[kind];
  return header;
}

// A stored point that moved as far as one did that was `before` relative to another origin.
Point moved(const Point& stored, const Point& before, const Point& now) {
  const auto along = [](float s, float b, float n) { return s == b ? n : n == b ? s : float(s + (double(n) - b)); };
  if (!is_indexed(now)) return now;
  return {along(stored.x, before.x, now.x), along(stored.y, before.y, now.y), along(stored.z, before.z, now.z)};
}

template <class T, class ValueAt>
void write_in_order(PointsWriter& writer, const Places& order, const ValueAt& value_at) {
  constexpr std::size_t kSome = 1 << 16;
  std::vector<T> some;
  for (std::size_t begin = 0; begin < order.size(); begin += kSome) {
    some.clear();
    for (std::size_t i = begin; i < std::min(order.size(), begin + kSome); ++i) some.push_back(value_at(order[i]));
    writer.write(std::span(some));
  }
}

}  // namespace

class Denoising::Tile {
 public:
  Tile(const TileWork& work, std::stop_token stop)
      : work_(work),
        stop_(std::move(stop)),
        leaves_(work.input.leaves_of(work.leaves)),
        origins_(origins_of(work, leaves_)) {
    if (work.input.count_of(leaves_) > std::numeric_limits<std::uint32_t>::max())
      throw Error(ErrorKind::memory, "a tile has too many points; plan with less --memory, or more --tiles");
  }

  void read() {
    if (origins_.empty()) return;
    enter(origins_.front());
    if (!has_points()) return;
    const Wanted all = all_wanted();
    fits_ = load(region_of(all, halo_of(all)));
    is_loaded_ = true;
  }

  void compute(Backend& backend) {
    backend_ = &backend;
    for (const Position& origin : origins_) {
      if (origin != origins_.front()) enter(origin);
      compute_here();
    }
    seen_.reset();
    own_ = {};
    loaded_ = {};
    places_ = {};
    outcomes_ = {};
  }

  void write(const std::filesystem::path& path) {
    std::vector<std::uint64_t> indices;
    work_.input.read(leaves_, nullptr, &indices);
    work_.chunks ? write_by_chunk(indices, path) : write_by_leaf(indices, path);
    results_ = {};
  }

 private:
  // Those of the zones that have points of the tile. The points of each are computed by themselves.
  static std::vector<Position> origins_of(const TileWork& work, const LeafRange& leaves) {
    if (!work.input.zones().are_several()) return {work.input.zones().origin};
    std::vector<Position> origins;
    for (std::uint32_t leaf = leaves.begin; leaf < leaves.end; ++leaf) origins.push_back(work.input.origin_for(leaf));
    std::sort(origins.begin(), origins.end());
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
    return origins;
  }

  void enter(const Position& origin) {
    seen_.emplace(work_.input.seen_from(origin));
    stages_ = relative_to(origin, work_.stages, seen_->zones());
    origin_ = origin;
    bounds_ = kNoBounds;
    for (std::uint32_t leaf = leaves_.begin; leaf < leaves_.end; ++leaf)
      if (seen_->origin_for(leaf) == origin) unite(bounds_, seen_->leaves()[leaf]);
    seen_->read(leaves_, &own_, nullptr);
  }

  // Calls visit(leaf, begin, end) for the leaves whose points are computed now, with their places in the tile.
  template <class Visit>
  void for_stretches(const Visit& visit) const {
    std::size_t at = 0;
    for (std::uint32_t leaf = leaves_.begin; leaf < leaves_.end; ++leaf) {
      const std::size_t begin = std::exchange(at, at + seen_->leaves()[leaf].valid);
      if (seen_->origin_for(leaf) == origin_) visit(leaf, begin, at);
    }
  }

  void compute_here() {
    results_.resize(own_.size());
    for_stretches([&](std::uint32_t leaf, std::size_t begin, std::size_t end) {
      const auto to = results_.begin() + std::ptrdiff_t(begin);  // outliers of iterations before stay as they are
      if (seen_->zones().middle_of(seen_->zone_of(leaf)) == origin_) {
        std::copy(own_.begin() + std::ptrdiff_t(begin), own_.begin() + std::ptrdiff_t(end), to);
      } else {
        std::vector<Point> stored;
        seen_->read_stored(leaf, stored);
        std::copy(stored.begin(), stored.end(), to);
      }
    });
    std::deque<Wanted> queue;
    if (has_points()) queue.push_back(all_wanted());
    while (!queue.empty()) {
      const Wanted wanted = std::move(queue.front());
      queue.pop_front();
      for (Wanted& more : attempt(wanted)) queue.push_back(std::move(more));
    }
  }

  bool has_points() const {
    bool has = false;
    for_stretches([&](std::uint32_t, std::size_t begin, std::size_t end) {
      has = has || std::any_of(own_.begin() + std::ptrdiff_t(begin), own_.begin() + std::ptrdiff_t(end), is_indexed);
    });
    return has;
  }
  Places indexed_places() const {
    Places places;
    for_stretches([&](std::uint32_t, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i)
        if (is_indexed(own_[i])) places.push_back(std::uint32_t(i));
    });
    return places;
  }
  Wanted all_wanted() const {
    if (origins_.size() == 1) return {true, {}, bounds_, 0};
    return {false, indexed_places(), bounds_, 0};
  }
  double halo_of(const Wanted& wanted) const {
    return wanted.halo > 0 ? wanted.halo : first_halo(seen_->bounds(), stages_, wanted.bounds);
  }
  point::Region region_of(const Wanted& wanted, double halo) const {
    return region_around(seen_->bounds(), wanted.bounds, halo);
  }

  // Returns what is to be done again.
  std::vector<Wanted> attempt(const Wanted& wanted) {
    const double halo = halo_of(wanted);
    const point::Region region = region_of(wanted, halo);
    if (!std::exchange(is_loaded_, false)) fits_ = load(region);
    if (!fits_) return split(wanted, halo);
    try {
      denoise();
      return take_results(wanted, region, halo);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::memory || loaded_.size() < kLeastSplit) throw;
      return split(wanted, halo);
    } catch (const std::bad_alloc&) {
      if (loaded_.size() < kLeastSplit) throw;
      return split(wanted, halo);
    }
  }

  // All points of the region; first those of the tile.
  bool load(const point::Region& region) {
    loaded_.clear();
    places_.clear();
    loaded_.reserve(own_.size() + own_.size() / 4);
    places_.reserve(own_.size());
    for (std::size_t i = 0; i < own_.size(); ++i) {
      if (!point::is_inside(region, to_vec3(own_[i]))) continue;
      loaded_.push_back(own_[i]);
      places_.push_back(std::uint32_t(i));
    }
    return loaded_.size() <= work_.most_points && seen_->append(region, leaves_, work_.most_points, loaded_);
  }

  void denoise() {
    backend_->upload(loaded_, stages_.frame ? IndexOrder::along_curve : IndexOrder::fastest);
    run_stages(*backend_, 0, stages_, stop_);
    throw_if_stopped(stop_);
  }

  std::vector<Wanted> take_results(const Wanted& wanted, const point::Region& region, double halo) {
    backend_->download(0, loaded_, {}, {});  // what was uploaded is not needed any more
    outcomes_.resize(loaded_.size());
    backend_->exactness()->outcomes(region, outcomes_);
    backend_->take_costs();
    Wanted left{false, {}, kNoBounds, 2 * halo};
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const std::uint32_t place = places_[i];
      if (!wanted.all && !std::binary_search(wanted.places.begin(), wanted.places.end(), place)) continue;
      if ((outcomes_[i] & point::kExact) == 0) {
        left.places.push_back(place);
        include(left.bounds, own_[place]);
        continue;
      }
      results_[place] = moved(results_[place], own_[place], loaded_[i]);
      add(counts_, outcomes_[i]);
    }
    if (left.places.empty()) return {};
    return {std::move(left)};
  }

  // In two along the longest side.
  std::vector<Wanted> split(const Wanted& wanted, double halo) {
    Places places = wanted.all ? indexed_places() : wanted.places;
    const Bounds& b = wanted.bounds;
    const float x = b.max.x - b.min.x, y = b.max.y - b.min.y, z = b.max.z - b.min.z;
    // where nearly all of the region is halo, halves would have hardly smaller ones
    if (places.size() < 2 || std::max({x, y, z}) < halo / 8) fail_at(places.front());
    std::vector<Wanted> halves;
    for (Places& half : halves_of(std::move(places), own_, b)) {
      Wanted part{false, std::move(half), kNoBounds, wanted.halo > 0 ? halo : 0};
      for (const std::uint32_t place : part.places) include(part.bounds, own_[place]);
      halves.push_back(std::move(part));
    }
    return halves;
  }

  [[noreturn]] void fail_at(std::uint32_t place) const {
    std::vector<std::uint64_t> indices;
    work_.input.read(leaves_, nullptr, &indices);
    throw Error(ErrorKind::memory, "point " + std::to_string(indices[place]) +
                                       " (from 0) has a neighbourhood that does not fit into --memory, since it lies "
                                       "far from others or many share its place; give more memory, or leave it out");
  }

  // By leaf, for the next iteration. Outliers are written too, as a NaN that tells the reason.
  void write_by_leaf(const std::vector<std::uint64_t>& indices, const std::filesystem::path& path) const {
    std::vector<Section> sections;
    std::size_t at = 0;
    for (std::uint32_t leaf = leaves_.begin; leaf < leaves_.end; ++leaf) {
      const std::size_t count = work_.input.leaves()[leaf].valid;
      Bounds b = kNoBounds;
      for (const Point& p : std::span(results_).subspan(at, count))
        if (is_indexed(p)) include(b, p);
      if (count > 0) sections.push_back({work_.input.tree_leaf(leaf), work_.input.zone_of(leaf), count, b.min, b.max});
      at += count;
    }
    PointsHeader header = header_of(counts_, work_.first_counts);
    header.index_bytes = sizeof(std::uint64_t);
    PointsWriter writer(path, header, sections, {});
    writer.write(std::span(results_));
    writer.write(std::span(indices));
    writer.finish();
  }

  // By chunk of the input, with indices in it, for the last step.
  void write_by_chunk(const std::vector<std::uint64_t>& indices, const std::filesystem::path& path) const {
    const std::vector<InputChunk>& chunks = *work_.chunks;
    std::vector<std::uint64_t> next(chunks.size() + 1, 0);
    for (const std::uint64_t index : indices) ++next[chunk_of(chunks, index) + 1];
    std::vector<Section> sections;
    for (std::size_t c = 0; c < chunks.size(); ++c) {
      if (next[c + 1] > 0) sections.push_back({std::uint32_t(c), {}, next[c + 1], {}, {}});
      next[c + 1] += next[c];
    }
    Places order(next.back());
    for (std::size_t i = 0; i < results_.size(); ++i) order[next[chunk_of(chunks, indices[i])]++] = std::uint32_t(i);
    PointsWriter writer(path, header_of(counts_, work_.first_counts), sections, {});
    write_in_order<Point>(writer, order, [&](std::uint32_t i) { return results_[i]; });
    write_in_order<std::uint32_t>(writer, order, [&](std::uint32_t i) {
      return std::uint32_t(indices[i] - chunks[chunk_of(chunks, indices[i])].first_point);
    });
    writer.finish();
  }

  static constexpr std::size_t kLeastSplit = 2000;
  TileWork work_;
  Backend* backend_ = nullptr;
  std::stop_token stop_;
  LeafRange leaves_;
  std::vector<Position> origins_;
  Position origin_{};  // that is computed around; what follows is relative to it
  std::optional<StoredCloud> seen_;
  FramedSettings stages_;
  Bounds bounds_;                          // of the tile's points that are computed now
  bool is_loaded_ = false, fits_ = false;  // what the first attempt needs
  std::vector<Point> own_;                 // all of the tile
  std::vector<Point> results_;             // each relative to the middle of its own zone
  std::vector<Point> loaded_;              // points that are computed, then their results
  Places places_;                          // in own_, of the first points of loaded_
  std::vector<unsigned char> outcomes_;
  Counts counts_;
};

Denoising::Denoising(const TileWork& work, std::filesystem::path path, std::stop_token stop)
    : tile_(std::make_unique<Tile>(work, std::move(stop))), path_(std::move(path)) {}
Denoising::~Denoising() = default;
void Denoising::read() { tile_->read(); }
void Denoising::compute(Backend& backend) { tile_->compute(backend); }
void Denoising::write() { tile_->write(path_); }

void denoise_all(const std::function<std::unique_ptr<Denoising>()>& next, Backend& backend) {
  std::shared_ptr<Denoising> present = next();
  if (present) present->read();
  while (present) {
    std::shared_ptr<Denoising> coming = next();
    std::future<void> reading;  // a future of std::async waits in its destructor
    if (coming) reading = std::async(std::launch::async, [coming] { coming->read(); });
    present->compute(backend);
    present->write();  // before anything is computed that a kill would cost as well
    if (reading.valid()) reading.get();
    present = std::move(coming);
  }
}

}  // namespace pointfair::scale
