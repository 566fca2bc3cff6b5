// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/collected.cuh"
#include "cuda/stages/surroundings.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;
constexpr std::size_t kExpectedParts = 16;  // of a leaf; the first guess

struct Room {
  NeighborPart* parts;
  Index *next, *first;
  Index* count;  // of parts that are wanted, also beyond the capacity
  Index capacity;
};

// The parts of one leaf, as a warp collects them.
class Collection {
 public:
  __device__ __forceinline__ Collection(const Room& room, Index leaf) : room_(room), link_(room.first + leaf) {}

  __device__ __forceinline__ void add(Index position, bool inside) {
    if (static_cast<int>(lane_number()) == held_) position_ = position;
    inside_ |= inside ? 1u << held_ : 0u;
    if (++held_ == kWarp) write();
  }
  __device__ __forceinline__ void finish() {
    if (held_ > 0) write();
    if (lane_number() == 0) *link_ = point::kNoNeighbor;
  }

 private:
  __device__ __forceinline__ void write() {
    const unsigned lane = lane_number();
    Index part = 0;
    if (lane == 0) part = atomicAdd(room_.count, 1u);
    part = __shfl_sync(kAllLanes, part, 0);
    if (part < room_.capacity) {
      room_.parts[part].position[lane] = static_cast<int>(lane) < held_ ? position_ : point::kNoNeighbor;
      room_.parts[part].inside[lane] = inside_;
      if (lane == 0) *link_ = part;
      link_ = room_.next + part;
    }
    held_ = 0;
    inside_ = 0;
  }

  const Room& room_;
  Index* link_;  // where the number of the next part goes
  int held_ = 0;
  Index position_ = point::kNoNeighbor;
  unsigned inside_ = 0;
};

__global__ void __launch_bounds__(kBlock)
    collect_neighbors(const __grid_constant__ Tree tree, point::Radii radii, const __grid_constant__ Room room,
                      const __grid_constant__ Stop stop) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ WalkedRadius::Shared shared[kWarps];
  const WalkedRadius around(tree, radii, stop, Index(at), tree.holds(at), shared[threadIdx.x / kWarp]);
  Collection collection(room, Index(at / kLeafSize));
  around.for_leaves([&](Index leaf, unsigned inside) {
    for (unsigned all = warp_or(inside); all != 0; all &= all - 1) {
      const int i = __ffs(static_cast<int>(all)) - 1;
      collection.add(leaf * kLeafSize + Index(i), (inside >> i & 1u) != 0);
    }
  });
  collection.finish();
}

}  // namespace

NeighborCollector::NeighborCollector(Context& context)
    : context_(context), parts_(context), next_(context), first_(context), count_(context) {}

CollectedNeighbors NeighborCollector::collected() const {
  return {complete_ ? parts_.data() : nullptr, next_.data(), first_.data()};
}

void NeighborCollector::release() {
  parts_.release();
  next_.release();
  complete_ = is_aside_ = false;
}

void NeighborCollector::set_aside() {
  const bool was_complete = complete_;
  release();
  is_aside_ = was_complete;
}

bool NeighborCollector::make_room(std::size_t parts) {
  try {
    parts_.resize(parts);
    next_.resize(parts);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::memory) throw;
    return false;
  }
  return true;
}

std::size_t NeighborCollector::run(const Tree& tree, const point::Radii& radii, const Stop& stop) {
  check(cudaMemsetAsync(count_.data(), 0, sizeof(Index), context_.stream()), "preparing neighbourhoods");
  const Index capacity = static_cast<Index>(std::min<std::size_t>(parts_.size(), point::kNoNeighbor));
  collect_neighbors<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context_.stream()>>>(
      tree, radii, {parts_.data(), next_.data(), first_.data(), count_.data(), capacity}, stop);
  check(cudaGetLastError(), "collecting neighbourhoods");
  Index count = 0;
  check(cudaMemcpyAsync(&count, count_.data(), sizeof(count), cudaMemcpyDeviceToHost, context_.stream()),
        "collecting neighbourhoods");
  context_.finish();
  return count;
}

void NeighborCollector::collect(const Tree& tree, const point::Radii& radii, std::size_t largest, const Stop& stop) {
  complete_ = is_aside_ = false;
  first_.resize(std::max<std::size_t>(tree.leaves, 1));
  count_.resize(1);
  const std::size_t most = largest / (sizeof(NeighborPart) + sizeof(Index));
  if (!make_room(std::min(most, std::max(parts_.size(), tree.leaves * kExpectedParts)))) return release();
  const std::size_t wanted = run(tree, radii, stop);
  if (wanted > parts_.size()) {
    if (wanted > most || !make_room(wanted)) return release();
    run(tree, radii, stop);
  }
  complete_ = true;
}

}  // namespace pointfair::cuda
