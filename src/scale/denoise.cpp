// SPDX-License-Identifier: Apache-2.0
#include "scale/denoise.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <new>
#include <numeric>
#include <utility>

#include "seam/exactness.hpp"
#include "tiles/halo.hpp"

namespace pointfair::scale {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

using Places = std::vector<std::uint32_t>;  // of points among those of the tile

// Points of the tile whose results are wanted.
struct Wanted {
  bool all = false;
  Places places;  // ascending; unless all
  Bounds bounds;
  double halo = 0;  // 0: as first thought
};

class Tile {
 public:
  Tile(const TileWork& work, Backend& backend, const std::stop_token& stop)
      : work_(work), backend_(backend), stop_(stop), bounds_(work.input.bounds_of(work.leaves)) {
    if (bounds_.valid > std::numeric_limits<std::uint32_t>::max())
      throw Error(ErrorKind::memory, "a tile has too many points; plan with less --memory, or more --tiles");
    work.input.read(work.leaves, &own_, nullptr);
    results_.assign(own_.size(), Point{kNan, kNan, kNan});
  }

  void run() {
    std::deque<Wanted> queue;
    if (!own_.empty()) queue.push_back({true, {}, bounds_, 0});
    while (!queue.empty()) {
      const Wanted wanted = std::move(queue.front());
      queue.pop_front();
      for (Wanted& more : attempt(wanted)) queue.push_back(std::move(more));
    }
  }

  std::vector<Point> take_results() { return std::move(results_); }
  const Counts& counts() const { return counts_; }

 private:
  // Returns what is to be done again.
  std::vector<Wanted> attempt(const Wanted& wanted) {
    const double halo = wanted.halo > 0 ? wanted.halo : first_halo(work_.input.bounds(), work_.stages, wanted.bounds);
    const point::Region region = region_around(work_.input.bounds(), wanted.bounds, halo);
    if (!load(region)) return split(wanted, halo);
    try {
      compute();
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
    for (std::size_t i = 0; i < own_.size(); ++i) {
      if (!point::is_inside(region, to_vec3(own_[i]))) continue;
      loaded_.push_back(own_[i]);
      places_.push_back(std::uint32_t(i));
    }
    return loaded_.size() <= work_.most_points && work_.input.append(region, work_.leaves, work_.most_points, loaded_);
  }

  void compute() {
    const TileStages& stages = work_.stages;
    backend_.upload(loaded_, stages.frame ? IndexOrder::along_curve : IndexOrder::fastest);
    backend_.build_index(0, stages.frame, stop_);
    backend_.find_neighbors(0, stages.neighbors, stop_);
    backend_.estimate_normals(0, stages.normals, stop_);
    backend_.fair(0, stages.fairing, false, stop_);
    if (stop_.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
  }

  std::vector<Wanted> take_results(const Wanted& wanted, const point::Region& region, double halo) {
    backend_.download(0, loaded_, {}, {});  // what was uploaded is not needed any more
    outcomes_.resize(loaded_.size());
    backend_.exactness()->outcomes(region, outcomes_);
    backend_.take_costs();
    Wanted left{false, {}, kNoBounds, 2 * halo};
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const std::uint32_t place = places_[i];
      if (!wanted.all && !std::binary_search(wanted.places.begin(), wanted.places.end(), place)) continue;
      if ((outcomes_[i] & point::kExact) == 0) {
        left.places.push_back(place);
        include(left.bounds, own_[place]);
        continue;
      }
      results_[place] = loaded_[i];
      counts_.unmoved.too_few_neighbors += (outcomes_[i] & point::kTooFew) != 0;
      counts_.unmoved.no_normal += (outcomes_[i] & point::kNoNormal) != 0;
      counts_.short_neighborhoods += (outcomes_[i] & point::kShort) != 0;
    }
    if (left.places.empty()) return {};
    return {std::move(left)};
  }

  // In two along the longest side.
  std::vector<Wanted> split(const Wanted& wanted, double halo) {
    Places places = wanted.places;
    if (wanted.all) {
      places.resize(own_.size());
      std::iota(places.begin(), places.end(), 0u);
    }
    const Bounds& b = wanted.bounds;
    const float x = b.max.x - b.min.x, y = b.max.y - b.min.y, z = b.max.z - b.min.z;
    // where nearly all of the region is halo, halves would have hardly smaller ones
    if (places.size() < 2 || std::max({x, y, z}) < halo / 8) fail_at(places.front());
    const auto axis = x >= y && x >= z ? &Point::x : y >= z ? &Point::y : &Point::z;
    const auto middle = places.begin() + std::ptrdiff_t(places.size() / 2);
    std::nth_element(places.begin(), middle, places.end(),
                     [&](std::uint32_t i, std::uint32_t j) { return own_[i].*axis < own_[j].*axis; });
    std::vector<Wanted> halves;
    for (const std::span<std::uint32_t> half : {std::span(places.begin(), middle), std::span(middle, places.end())}) {
      std::sort(half.begin(), half.end());
      Wanted part{false, {half.begin(), half.end()}, kNoBounds, wanted.halo > 0 ? halo : 0};
      for (const std::uint32_t place : half) include(part.bounds, own_[place]);
      halves.push_back(std::move(part));
    }
    return halves;
  }

  [[noreturn]] void fail_at(std::uint32_t place) const {
    std::vector<std::uint64_t> indices;
    work_.input.read(work_.leaves, nullptr, &indices);
    throw Error(ErrorKind::memory, "point " + std::to_string(indices[place]) +
                                       " (from 0) has a neighbourhood that does not fit into --memory, since it lies "
                                       "far from others or many share its place; give more memory, or leave it out");
  }

  static constexpr std::size_t kLeastSplit = 2000;
  const TileWork& work_;
  Backend& backend_;
  const std::stop_token& stop_;
  Bounds bounds_;
  std::vector<Point> own_, results_;
  std::vector<Point> loaded_;  // points that are computed, then their results
  Places places_;              // in own_, of the first points of loaded_
  std::vector<unsigned char> outcomes_;
  Counts counts_;
};

PointsHeader header_of(const Counts& counts) {
  PointsHeader header;
  header.counts[kTooFewCount] = counts.unmoved.too_few_neighbors;
  header.counts[kNoNormalCount] = counts.unmoved.no_normal;
  header.counts[kShortCount] = counts.short_neighborhoods;
  return header;
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

// By leaf, for the next iteration.
void write_by_leaf(const TileWork& work, const std::vector<Point>& results, const std::vector<std::uint64_t>& indices,
                   const Counts& counts, const std::filesystem::path& path) {
  std::vector<Section> sections;
  Places order;
  std::size_t at = 0;
  for (std::uint32_t leaf = work.leaves.begin; leaf < work.leaves.end; ++leaf) {
    Bounds b = kNoBounds;
    for (const std::size_t end = at + work.input.leaves()[leaf].valid; at < end; ++at) {
      if (!is_indexed(results[at])) continue;
      include(b, results[at]);
      order.push_back(std::uint32_t(at));
    }
    if (b.valid > 0) sections.push_back({leaf, 0, b.valid, b.min, b.max});
  }
  PointsHeader header = header_of(counts);
  header.index_bytes = sizeof(std::uint64_t);
  PointsWriter writer(path, header, sections, {});
  write_in_order<Point>(writer, order, [&](std::uint32_t i) { return results[i]; });
  write_in_order<std::uint64_t>(writer, order, [&](std::uint32_t i) { return indices[i]; });
  writer.finish();
}

// By chunk of the input, with indices in it, for the last step.
void write_by_chunk(const TileWork& work, const std::vector<Point>& results, const std::vector<std::uint64_t>& indices,
                    const Counts& counts, const std::filesystem::path& path) {
  const std::vector<InputChunk>& chunks = *work.chunks;
  const auto chunk_of = [&](std::uint64_t index) {
    const auto after = std::upper_bound(chunks.begin(), chunks.end(), index,
                                        [](std::uint64_t i, const InputChunk& c) { return i < c.first_point; });
    return std::size_t(after - chunks.begin()) - 1;
  };
  std::vector<std::uint64_t> next(chunks.size() + 1, 0);
  for (std::size_t i = 0; i < results.size(); ++i)
    if (!std::isnan(results[i].x)) ++next[chunk_of(indices[i]) + 1];
  std::vector<Section> sections;
  for (std::size_t c = 0; c < chunks.size(); ++c) {
    if (next[c + 1] > 0) sections.push_back({std::uint32_t(c), 0, next[c + 1], {}, {}});
    next[c + 1] += next[c];
  }
  Places order(next.back());
  for (std::size_t i = 0; i < results.size(); ++i)
    if (!std::isnan(results[i].x)) order[next[chunk_of(indices[i])]++] = std::uint32_t(i);
  PointsWriter writer(path, header_of(counts), sections, {});
  write_in_order<Point>(writer, order, [&](std::uint32_t i) { return results[i]; });
  write_in_order<std::uint32_t>(writer, order, [&](std::uint32_t i) {
    return std::uint32_t(indices[i] - chunks[chunk_of(indices[i])].first_point);
  });
  writer.finish();
}

}  // namespace

void denoise(const TileWork& work, Backend& backend, const std::filesystem::path& path, const std::stop_token& stop) {
  std::vector<Point> results;
  Counts counts;
  {
    Tile tile(work, backend, stop);
    tile.run();
    results = tile.take_results();
    counts = tile.counts();
  }
  std::vector<std::uint64_t> indices;
  work.input.read(work.leaves, nullptr, &indices);
  work.chunks ? write_by_chunk(work, results, indices, counts, path)
              : write_by_leaf(work, results, indices, counts, path);
}

}  // namespace pointfair::scale
