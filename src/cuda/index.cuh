// SPDX-License-Identifier: Apache-2.0
// Builds the index (src/cuda/tree.cuh) of a cloud on the card.
// Memory: 16 bytes a point and 0.9 for boxes; 16 to 24 more while it is built.
#pragma once

#include <optional>
#include <span>

#include "backend.hpp"
#include "cuda/memory.cuh"
#include "cuda/tree.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {

// A cloud on its way to the card: its first part is there after one event, all of it after another.
struct Arrival {
  std::size_t first_part;
  cudaEvent_t first, all;
  std::span<const Point> source;  // the cloud in host memory
};

struct Sorted;

class DeviceIndex {
 public:
  explicit DeviceIndex(Context& context);

  // `points` on the card, in upload order; `cube` as Backend::order_along. Only starts the work, so far as `arrival`,
  // if not null, allows.
  void build(const Point* points, std::size_t count, const std::optional<CurveCube>& cube,
             const Arrival* arrival = nullptr);

  Tree tree() const;
  // As Tree::whole, from now on.
  void set_whole(const Index* whole) { whole_ = whole; }
  CloudState* state() const { return state_.data(); }
  std::size_t points() const { return count_; }
  std::size_t leaves() const { return leaves_; }

 private:
  template <class Key, int kBits>
  void sort(const Point* points, const Arrival* arrival, Sorted& sorted);
  void build_boxes(const Point* points, const Sorted& from);

  Context& context_;
  const Index* whole_ = nullptr;
  std::size_t count_ = 0, leaves_ = 0;
  DeviceArray<CloudState> state_;
  DeviceArray<float4> points_;
  DeviceArray<BoxGroup> groups_;
  Index first_group_[kMaxLevels] = {};
  int levels_ = 0;
};

}  // namespace pointfair::cuda
