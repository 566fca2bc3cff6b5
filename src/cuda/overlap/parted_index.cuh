// SPDX-License-Identifier: Apache-2.0
// The index of a cloud whose parts lie apart from each other, while they arrive: a tree of each part, under common
// upper levels, of which there is one version for each part that arrives. A list does not depend on the tree that finds
// it.
#pragma once

#include <memory>
#include <optional>

#include "cuda/index/index.cuh"
#include "cuda/runtime/transfer.cuh"

namespace pointfair::cuda {

class PartSort;

class PartedIndex {
 public:
  // Builds `index`, which is then the whole cloud's, too.
  PartedIndex(Context& context, DeviceIndex& index);
  ~PartedIndex();

  // `points` on the card, in upload order. Only starts the work, on a stream of its own.
  void build(const Point* points, std::size_t count, const Arrival& arrival);
  bool is_building() const { return sort_ != nullptr; }  // until join()

  const Parts& parts() const { return parts_; }
  LeafRange leaves_of(std::size_t part) const;
  // Of a part and all before it, there after ready(part), and of all after it, there after ready_after().
  Tree tree_until(std::size_t part) const;
  Tree tree_after(std::size_t part) const;
  cudaEvent_t ready(std::size_t part) const { return ready_[part]; }
  cudaEvent_t ready_after() const { return ready_[parts_.count()]; }
  std::size_t leaves() const { return index_.leaves(); }

  cudaStream_t stream() const { return side_->stream(); }
  // The context's main stream waits for the index from now on.
  void join();

 private:
  void build_part(const Point* points, std::size_t part);

  Context& context_;
  DeviceIndex& index_;
  std::optional<SideStream> side_;
  Parts parts_;
  Events ready_;
  std::unique_ptr<PartSort> sort_;
};

}  // namespace pointfair::cuda
