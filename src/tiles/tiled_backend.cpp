// SPDX-License-Identifier: Apache-2.0
#include "tiles/tiled_backend.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "platform/large_vector.hpp"
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

using Room = platform::LargeVector<Point>;

// What the room held is not kept.
void make_room(Room& room, std::size_t count) {
  if (count > room.capacity()) room = {};
  room.resize(count);
}

// The points of a cut cloud, and room for the results of all of them.
class HostStore final : public PointStore {
 public:
  HostStore(const Cut& cut, std::span<const Point> input, std::span<Point> results, std::uint64_t most_points,
            const ForEach& for_each, std::span<unsigned char> outcomes = {})
      : cut_(cut),
        input_(input),
        results_(results),
        most_points_(most_points),
        for_each_(for_each),
        outcomes_(outcomes) {}

  const Bounds& bounds() const override { return cut_.bounds(); }
  std::span<const Point> points() const override { return input_; }
  bool load(const point::Region& region, TileWorker& worker) override {
    cut_.find(region, for_each_, worker.numbers);
    const std::span<const std::uint32_t> numbers = worker.numbers;
    if (numbers.size() > most_points_) return false;
    const std::span<Point> to = worker.room(worker.in, numbers.size());
    for_tile_blocks(to.size(), for_each_, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) to[i] = input_[numbers[i]];
    });
    worker.points = to;
    if (!results_.empty()) worker.results = worker.room(worker.out, numbers.size());
    return true;
  }
  void keep(std::span<const std::uint32_t> numbers, std::span<const Point> results,
            std::span<const unsigned char> outcomes) override {
    for (std::size_t i = 0; i < numbers.size(); ++i)
      if (outcomes[i] != 0) {
        results_[numbers[i]] = results[i];
        if (!outcomes_.empty()) outcomes_[numbers[i]] = outcomes[i];
      }
  }
  Error does_not_fit(std::size_t number) const override {
    return {ErrorKind::memory, "point " + std::to_string(number) +
                                   " lies so far from others that its neighbourhood does not fit the device's memory; "
                                   "remove outliers, or run on the CPU"};
  }

 private:
  const Cut& cut_;
  std::span<const Point> input_;
  std::span<Point> results_;
  std::uint64_t most_points_;
  const ForEach& for_each_;
  std::span<unsigned char> outcomes_;
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
    for (auto& backend : workers) {
      workers_.emplace_back(*backend).overlaps = true;
      backends_.push_back(std::move(backend));
    }
  }

  void cut_into(std::uint64_t tiles) override { tiling_.tiles = tiles; }
  DeviceInfo device() const override { return backends_[0]->device(); }
  HostBuffer host_buffer(std::size_t count) override { return backends_[0]->host_buffer(count); }

  void upload(std::span<const Point> points, IndexOrder) override {
    make_room(cloud_, points.size());
    copy(points, cloud_);
    for (TileWorker& worker : workers_) worker.peak_host_bytes = worker.peak_device_bytes = 0;
    copies_.clear();
    forget_results();
  }
  void set_aside(std::vector<Copy> copies) override {
    for (const Copy& copy : copies_) cloud_[copy.point] = copy.place;
    copies_ = std::move(copies);
    for (const Copy& copy : copies_) cloud_[copy.point] = {kNan, kNan, kNan};
    forget_results();
  }

  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token) override {
    const auto start = Clock::now();
    if (iteration > 0 && iteration != further_iteration_) {
      if (iteration > 1) std::swap(held(iteration - 1).faired, input_);
      further_iteration_ = iteration;
    }
    Iteration& its = held(iteration);
    its.stages.frame = frame;
    its.cut.emplace(input_of(iteration), tiling_.tiles, on_host());
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
    make_room(its.faired, cloud_.size());
    copy_invalid(input_of(iteration), its.faired);
    its.counts = run(iteration, TileRun::Result::points, its.faired, stop);
    its.counts.unmoved.non_finite = cloud_.size() - first_.cut->bounds().valid - copies_.size();
    add_copies(copies_, cloud_.size(), its.counts,
               [&](std::span<unsigned char> outcomes) { std::ranges::copy(outcomes_, outcomes.begin()); });
    note("tiles", start);
  }

  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    const auto start = Clock::now();
    const Room& faired = held(iteration).faired;
    std::ranges::fill(outliers, std::uint8_t(0));
    const bool is_limited = limits.farthest > 0, may_hold_back = is_limited || iteration > 0;
    const DisplacementLimits used = limits.or_endless();
    const point::NodeField field = field_of(used.levels.get());
    OutlierTally held_back;
    const auto hold_back = [&](std::size_t i, const Point& from, const Point& now, OutlierCounts& here) {
      const auto limited = point::limited(to_vec3(from), to_vec3(now), used, point::node_value(field, to_vec3(from)));
      points[i] = {limited.place.x, limited.place.y, limited.place.z};
      count(limited.outlier, here);
      if (!outliers.empty()) outliers[i] = static_cast<std::uint8_t>(limited.outlier);
    };
    for_tile_blocks(points.size(), on_host(), [&](std::size_t first, std::size_t last) {
      if (!may_hold_back) {
        std::copy_n(&faired[first], last - first, &points[first]);
        return;
      }
      OutlierCounts here;
      for (std::size_t i = first; i < last; ++i) {
        points[i] = faired[i];
        if (is_indexed(cloud_[i])) hold_back(i, cloud_[i], faired[i], here);
      }
      held_back.add(here);
    });
    OutlierCounts of_copies;
    for (const Copy& copy : copies_) {
      points[copy.point] = faired[copy.first];
      if (may_hold_back) hold_back(copy.point, copy.place, faired[copy.first], of_copies);
    }
    held_back.add(of_copies);
    note("download", start);
    return held_back.counts();
  }
  void download_input(std::span<Point> points) override {
    copy(cloud_, points);
    for (const Copy& copy : copies_) points[copy.point] = copy.place;
  }
  // Normals are not kept: the tiles are computed again.
  void download_normals(int iteration, std::span<Point> normals, std::stop_token stop) override {
    std::ranges::fill(normals, Point{0, 0, 0});
    run(iteration, TileRun::Result::normals, normals, stop);
    follow<Point>(copies_, normals);
  }

  Counts counts(int iteration) override { return held(iteration).counts; }
  Costs take_costs() override {
    std::uint64_t bytes = 0, of_worker = 0, of_device = 0;
    for (const Room* points : {&cloud_, &input_, &first_.faired, &further_.faired})
      bytes += points->capacity() * sizeof(Point);
    for (const TileWorker& worker : workers_) {
      bytes += (worker.in.points().size() + worker.out.points().size()) * sizeof(Point);
      bytes += worker.numbers.capacity() * sizeof(std::uint32_t);
      of_worker = std::max(of_worker, worker.peak_host_bytes);
      of_device = std::max(of_device, worker.peak_device_bytes);
    }
    const std::uint64_t tiles = first_.cut ? std::max<std::uint64_t>(1, first_.cut->tiles().size()) : 1;
    return {std::exchange(times_, {}), bytes + of_worker * workers_.size(), of_device * workers_.size(), tiles};
  }

  Sampling& sampling() override { return *this; }

  CloudSample sample_cloud(std::size_t count) override {
    const auto point_at = [this](std::size_t i) { return std::pair(cloud_[i], std::uint32_t(i)); };
    return sample_points(cloud_.size(), point_at, count, on_host());
  }
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    std::ranges::fill(out, Point{kNan, kNan, kNan});
    std::vector<Point> places;
    for (const std::uint32_t query : queries) places.push_back(cloud_[query]);
    const ExactRows rows{
        k, places, out, [&](const TileWorker& worker, std::size_t q) {
          return std::uint32_t(std::ranges::lower_bound(worker.numbers, queries[q]) - worker.numbers.begin());
        }};
    TaskQueue<const Cut::Tile*> tiles;
    for (const Cut::Tile& tile : first_.cut->tiles()) tiles.put(&tile);
    const ForEach each = on_host();
    HostStore store(*first_.cut, cloud_, {}, tiling_.most_points, each);
    on_feeders(tiling_.feeders, [&](std::size_t feeder) {
      TileWorker& worker = workers_of(workers_, feeder, tiling_.feeders).front();
      while (const auto tile = tiles.take(false)) {
        std::vector<std::size_t> asked;
        for (std::size_t q = 0; q < queries.size(); ++q)
          if (is_indexed(places[q]) && is_in_cell((*tile)->cell, to_vec3(places[q]))) asked.push_back(q);
        const double halo = reach_of_nearest(first_.cut->bounds(), k, (*tile)->core);
        rows.fill(store, worker, std::move(asked), tiling_.first_halo * halo);
      }
    });
  }
  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    backends_[0]->sampling().for_each_on_host(count, body);
  }

 private:
  Iteration& held(int iteration) {
    if (iteration != 0 && iteration != further_iteration_)
      throw Error(ErrorKind::failed, "the results of iteration " + std::to_string(iteration) + " are not held");
    return iteration == 0 ? first_ : further_;
  }
  std::span<const Point> input_of(int iteration) const {
    return iteration == 0 ? cloud_ : iteration == 1 ? first_.faired : input_;
  }
  void forget_results() {
    first_.cut.reset();
    further_.cut.reset();
    further_iteration_ = 0;
  }
  void note(const char* name, Clock::time_point start) { times_.push_back({name, milliseconds_since(start)}); }

  Counts run(int iteration, TileRun::Result result, std::span<Point> results, const std::stop_token& stop) {
    const Iteration& its = held(iteration);
    std::vector<TileTask> tiles;
    for (const Cut::Tile& tile : its.cut->tiles())
      if (tile.core.valid > 0) tiles.push_back({tile.cell, {}, tile.core});
    const ForEach each = on_host();
    outcomes_.resize(copies_.empty() ? 0 : results.size());
    HostStore store(*its.cut, input_of(iteration), results, tiling_.most_points, each, outcomes_);
    return run_tiles({store, its.stages, each, result, tiling_.feeders, tiling_.first_halo}, workers_, std::move(tiles),
                     stop);
  }

  // By all threads.
  void copy(std::span<const Point> from, std::span<Point> to) {
    for_tile_blocks(from.size(), on_host(),
                    [&](std::size_t first, std::size_t last) { std::copy_n(&from[first], last - first, &to[first]); });
  }
  // Points that no tile has.
  void copy_invalid(std::span<const Point> from, std::span<Point> to) {
    for_tile_blocks(from.size(), on_host(), [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i)
        if (!is_indexed(from[i])) to[i] = from[i];
    });
  }

  std::vector<TileWorker> workers_;
  std::vector<std::unique_ptr<Backend>> backends_;  // of the workers; go first, since they may still read their buffers
  Tiling tiling_;
  std::vector<Copy> copies_;             // that are set aside; NaN in the cloud
  std::vector<unsigned char> outcomes_;  // of the last run, if there are any
  Room cloud_, input_;                   // as uploaded; of iterations from the third on
  Iteration first_, further_;
  int further_iteration_ = 0;  // which further_ is; 0: none
  std::vector<StageTime> times_;
};

}  // namespace

std::unique_ptr<TiledBackend> make_tiled_backend(std::vector<std::unique_ptr<Backend>> workers, Tiling tiling) {
  return std::make_unique<CloudInTiles>(std::move(workers), tiling);
}

}  // namespace pointfair
