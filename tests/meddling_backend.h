// SPDX-License-Identifier: Apache-2.0
// A backend whose calls fail, or are stopped before they begin, as a test asks for.
#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <new>
#include <stop_token>
#include <utility>

#include "forwarding_backend.h"

namespace pointfair {

// What happens to one of the calls to come. Shared by all backends of a test.
struct Meddling {
  enum class Kind { none, error, no_memory, stop };
  Kind kind = Kind::none;
  int calls_left = 0;  // before it
  std::stop_source* stop = nullptr;

  void at_call() {
    static std::mutex mutex;  // calls may come from several threads
    const std::lock_guard lock(mutex);
    if (kind == Kind::none || calls_left-- > 0) return;
    switch (std::exchange(kind, Kind::none)) {
      case Kind::error:
        throw Error(ErrorKind::failed, "this call fails");
      case Kind::no_memory:
        throw std::bad_alloc();
      case Kind::stop:
        stop->request_stop();
        break;
      case Kind::none:
        break;
    }
  }
};

class MeddlingBackend final : public ForwardingBackend {
 public:
  MeddlingBackend(std::unique_ptr<Backend> to, Meddling& meddling)
      : ForwardingBackend(std::move(to)), meddling_(meddling) {}

  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) override {
    meddling_.at_call();
    ForwardingBackend::build_index(iteration, frame, stop);
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override {
    meddling_.at_call();
    ForwardingBackend::find_neighbors(iteration, settings, stop);
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) override {
    meddling_.at_call();
    ForwardingBackend::estimate_normals(iteration, settings, stop);
  }
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override {
    meddling_.at_call();
    ForwardingBackend::fair(iteration, settings, stop);
  }
  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    meddling_.at_call();
    return ForwardingBackend::download(iteration, points, limits, outliers);
  }
  void download_normals(int iteration, std::span<Point> normals, std::stop_token stop) override {
    meddling_.at_call();
    ForwardingBackend::download_normals(iteration, normals, stop);
  }
  Counts counts(int iteration) override {
    meddling_.at_call();
    return ForwardingBackend::counts(iteration);
  }
  CloudSample sample_cloud(std::size_t count) override {
    meddling_.at_call();
    return ForwardingBackend::sample_cloud(count);
  }
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    meddling_.at_call();
    ForwardingBackend::sample_neighborhoods(queries, k, out);
  }
  Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                       std::stop_token stop) override {
    meddling_.at_call();
    return ForwardingBackend::take_samples(for_spacing, for_noise, stop);
  }

 private:
  Meddling& meddling_;
};

}  // namespace pointfair
