// SPDX-License-Identifier: Apache-2.0
#include "batch.hpp"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace pointfair::python {
namespace {

void check_offsets(std::span<const std::int64_t> offsets, std::size_t points) {
  if (offsets.empty() || offsets.front() != 0 || offsets.back() != static_cast<std::int64_t>(points))
    throw Error(ErrorKind::usage,
                "offsets must begin with 0 and end with the number of points, " + std::to_string(points));
  if (!std::is_sorted(offsets.begin(), offsets.end()))
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

}  // namespace

template <class Scalar>
void denoise_batch(std::span<const Scalar> coordinates, std::span<const std::int64_t> offsets, const Params& params,
                   unsigned threads, std::span<Scalar> out, std::span<Report> reports, const Watch& watch) {
  check_offsets(offsets, coordinates.size() / 3);
  const std::size_t clouds = offsets.size() - 1;
  std::atomic<std::size_t> next{0};
  FirstError first_error;
  const auto work = [&](bool tells) {
    std::size_t cloud = 0;
    try {
      ArrayPipeline pipeline(Device(Device::cpu, 0, 1));
      while (!first_error.any() && (cloud = next.fetch_add(1)) < clouds) {
        const auto begin = static_cast<std::size_t>(3 * offsets[cloud]);
        const auto count = static_cast<std::size_t>(3 * offsets[cloud + 1]) - begin;
        pipeline.load(coordinates.subspan(begin, count), false);
        pipeline.run(params, {}, out.subspan(begin, count), {watch.stop, {}});
        if (!reports.empty()) reports[cloud] = pipeline.pipeline().report();
        if (tells) watch.progress(double(cloud) / double(clouds), "batch");
      }
    } catch (...) {
      first_error.note(cloud, std::current_exception());
    }
  };
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  const std::size_t workers = std::min<std::size_t>(threads == 0 ? cores : std::min(threads, cores), clouds);
  {
    std::vector<std::jthread> helpers;
    for (std::size_t i = 1; i < workers; ++i) helpers.emplace_back(work, false);
    if (workers > 0) work(watch.progress != nullptr);
  }
  first_error.rethrow();
}

template void denoise_batch<float>(std::span<const float>, std::span<const std::int64_t>, const Params&, unsigned,
                                   std::span<float>, std::span<Report>, const Watch&);
template void denoise_batch<double>(std::span<const double>, std::span<const std::int64_t>, const Params&, unsigned,
                                    std::span<double>, std::span<Report>, const Watch&);

}  // namespace pointfair::python
