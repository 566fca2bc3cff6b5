// SPDX-License-Identifier: Apache-2.0
#include "tiles/tiled_backend.hpp"

#include <algorithm>
#include <limits>
#include <mutex>
#include <utility>

#include "point/outliers.h"
#include "seam/clock.hpp"
#include "seam/exactness.hpp"
#include "seam/noise_levels.hpp"
#include "seam/outlier_tally.hpp"
#include "seam/sampling.hpp"
#include "tiles/cut.hpp"
#include "tiles/exact_rows.hpp"
#include "tiles/tile_run.hpp"

namespace pointfair {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Points whose memory is first touched by the threads that write them.
class Room {
 public:
  void resize(std::size_t count) {
    if (count > capacity_) {
      points_.reset();  // nothing of it is needed
      capacity_ = 0;
      points_ = std::make_unique_for_overwrite<Point[]>(count);
      capacity_ = count;
    }
    count_ = count;
  }
  std::size_t size() const { return count_; }
  std::size_t capacity() const { return capacity_; }
  std::span<Point> points() { return {points_.get(), count_}; }
  std::span<const Point> points() const { return {points_.get(), count_}; }
  const Point& operator[](std::size_t i) const { return points_[i]; }

 private:
  std::unique_ptr<Point[]> points_;
  std::size_t count_ = 0, capacity_ = 0;
};

// What is held of one iteration. Stages up to the normals only note what they are to do; fairing does it all.
struct Iteration {
  std::optional<Cut> cut;  // of its input
  FramedSettings stages;
  Room faired;
  Counts counts;
};

class CloudInTiles final : public TiledBackend, public Sampling {
 public:
  CloudInTiles(std::vector<std::unique_ptr<Backend>> workers, Tiling tiling) : tiling_(tiling) {
    for (auto& backend : workers) workers_.emplace_back(std::move(backend));
  }

  void cut_into(std::uint64_t tiles) override { tiling_.tiles = tiles; }
  DeviceInfo device() const override { return workers_[0].backend->device(); }
  HostBuffer host_buffer(std::size_t count) override { return workers_[0].backend->host_buffer(count); }

  void upload(std::span<const Point> points, IndexOrder) override {
    cloud_.resize(points.size());
    copy(points, cloud_.points());
    peak_device_ = peak_of_workers_ = 0;
    first_.cut.reset();
    further_.cut.reset();
    further_iteration_ = 0;
  }

  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token) override {
    const auto start = Clock::now();
    if (iteration > 0 && iteration != further_iteration_) {
      if (iteration > 1) std::swap(held(iteration - 1).faired, input_);
      further_iteration_ = iteration;
    }
    Iteration& its = held(iteration);
    its.stages.frame = frame;
    its.cut.emplace(input_of(iteration), tiling_.tiles, for_each());
    note("cut", start);
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token) override {
    held(iteration).stages.neighbors = settings;
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token) override {
    held(iteration).stages.normals = settings;
  }
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override {
    const auto start = Clock::now();
    Iteration& its = held(iteration);
    its.stages.fairing = settings;
    its.faired.resize(cloud_.size());
    copy_invalid(input_of(iteration), its.faired.points());
    TileRun::Results results{its.faired.points(), {}, {}};
    results.counts.unmoved.non_finite = cloud_.size() - first_.cut->bounds().valid;
    run(iteration, results, stop);
    its.counts = results.counts;
    note("tiles", start);
  }

  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    const auto start = Clock::now();
    const Room& faired = held(iteration).faired;
    std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
    const bool is_limited = limits.farthest > 0, may_hold_back = is_limited || iteration > 0;
    const DisplacementLimits used = limits.or_endless();
    const point::NodeField field = field_of(used.levels.get());
    OutlierTally held_back;
    for_tile_blocks(points.size(), for_each(), [&](std::size_t first, std::size_t last) {
      if (!may_hold_back) {
        std::copy_n(&faired[first], last - first, &points[first]);
        return;
      }
      OutlierCounts here;
      for (std::size_t i = first; i < last; ++i) {
        points[i] = faired[i];
        if (!is_indexed(cloud_[i])) continue;
        const float level = point::node_value(field, to_vec3(cloud_[i]));
        const auto limited = point::limited(to_vec3(cloud_[i]), to_vec3(faired[i]), used, level);
        points[i] = {limited.place.x, limited.place.y, limited.place.z};
        count(limited.outlier, here);
        if (!outliers.empty()) outliers[i] = static_cast<std::uint8_t>(limited.outlier);
      }
      held_back.add(here);
    });
    note("download", start);
    return held_back.counts();
  }
  void download_input(std::span<Point> points) override { copy(cloud_.points(), points); }
  // Normals are not kept: the tiles are computed again.
  void download_normals(int iteration, std::span<Point> normals, std::stop_token stop) override {
    std::fill(normals.begin(), normals.end(), Point{0, 0, 0});
    TileRun::Results results{{}, normals, {}};
    run(iteration, results, stop);
  }

  Counts counts(int iteration) override { return held(iteration).counts; }
  Costs take_costs() override {
    std::uint64_t bytes = peak_of_workers_;
    for (const Room* points : {&cloud_, &input_, &first_.faired, &further_.faired})
      bytes += points->capacity() * sizeof(Point);
    for (const TileWorker& worker : workers_) {
      bytes += (worker.in.points().size() + worker.out.points().size()) * sizeof(Point);
      bytes += worker.indices.capacity() * sizeof(std::uint32_t);
    }
    const std::uint64_t tiles = first_.cut ? std::max<std::uint64_t>(1, first_.cut->tiles().size()) : 1;
    return {std::exchange(times_, {}), bytes, peak_device_, tiles};
  }

  Sampling& sampling() override { return *this; }

  CloudSample sample_cloud(std::size_t count) override {
    const auto point_at = [this](std::size_t i) { return std::pair(cloud_[i], std::uint32_t(i)); };
    return sample_points(cloud_.size(), point_at, count, for_each());
  }
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    std::fill(out.begin(), out.end(), Point{kNan, kNan, kNan});
    TaskQueue<const Cut::Tile*> tiles;
    for (const Cut::Tile& tile : first_.cut->tiles()) tiles.put(&tile);
    on_feeders(tiling_.feeders, [&](std::size_t feeder) {
      TileWorker& worker = workers_of(workers_, feeder, tiling_.feeders).front();
      while (const auto tile = tiles.take(false)) sample_tile(**tile, worker, queries, k, out);
    });
  }
  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    workers_[0].backend->sampling().for_each_on_host(count, body);
  }

 private:
  // Rows of neighbourhoods that are not known yet.
  struct Rows {
    std::vector<std::size_t> asked;
    Bounds bounds;  // of their queries
    double halo;
  };

  ForEach for_each() {
    return [this](std::size_t count, const std::function<void(std::size_t)>& body) { for_each_on_host(count, body); };
  }
  Iteration& held(int iteration) {
    if (iteration != 0 && iteration != further_iteration_)
      throw Error(ErrorKind::failed, "the results of iteration " + std::to_string(iteration) + " are not held");
    return iteration == 0 ? first_ : further_;
  }
  std::span<const Point> input_of(int iteration) const {
    return (iteration == 0 ? cloud_ : iteration == 1 ? first_.faired : input_).points();
  }
  void note(const char* name, Clock::time_point start) { times_.push_back({name, milliseconds_since(start)}); }

  void run(int iteration, TileRun::Results& results, const std::stop_token& stop) {
    const Iteration& its = held(iteration);
    TileRun(workers_, tiling_, for_each()).run(*its.cut, input_of(iteration), its.stages, results, stop);
    peak_device_ = std::max(peak_device_, results.peak_device_bytes);
    peak_of_workers_ = std::max(peak_of_workers_, results.peak_host_bytes);
  }

  // By all threads.
  void copy(std::span<const Point> from, std::span<Point> to) {
    for_tile_blocks(from.size(), for_each(),
                    [&](std::size_t first, std::size_t last) { std::copy_n(&from[first], last - first, &to[first]); });
  }
  // Points that no tile has.
  void copy_invalid(std::span<const Point> from, std::span<Point> to) {
    for_tile_blocks(from.size(), for_each(), [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        if (!is_indexed(from[i])) to[i] = from[i];
    });
  }

  // Fills the rows of the queries in the tile.
  void sample_tile(const Cut::Tile& tile, TileWorker& worker, std::span<const std::uint32_t> queries, int k,
                   std::span<Point> out) {
    Rows rows{{}, kNoBounds, tiling_.first_halo * reach_of_nearest(first_.cut->bounds(), k, tile.core)};
    for (std::size_t q = 0; q < queries.size(); ++q) {
      const Point& p = cloud_[queries[q]];
      if (!is_indexed(p) || !is_in_cell(tile.cell, to_vec3(p))) continue;
      rows.asked.push_back(q);
      include(rows.bounds, p);
    }
    while (!rows.asked.empty()) rows = sample(worker, queries, k, rows, out);
  }

  // Fills the rows that are exact, and returns the others, to be sampled farther out.
  Rows sample(TileWorker& worker, std::span<const std::uint32_t> queries, int k, const Rows& rows,
              std::span<Point> out) {
    worker.find(*first_.cut, region_around(first_.cut->bounds(), rows.bounds, rows.halo), for_each());
    worker.upload(cloud_.points(), for_each());
    std::vector<std::uint32_t> places;
    for (const std::size_t q : rows.asked)
      places.push_back(std::uint32_t(std::lower_bound(worker.indices.begin(), worker.indices.end(), queries[q]) -
                                     worker.indices.begin()));
    Rows left{sample_exact_rows(*worker.backend, worker.loaded, places, rows.asked, k, out), kNoBounds, 2 * rows.halo};
    for (const std::size_t q : left.asked) include(left.bounds, cloud_[queries[q]]);
    const Costs costs = worker.backend->take_costs();
    const std::lock_guard lock(peaks_);
    peak_device_ = std::max(peak_device_, costs.peak_device_bytes * workers_.size());
    peak_of_workers_ = std::max(peak_of_workers_, costs.peak_host_bytes * workers_.size());
    return left;
  }

  std::vector<TileWorker> workers_;
  std::mutex peaks_;  // of the two at the end, while several feeders work
  Tiling tiling_;
  Room cloud_, input_;  // as uploaded; of iterations from the third on
  Iteration first_, further_;
  int further_iteration_ = 0;  // which further_ is; 0: none
  std::vector<StageTime> times_;
  std::uint64_t peak_device_ = 0, peak_of_workers_ = 0;
};

}  // namespace

std::unique_ptr<TiledBackend> make_tiled_backend(std::vector<std::unique_ptr<Backend>> workers, Tiling tiling) {
  return std::make_unique<CloudInTiles>(std::move(workers), tiling);
}

}  // namespace pointfair
