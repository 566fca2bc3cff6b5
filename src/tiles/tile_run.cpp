// SPDX-License-Identifier: Apache-2.0
#include "tiles/tile_run.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "seam/exactness.hpp"
#include "seam/overlap.hpp"
#include "seam/stop.hpp"
#include "tiles/halves.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kBlock = 1 << 14;

}  // namespace

FramedSettings settings_for(const FramedSettings& settings, std::span<const std::uint32_t> indices) {
  const auto& sensors = settings.fairing.sensors;
  if (!sensors || sensors->places.size() < 2) return settings;
  SensorPlaces its;
  its.places.reserve(indices.size());
  for (const std::uint32_t i : indices) its.places.push_back(sensors->places[i]);
  FramedSettings of_tile = settings;
  of_tile.fairing.sensors = std::make_shared<const SensorPlaces>(std::move(its));
  return of_tile;
}

void add(Counts& counts, const Counts& more) {
  counts.unmoved.too_few_neighbors += more.unmoved.too_few_neighbors;
  counts.unmoved.no_normal += more.unmoved.no_normal;
  counts.short_neighborhoods += more.short_neighborhoods;
}

void for_tile_blocks(std::size_t count, const ForEach& for_each,
                     const std::function<void(std::size_t, std::size_t)>& body) {
  for_each((count + kBlock - 1) / kBlock,
           [&](std::size_t block) { body(block * kBlock, std::min(count, (block + 1) * kBlock)); });
}

bool TileTask::wants(std::uint32_t index, const Point& p) const {
  return cell ? is_in_cell(*cell, to_vec3(p)) : std::binary_search(listed.begin(), listed.end(), index);
}

std::span<TileWorker> workers_of(std::vector<TileWorker>& workers, std::size_t feeder, std::size_t feeders) {
  const std::size_t first = feeder * workers.size() / feeders;
  return std::span(workers).subspan(first, (feeder + 1) * workers.size() / feeders - first);
}

std::span<Point> TileWorker::room(HostBuffer& buffer, std::size_t count) {
  if (buffer.points().size() < count) {
    buffer = {};
    buffer = backend->host_buffer(count + count / 4);
  }
  return buffer.points().first(count);
}

void TileWorker::find(const Cut& cut, const point::Region& region, const ForEach& for_each) {
  cut.find(region, for_each, indices);
  loaded = region;
}

void TileWorker::upload(std::span<const Point> input, const ForEach& for_each) {
  finish_upload();  // of a run that failed
  const std::span<Point> to = room(in, indices.size());
  for_tile_blocks(to.size(), for_each, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) to[i] = input[indices[i]];
  });
  if (Overlap* overlap = backend->overlap()) {
    overlap->start_upload(to, IndexOrder::along_curve);
  } else {
    backend->upload(to, IndexOrder::along_curve);
  }
}

void TileWorker::finish_upload() {
  if (Overlap* overlap = backend->overlap()) overlap->finish_upload();
}

// A run's input and state.
struct TileRun::Job {
  const Cut& cut;
  std::span<const Point> input;
  const FramedSettings& stages;
  TaskQueue<TileTask> tasks{};
  std::mutex mutex{};  // of what follows; results of points have one writer each
  Results& results;
  double halo_factor;  // by which the tiles to come are wider than first_halo()

  TileTask listed(Indices indices, double halo) const {
    std::sort(indices.begin(), indices.end());
    Bounds bounds = kNoBounds;
    for (const std::uint32_t i : indices) include(bounds, input[i]);
    return {std::nullopt, std::move(indices), bounds, halo};
  }
};

void TileRun::run(const Cut& cut, std::span<const Point> input, const FramedSettings& stages, Results& results,
                  const std::stop_token& stop) {
  Job job{.cut = cut, .input = input, .stages = stages, .results = results, .halo_factor = tiling_.first_halo};
  for (TileWorker& worker : workers_) worker.task.reset();  // of a run that failed
  for (const Cut::Tile& tile : cut.tiles())
    if (tile.core.valid > 0) job.tasks.put({tile.cell, {}, tile.core, 0});
  on_feeders(tiling_.feeders, [&](std::size_t feeder) {
    try {
      feed(job, workers_of(workers_, feeder, tiling_.feeders), stop);
    } catch (...) {
      job.tasks.close();
      throw;
    }
  });
}

// The workers in turn, so that one computes while another is copied to and from.
void TileRun::feed(Job& job, std::span<TileWorker> workers, const std::stop_token& stop) {
  const auto any_at_work = [&] {
    return std::any_of(workers.begin(), workers.end(), [](const TileWorker& w) { return w.task.has_value(); });
  };
  for (std::size_t turn = 0;; ++turn) {
    throw_if_stopped(stop);
    if (job.tasks.is_closed()) return;
    TileWorker& worker = workers[turn % workers.size()];
    if (worker.task) collect(job, worker);
    const bool none_at_work = !any_at_work();
    if (std::optional<TileTask> task = job.tasks.take(none_at_work)) {
      start(job, worker, std::move(*task), stop);
    } else if (none_at_work) {
      return;
    }
  }
}

void TileRun::start(Job& job, TileWorker& worker, TileTask task, const std::stop_token& stop) {
  if (task.halo == 0) {
    const std::lock_guard lock(job.mutex);
    task.halo = first_halo(job.cut.bounds(), job.stages, task.bounds) * job.halo_factor;
  }
  worker.find(job.cut, region_around(job.cut.bounds(), task.bounds, task.halo), for_each_);
  if (worker.indices.size() > tiling_.most_points) return split(job, worker, std::move(task));
  worker.upload(job.input, for_each_);
  Backend& backend = *worker.backend;
  run_stages(backend, 0, settings_for(job.stages, worker.indices), stop);
  worker.task = std::move(task);
}

// In two along the longest side, if a task needs more points than can be uploaded.
void TileRun::split(Job& job, const TileWorker& worker, TileTask task) {
  if (task.cell)
    for (const std::uint32_t i : worker.indices)
      if (is_in_cell(*task.cell, to_vec3(job.input[i]))) task.listed.push_back(i);
  if (task.listed.size() < 2)
    throw Error(ErrorKind::memory,
                "point " + std::to_string(task.listed.empty() ? 0 : task.listed[0]) +
                    " lies so far from others that its neighbourhood does not fit the device's memory; remove "
                    "outliers, or run on the CPU");
  for (Indices& half : halves_of(std::move(task.listed), job.input, task.bounds))
    job.tasks.put(job.listed(std::move(half), task.halo));
  job.tasks.finish_one();
}

// Takes the results that are exact, and makes a task of the others.
void TileRun::collect(Job& job, TileWorker& worker) {
  const TileTask task = std::move(*worker.task);
  worker.task.reset();
  Backend& backend = *worker.backend;
  const std::size_t count = worker.indices.size();
  const std::span<Point> out = worker.room(worker.out, count);
  backend.download(0, out, {}, {});
  worker.outcomes.resize(count);
  backend.exactness()->outcomes(worker.loaded, worker.outcomes);
  std::vector<Point> normals(job.results.normals.empty() ? 0 : count);
  if (!normals.empty()) backend.download_normals(0, normals, {});

  Indices left = take_results(job, worker, task, out, normals);
  const Costs costs = backend.take_costs();
  {
    const std::lock_guard lock(job.mutex);
    Results& results = job.results;
    results.peak_host_bytes = std::max(results.peak_host_bytes, costs.peak_host_bytes * workers_.size());
    results.peak_device_bytes = std::max(results.peak_device_bytes, costs.peak_device_bytes * workers_.size());
    if (task.cell && left.size() > task.bounds.valid / 50) job.halo_factor *= 1.5;
  }
  if (!left.empty()) job.tasks.put(job.listed(std::move(left), 2 * task.halo));
  job.tasks.finish_one();
}

// Returns the points of the task whose results are not known to be exact.
Indices TileRun::take_results(Job& job, const TileWorker& worker, const TileTask& task, std::span<const Point> out,
                              std::span<const Point> normals) {
  const std::size_t count = worker.indices.size();
  std::vector<Indices> left((count + kBlock - 1) / kBlock);
  std::vector<Counts> counts(left.size());
  for_tile_blocks(count, for_each_, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const std::uint32_t index = worker.indices[i];
      if (!task.wants(index, job.input[index])) continue;
      if ((worker.outcomes[i] & point::kExact) == 0) {
        left[first / kBlock].push_back(index);
        continue;
      }
      if (!job.results.points.empty()) job.results.points[index] = out[i];
      if (!normals.empty()) job.results.normals[index] = normals[i];
      add(counts[first / kBlock], worker.outcomes[i]);
    }
  });
  Indices all;
  for (const Indices& some : left) all.insert(all.end(), some.begin(), some.end());
  const std::lock_guard lock(job.mutex);
  for (const Counts& some : counts) add(job.results.counts, some);
  return all;
}

}  // namespace pointfair
