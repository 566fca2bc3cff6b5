// SPDX-License-Identifier: Apache-2.0
// Builds the index (src/cuda/index/tree.cuh) of a cloud on the card.
// Memory: 16 bytes a point and 0.8 for boxes, 4 with a frame; 16 to 24 more while it is built.
#pragma once

#include <optional>

#include "cuda/index/tree.cuh"
#include "cuda/runtime/memory.cuh"
#include "pointfair/cloud.hpp"
#include "seam/settings.hpp"

namespace pointfair::cuda {

struct CloudBatch;
struct Sorted;

// The levels of boxes of a tree. From `own_levels` on several tops may stand over the same lower levels.
struct Levels {
  int count = 0, own = kMaxLevels;
  Index first_group[kMaxLevels] = {};
  Index groups[kMaxLevels] = {};  // how many a level has
  Index groups_of_top = 0;
};

class DeviceIndex {
 public:
  explicit DeviceIndex(Context& context);

  // `points` on the card, in upload order; `frame` as Backend::build_index. Only starts the work.
  void build(const Point* points, std::size_t count, const std::optional<Frame>& frame);
  // Of many clouds at once (src/cuda/index/cloud_batch.cuh).
  void build(const Point* points, const CloudBatch& batch);
  Tree tree() const { return tree_with_top(whole_top_); }

  // For an index that is built otherwise (src/cuda/overlap): room for so many points, then for the boxes of all levels
  // and so many tops, of which the one of number `whole_top` stands over the whole cloud.
  void make_room(std::size_t count);
  void lay_out_levels(int own_levels, std::size_t tops, std::size_t whole_top);
  const Levels& levels() const { return levels_; }
  float4* sorted_points() { return points_.data(); }
  Tree tree_with_top(std::size_t top) const;
  Tree without_top() const;

  CloudState* state() const { return state_.data(); }
  std::size_t points() const { return count_; }
  std::size_t leaves() const { return leaves_; }
  LeafRange all_leaves() const { return {0, static_cast<Index>(leaves_)}; }

 private:
  template <class Key, int kBits>
  void sort(const Point* points, Sorted& sorted);
  void build_boxes(const Point* points, const Sorted& from);
  void hash_positions(const Frame& frame);

  Context& context_;
  std::size_t count_ = 0, leaves_ = 0, whole_top_ = 0;
  Index leaves_of_cloud_ = 0, groups_of_cloud_ = 0;  // of a batch
  DeviceArray<CloudState> state_;
  DeviceArray<float4> points_;
  DeviceArray<float> share_;            // with a frame, or settings of clouds
  DeviceArray<Index> valid_of_clouds_;  // of a batch
  const CloudSettings* settings_ = nullptr;
  DeviceArray<BoxGroup> groups_;
  Levels levels_;
};

}  // namespace pointfair::cuda
