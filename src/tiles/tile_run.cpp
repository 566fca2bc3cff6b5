// SPDX-License-Identifier: Apache-2.0
#include "tiles/tile_run.hpp"

#include <algorithm>
#include <cmath>
#include <new>
#include <optional>
#include <utility>

#include "point/outliers.h"
#include "seam/exactness.hpp"
#include "seam/noise_levels.hpp"
#include "seam/outlier_tally.hpp"
#include "seam/overlap.hpp"
#include "seam/sampling.hpp"
#include "seam/stop.hpp"
#include "tiles/halves.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kBlock = 1 << 14;
constexpr std::size_t kMostFarOff = 64;  // points that are looked at one by one, where they do not fit together

constexpr double kSurely = 1 + 1e-5;  // of squares of lengths, which backends round to floats

// Whether the radius of a point ends within what is known, and none of its neighbours is so near that their plane could
// make it one of a surface (point/outliers.h).
bool lacks_near_ones(const TileWorker& worker, std::size_t index, const FramedSettings& stages, double known) {
  const NeighborSettings& n = stages.neighbors;
  const FairingSettings& f = stages.fairing;
  const Point& place = worker.points[index];
  const std::uint32_t itself = first_of(worker.copies, std::uint32_t(index));
  std::vector<double> squared;
  for (std::uint32_t i = 0; i < worker.points.size(); ++i)
    if (i != itself && first_of(worker.copies, i) == i)
      squared.push_back(point::squared_length(point::offset_between(place, worker.points[i])));
  if (n.k > 0 || n.min_neighbors == 0 || squared.size() < std::size_t(n.min_neighbors)) return false;
  const auto last = squared.begin() + n.min_neighbors - 1;
  std::nth_element(squared.begin(), last, squared.end());
  const double nearest = *std::min_element(squared.begin(), last + 1), level = noise_level_at(n.levels.get(), place),
               base = level * n.radius, off = std::max(double(f.outlier_distance), level * f.level_outlier_distance),
               wide = std::isfinite(n.widest) ? n.widest : 0,
               widest = kSurely * (std::max(*last, wide * wide) + base * base);
  return widest < known * known && nearest > kSurely * std::max(point::kNearSquaredRadius * widest, off * off);
}

// Points that lie so far from all others that a box which holds the nearest of these holds more than fits: strays of a
// survey. Whether one is isolated follows from its nearest points alone, where they are all about as far as the
// nearest.
struct Isolated {
  Point result;
  unsigned char outcome;  // point::Outcome
};

// The result of the point at a place, if it is one that keeps its place with the whole cloud loaded, too. Null: it does
// not, or that does not follow from what the store loads around it.
std::optional<Isolated> isolated_at(const Point& place, PointStore& store, const FramedSettings& stages,
                                    TileWorker& worker, const std::stop_token& stop) {
  const auto& sensors = stages.fairing.sensors;
  if (sensors && sensors->places.size() > 1) return std::nullopt;  // which place is whose is told by numbers
  const double known = store.load_nearest(place, worker) - reach_of_decision(stages.copies);
  const auto at = std::ranges::find_if(worker.points, [&](const Point& p) { return same_place(p, place); });
  if (!(known > 0) || at == worker.points.end()) return std::nullopt;
  const auto index = std::size_t(at - worker.points.begin());
  worker.loaded = kEverywhere;
  worker.upload(stages.frame ? IndexOrder::along_curve : IndexOrder::fastest, stages.copies);
  if (!lacks_near_ones(worker, index, stages, known)) return std::nullopt;
  Backend& backend = *worker.backend;
  run_stages(backend, 0, stages, stop);
  worker.outcomes.resize(worker.points.size());
  backend.exactness()->outcomes(kEverywhere, worker.outcomes);
  const unsigned char outcome = worker.outcomes[index];
  backend.download(0, worker.results, {}, {});
  worker.note_costs();
  const Point result = worker.results[index];
  const bool is_isolated = std::isnan(result.x) && point::outlier_at(result.x) == point::Outlier::isolated;
  if (!is_isolated && (outcome & (point::kTooFew | point::kNoNormal)) == 0) return std::nullopt;
  return Isolated{result, outcome};
}

// A run, and what is left of it.
class Engine {
 public:
  Engine(const TileRun& run, std::vector<TileTask> first, const std::stop_token& stop)
      : run_(run), stop_(stop), halo_factor_(run.first_halo) {
    for (TileTask& task : first) tasks_.put(std::move(task));
  }

  Counts run(std::span<TileWorker> workers) {
    for (TileWorker& worker : workers) worker.task.reset();  // of a run that failed
    on_feeders(run_.feeders, [&](std::size_t feeder) {
      try {
        feed(workers_of(workers, feeder, run_.feeders));
      } catch (...) {
        tasks_.close();
        throw;
      }
    });
    return counts_;
  }

 private:
  // The workers in turn, so that one computes while another is copied to and from.
  void feed(std::span<TileWorker> workers) {
    const auto any_at_work = [&] {
      return std::ranges::any_of(workers, [](const TileWorker& w) { return w.task.has_value(); });
    };
    for (std::size_t turn = 0;; ++turn) {
      throw_if_stopped(stop_);
      if (tasks_.is_closed()) return;
      TileWorker& worker = workers[turn % workers.size()];
      if (worker.task) collect(worker);
      const bool none_at_work = !any_at_work();
      if (std::optional<TileTask> task = tasks_.take(none_at_work)) {
        worker.task = std::move(*task);
        start(worker);
      } else if (none_at_work) {
        return;
      }
    }
  }

  void start(TileWorker& worker) {
    const TileTask& task = *worker.task;
    worker.halo = task.halo > 0 ? task.halo : std::min(halo_of(task), task.widest_halo);
    worker.loaded = region_around(run_.store.bounds(), task.bounds, worker.halo);
    worker.finish_upload();  // of a run that failed
    if (!run_.store.load(worker.loaded, worker)) return split(worker);
    within_memory(worker, [&] {
      worker.upload(run_.stages.frame ? IndexOrder::along_curve : IndexOrder::fastest, run_.stages.copies);
      run_stages(*worker.backend, 0, settings_for(run_.stages, worker.numbers), stop_);
    });
  }

  double halo_of(const TileTask& task) {
    const std::lock_guard lock(mutex_);
    return first_halo(run_.store.bounds(), run_.stages, task.bounds) * halo_factor_;
  }

  // Takes the results that are exact, and makes a task of the others.
  void collect(TileWorker& worker) {
    Backend& backend = *worker.backend;
    const bool is_there = within_memory(worker, [&] {
      backend.download(0, worker.results, {}, {});
      worker.outcomes.resize(worker.points.size());
      backend.exactness()->outcomes(without_border(worker.loaded, run_.stages.copies), worker.outcomes);
      for (const Copy& copy : worker.copies) {
        unsigned char& outcome = worker.outcomes[copy.point];
        outcome = copy.is_sure ? outcome | point::kIsCopy : 0;
      }
      if (run_.result == TileRun::Result::normals) backend.download_normals(0, worker.results, {});
      worker.note_costs();
    });
    if (!is_there) return;
    const TileTask task = *std::exchange(worker.task, std::nullopt);
    Indices left = take_results(worker, task);
    if (task.cell && left.size() > task.bounds.valid / 50) {
      const std::lock_guard lock(mutex_);
      halo_factor_ *= 1.5;
    }
    if (!left.empty()) tasks_.put(listed(std::move(left), 2 * worker.halo));
    tasks_.finish_one();
  }

  // Returns the points of the task whose results are not known to be exact.
  Indices take_results(TileWorker& worker, const TileTask& task) {
    const std::span<const std::uint32_t> numbers = worker.numbers;
    const std::span<const Point> points = run_.store.points();
    std::vector<Indices> left((numbers.size() + kBlock - 1) / kBlock);
    std::vector<Counts> counts(left.size());
    for_tile_blocks(numbers.size(), run_.for_each, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        unsigned char& outcome = worker.outcomes[i];
        if (!is_wanted(task, numbers[i], points[numbers[i]])) {
          outcome = 0;
        } else if ((outcome & point::kExact) == 0) {
          outcome = 0;
          left[first / kBlock].push_back(numbers[i]);
        } else {
          add(counts[first / kBlock], outcome);
        }
      }
      run_.store.keep(numbers.subspan(first, last - first), worker.results.subspan(first, last - first),
                      std::span(worker.outcomes).subspan(first, last - first));
    });
    Indices all;
    for (const Indices& some : left) all.insert(all.end(), some.begin(), some.end());
    const std::lock_guard lock(mutex_);
    for (const Counts& some : counts) add(counts_, some);
    return all;
  }

  static bool is_wanted(const TileTask& task, std::uint32_t number, const Point& p) {
    return task.cell ? is_in_cell(*task.cell, to_vec3(p)) : std::ranges::binary_search(task.listed, number);
  }

  // Does `work` for the worker's task; false where it needs more memory than there is, and the task was split.
  template <class Work>
  bool within_memory(TileWorker& worker, const Work& work) {
    try {
      work();
      return true;
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::memory || worker.points.size() < run_.least_split) throw;
    } catch (const std::bad_alloc&) {
      if (worker.points.size() < run_.least_split) throw;
    }
    split(worker);
    return false;
  }

  // In two along the longest side. Where nearly all of the region is halo, halves would have hardly smaller ones.
  void split(TileWorker& worker) {
    TileTask task = *std::exchange(worker.task, std::nullopt);
    const std::span<const Point> points = run_.store.points();
    if (task.cell)
      for (const std::uint32_t i : worker.numbers)
        if (is_in_cell(*task.cell, to_vec3(points[i]))) task.listed.push_back(i);
    const Bounds& b = task.bounds;
    const float longest = std::max({b.max.x - b.min.x, b.max.y - b.min.y, b.max.z - b.min.z});
    if (task.listed.size() < 2 || longest < worker.halo / 8) {
      take_isolated(worker, task.listed);
      tasks_.finish_one();
      return;
    }
    for (Indices& half : halves_of(std::move(task.listed), points, task.bounds)) {
      if (half.empty()) continue;
      TileTask part = listed(std::move(half), task.halo > 0 ? worker.halo : 0);
      part.widest_halo = worker.halo;  // a strip along a border looks sparse
      tasks_.put(std::move(part));
    }
    tasks_.finish_one();
  }

  // Throws Error(memory) where one of the points is not, or may not be, isolated.
  void take_isolated(TileWorker& worker, const Indices& numbers) {
    if (numbers.empty() || numbers.size() > kMostFarOff || run_.result != TileRun::Result::points)
      throw run_.store.does_not_fit(numbers.empty() ? 0 : numbers.front());
    for (const std::uint32_t number : numbers) {
      const auto found = isolated_at(run_.store.points()[number], run_.store, run_.stages, worker, stop_);
      if (!found) throw run_.store.does_not_fit(number);
      run_.store.keep({&number, 1}, {&found->result, 1}, {&found->outcome, 1});
      const std::lock_guard lock(mutex_);
      add(counts_, found->outcome);
    }
  }

  TileTask listed(Indices indices, double halo) const {
    std::ranges::sort(indices);
    Bounds bounds = kNoBounds;
    for (const std::uint32_t i : indices) include(bounds, run_.store.points()[i]);
    return {std::nullopt, std::move(indices), bounds, halo};
  }

  const TileRun& run_;
  const std::stop_token& stop_;
  TaskQueue<TileTask> tasks_;
  std::mutex mutex_;  // of what follows
  Counts counts_;
  double halo_factor_;  // by which the tiles to come are wider than first_halo()
};

}  // namespace

Counts run_tiles(const TileRun& run, std::span<TileWorker> workers, std::vector<TileTask> first,
                 const std::stop_token& stop) {
  return Engine(run, std::move(first), stop).run(workers);
}

std::span<Point> TileWorker::room(HostBuffer& buffer, std::size_t count) {
  if (buffer.points().size() < count) {
    buffer = {};
    buffer = backend->host_buffer(count + count / 4);
  }
  return buffer.points().first(count);
}

// Beside other workers, an index gains nothing from being begun before all points are there.
void TileWorker::upload(IndexOrder expected, const CopyRule& rule) {
  Overlap* const overlap = overlaps ? backend->overlap() : nullptr;
  overlap ? overlap->start_upload(points, IndexOrder::along_curve) : backend->upload(points, expected);
  copies.clear();
  if (!rule.any() && known_copies.empty()) return;
  finish_upload();
  backend->sampling().for_each_on_host(1, [&](std::size_t) {
    copies = known_copies.empty() ? copies_among(points, rule, loaded) : copies_at_one_place(points, known_copies);
  });
  backend->set_aside(copies);
}

void TileWorker::finish_upload() {
  Overlap* const overlap = overlaps ? backend->overlap() : nullptr;
  if (overlap) overlap->finish_upload();
}

void TileWorker::note_costs() {
  const Costs costs = backend->take_costs();
  peak_host_bytes = std::max(peak_host_bytes, costs.peak_host_bytes);
  peak_device_bytes = std::max(peak_device_bytes, costs.peak_device_bytes);
}

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

std::span<TileWorker> workers_of(std::span<TileWorker> workers, std::size_t feeder, std::size_t feeders) {
  const std::size_t first = feeder * workers.size() / feeders;
  return workers.subspan(first, (feeder + 1) * workers.size() / feeders - first);
}

void add(Counts& counts, const Counts& more) {
  counts.unmoved.too_few_neighbors += more.unmoved.too_few_neighbors;
  counts.unmoved.no_normal += more.unmoved.no_normal;
  counts.short_neighborhoods += more.short_neighborhoods;
  counts.copies += more.copies;
  add(counts.pulled, more.pulled);
}

void for_tile_blocks(std::size_t count, const ForEach& for_each,
                     const std::function<void(std::size_t, std::size_t)>& body) {
  for_each((count + kBlock - 1) / kBlock,
           [&](std::size_t block) { body(block * kBlock, std::min(count, (block + 1) * kBlock)); });
}

}  // namespace pointfair
