// SPDX-License-Identifier: Apache-2.0
// A backend that hands every call on to another: tests override the calls that they watch or let fail.
#pragma once

#include <memory>
#include <utility>

#include "backend.hpp"

namespace pointfair {

class ForwardingBackend : public Backend {
 public:
  explicit ForwardingBackend(std::unique_ptr<Backend> to) : to_(std::move(to)) {}

  DeviceInfo device() const override { return to_->device(); }
  HostBuffer host_buffer(std::size_t count) override { return to_->host_buffer(count); }
  void upload(std::span<const Point> points) override { to_->upload(points); }
  void set_originals(std::span<const std::uint32_t> originals) override { to_->set_originals(originals); }
  void begin_pass(int pass) override { to_->begin_pass(pass); }
  void order_along(std::optional<CurveCube> cube) override { to_->order_along(cube); }
  void build_index(std::stop_token stop) override { to_->build_index(stop); }
  void find_neighbors(const NeighborSettings& settings, std::stop_token stop) override {
    to_->find_neighbors(settings, stop);
  }
  void estimate_normals(const NormalSettings& settings, std::stop_token stop) override {
    to_->estimate_normals(settings, stop);
  }
  void fair(const FairingSettings& settings, std::stop_token stop) override { to_->fair(settings, stop); }
  std::uint64_t download(std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    return to_->download(points, limits, outliers);
  }
  void download_normals(std::span<Point> normals) override { to_->download_normals(normals); }
  void download_input(std::span<Point> points) override { to_->download_input(points); }
  Bounds bounds() const override { return to_->bounds(); }
  void sample_neighborhoods(std::span<const std::uint32_t> queries, int k, std::span<Point> out) override {
    to_->sample_neighborhoods(queries, k, out);
  }
  Samples take_samples(std::span<const std::uint32_t> for_spacing, std::span<const std::uint32_t> for_noise,
                       std::stop_token stop) override {
    return to_->take_samples(for_spacing, for_noise, stop);
  }
  void outcomes(const point::Region& loaded, std::span<unsigned char> out) override { to_->outcomes(loaded, out); }
  Counts counts() const override { return to_->counts(); }
  std::uint64_t peak_host_bytes() const override { return to_->peak_host_bytes(); }
  std::uint64_t peak_device_bytes() const override { return to_->peak_device_bytes(); }

 private:
  std::unique_ptr<Backend> to_;
};

}  // namespace pointfair
