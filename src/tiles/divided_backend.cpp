// SPDX-License-Identifier: Apache-2.0
#include "tiles/divided_backend.hpp"

#include <algorithm>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "seam/clock.hpp"
#include "seam/device_memory.hpp"
#include "seam/device_tiles.hpp"
#include "seam/exactness.hpp"
#include "seam/sampling.hpp"
#include "seam/stop.hpp"
#include "tiles/choice.hpp"
#include "tiles/cut.hpp"
#include "tiles/feeders.hpp"
#include "tiles/halo.hpp"
#include "tiles/tile_run.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kSampled = 4096;  // points of which the cells are made

// What is held of one iteration. Stages up to the normals only note what they are to do; fairing does it all.
struct Iteration {
  FramedSettings stages;
  Counts counts;
};

// The bounds of a cell within a cloud of many times as many points.
Bounds within(const Bounds& whole, const point::Cell& cell, std::uint64_t cells) {
  return {{std::max(cell.min.x, whole.min.x), std::max(cell.min.y, whole.min.y), std::max(cell.min.z, whole.min.z)},
          {std::min(cell.max.x, whole.max.x), std::min(cell.max.y, whole.max.y), std::min(cell.max.z, whole.max.z)},
          whole.valid / cells + 1};
}

class DividedCloud final : public Backend, public Sampling, public DeviceMemory {
 public:
  DividedCloud(std::unique_ptr<Backend> whole, std::vector<std::function<std::unique_ptr<Backend>()>> of_devices)
      : whole_(std::move(whole)), of_devices_(std::move(of_devices)), cells_wanted_(of_devices_.size()) {}

  DeviceInfo device() const override { return whole_->device(); }
  HostBuffer host_buffer(std::size_t count) override { return whole_->host_buffer(count); }

  // The whole index is for estimates only, so none is begun.
  void upload(std::span<const Point> points, IndexOrder) override {
    forget(points.size());
    make_workers();  // their links carry shares
    whole_->upload(points, IndexOrder::along_curve);
  }
  Origin upload(const DevicePoints& points, DeviceStream stream, const ChooseOrigin& choose, IndexOrder) override {
    forget(points.count);
    return memory().upload(points, stream, choose, IndexOrder::along_curve);
  }

  void set_aside(std::vector<Copy> copies) override {
    forget(points_);
    copies_ = copies;
    whole_->set_aside(std::move(copies));
  }

  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token) override {
    if (iteration > 0) further_iteration_ = iteration;
    held(iteration).stages.frame = frame;
    is_indexed_ = is_indexed_ && iteration > 0;
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token) override {
    held(iteration).stages.neighbors = settings;
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token) override {
    held(iteration).stages.normals = settings;
  }
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override {
    const auto start = Clock::now();
    cut_milliseconds_ = 0;
    Iteration& its = held(iteration);
    its.stages.fairing = settings;
    for (;;) try {
        its.counts = compute(iteration, stop);
        break;
      } catch (const Error& error) {
        workers_.clear();  // their memory is needed
        const std::uint64_t more = more_tiles({}, bounds().valid, cells_wanted_);
        if (error.kind() != ErrorKind::memory || more == 0) throw;
        cells_wanted_ = more;
        cells_.clear();
      }
    times_.push_back({"cut", cut_milliseconds_});
    times_.push_back({"tiles", milliseconds_since(start) - cut_milliseconds_});
  }

  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    return whole_->download(iteration, points, limits, outliers);
  }
  OutlierCounts download(int iteration, const DeviceOutput& points, DeviceStream stream,
                         const DisplacementLimits& limits, std::span<std::uint8_t> outliers) override {
    return memory().download(iteration, points, stream, limits, outliers);
  }
  void download_input(std::span<Point> points) override { whole_->download_input(points); }
  // Normals are not kept: the first device computes all of them again.
  void download_normals(int iteration, std::span<Point> normals, std::stop_token stop) override {
    estimate_whole(iteration, stop);
    whole_->download_normals(iteration, normals, stop);
  }
  void download_normals(int iteration, const DeviceOutput& normals, DeviceStream stream) override {
    estimate_whole(iteration, {});
    memory().download_normals(iteration, normals, stream);
  }

  Counts counts(int iteration) override {
    Counts counts = held(iteration).counts;
    counts.unmoved.non_finite = points_ - bounds().valid - copies_.size();
    add_copies(copies_, points_, counts, [&](std::span<unsigned char> outcomes) {
      estimate_whole(0, {});
      whole_->exactness()->outcomes(kEverywhere, outcomes);
    });
    return counts;
  }
  Costs take_costs() override {
    Costs costs = whole_->take_costs();
    costs.stages.insert(costs.stages.begin(), times_.begin(), times_.end());
    times_.clear();
    std::uint64_t most = 0;
    for (const auto& worker : workers_) most = std::max(most, worker->take_costs().peak_device_bytes);
    costs.peak_device_bytes += most;
    costs.tiles = std::max<std::uint64_t>(1, cells_.size());
    return costs;
  }

  // A stage that was given up is computed anew in any case, but the first device must not find the stop again.
  std::optional<StageOf> take_stopped() override {
    whole_->take_stopped();
    return std::nullopt;
  }

  Sampling& sampling() override { return *this; }
  ManyClouds* many_clouds() override { return whole_->many_clouds(); }
  DeviceMemory* device_memory() override { return whole_->device_memory() == nullptr ? nullptr : this; }

  CloudSample sample_cloud(std::size_t count) override { return whole_->sampling().sample_cloud(count); }
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    index_whole();
    whole_->sampling().sample_neighborhoods(queries, k, out);
  }
  Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                       std::stop_token stop) override {
    index_whole();
    return whole_->sampling().take_samples(for_spacing, for_noise, stop);
  }
  Samples take_samples_by(SampleRule rule, std::span<const std::uint32_t> for_noise, std::stop_token stop) override {
    index_whole();
    return whole_->sampling().take_samples_by(rule, for_noise, stop);
  }
  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    whole_->sampling().for_each_on_host(count, body);
  }

 private:
  DeviceTiles& tiles() { return *whole_->device_tiles(); }
  DeviceMemory& memory() { return *whole_->device_memory(); }
  Iteration& held(int iteration) {
    if (iteration != 0 && iteration != further_iteration_)
      throw Error(ErrorKind::failed, "the results of iteration " + std::to_string(iteration) + " are not held");
    return iteration == 0 ? first_ : further_;
  }
  void forget(std::size_t points) {
    points_ = points;
    copies_.clear();
    further_iteration_ = 0;
    is_indexed_ = false;
    cells_.clear();
    bounds_.reset();
  }

  void index_whole() {
    if (!is_indexed_) whole_->build_index(0, first_.stages.frame, {});
    is_indexed_ = true;
  }
  void estimate_whole(int iteration, const std::stop_token& stop) {
    const FramedSettings& stages = held(iteration).stages;
    try {
      whole_->build_index(iteration, stages.frame, stop);
      whole_->find_neighbors(iteration, stages.neighbors, stop);
      whole_->estimate_normals(iteration, stages.normals, stop);
    } catch (const Error&) {
      whole_->take_stopped();
      throw;
    }
  }

  const Bounds& bounds() {
    if (!bounds_) divide();
    return *bounds_;
  }
  void divide() {
    CloudSample sample = sample_cloud(kSampled);
    bounds_ = sample.bounds;
    cells_ = cells_of(sample.points, cells_wanted_);
  }
  void make_workers() {
    if (!workers_.empty()) return;
    const std::size_t count = std::min(of_devices_.size(), DeviceTiles::kMostTiles);
    for (std::size_t i = 0; i < count; ++i) {
      workers_.push_back(of_devices_[i]());
      workers_.back()->device_tiles()->connect(tiles());
    }
  }

  // The cells in turn, as many at once as there are devices; then what is left of them, with more around it.
  Counts compute(int iteration, const std::stop_token& stop) {
    make_workers();
    if (cells_.empty()) divide();
    const FramedSettings& stages = held(iteration).stages;
    std::deque<TileTask> tasks;
    for (const point::Cell& cell : cells_) {
      const Bounds its = within(bounds(), cell, cells_.size());
      tasks.push_back({cell, {}, its, first_halo(bounds(), stages, its)});
    }
    Counts counts;
    tiles().begin_tiles(iteration);
    while (!tasks.empty() && bounds().valid > 0) {
      throw_if_stopped(stop);
      const std::size_t at_once = std::min(tasks.size(), workers_.size());
      std::vector<DeviceTile> now;
      for (std::size_t i = 0; i < at_once; ++i)
        now.push_back({*tasks[i].cell, region_around(bounds(), tasks[i].bounds, tasks[i].halo)});
      const auto start = Clock::now();
      tiles().gather(now);
      cut_milliseconds_ += milliseconds_since(start);
      const std::vector<FramedSettings> of_tiles = settings_of_tiles(stages, at_once);
      on_feeders(at_once, [&](std::size_t i) { compute_tile(i, of_tiles[i], stop); });
      const auto back = Clock::now();
      const std::vector<TileTally> tallies = tiles().scatter();
      cut_milliseconds_ += milliseconds_since(back);
      for (const TileTally& tally : tallies) {
        add(counts, tally.counts);
        if (tally.left.valid > 0) tasks.push_back({tasks.front().cell, {}, tally.left, 2 * tasks.front().halo});
        tasks.pop_front();
      }
    }
    return counts;
  }

  std::vector<FramedSettings> settings_of_tiles(const FramedSettings& settings, std::size_t tiles_now) {
    std::vector<FramedSettings> result(tiles_now, settings);
    const auto& sensors = settings.fairing.sensors;
    if (!sensors || sensors->places.size() < 2) return result;
    for (std::size_t i = 0; i < tiles_now; ++i) result[i] = settings_for(settings, tiles().gathered(i));
    return result;
  }
  void compute_tile(std::size_t tile, const FramedSettings& stages, const std::stop_token& stop) {
    Backend& worker = *workers_[tile];
    DeviceTiles& its = *worker.device_tiles();
    try {
      its.take(tiles(), tile);
      run_stages(worker, 0, stages, stop);
      its.give(tiles(), tile);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::interrupted) worker.take_stopped();
      throw;
    }
  }

  std::unique_ptr<Backend> whole_;
  std::vector<std::function<std::unique_ptr<Backend>()>> of_devices_;
  std::vector<std::unique_ptr<Backend>> workers_;
  std::size_t cells_wanted_, points_ = 0;
  std::vector<Copy> copies_;  // that are set aside
  std::vector<point::Cell> cells_;
  std::optional<Bounds> bounds_;  // of what was uploaded
  Iteration first_, further_;
  int further_iteration_ = 0;  // which further_ is; 0: none
  bool is_indexed_ = false;    // the first iteration's input as a whole
  std::vector<StageTime> times_;
  double cut_milliseconds_ = 0;  // of this iteration: for points to tiles, and for results back
};

}  // namespace

std::unique_ptr<Backend> make_divided_backend(std::vector<std::function<std::unique_ptr<Backend>()>> of_devices) {
  std::unique_ptr<Backend> whole = of_devices.at(0)();
  if (whole->device_tiles() == nullptr) return nullptr;
  return std::make_unique<DividedCloud>(std::move(whole), std::move(of_devices));
}

}  // namespace pointfair
