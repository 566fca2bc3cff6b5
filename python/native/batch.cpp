// SPDX-License-Identifier: Apache-2.0
#include "batch.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <exception>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace pointfair::python {
namespace {

void check_offsets(std::span<const std::int64_t> offsets, std::size_t points) {
  if (offsets.empty() || offsets.front() != 0 || offsets.back() != static_cast<std::int64_t>(points))
    throw Error(ErrorKind::usage,
                "offsets must begin with 0 and end with the number of points, " + std::to_string(points));
  if (!std::ranges::is_sorted(offsets))
    throw Error(ErrorKind::usage, "offsets must not decrease: cloud i has the points offsets[i] to offsets[i + 1]");
}

// The error of the cloud with the lowest number, whatever the order of the threads.
class FirstError {
 public:
  void note(std::size_t cloud, std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    if (error_ && cloud >= cloud_) return;
    cloud_ = cloud;
    error_ = std::move(error);
  }
  bool any() {
    const std::lock_guard lock(mutex_);
    return error_ != nullptr;
  }
  void rethrow() {
    if (!error_) return;
    try {
      std::rethrow_exception(error_);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::interrupted) throw;
      throw Error(error.kind(), "cloud " + std::to_string(cloud_) + " of the batch: " + error.what());
    }
  }

 private:
  std::mutex mutex_;
  std::size_t cloud_ = 0;
  std::exception_ptr error_;
};

// Calls make_body() on each of `workers` threads, this one included, and what it returns for each cloud in turn.
template <class MakeBody>
void for_each_cloud(std::size_t clouds, std::size_t workers, const MakeBody& make_body) {
  std::atomic<std::size_t> next{0};
  FirstError first_error;
  const auto work = [&](bool is_first) {
    std::size_t cloud = 0;
    try {
      auto body = make_body(is_first);
      while (!first_error.any() && (cloud = next.fetch_add(1)) < clouds) body(cloud);
    } catch (...) {
      first_error.note(cloud, std::current_exception());
    }
  };
  {
    std::vector<std::jthread> helpers;
    for (std::size_t i = 1; i < std::min(workers, clouds); ++i) helpers.emplace_back(work, false);
    if (clouds > 0) work(true);
  }
  first_error.rethrow();
}

std::size_t workers_of(unsigned threads) {
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  return threads == 0 ? cores : std::min(threads, cores);
}

template <class Scalar>
std::span<const std::array<Scalar, 3>> rows_of(std::span<const Scalar> coordinates) {
  return {reinterpret_cast<const std::array<Scalar, 3>*>(coordinates.data()), coordinates.size() / 3};
}

// Positions of many clouds, and the points that are computed: relative to the origin that each cloud has of its own.
template <class Scalar>
class ManyArrays {
 public:
  using RowType = std::array<Scalar, 3>;

  ManyArrays(std::span<const Scalar> coordinates, std::span<const std::int64_t> offsets, std::size_t workers)
      : rows_(rows_of(coordinates)),
        offsets_(offsets.begin(), offsets.end()),
        workers_(workers),
        clouds_(offsets.size() - 1),
        is_wide_(clouds_.size()) {
    points_.resize(rows_.size());
    for_each_cloud(clouds_.size(), workers_, [this](bool) {
      return [this](std::size_t cloud) {
        std::vector<Position> positions;
        for (const RowType& row : rows(cloud)) positions.push_back({double(row[0]), double(row[1]), double(row[2])});
        clouds_[cloud] = make_cloud(positions);
        const Cloud& its = clouds_[cloud];
        is_wide_[cloud] = sizeof(Scalar) == sizeof(double) && needs_zones(its);  // floats have no more digits
        std::ranges::copy(its.points, points_.begin() + static_cast<std::ptrdiff_t>(offsets_[cloud]));
      };
    });
  }

  const std::vector<std::uint64_t>& offsets() const { return offsets_; }
  std::span<const Point> points() const { return points_; }
  bool is_wide(std::size_t cloud) const { return is_wide_[cloud] != 0; }

  // Those that are not wide.
  void move(std::span<const Point> after, std::span<Scalar> out) const {
    for_each_cloud(clouds_.size(), workers_, [&](bool) {
      return [&](std::size_t cloud) {
        if (is_wide(cloud)) return;
        const auto its = rows(cloud);
        std::vector<Position> positions;
        for (const RowType& row : its) positions.push_back({double(row[0]), double(row[1]), double(row[2])});
        const auto begin = static_cast<std::size_t>(offsets_[cloud]);
        move_positions(clouds_[cloud], after.subspan(begin, its.size()), positions);
        Scalar* to = out.data() + 3 * begin;
        for (const Position& position : positions)
          for (const double value : position) *to++ = static_cast<Scalar>(value);
      };
    });
  }

 private:
  std::span<const RowType> rows(std::size_t cloud) const {
    const auto begin = static_cast<std::size_t>(offsets_[cloud]);
    return rows_.subspan(begin, static_cast<std::size_t>(offsets_[cloud + 1]) - begin);
  }

  std::span<const RowType> rows_;
  std::vector<std::uint64_t> offsets_;
  std::size_t workers_;
  std::vector<Cloud> clouds_;
  std::vector<std::uint8_t> is_wide_;
  std::vector<Point> points_;
};

// One after the other, each as Pipeline.run does.
template <class Scalar>
class Alone {
 public:
  Alone(Device device, std::span<const Scalar> coordinates, std::span<const std::int64_t> offsets,
        std::span<Scalar> out)
      : arrays_(device), coordinates_(coordinates), offsets_(offsets), out_(out) {}

  void run(std::size_t cloud, const Params& params, const std::stop_token& stop) {
    const auto begin = static_cast<std::size_t>(3 * offsets_[cloud]);
    const auto count = static_cast<std::size_t>(3 * offsets_[cloud + 1]) - begin;
    arrays_.load(coordinates_.subspan(begin, count), false);
    arrays_.run(params, {}, out_.subspan(begin, count), {stop, {}});
  }
  Report report() const { return arrays_.report(); }

 private:
  ArrayPipeline arrays_;
  std::span<const Scalar> coordinates_;
  std::span<const std::int64_t> offsets_;
  std::span<Scalar> out_;
};

template <class Scalar>
void run_together(Pipeline& pipeline, Device device, std::span<const Scalar> coordinates,
                  std::span<const std::int64_t> offsets, const Params& params, std::size_t workers,
                  std::span<Scalar> out, const Watch& watch) {
  if constexpr (sizeof(Scalar) == sizeof(float)) {
    const std::vector<std::uint64_t> ends(offsets.begin(), offsets.end());
    const std::size_t count = coordinates.size() / 3;
    const std::span<const Point> points(reinterpret_cast<const Point*>(coordinates.data()), count);
    const std::vector<Position> origins = choose_origins(points, ends);
    if (std::ranges::all_of(origins, [](const Position& origin) { return origin == Position{}; })) {
      const std::span<Point> after(reinterpret_cast<Point*>(out.data()), count);
      pipeline.run_many(points, ends, params, after, watch.stop);
      return keep_zeros(points, after);
    }
  }
  const ManyArrays<Scalar> arrays(coordinates, offsets, workers);
  std::vector<Point> after(arrays.points().size());
  pipeline.run_many(arrays.points(), arrays.offsets(), params, after, watch.stop);
  arrays.move(after, out);
  std::optional<Alone<Scalar>> alone;  // of clouds that have zones
  for (std::size_t cloud = 0; cloud + 1 < offsets.size(); ++cloud) {
    if (!arrays.is_wide(cloud)) continue;
    if (!alone) alone.emplace(device, coordinates, offsets, out);
    alone->run(cloud, params, watch.stop);
  }
}

}  // namespace

template <class Scalar>
void denoise_batch(Pipeline& pipeline, Device device, std::span<const Scalar> coordinates,
                   std::span<const std::int64_t> offsets, const Params& params, unsigned threads, std::span<Scalar> out,
                   std::span<Report> reports, const Watch& watch) {
  check_offsets(offsets, coordinates.size() / 3);
  const std::size_t clouds = offsets.size() - 1;
  if (reports.empty() && pipeline.runs_together(params))
    return run_together(pipeline, device, coordinates, offsets, params, workers_of(threads), out, watch);
  const bool on_card = pipeline.device().kind == Device::cuda;
  for_each_cloud(clouds, workers_of(threads), [&](bool is_first) {
    const Device its = on_card ? device : Device(Device::cpu, 0, 1);
    return [&, is_first, alone = Alone<Scalar>(its, coordinates, offsets, out)](std::size_t cloud) mutable {
      alone.run(cloud, params, watch.stop);
      if (!reports.empty()) reports[cloud] = alone.report();
      if (is_first && watch.progress) watch.progress(double(cloud) / double(clouds), "batch");
    };
  });
}

template void denoise_batch<float>(Pipeline&, Device, std::span<const float>, std::span<const std::int64_t>,
                                   const Params&, unsigned, std::span<float>, std::span<Report>, const Watch&);
template void denoise_batch<double>(Pipeline&, Device, std::span<const double>, std::span<const std::int64_t>,
                                    const Params&, unsigned, std::span<double>, std::span<Report>, const Watch&);

}  // namespace pointfair::python
