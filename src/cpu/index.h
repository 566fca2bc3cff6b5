// SPDX-License-Identifier: Apache-2.0
// The index over occupied space: points sorted along a Hilbert curve under a tree of tight boxes (src/cpu/kernels.h).
// Memory: 16 bytes a point and 1.6 for boxes, 4 more along the curve of a frame.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "cpu/kernels.h"
#include "cpu/memory.h"
#include "seam/cloud_sample.hpp"
#include "seam/settings.hpp"

namespace pointfair::cpu {

struct InvalidPoint {
  Index original;
  Point position;
};

// Where the points are sorted: 16 bytes a point, of no use once an index is built.
struct SortSpace {
  Buffer<std::uint64_t> elements, scratch;  // sort key over place in the array of points
  explicit SortSpace(MemoryMeter& meter) : elements(meter), scratch(meter) {}
  void release() {
    elements.release();
    scratch.release();
  }
};

class SpatialIndex {
 public:
  explicit SpatialIndex(MemoryMeter& meter);

  // `originals` gives the upload index of each point; empty: its place in `points`. `frame` as Backend::build_index.
  void build(std::span<const Point> points, std::span<const Index> originals, const std::optional<Frame>& frame,
             SortSpace& space, const Kernels& kernels, const std::stop_token& stop);

  IndexView view() const;
  const Bounds& bounds() const { return bounds_; }
  const std::vector<InvalidPoint>& invalid() const { return invalid_; }
  std::span<const Index> originals() const { return {original_.data(), original_.size()}; }

 private:
  void collect_valid(std::span<const Point> points, std::span<const Index> originals, SortSpace& space,
                     const std::stop_token& stop);
  void hash_positions(point::Vec3<float> corner, const std::stop_token& stop);
  void gather(std::span<const Point> points, std::span<const Index> originals, const SortSpace& space,
              const std::stop_token& stop);
  void build_boxes(const std::stop_token& stop);
  Box leaf_box(std::size_t leaf) const;

  Buffer<float> x_, y_, z_;
  Buffer<Index> original_;
  Buffer<float> share_;
  std::vector<Buffer<BoxGroup>> levels_;
  MemoryMeter* meter_;
  std::vector<InvalidPoint> invalid_;
  Bounds bounds_;
  Index points_ = 0, leaves_ = 0;
};

}  // namespace pointfair::cpu
