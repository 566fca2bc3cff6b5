// SPDX-License-Identifier: Apache-2.0
#include "pipeline/loaded_cloud.hpp"

#include <utility>

#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"
#include "seam/exactness.hpp"
#include "seam/overlap.hpp"
#include "seam/sampling.hpp"
#include "tiles/divided_backend.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kWorkersOfCard = 2;  // one is copied to and from while the other computes

}  // namespace

Backend& LoadedCloud::backend() {
  if (!backend_) {
    cut_into(1);
    backend_->upload({}, IndexOrder::fastest);
  }
  return *backend_;
}

void LoadedCloud::forget() {
  points_ = 0;
  cached = {};
  sample.reset();
  spacing.reset();
  copies.reset();
  sample_without_copies.reset();
  spacing_without_copies.reset();
  copies_.clear();
  seams_.clear();
  repeats_.reset();
  aside_ = Aside::nothing;
  noise.reset();
  levels.reset();
  reach_levels.reset();
  sensor = {};
}

// After a failed load, so that nothing runs on half of a cloud.
void LoadedCloud::drop() noexcept {
  forget();
  try {
    if (backend_) backend_->upload({}, IndexOrder::fastest);
  } catch (...) {
    reset();  // a lost card
  }
}

// Without a backend. Its memory may be needed for another.
void LoadedCloud::reset() noexcept {
  backend_.reset();
  tiled_ = nullptr;
  is_divided_ = is_on_cpu_ = false;
}

// What `make` leaves takes the place of the backend, with the same points and nothing cached.
void LoadedCloud::carry_over(const std::function<void()>& make) {
  std::vector<Point> input(points_);
  backend_->download_input(input);
  try {
    reset();
    make();
    upload(input, cached.order, false);
    const std::span<const Copy> its = copies_aside();
    if (!its.empty()) backend_->set_aside({its.begin(), its.end()});
  } catch (...) {
    drop();
    throw;
  }
  cached = {};
}

std::vector<Copy> LoadedCloud::copies_by(const CopyRule& rule, std::span<Point> points, const std::stop_token& stop) {
  std::vector<Copy> its;
  backend().download_input(points);
  backend().sampling().for_each_on_host(1, [&](std::size_t) { its = copies_among(points, rule, kEverywhere, stop); });
  return its;
}

void LoadedCloud::find_repeats(const Point& corner, const std::stop_token& stop) {
  if (repeats_) return;
  std::vector<Point> points(points_);
  repeats_ = copies_by({0, corner}, points, stop);
}

void LoadedCloud::find_copies(const CopyRule& rule, double times, const std::stop_token& stop) {
  std::vector<Point> points(points_);
  copies_ = copies_by(rule, points, stop);
  std::vector<std::uint32_t> firsts;
  std::vector<Point> places;
  for (const std::uint32_t index : sample->indices) {
    firsts.push_back(first_of(copies_, index));
    places.push_back(points[firsts.back()]);
  }
  sample_without_copies = once_each(*sample, firsts, places, times);
}

void LoadedCloud::set_aside(Aside which) {
  if (which == Aside::seams && seams_.empty()) which = Aside::nothing;
  if (which == Aside::repeats && repeats_->empty()) which = Aside::nothing;
  if (which == aside_) return;
  cached = Cached{.order = cached.order, .settings = {}};
  aside_ = which;
  const std::span<const Copy> its = copies_aside();
  backend().set_aside({its.begin(), its.end()});
}

std::span<const Copy> LoadedCloud::copies_aside() const {
  switch (aside_) {
    case Aside::copies:
      return copies_;
    case Aside::seams:
      return seams_;
    case Aside::repeats:
      return *repeats_;
    case Aside::nothing:
      break;
  }
  return {};
}

bool LoadedCloud::move_to_cpu() {
  if (!workers_.on_cpu) return false;
  finish_load();
  carry_over([&] {
    tiles_ = 1;
    backend_ = workers_.on_cpu();
    is_on_cpu_ = true;
  });
  return true;
}

// A backend for a cloud of so many points, the present one if it suits.
void LoadedCloud::hold(std::uint64_t points) {
  if (!share(cards(), points)) return cut_into(1);
  if (!divide()) cut_into(tiles_of(cards(), points));
}

// A backend whose devices share a cloud on the first of them; false if they cannot.
bool LoadedCloud::divide() {
  if (is_divided_) return true;
  reset();
  backend_ = make_divided_backend(workers_.of_cards);
  is_divided_ = backend_ != nullptr;
  tiles_ = 1;
  return is_divided_;
}

// A backend that will cut what it is given into so many tiles, the present one if it can.
void LoadedCloud::cut_into(std::uint64_t tiles) {
  tiles_ = tiles;
  if (tiles > 1 && tiled_ != nullptr) return tiled_->cut_into(tiles);
  if (tiles == 1 && backend_ && tiled_ == nullptr && !is_divided_) return;
  if (workers_.of_cards.empty()) throw Error(ErrorKind::device, "the device was lost; make another Pipeline");
  reset();
  if (tiles == 1) {
    backend_ = workers_.of_cards[0]();
    return;
  }
  std::vector<std::unique_ptr<Backend>> workers;
  for (const MakeBackend& make_worker : workers_.of_cards)
    for (std::size_t i = 0; i < kWorkersOfCard; ++i) workers.push_back(make_worker());
  std::unique_ptr<TiledBackend> tiled =
      make_tiled_backend(std::move(workers), {.tiles = tiles, .feeders = workers_.of_cards.size()});
  tiled_ = tiled.get();
  backend_ = std::move(tiled);
}

void LoadedCloud::replace(std::uint64_t points, const std::function<void()>& upload) {
  forget();
  try {
    if (points > kMaxPoints)
      throw Error(ErrorKind::usage, "the cloud has " + std::to_string(points) + " points, and a pipeline holds " +
                                        std::to_string(kMaxPoints) + " at most; cut it into tiles");
    if (is_on_cpu_) reset();
    hold(points);
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
      const std::uint64_t tiles = tiles_after(error);
      if (tiles == 0) throw;
      reset();
      cut_into(tiles);
    }
}

void LoadedCloud::finish_load() noexcept {
  try {
    Overlap* const overlap = backend_ ? backend_->overlap() : nullptr;
    if (overlap != nullptr) overlap->finish_upload();
  } catch (...) {  // a lost card: the run has said so
  }
}

// How many tiles there will be where the memory does not suffice; 0: they do not help.
std::uint64_t LoadedCloud::tiles_after(const Error& error) const {
  const bool may_cut = error.kind() == ErrorKind::memory && !workers_.of_cards.empty() && !is_on_cpu_;
  return may_cut ? more_tiles(cards(), points_, tiles_) : 0;
}

void LoadedCloud::within_memory(const std::function<void()>& work) {
  backend();
  for (;;) try {
      return work();
    } catch (const Error& error) {
      const std::uint64_t tiles = tiles_after(error);
      if (tiles == 0) throw;
      carry_over([&] { cut_into(tiles); });
    }
}

}  // namespace pointfair
