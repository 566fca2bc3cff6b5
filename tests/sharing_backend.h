// SPDX-License-Identifier: Apache-2.0
// A device that shares a cloud which lies on it: a CPU backend, and the copies between devices as loops.
#pragma once

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "forwarding_backend.h"
#include "point/outliers.h"
#include "seam/cloud_sample.hpp"
#include "seam/device_tiles.hpp"
#include "seam/noise_levels.hpp"
#include "seam/outlier_tally.hpp"
#include "seam/rules.hpp"

namespace pointfair {

constexpr float kNan = __builtin_nanf("");

class SharingBackend : public ForwardingBackend, public DeviceTiles {
 public:
  explicit SharingBackend(std::unique_ptr<Backend> to) : ForwardingBackend(std::move(to)) {}

  DeviceTiles* device_tiles() override { return this; }
  Overlap* overlap() override { return nullptr; }

  void upload(std::span<const Point> points, IndexOrder expected) override {
    uploaded_.assign(points.begin(), points.end());
    copies_.clear();
    further_iteration_ = 0;
    results_ = nullptr;
    ForwardingBackend::upload(points, expected);
  }
  void set_aside(std::vector<Copy> copies) override {
    for (const Copy& copy : copies_) uploaded_[copy.point] = copy.place;
    copies_ = copies;
    for (const Copy& copy : copies_) uploaded_[copy.point] = {kNan, kNan, kNan};
    further_iteration_ = 0;
    results_ = nullptr;
    ForwardingBackend::set_aside(std::move(copies));
  }
  void build_index(int iteration, const std::optional<Frame>& frame, std::stop_token stop) override {
    if (!is_moved(iteration)) return ForwardingBackend::build_index(iteration, frame, stop);
    moved_ = make_cpu_backend(0);
    moved_->upload(input_of(iteration), IndexOrder::along_curve);
    moved_->build_index(0, frame, stop);
  }
  void find_neighbors(int iteration, const NeighborSettings& settings, std::stop_token stop) override {
    if (is_moved(iteration)) return moved_->find_neighbors(0, settings, stop);
    ForwardingBackend::find_neighbors(iteration, settings, stop);
  }
  void estimate_normals(int iteration, const NormalSettings& settings, std::stop_token stop) override {
    if (is_moved(iteration)) return moved_->estimate_normals(0, settings, stop);
    ForwardingBackend::estimate_normals(iteration, settings, stop);
  }
  void download_normals(int iteration, std::span<Point> normals, std::stop_token stop) override {
    if (!is_moved(iteration)) return ForwardingBackend::download_normals(iteration, normals, stop);
    moved_->download_normals(0, normals, stop);
    follow<Point>(copies_, normals);
  }
  OutlierCounts download(int iteration, std::span<Point> points, const DisplacementLimits& limits,
                         std::span<std::uint8_t> outliers) override {
    if (results_ == nullptr) return ForwardingBackend::download(iteration, points, limits, outliers);
    const DisplacementLimits used = limits.or_endless();
    const point::NodeField field = field_of(used.levels.get());
    const std::vector<Point>& faired = iteration == 0 ? first_ : further_;
    OutlierCounts counts;
    std::fill(outliers.begin(), outliers.end(), std::uint8_t(0));
    const auto hold_back = [&](std::size_t i, const Point& from, const Point& now) {
      const auto limited = point::limited(to_vec3(from), to_vec3(now), used, point::node_value(field, to_vec3(from)));
      points[i] = {limited.place.x, limited.place.y, limited.place.z};
      count(limited.outlier, counts);
      if (!outliers.empty()) outliers[i] = static_cast<std::uint8_t>(limited.outlier);
    };
    for (std::size_t i = 0; i < points.size(); ++i) {
      points[i] = faired[i];
      if (is_indexed(uploaded_[i])) hold_back(i, uploaded_[i], faired[i]);
    }
    for (const Copy& copy : copies_) hold_back(copy.point, copy.place, faired[copy.first]);
    return counts;
  }

  void begin_tiles(int iteration) override {
    if (iteration > 0 && iteration != further_iteration_) {
      if (iteration > 1) std::swap(further_, input_);
      further_iteration_ = iteration;
    }
    tiles_input_ = input_of(iteration);
    results_ = iteration == 0 ? &first_ : &further_;
    results_->assign(tiles_input_.begin(), tiles_input_.end());
    done_.assign(tiles_input_.size(), false);
  }
  std::vector<std::size_t> gather(std::span<const DeviceTile> tiles) override {
    tiles_.clear();
    std::vector<std::size_t> counts;
    for (const DeviceTile& tile : tiles) {
      Tile its{tile, {}, {}, {}};
      for (std::size_t i = 0; i < tiles_input_.size(); ++i) {
        if (!is_indexed(tiles_input_[i]) || !point::is_inside(tile.loaded, to_vec3(tiles_input_[i]))) continue;
        its.indices.push_back(std::uint32_t(i));
        its.points.push_back(tiles_input_[i]);
      }
      its.outcomes.resize(its.points.size());
      counts.push_back(its.points.size());
      tiles_.push_back(std::move(its));
    }
    return counts;
  }
  std::vector<std::uint32_t> gathered(std::size_t tile) override { return tiles_[tile].indices; }
  std::vector<TileTally> scatter() override {
    std::vector<TileTally> tallies;
    for (const Tile& tile : tiles_) tallies.push_back(results_of(tile));
    return tallies;
  }

  void connect(DeviceTiles&) override {}
  void take(DeviceTiles& whole, std::size_t tile) override {
    ForwardingBackend::upload(static_cast<SharingBackend&>(whole).tiles_[tile].points, IndexOrder::along_curve);
  }
  void give(DeviceTiles& whole, std::size_t tile) override {
    Tile& to_tile = static_cast<SharingBackend&>(whole).tiles_[tile];
    ForwardingBackend::download(0, to_tile.points, {}, {});
    to().exactness()->outcomes(to_tile.tile.loaded, to_tile.outcomes);
  }

 private:
  struct Tile {
    DeviceTile tile;
    std::vector<std::uint32_t> indices;
    std::vector<Point> points;
    std::vector<unsigned char> outcomes;
  };

  // Whether the cloud is shared, and the iteration's input known here alone.
  bool is_moved(int iteration) const { return results_ != nullptr && iteration > 0; }
  const std::vector<Point>& input_of(int iteration) const {
    return iteration == 0 ? uploaded_ : iteration == 1 ? first_ : input_;
  }
  TileTally results_of(const Tile& tile) {
    TileTally tally{{}, kNoBounds};
    for (std::size_t i = 0; i < tile.points.size(); ++i) {
      const std::uint32_t index = tile.indices[i];
      const Point& p = tiles_input_[index];
      if (done_[index] || !point::is_in_cell(tile.tile.cell, to_vec3(p))) continue;
      if ((tile.outcomes[i] & point::kExact) == 0) {
        include(tally.left, p);
        continue;
      }
      done_[index] = true;
      (*results_)[index] = tile.points[i];
      tally.counts.unmoved.too_few_neighbors += (tile.outcomes[i] & point::kTooFew) != 0;
      tally.counts.unmoved.no_normal += (tile.outcomes[i] & point::kNoNormal) != 0;
      tally.counts.short_neighborhoods += (tile.outcomes[i] & point::kShort) != 0;
    }
    return tally;
  }

  std::vector<Point> uploaded_, first_, further_, input_;  // input_: of iterations from the third on
  std::vector<Copy> copies_;
  std::vector<Point> tiles_input_;
  std::vector<Point>* results_ = nullptr;  // null: nobody shares the cloud
  std::vector<bool> done_;
  std::vector<Tile> tiles_;
  int further_iteration_ = 0;
  std::unique_ptr<Backend> moved_;  // with the input of a further iteration
};

}  // namespace pointfair
