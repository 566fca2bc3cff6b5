// SPDX-License-Identifier: Apache-2.0
// A backend that hands every call on to another: tests override the calls that they watch or let fail.
#pragma once

#include <memory>
#include <utility>

#include "seam/backend.hpp"
#include "seam/exactness.hpp"
#include "seam/sampling.hpp"

namespace pointfair {

class ForwardingBackend : public Backend, public Sampling {
 public:
  explicit ForwardingBackend(std::unique_ptr<Backend> to) : to_(std::move(to)) {}

  DeviceInfo device() const override { return to_->device(); }
  HostBuffer host_buffer(std::size_t count) override { return to_->host_buffer(count); }
  void upload(std::span<const Point> points, IndexOrder expected) override { to_->upload(points, expected); }
  void set_aside(std::vector<Copy> copies) override { to_->set_aside(std::move(copies)); }
  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) override {
    to_->build_index(iteration, frame, stop);
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override {
    to_->find_neighbors(iteration, settings, stop);
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) override {
    to_->estimate_normals(iteration, settings, stop);
  }
  void fair(int iteration, const FairingSettings& settings, std::stop_token stop) override {
    to_->fair(iteration, settings, stop);
  }
  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    return to_->download(iteration, points, limits, outliers);
  }
  void download_normals(int iteration, std::span<Point> normals, std::stop_token stop) override {
    to_->download_normals(iteration, normals, stop);
  }
  void download_input(std::span<Point> points) override { to_->download_input(points); }
  bool holds_whole() const override { return to_->holds_whole(); }
  bool reads_faces() const override { return to_->reads_faces(); }
  SolverReport solver_report(int iteration) override { return to_->solver_report(iteration); }
  Counts counts(int iteration) override { return to_->counts(iteration); }
  Costs take_costs() override { return to_->take_costs(); }
  std::optional<StageOf> take_stopped() override { return to_->take_stopped(); }

  Sampling& sampling() override { return *this; }
  Exactness* exactness() override { return to_->exactness(); }
  Overlap* overlap() override { return to_->overlap(); }

  CloudSample sample_cloud(std::size_t count) override { return to_->sampling().sample_cloud(count); }
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    to_->sampling().sample_neighborhoods(queries, k, out);
  }
  Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                       std::stop_token stop) override {
    return to_->sampling().take_samples(for_spacing, for_noise, stop);
  }
  void foresee_nearest(int count) override { to_->sampling().foresee_nearest(count); }
  void for_each_on_host(std::size_t count, const std::function<void(std::size_t)>& body) override {
    to_->sampling().for_each_on_host(count, body);
  }

 protected:
  Backend& to() { return *to_; }

 private:
  std::unique_ptr<Backend> to_;
};

// A CPU with room for so many points.
class SmallBackend : public ForwardingBackend {
 public:
  explicit SmallBackend(std::size_t room) : ForwardingBackend(make_cpu_backend(0)), room_(room) {}
  void upload(std::span<const Point> points, IndexOrder expected) override {
    if (points.size() > room_) throw Error(ErrorKind::memory, "no room");
    ++uploads;
    ForwardingBackend::upload(points, expected);
  }
  int uploads = 0;

 private:
  std::size_t room_;
};

}  // namespace pointfair
