// SPDX-License-Identifier: Apache-2.0
#include "pipeline/loaded_cloud.hpp"

#include <algorithm>
#include <utility>

#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"
#include "seam/overlap.hpp"
#include "tiles/tiled_backend.hpp"

namespace pointfair {
namespace {

constexpr std::uint64_t kFirstTiles = 4;    // of a cloud that does not fit
constexpr std::uint64_t kLeastTile = 2000;  // points; if so few do not fit, tiles do not help
constexpr std::size_t kWorkers = 2;         // one is copied to and from while the other computes

}  // namespace

Backend& LoadedCloud::backend() {
  if (!backend_) {
    if (!make_worker_) throw Error(ErrorKind::device, "the device was lost; make another Pipeline");
    backend_ = make_worker_();
    backend_->upload({}, IndexOrder::fastest);
  }
  return *backend_;
}

void LoadedCloud::forget() {
  points_ = 0;
  cached = {};
  sample.reset();
  spacing.reset();
  noise.reset();
  levels.reset();
  reach_levels.reset();
}

// After a failed load, so that nothing runs on half of a cloud.
void LoadedCloud::drop() noexcept {
  forget();
  try {
    if (backend_) backend_->upload({}, IndexOrder::fastest);
  } catch (...) {
    backend_.reset();  // a lost card
  }
}

void LoadedCloud::replace(std::uint64_t points, const std::function<void()>& upload) {
  forget();
  try {
    if (points > kMaxPoints)
      throw Error(ErrorKind::usage, "the cloud has " + std::to_string(points) + " points, and a pipeline holds " +
                                        std::to_string(kMaxPoints) + " at most; cut it into tiles");
    if (std::exchange(tiles_, 1) > 1) backend_.reset();
    backend();
    points_ = points;
    upload();
  } catch (...) {
    drop();
    throw;
  }
}

void LoadedCloud::load(std::span<const Point> points, IndexOrder expected, bool overlapped) {
  replace(points.size(), [&] { upload(points, expected, overlapped); });
}

Origin LoadedCloud::load(const DevicePoints& points, DeviceStream stream, IndexOrder expected) {
  Origin origin{};
  replace(points.count, [&] {
    DeviceMemory* const memory = backend_->device_memory();
    if (memory == nullptr)
      throw Error(ErrorKind::usage,
                  "the points lie on a card, and this pipeline computes on the CPU: make it with Device::cuda, or copy "
                  "the points to host memory");
    origin = memory->upload(points, stream, choose_origin_by_sample, expected);
  });
  return origin;
}

void LoadedCloud::upload(std::span<const Point> points, IndexOrder expected, bool overlapped) {
  for (;;) try {
      Overlap* const overlap = overlapped ? backend_->overlap() : nullptr;
      if (overlap != nullptr) return overlap->start_upload(points, expected);
      return backend_->upload(points, expected);
    } catch (const Error& error) {
      if (!may_tile(error)) throw;
      make_tiled();
    }
}

void LoadedCloud::finish_load() noexcept {
  try {
    Overlap* const overlap = backend_ ? backend_->overlap() : nullptr;
    if (overlap != nullptr) overlap->finish_upload();
  } catch (...) {  // a lost card: the run has said so
  }
}

bool LoadedCloud::may_tile(const Error& error) const {
  return error.kind() == ErrorKind::memory && make_worker_ && points_ / std::max(kFirstTiles, 2 * tiles_) >= kLeastTile;
}

// An empty backend, of twice as many tiles as before.
void LoadedCloud::make_tiled() {
  tiles_ = std::max(kFirstTiles, 2 * tiles_);
  backend_.reset();  // its memory is needed
  std::vector<std::unique_ptr<Backend>> workers;
  for (std::size_t i = 0; i < kWorkers; ++i) workers.push_back(make_worker_());
  backend_ = make_tiled_backend(std::move(workers), {tiles_});
}

void LoadedCloud::within_memory(const std::function<void()>& work) {
  backend();
  for (;;) try {
      return work();
    } catch (const Error& error) {
      if (!may_tile(error)) throw;
      std::vector<Point> input(points_);
      backend_->download_input(input);
      try {
        make_tiled();
        upload(input, cached.order, false);
      } catch (...) {
        drop();
        throw;
      }
      cached = {};
    }
}

}  // namespace pointfair
