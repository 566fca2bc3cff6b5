// SPDX-License-Identifier: Apache-2.0
// Builds the index (src/cuda/tree.cuh) of a cloud on the card, one tree of the whole or, while its parts arrive, a tree
// of each part under common upper levels.
// Memory: 16 bytes a point and 0.8 for boxes, 4 with a frame; 16 to 24 more while it is built, of each point or of
// those of one part.
#pragma once

#include <memory>
#include <optional>

#include "cuda/memory.cuh"
#include "cuda/transfer.cuh"
#include "cuda/tree.cuh"
#include "pointfair/cloud.hpp"
#include "seam/settings.hpp"

namespace pointfair::cuda {

class PartSort;
struct Sorted;

class DeviceIndex {
 public:
  explicit DeviceIndex(Context& context);
  ~DeviceIndex();

  // `points` on the card, in upload order; `frame` as Backend::build_index. Only starts the work, so far as `arrival`,
  // if not null, allows. If its parts lie apart, without a frame, the index is built on a stream of its own, and
  // is_in_parts() until join().
  void build(const Point* points, std::size_t count, const std::optional<Frame>& frame,
             const Arrival* arrival = nullptr);

  // Of the whole cloud, after join().
  Tree tree() const;

  // While it is in parts: a part's leaves, the tree of a part and all before it, which is there after ready(part), and
  // the tree of all after it, there after ready_after().
  bool is_in_parts() const { return sort_ != nullptr; }
  const Parts& parts() const { return parts_; }
  LeafRange leaves_of(std::size_t part) const;
  LeafRange all_leaves() const { return {0, static_cast<Index>(leaves_)}; }
  Tree tree_until(std::size_t part) const;
  Tree tree_after(std::size_t part) const;
  cudaEvent_t ready(std::size_t part) const { return ready_[part]; }
  cudaEvent_t ready_after() const { return ready_[parts_.count()]; }
  cudaStream_t stream() const { return side_->stream(); }
  // The context's main stream waits for the index from now on.
  void join();

  CloudState* state() const { return state_.data(); }
  std::size_t points() const { return count_; }
  std::size_t leaves() const { return leaves_; }

 private:
  template <class Key, int kBits>
  void sort(const Point* points, const Arrival* arrival, Sorted& sorted);
  void lay_out_levels();
  void build_boxes(const Point* points, const Sorted& from);
  void build_parts(const Point* points, const Arrival& arrival);
  void build_part(const Point* points, std::size_t part);
  Tree tree_with_top(std::size_t top) const;
  Tree subtrees() const;

  Context& context_;
  std::optional<SideStream> side_;  // where parts are indexed
  std::size_t count_ = 0, leaves_ = 0;
  DeviceArray<CloudState> state_;
  DeviceArray<float4> points_;
  DeviceArray<float> share_;  // with a frame
  DeviceArray<BoxGroup> groups_;
  Index first_group_[kMaxLevels] = {};
  Index groups_of_[kMaxLevels] = {};  // how many a level has
  int levels_ = 0;

  // Of an index in parts: levels from own_levels_ on are common, and there is a top of these for each tree_until() and
  // tree_after().
  Parts parts_;
  int own_levels_ = kMaxLevels;
  Index groups_of_top_ = 0, tops_ = 0;
  Events ready_;
  std::unique_ptr<PartSort> sort_;
};

}  // namespace pointfair::cuda
