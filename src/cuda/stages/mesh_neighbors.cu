// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/mesh_neighbors.cuh"
#include "cuda/stages/mesh_reaching.cuh"
#include "cuda/stages/surroundings.cuh"
#include "point/mesh_ball.h"
#include "pointfair/params.hpp"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = kWarp;                              // a warp, since each has a table in the memory of its block
constexpr unsigned kSlotsOnChip = 1024;                    // 24 KiB
constexpr unsigned kSlotsElsewhere = 8192;                 // at first
constexpr std::size_t kWarpsOfProcessor = 8;               // as many as have room for their tables
constexpr std::size_t kMostMemory = std::size_t(1) << 30;  // of all tables elsewhere, if some warps are enough
constexpr int kAllRounds = 0x7fffffff;

// Writes the parts of a leaf's groups from sorted positions over lanes.
class PartWriter {
 public:
  struct Shared {
    Index at[2 * kWarp];
    unsigned lanes[2 * kWarp];
  };
  __device__ PartWriter(const PartsRoom& room, Index* link, Shared& shared)
      : room_(room), link_(link), shared_(shared) {}

  // A position, or none, of each lane of the warp, with the points of the group that have it.
  __device__ void add(Index at, unsigned points) {
    const unsigned those = __ballot_sync(kAllLanes, points != 0);
    if (points != 0) {
      const unsigned to = held_ + __popc(those & lanes_below());
      shared_.at[to] = at;
      shared_.lanes[to] = points;
    }
    held_ += __popc(those);
    __syncwarp();
    if (held_ >= kWarp) write();
  }
  __device__ void finish() {
    if (held_ > 0) write();
    if (lane_number() == 0) *link_ = point::kNoNeighbor;
  }

 private:
  __device__ void write() {
    const unsigned lane = lane_number();
    Index part = 0;
    if (lane == 0) part = atomicAdd(room_.count, 1u);
    part = __shfl_sync(kAllLanes, part, 0);
    const Index at = lane < held_ ? shared_.at[lane] : point::kNoNeighbor;
    const unsigned points = lane < held_ ? shared_.lanes[lane] : 0;
    const bool fits = part < room_.capacity;
    if (fits) room_.parts[part].position[lane] = at;
    for (unsigned p = 0; p < kGroup; ++p) {
      const unsigned inside = __ballot_sync(kAllLanes, (points >> p & 1u) != 0);
      if (fits && lane == p) room_.parts[part].inside[p] = inside;
    }
    if (fits) {
      if (lane == 0) *link_ = part;
      link_ = room_.next + part;
    }
    const unsigned left = held_ > kWarp ? held_ - kWarp : 0;
    const Index later = shared_.at[lane + kWarp];
    const unsigned later_lanes = shared_.lanes[lane + kWarp];
    __syncwarp();
    shared_.at[lane] = later;
    shared_.lanes[lane] = later_lanes;
    held_ = left;
    __syncwarp();
  }

  const PartsRoom& room_;
  Index* link_;  // where the number of the group's next part goes
  Shared& shared_;
  unsigned held_ = 0;
};

struct TablesView {
  std::byte* memory;  // null: on the chip
  unsigned size;
  Index warps;
  const Index* leaves;  // null: all
  Index count;          // of leaves
  Index* full;          // leaves whose tables were full
  unsigned* full_count;
};

// Calls body(leaf, reaching, table) for each leaf; notes those whose tables are full.
template <class Body>
__device__ void for_leaves(const Tree& tree, const SortedEdgesView& edges, const TablesView& tables,
                           Reaching::Shared& shared, const Stop& stop, const Body& body) {
  extern __shared__ __align__(16) std::byte on_chip[];
  const ReachTable table(tables.memory == nullptr
                             ? on_chip
                             : tables.memory + std::size_t(blockIdx.x) * tables.size * ReachTable::kBytesOfSlot,
                         tables.size);
  Reaching reaching(tree, edges, table, shared);
  for (Index i = blockIdx.x; i < tables.count; i += tables.warps) {
    const Index leaf = tables.leaves == nullptr ? i : tables.leaves[i];
    if (stop.is_heard(i)) return;
    body(leaf, reaching, table);
    __syncwarp();
    if (reaching.is_full() && lane_number() == 0) tables.full[atomicAdd(tables.full_count, 1u)] = leaf;
    __syncwarp();
  }
}

__global__ void __launch_bounds__(kBlock)
    reach_balls(const __grid_constant__ Tree tree, const __grid_constant__ SortedEdgesView edges,
                const __grid_constant__ TablesView tables, point::Radii radii, float growth,
                const __grid_constant__ PartsRoom room, const __grid_constant__ Stop stop) {
  __shared__ Reaching::Shared shared;
  __shared__ PartWriter::Shared of_writer;
  __shared__ float shares[kWarp];
  for_leaves(tree, edges, tables, shared, stop, [&](Index leaf, Reaching& reaching, const ReachTable& table) {
    const Index at = leaf * kLeafSize + lane_number();
    const point::MeshBall ball = tree.holds(at) ? point::mesh_ball_of(radii, at, growth) : point::MeshBall{-1, -1, 1};
    shares[lane_number()] = ball.share;
    const bool is_thinned = __any_sync(kAllLanes, ball.share < 1);
    reaching.spread(leaf, ball.squared_limit, kAllRounds);
    if (reaching.is_full()) return;
    reaching.keep([&](Index there, unsigned lanes) {
      for (unsigned lane = 0; is_thinned && lane < kWarp; ++lane)
        if (shares[lane] < 1 && !(tree.share[there] < shares[lane])) lanes &= ~(1u << lane);
      return lanes;
    });
    if (reaching.taken() > unsigned(kMaxNeighbors)) {
      unsigned crowded = __ballot_sync(kAllLanes, reaching.count() > unsigned(kMaxNeighbors));
      for (; crowded != 0; crowded &= crowded - 1) {
        const unsigned lane = static_cast<unsigned>(__ffs(static_cast<int>(crowded)) - 1);
        const unsigned all = reaching.sort_of(lane);
        for (unsigned i = unsigned(kMaxNeighbors) + lane_number(); i < all; i += kWarp)
          reaching.forget(point::key_index(table.sorted[i]), lane);
        __syncwarp();
      }
    }
    const unsigned count = reaching.sort_all();
    for (unsigned group = 0; group < unsigned(kGroups); ++group) {
      PartWriter writer(room, room.first + leaf * kGroups + group, of_writer);
      for (unsigned first = 0; first < count; first += kWarp) {
        const Key key = first + lane_number() < count ? table.sorted[first + lane_number()] : 0;
        writer.add(static_cast<Index>(key >> 32),
                   static_cast<unsigned>(key) >> (group * kGroup) & ((1u << kGroup) - 1));
      }
      writer.finish();
    }
  });
}

struct RingRoom {
  Index* entries;
  LeafList* of_leaves;
  unsigned long long* used;  // entries that are wanted, also beyond the capacity
  unsigned long long capacity;
};

__global__ void __launch_bounds__(kBlock)
    reach_rings(const __grid_constant__ Tree tree, const __grid_constant__ SortedEdgesView edges,
                const __grid_constant__ TablesView tables, int rings, float squared_limit,
                const __grid_constant__ RingRoom room, const __grid_constant__ Stop stop) {
  __shared__ Reaching::Shared shared;
  for_leaves(tree, edges, tables, shared, stop, [&](Index leaf, Reaching& reaching, const ReachTable& table) {
    const unsigned lane = lane_number();
    reaching.spread(leaf, rings > 0 ? __builtin_inff() : squared_limit, rings > 0 ? rings : kAllRounds);
    if (reaching.is_full()) return;
    reaching.set_limit(squared_limit);
    reaching.keep([&](Index there, unsigned lanes) { return lanes & reaching.within(there); });
    const unsigned k = warp_max(min(reaching.count(), unsigned(kMaxNeighbors)));
    unsigned long long begin = 0;
    if (lane == 0) {
      begin = atomicAdd(room.used, static_cast<unsigned long long>(k) * kWarp);
      room.of_leaves[leaf] = {begin, static_cast<int>(k)};
    }
    begin = __shfl_sync(kAllLanes, begin, 0);
    if (begin + static_cast<unsigned long long>(k) * kWarp > room.capacity) return;
    for (unsigned of = 0; of < kWarp; ++of) {
      const unsigned count = reaching.sort_of(of);
      for (unsigned slot = lane; slot < k; slot += kWarp)
        room.entries[begin + slot * kWarp + of] =
            slot < count ? point::key_index(table.sorted[slot]) : point::kNoNeighbor;
      __syncwarp();
    }
  });
}

}  // namespace

template <class Launch>
void MeshTables::with(std::size_t leaves, const Launch& launch) {
  const std::size_t resident = std::size_t(context_.processors()) * kWarpsOfProcessor;
  count_.resize(1);
  next_.resize(leaves);
  unsigned size = kSlotsOnChip, count = static_cast<unsigned>(leaves);
  for (bool on_chip = true; count > 0; on_chip = false) {
    const std::size_t bytes = size * ReachTable::kBytesOfSlot;
    std::size_t warps = std::min<std::size_t>(count, resident);
    if (!on_chip) {
      warps = std::max<std::size_t>(1, std::min(warps, kMostMemory / bytes));
      memory_.resize(warps * bytes);
      now_.swap(next_);
      next_.resize(count);
    }
    count_.clear("following edges");
    launch(TablesView{on_chip ? nullptr : memory_.data(), size, static_cast<Index>(warps),
                      on_chip ? nullptr : now_.data(), count, next_.data(), count_.data()},
           static_cast<unsigned>(warps), on_chip ? bytes : 0);
    check(cudaGetLastError(), "following edges");
    count = count_.first("following edges");
    size = on_chip ? kSlotsElsewhere : 4 * size;
  }
  memory_.release();
}

void find_balls(Context& context, MeshTables& tables, const Tree& tree, const SortedEdgesView& edges,
                const point::Radii& radii, float growth, const PartsRoom& room, const Stop& stop) {
  check(cudaMemsetAsync(room.first, 0xff, std::size_t(tree.leaves) * kGroups * sizeof(Index), context.stream()),
        "preparing neighbourhoods");  // if it is stopped
  tables.with(tree.leaves, [&](const TablesView& view, unsigned blocks, std::size_t bytes) {
    reach_balls<<<blocks, kBlock, bytes, context.stream()>>>(tree, edges, view, radii, growth, room, stop);
  });
}

void RingLists::find(MeshTables& tables, const Tree& tree, const SortedEdgesView& edges, int rings, float squared_limit,
                     const Stop& stop) {
  constexpr std::size_t kExpected = 10 * kLeafSize;  // of a leaf; the first guess
  of_leaves_.resize(tree.leaves);
  used_.resize(1);
  if (entries_.size() < tree.leaves * kExpected) entries_.resize(tree.leaves * kExpected);
  for (;;) {
    used_.clear("preparing rings");
    tables.with(tree.leaves, [&](const TablesView& view, unsigned blocks, std::size_t bytes) {
      reach_rings<<<blocks, kBlock, bytes, context_.stream()>>>(
          tree, edges, view, rings, squared_limit, {entries_.data(), of_leaves_.data(), used_.data(), entries_.size()},
          stop);
    });
    const unsigned long long used = used_.first("following edges");
    if (used <= entries_.size()) return;
    entries_.resize(used);
  }
}

}  // namespace pointfair::cuda
