// SPDX-License-Identifier: Apache-2.0
// A backend for clouds that its workers cannot hold at once: the cloud stays in host memory, and one piece of it after
// the other is uploaded with a halo, computed and downloaded. With two workers on one card, one piece is copied while
// the other is computed.
//
// Exact halos. One pass at a time goes over all pieces, so a halo serves one pass. A worker tells of each point whether
// its result would be the same with the whole cloud loaded (point/region.h): its neighbourhood lies inside what is
// loaded, and so do those of all whose normals or mean distances it reads. Points of which that is not sure are done
// again with a halo twice as wide. Points are uploaded in the order of the whole cloud, so that ties among equally near
// ones, which go by index, are as in the whole; balls are thinned by that index itself, and sums over
// them run along a curve that the caller lays over the whole cloud.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <deque>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "cut.hpp"
#include "point/outliers.h"

namespace pointfair {
namespace {

using Clock = std::chrono::steady_clock;
using Indices = std::vector<std::uint32_t>;

constexpr std::size_t kBlock = 1 << 14;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

// Points whose results are wanted: those of a cell, or those listed.
struct Task {
  std::optional<Cell> cell;
  Indices listed;
  Bounds bounds;
  double halo;

  bool wants(std::uint32_t index, const Point& p) const {
    return cell ? cell->contains(p) : std::binary_search(listed.begin(), listed.end(), index);
  }
};

// A backend, and the task that it is about.
struct Worker {
  std::optional<Task> task;
  point::Region loaded{};
  Indices indices;  // of the uploaded points
  HostBuffer in, out;
  std::vector<unsigned char> outcomes;
  std::unique_ptr<Backend> backend;  // goes first, since it may still read `in`

  std::span<Point> room(HostBuffer& buffer, std::size_t count) {
    if (buffer.points().size() < count) {
      buffer = {};
      buffer = backend->host_buffer(count + count / 4);
    }
    return buffer.points().first(count);
  }
};

class CutBackend final : public Backend {
 public:
  CutBackend(std::vector<std::unique_ptr<Backend>> workers, Cutting cutting) : cutting_(cutting) {
    for (auto& backend : workers) workers_.emplace_back().backend = std::move(backend);
  }

  DeviceInfo device() const override { return workers_[0].backend->device(); }
  HostBuffer host_buffer(std::size_t count) override { return workers_[0].backend->host_buffer(count); }

  void upload(std::span<const Point> points) override {
    copy(points, cloud_);
    peak_device_ = peak_inner_host_ = 0;
    for (std::optional<Cut>& cut : cuts_) cut.reset();
    begin_pass(0);
  }

  void begin_pass(int pass) override {
    pass_ = pass;
    if (pass > 1) further_.swap(pass_input_);
  }

  void order_along(std::optional<CurveCube> cube) override {
    for (Worker& worker : workers_) worker.backend->order_along(cube);
  }

  void build_index(std::stop_token) override {
    const auto start = Clock::now();
    cuts_[chain()].emplace(input(), cutting_.pieces, for_each());
    note("cut", start);
  }
  void find_neighbors(const NeighborSettings& settings, std::stop_token) override { neighbors_ = settings; }
  void estimate_normals(const NormalSettings& settings, std::stop_token) override { normals_ = settings; }
  void fair(const FairingSettings& settings, std::stop_token stop) override {
    fairing_ = settings;
    const auto start = Clock::now();
    run({}, stop);
    note("tiles", start);
  }

  std::vector<StageTime> stage_times() override { return std::exchange(times_, {}); }

  std::uint64_t download(std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    const auto start = Clock::now();
    std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
    const bool is_limited = limits.farthest > 0;
    const float farthest = is_limited ? limits.farthest : kInfinity;
    const float outlier_distance = is_limited ? limits.outlier_distance : kInfinity;
    std::atomic<std::uint64_t> held_back = 0;
    const bool may_hold_back = is_limited || pass_ > 0;
    for_blocks(points.size(), [&](std::size_t first, std::size_t last) {
      std::uint64_t here = 0;
      if (!may_hold_back) {
        std::copy_n(&output()[first], last - first, &points[first]);
        return;
      }
      for (std::size_t i = first; i < last; ++i) {
        const Point &before = cloud_[i], &after = output()[i];
        points[i] = after;
        if (!is_valid(before)) continue;
        const auto settled =
            point::settled({before.x, before.y, before.z}, {after.x, after.y, after.z}, farthest, outlier_distance);
        points[i] = {settled.place.x, settled.place.y, settled.place.z};
        here += settled.is_outlier;
        if (!outliers.empty()) outliers[i] = settled.is_outlier;
      }
      held_back += here;
    });
    note("download", start);
    return held_back;
  }
  void download_input(std::span<Point> points) override { std::copy(cloud_.begin(), cloud_.end(), points.begin()); }
  // Normals are not kept: the pass runs again.
  void download_normals(std::span<Point> normals) override {
    std::fill(normals.begin(), normals.end(), Point{0, 0, 0});
    run(normals, {});
  }

  Bounds bounds() const override { return cut().bounds(); }

  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    std::fill(out.begin(), out.end(), Point{kNan, kNan, kNan});
    for (const Cut::Piece& piece : cut().pieces()) {
      Samples samples{{}, kNoBounds, cutting_.first_halo * first_halo(k, piece.core)};
      for (std::size_t q = 0; q < queries.size(); ++q) {
        const Point& p = input()[queries[q]];
        if (!is_valid(p) || !piece.cell.contains(p)) continue;
        samples.asked.push_back(q);
        include(samples.bounds, p);
      }
      sample(queries, k, samples, out);
    }
  }
  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    workers_[0].backend->for_each_on_host(count, body);
  }

  std::uint64_t pieces() const override { return cuts_[0] ? std::max<std::uint64_t>(1, cuts_[0]->pieces().size()) : 1; }
  Counts counts() const override { return counts_[chain()]; }
  std::uint64_t peak_host_bytes() const override {
    std::uint64_t bytes = (cloud_.capacity() + first_.capacity() + further_.capacity() + pass_input_.capacity());
    for (const Worker& worker : workers_) {
      bytes += worker.in.points().size() + worker.out.points().size();
      bytes += worker.indices.capacity() / 3;
    }
    return bytes * sizeof(Point) + peak_inner_host_;
  }
  std::uint64_t peak_device_bytes() const override { return peak_device_; }

 private:
  struct Samples {
    std::vector<std::size_t> asked;  // rows
    Bounds bounds;                   // of their points
    double halo;
  };

  ForEach for_each() {
    return [this](std::size_t count, const std::function<void(std::size_t)>& body) { for_each_on_host(count, body); };
  }
  const std::vector<Point>& input() const { return pass_ == 0 ? cloud_ : pass_ == 1 ? first_ : pass_input_; }
  std::vector<Point>& output() { return pass_ == 0 ? first_ : further_; }
  int chain() const { return pass_ == 0 ? 0 : 1; }
  const Cut& cut() const { return *cuts_[chain()]; }
  void note(const char* name, Clock::time_point start) {
    times_.push_back({name, std::chrono::duration<double, std::milli>(Clock::now() - start).count()});
  }

  // As wide as the k nearest of a surface with the piece's points should reach, and then some.
  double first_halo(double k, const Bounds& b) const {
    double sides[] = {double(b.max.x) - b.min.x, double(b.max.y) - b.min.y, double(b.max.z) - b.min.z};
    std::sort(std::begin(sides), std::end(sides));
    const double count = double(std::max<std::uint64_t>(b.valid, 1));
    const double spacing = std::max(std::sqrt(sides[2] * sides[1] / count), sides[2] / count);
    const Bounds& all = cut().bounds();
    const double diagonal =
        std::hypot(double(all.max.x) - all.min.x, double(all.max.y) - all.min.y, double(all.max.z) - all.min.z);
    return std::max(2.5 * std::sqrt((k + 1) / std::numbers::pi) * spacing, 1e-6 * diagonal);
  }
  double first_halo(const Bounds& bounds) const {
    const double nearest = first_halo(neighbors_.k > 0 ? neighbors_.k : neighbors_.widening, bounds);
    double reach = neighbors_.k > 0 ? nearest : std::hypot(nearest, double(neighbors_.radius));
    if (neighbors_.k > 0 && neighbors_.radius > 0) reach = std::min(reach, 1.01 * double(neighbors_.radius));
    if (neighbors_.constraint) reach += double(neighbors_.reach);
    const bool reads_others = fairing_.two_planes || fairing_.area_weight != AreaWeight::none || fairing_.pull_outliers;
    const int steps = fairing_.method != Method::bilateral ? 2 : int(reads_others);
    return reach * (normals_.filter_rounds + double(normals_.flat_radius) * (1 + steps)) * halo_factor_;
  }

  // Grown by the halo, without an end where the cloud ends.
  point::Region region_of(const Bounds& wanted, double halo) const {
    point::Region region = region_around(wanted, halo);
    const Bounds& all = cut().bounds();
    if (region.min.x <= all.min.x) region.min.x = -kUnbounded;
    if (region.min.y <= all.min.y) region.min.y = -kUnbounded;
    if (region.min.z <= all.min.z) region.min.z = -kUnbounded;
    if (region.max.x >= all.max.x) region.max.x = kUnbounded;
    if (region.max.y >= all.max.y) region.max.y = kUnbounded;
    if (region.max.z >= all.max.z) region.max.z = kUnbounded;
    return region;
  }

  void load(Worker& worker, const point::Region& region) {
    cut().find(region, for_each(), worker.indices);
    worker.loaded = region;
  }
  // Goes on until the worker is asked for a result, or for finish_upload().
  void upload(Worker& worker) {
    worker.backend->finish_upload();  // of a run that failed
    const std::span<Point> in = worker.room(worker.in, worker.indices.size());
    for_blocks(in.size(), [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) in[i] = input()[worker.indices[i]];
    });
    worker.backend->start_upload(in);
    worker.backend->begin_pass(0);
  }
  void for_blocks(std::size_t count, const std::function<void(std::size_t, std::size_t)>& body) {
    for_each_on_host((count + kBlock - 1) / kBlock,
                     [&](std::size_t b) { body(b * kBlock, std::min(count, (b + 1) * kBlock)); });
  }

  // By all threads; a vector's own copy is made by one.
  void copy(std::span<const Point> from, std::vector<Point>& to) {
    if (to.capacity() < from.size()) to = {};  // nothing of it is needed
    to.resize(from.size());
    for_blocks(from.size(), [&](std::size_t first, std::size_t last) {
      std::copy(from.begin() + std::ptrdiff_t(first), from.begin() + std::ptrdiff_t(last),
                to.begin() + std::ptrdiff_t(first));
    });
  }

  // The whole pass; `normals`, if any are asked for, in the order of the cloud.
  void run(std::span<Point> normals, const std::stop_token& stop) {
    copy(input(), output());
    Counts& all = counts_[chain()];
    all = {};
    all.unmoved.non_finite = cloud_.size() - cuts_[0]->bounds().valid;
    halo_factor_ = cutting_.first_halo;
    for (Worker& worker : workers_) worker.task.reset();  // of a run that failed
    std::deque<Task> tasks;
    for (const Cut::Piece& piece : cut().pieces())
      if (piece.core.valid > 0) tasks.push_back({piece.cell, {}, piece.core, 0});
    for (std::size_t turn = 0; !tasks.empty() || any_at_work(); ++turn) {
      if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
      Worker& worker = workers_[turn % workers_.size()];
      if (worker.task) collect(worker, normals, tasks);
      if (tasks.empty()) continue;
      Task task = std::move(tasks.front());
      tasks.pop_front();
      start(worker, std::move(task), tasks, stop);
    }
  }
  bool any_at_work() const {
    return std::any_of(workers_.begin(), workers_.end(), [](const Worker& w) { return w.task.has_value(); });
  }

  void start(Worker& worker, Task task, std::deque<Task>& tasks, const std::stop_token& stop) {
    if (task.halo == 0) task.halo = first_halo(task.bounds);
    load(worker, region_of(task.bounds, task.halo));
    if (worker.indices.size() > cutting_.most_points) return split(worker, std::move(task), tasks);
    upload(worker);
    Backend& backend = *worker.backend;
    if (neighbors_.k == 0) backend.set_originals(worker.indices);
    backend.build_index(stop);
    backend.find_neighbors(neighbors_, stop);
    backend.estimate_normals(normals_, stop);
    backend.fair(fairing_, stop);
    worker.task = std::move(task);
  }

  // In two along the longest side, if a task needs more points than can be uploaded.
  void split(const Worker& worker, Task task, std::deque<Task>& tasks) {
    if (task.cell)
      for (const std::uint32_t i : worker.indices)
        if (task.cell->contains(input()[i])) task.listed.push_back(i);
    if (task.listed.size() < 2)
      throw Error(ErrorKind::memory,
                  "point " + std::to_string(task.listed.empty() ? 0 : task.listed[0]) +
                      " lies so far from others that its neighbourhood does not fit the device's memory; remove "
                      "stray points, or run on the CPU");
    const Bounds& b = task.bounds;
    const float x = b.max.x - b.min.x, y = b.max.y - b.min.y, z = b.max.z - b.min.z;
    const auto axis = x >= y && x >= z ? &Point::x : y >= z ? &Point::y : &Point::z;
    const auto middle = task.listed.begin() + std::ptrdiff_t(task.listed.size() / 2);
    std::nth_element(task.listed.begin(), middle, task.listed.end(),
                     [&](std::uint32_t a, std::uint32_t c) { return input()[a].*axis < input()[c].*axis; });
    tasks.push_back(listed_task({task.listed.begin(), middle}, task.halo));
    tasks.push_back(listed_task({middle, task.listed.end()}, task.halo));
  }
  Task listed_task(Indices indices, double halo) const {
    std::sort(indices.begin(), indices.end());
    Bounds bounds = kNoBounds;
    for (const std::uint32_t i : indices) include(bounds, input()[i]);
    return {std::nullopt, std::move(indices), bounds, halo};
  }

  // Takes the results that are exact, and makes a task of the others.
  void collect(Worker& worker, std::span<Point> normals, std::deque<Task>& tasks) {
    const Task task = std::move(*worker.task);
    worker.task.reset();
    Backend& backend = *worker.backend;
    const std::size_t count = worker.indices.size();
    const std::span<Point> out = worker.room(worker.out, count);
    backend.download(out, {}, {});
    worker.outcomes.resize(count);
    backend.outcomes(worker.loaded, worker.outcomes);
    std::vector<Point> its_normals(normals.empty() ? 0 : count);
    if (!normals.empty()) backend.download_normals(its_normals);

    std::vector<Indices> again((count + kBlock - 1) / kBlock);
    std::vector<Counts> counts(again.size());
    for_blocks(count, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) {
        const std::uint32_t index = worker.indices[i];
        if (!task.wants(index, input()[index])) continue;
        const unsigned char outcome = worker.outcomes[i];
        if ((outcome & point::kExact) == 0) {
          again[first / kBlock].push_back(index);
          continue;
        }
        output()[index] = out[i];
        if (!normals.empty()) normals[index] = its_normals[i];
        Counts& c = counts[first / kBlock];
        c.unmoved.too_few_neighbors += (outcome & point::kTooFew) != 0;
        c.unmoved.no_normal += (outcome & point::kNoNormal) != 0;
        c.short_neighborhoods += (outcome & point::kShort) != 0;
      }
    });
    Counts& all = counts_[chain()];
    for (const Counts& c : counts) {
      all.unmoved.too_few_neighbors += c.unmoved.too_few_neighbors;
      all.unmoved.no_normal += c.unmoved.no_normal;
      all.short_neighborhoods += c.short_neighborhoods;
    }
    note_peaks(worker);
    Indices left;
    for (const Indices& some : again) left.insert(left.end(), some.begin(), some.end());
    if (left.empty()) return;
    if (task.cell && left.size() > task.bounds.valid / 50) halo_factor_ *= 1.5;  // for the pieces to come
    tasks.push_back(listed_task(std::move(left), 2 * task.halo));
  }
  void note_peaks(const Worker& worker) {
    peak_device_ = std::max(peak_device_, worker.backend->peak_device_bytes() * workers_.size());
    peak_inner_host_ = std::max(peak_inner_host_, worker.backend->peak_host_bytes() * workers_.size());
  }

  // Rows of the neighbourhoods that are exact; the others again, farther out.
  void sample(std::span<const std::uint32_t> queries, int k, Samples samples, std::span<Point> out) {
    Worker& worker = workers_[0];
    while (!samples.asked.empty()) {
      load(worker, region_of(samples.bounds, samples.halo));
      upload(worker);
      worker.backend->build_index({});
      std::vector<std::uint32_t> places;
      for (const std::size_t q : samples.asked)
        places.push_back(std::uint32_t(std::lower_bound(worker.indices.begin(), worker.indices.end(), queries[q]) -
                                       worker.indices.begin()));
      const std::size_t row_size = std::size_t(k) + 1;
      std::vector<Point> rows(places.size() * row_size);
      worker.backend->sample_neighborhoods(places, k, rows);
      note_peaks(worker);
      Samples again{{}, kNoBounds, 2 * samples.halo};
      for (std::size_t r = 0; r < places.size(); ++r) {
        const Point* row = &rows[r * row_size];
        const auto here = to_vec3(row[0]), last = to_vec3(row[k]);
        const bool full = is_valid(row[k]);
        const point::ListRule rule{k, kUnbounded, false, 0};
        if (point::is_exact_list(rule, full ? k : 0, full ? point::squared_length(last - here) : 0.0f,
                                 point::squared_gap_to_outside(worker.loaded, here))) {
          std::copy_n(row, row_size, &out[samples.asked[r] * row_size]);
        } else {
          again.asked.push_back(samples.asked[r]);
          include(again.bounds, row[0]);
        }
      }
      samples = std::move(again);
    }
  }

  std::vector<Worker> workers_;
  Cutting cutting_;
  std::vector<Point> cloud_, first_, further_, pass_input_;  // results of the first pass, of the pass at work
  int pass_ = 0;
  std::optional<Cut> cuts_[2];  // of the first pass's input, of that of the pass at work
  NeighborSettings neighbors_;
  NormalSettings normals_;
  FairingSettings fairing_;
  double halo_factor_ = 1;
  Counts counts_[2];
  std::vector<StageTime> times_;
  std::uint64_t peak_device_ = 0, peak_inner_host_ = 0;
};

}  // namespace

void Backend::outcomes(const point::Region&, std::span<unsigned char>) {
  throw Error(ErrorKind::failed, "this backend does not say which results are exact");
}
void Backend::download_input(std::span<Point>) {
  throw Error(ErrorKind::failed, "this backend does not give back what was uploaded");
}

std::unique_ptr<Backend> make_cut_backend(std::vector<std::unique_ptr<Backend>> workers, Cutting cutting) {
  return std::make_unique<CutBackend>(std::move(workers), cutting);
}

}  // namespace pointfair
