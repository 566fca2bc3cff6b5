// SPDX-License-Identifier: Apache-2.0
// The results of every stage of one pass. Memory, bytes a point: index 18, lists 4 k, W_a lengths 4, normals 12,
// faired positions 12.
#pragma once

#include "backend.hpp"
#include "cpu/index.h"
#include "cpu/kernels.h"
#include "cpu/memory.h"

namespace pointfair::cpu {

class Chain {
 public:
  explicit Chain(MemoryMeter& meter);

  void build_index(std::span<const Point> points, std::span<const Index> originals, const Kernels& kernels,
                   const std::stop_token& stop);
  void find_neighbors(const NeighborSettings& settings, const Kernels& kernels, const std::stop_token& stop);
  void estimate_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop);
  void fair(const FairingSettings& settings, const Kernels& kernels, const std::stop_token& stop);

  // In sorted order, one for each valid point.
  std::span<const Point> faired() const { return {faired_.data(), std::size_t(index_.view().points)}; }
  const SpatialIndex& index() const { return index_; }
  NormalsView normals() const { return {normal_x_.data(), normal_y_.data(), normal_z_.data()}; }
  const Counts& counts() const { return counts_; }

 private:
  NeighborView lists() const { return {neighbors_.k, lists_.data()}; }
  Ball ball() const { return {neighbors_.radius * neighbors_.radius}; }
  bool has_lists() const { return neighbors_.k > 0; }

  SpatialIndex index_;
  Buffer<Index> lists_;
  Buffer<float> mean_distance_, normal_x_, normal_y_, normal_z_;
  Buffer<Point> faired_;
  NeighborSettings neighbors_;
  Counts counts_;
};

}  // namespace pointfair::cpu
