// SPDX-License-Identifier: Apache-2.0
// The neighbours of all points as one graph whose edges weigh alike from both ends (docs/methods.md, "implicit").
#pragma once

#include "cuda/runtime/memory.cuh"
#include "cuda/search/lists.cuh"
#include "point/graph.h"
#include "seam/settings.hpp"

namespace pointfair::cuda {

// A sorted point that exists, as the system reads it.
__device__ inline point::Place place_of(float4 p) { return {p.x, p.y, p.z}; }

// Memory, bytes a point: 16 k for the entries and 28; 16 k more while it is made.
class WeightedGraph {
 public:
  // Of lists. Waits for the card where weights go by the mean length.
  WeightedGraph(Context& context, const Tree& tree, const Lists& lists, const FairingSettings& settings);

  point::GraphView view() const {
    return {begin_.data(), count_.data(), reinterpret_cast<const point::GraphEntry*>(entries_.data()), mass_.data(),
            weight_sum_.data()};
  }
  double lambda_unit() const { return lambda_unit_; }  // Eq. 28 is solved with lambda times this

 private:
  using Keys = DeviceArray<unsigned long long>;

  // Sorted keys of all entries into `keys`.
  void sort_entries(const Tree& tree, const Lists& lists, Keys& keys);
  double mean_length(const Tree& tree, const Keys& keys);

  Context& context_;
  const std::size_t places_;
  const int bits_;  // of a place in a key
  Keys begin_;
  DeviceArray<Index> count_;
  Keys entries_;  // point::GraphEntry, in the memory that sorting took
  DeviceArray<double> mass_, weight_sum_;
  double lambda_unit_ = 1;
};

}  // namespace pointfair::cuda
