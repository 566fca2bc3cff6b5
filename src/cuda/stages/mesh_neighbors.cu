// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/mesh_neighbors.cuh"
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

// Slots by a hash of sorted positions. At most half of them are taken, and a warp more.
struct Table {
  static constexpr std::size_t kBytesOfSlot = 6 * sizeof(unsigned);

  Index* at;  // kNoNeighbor: free
  // Of each slot, bits of the leaf's points: that have reached it, whose limit holds it, that have reached it in the
  // last round, and are reaching it in this one.
  unsigned *reached, *within, *fresh, *next;
  unsigned* used;  // taken slots, in the order in which they were taken
  Key* sorted;     // in the place of `fresh` and `next`, once nothing spreads any more
  unsigned size;   // a power of two

  __device__ Table(std::byte* memory, unsigned slots) : size(slots) {
    sorted = reinterpret_cast<Key*>(memory);
    fresh = reinterpret_cast<unsigned*>(memory);
    next = fresh + slots;
    reached = next + slots;
    within = reached + slots;
    used = within + slots;
    at = used + slots;
  }
  __device__ unsigned most() const { return size / 2; }

  __device__ void clear() const {
    for (unsigned slot = lane_number(); slot < size; slot += kWarp) {
      at[slot] = point::kNoNeighbor;
      reached[slot] = fresh[slot] = next[slot] = 0;
    }
    __syncwarp();
  }
};

// What the points of a leaf reach. All lanes of the warp call all members but the private ones.
class Reaching {
 public:
  struct Shared {
    float x[kWarp], y[kWarp], z[kWarp], squared_limit[kWarp];  // the limit is negative where there is no point
    Index own[kWarp];                                          // where the point's vertex is
    unsigned taken;                                            // slots
    bool is_full;
  };

  __device__ Reaching(const Tree& tree, const SortedEdgesView& edges, const Table& table, Shared& shared)
      : tree_(tree), edges_(edges), table_(table), shared_(shared) {}

  // From the points of a leaf, so many edges far.
  __device__ void spread(Index leaf, float squared_limit, int rounds) {
    table_.clear();
    const std::size_t at = std::size_t(leaf) * kLeafSize + lane_number();
    const float4 p = tree_.points[at];
    const bool valid = is_present(p);
    const unsigned lane = lane_number(), bit = 1u << lane;
    const SortedEnds ends = edges_.of[at];
    shared_.x[lane] = p.x, shared_.y[lane] = p.y, shared_.z[lane] = p.z;
    shared_.squared_limit[lane] = valid ? squared_limit : -1.0f;
    shared_.own[lane] = ends.own;
    if (lane == 0) {
      shared_.taken = 0;
      shared_.is_full = false;
    }
    settled_ = 0;
    __syncwarp();
    if (shared_.own[lane] != point::kNoNeighbor) {  // not to be reached again
      const unsigned slot = slot_of(shared_.own[lane]);
      if (slot < table_.size) atomicOr(table_.reached + slot, bit);
    }
    __syncwarp();
    enter_all(ends, bit);
    for (bool any = settle(); any && rounds > 1 && !shared_.is_full; any = settle(), --rounds) step();
  }
  __device__ bool is_full() const { return shared_.is_full; }
  __device__ unsigned taken() const { return shared_.taken; }

  // Keeps of what lanes reached, but for their own vertices, what keep(position, lanes) says.
  template <class Keep>
  __device__ void keep(const Keep& keep_of) {
    for (unsigned i = lane_number(); i < shared_.taken; i += kWarp) {
      const unsigned slot = table_.used[i];
      unsigned lanes = table_.reached[slot];
      if (lanes == 0) continue;
      for (unsigned lane = 0; lane < kWarp; ++lane)
        if (shared_.own[lane] == table_.at[slot]) lanes &= ~(1u << lane);
      table_.reached[slot] = keep_of(table_.at[slot], lanes);
    }
    __syncwarp();
  }
  // The lanes whose limit holds a position.
  __device__ unsigned within(Index there) const {
    const Vec p = position_of(tree_.points[there]);
    unsigned lanes = 0;
    for (unsigned lane = 0; lane < kWarp; ++lane)
      if (squared_distance(p, lane) <= shared_.squared_limit[lane]) lanes |= 1u << lane;
    return lanes;
  }
  __device__ void set_limit(float squared_limit) {
    if (!(shared_.squared_limit[lane_number()] < 0)) shared_.squared_limit[lane_number()] = squared_limit;
    __syncwarp();
  }

  // How many this lane has reached.
  __device__ unsigned count() const {
    unsigned own = 0;
    for (unsigned i = 0; i < shared_.taken; ++i) own += table_.reached[table_.used[i]] >> lane_number() & 1u;
    return own;
  }
  // Keys of what a lane has reached, nearest first, into table.sorted; returns how many.
  __device__ unsigned sort_of(unsigned lane) {
    const unsigned count = gather([&](unsigned slot, Key& key) {
      if ((table_.reached[slot] >> lane & 1u) == 0) return false;
      const Index there = table_.at[slot];
      key = point::neighbor_key(squared_distance(position_of(tree_.points[there]), lane), there);
      return true;
    });
    sort(count, Precedes{tree_.points});
    return count;
  }
  __device__ void forget(Index there, unsigned lane) { table_.reached[slot_of(there)] &= ~(1u << lane); }

  // Positions that any lane has reached, ascending, over the lanes that have, into table.sorted; returns how many.
  __device__ unsigned sort_all() {
    const unsigned count = gather([&](unsigned slot, Key& key) {
      key = Key(table_.at[slot]) << 32 | table_.reached[slot];
      return table_.reached[slot] != 0;
    });
    sort(count, [](Key a, Key b) { return a < b; });
    return count;
  }

 private:
  __device__ float squared_distance(Vec p, unsigned lane) const {
    return point::squared_length(Vec{p.x - shared_.x[lane], p.y - shared_.y[lane], p.z - shared_.z[lane]});
  }

  // The slot of a position, taken if need be; table.size if there is no room.
  __device__ unsigned slot_of(Index there) {
    unsigned slot = (there * 2654435761u >> 7) & (table_.size - 1);
    for (;; slot = (slot + 1) & (table_.size - 1)) {
      const Index held = static_cast<volatile Index*>(table_.at)[slot];
      if (held == there) return slot;
      if (held != point::kNoNeighbor) continue;
      if (static_cast<volatile unsigned&>(shared_.taken) >= table_.most()) {
        shared_.is_full = true;
        return table_.size;
      }
      const Index before = atomicCAS(table_.at + slot, point::kNoNeighbor, there);
      if (before == point::kNoNeighbor) {
        table_.used[atomicAdd(&shared_.taken, 1u)] = slot;
        return slot;
      }
      if (before == there) return slot;
    }
  }

  __device__ void enter_all(const SortedEnds& ends, unsigned lanes) {
    for (unsigned n = 0; n < ends.count; ++n) {
      const Index there = edges_.there[ends.begin + n];
      if (there == point::kNoNeighbor) continue;
      const unsigned slot = slot_of(there);
      if (slot < table_.size) atomicOr(table_.next + slot, lanes);
    }
  }
  __device__ bool leads_on(const SortedEnds& ends) const {
    if (ends.count <= point::kMostMeshEdges) return true;
    unsigned held = 0;
    for (unsigned n = 0; n < ends.count; ++n) held += edges_.there[ends.begin + n] != point::kNoNeighbor;
    return held <= point::kMostMeshEdges;
  }

  // From what was reached in the last round.
  __device__ void step() {
    const unsigned taken = shared_.taken;
    __syncwarp();
    for (unsigned i = lane_number(); i < taken; i += kWarp) {
      const unsigned slot = table_.used[i], lanes = table_.fresh[slot];
      if (lanes == 0) continue;
      const SortedEnds ends = edges_.of[table_.at[slot]];
      if (leads_on(ends)) enter_all(ends, lanes);
    }
  }
  // Ends a round; whether anything was reached.
  __device__ bool settle() {
    __syncwarp();
    bool any = false;
    for (unsigned i = lane_number(); i < shared_.taken; i += kWarp) {
      const unsigned slot = table_.used[i];
      if (i >= settled_) table_.within[slot] = within(table_.at[slot]);
      const unsigned fresh = table_.next[slot] & table_.within[slot] & ~table_.reached[slot];
      table_.next[slot] = 0;
      table_.fresh[slot] = fresh;
      table_.reached[slot] |= fresh;
      any = any || fresh != 0;
    }
    settled_ = shared_.taken;
    return __any_sync(kAllLanes, any);
  }

  // Keys that key_of(slot, key) gives, into table.sorted; returns how many.
  template <class KeyOf>
  __device__ unsigned gather(const KeyOf& key_of) {
    unsigned count = 0;
    for (unsigned first = 0; first < shared_.taken; first += kWarp) {
      Key key = 0;
      const bool has = first + lane_number() < shared_.taken && key_of(table_.used[first + lane_number()], key);
      const unsigned those = __ballot_sync(kAllLanes, has);
      if (has) table_.sorted[count + __popc(those & lanes_below())] = key;
      count += __popc(those);
    }
    __syncwarp();
    return count;
  }
  // Bitonic (Batcher 1968).
  template <class Less>
  __device__ void sort(unsigned count, const Less& less) {
    unsigned size = 1;
    while (size < count) size *= 2;
    for (unsigned i = count + lane_number(); i < size; i += kWarp) table_.sorted[i] = kNoKey;
    __syncwarp();
    for (unsigned run = 2; run <= size; run *= 2)
      for (unsigned step = run / 2; step > 0; step /= 2) {
        for (unsigned i = lane_number(); i < size; i += kWarp) {
          const unsigned other = i ^ step;
          if (other < i) continue;
          const Key a = table_.sorted[i], b = table_.sorted[other];
          if (less(b, a) == ((i & run) == 0)) table_.sorted[i] = b, table_.sorted[other] = a;
        }
        __syncwarp();
      }
  }

  const Tree& tree_;
  const SortedEdgesView& edges_;
  const Table& table_;
  Shared& shared_;
  unsigned settled_ = 0;
};

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
  const Table table(
      tables.memory == nullptr ? on_chip : tables.memory + std::size_t(blockIdx.x) * tables.size * Table::kBytesOfSlot,
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
  for_leaves(tree, edges, tables, shared, stop, [&](Index leaf, Reaching& reaching, const Table& table) {
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
  for_leaves(tree, edges, tables, shared, stop, [&](Index leaf, Reaching& reaching, const Table& table) {
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
  const cudaStream_t stream = context_.stream();
  const std::size_t resident = std::size_t(context_.processors()) * kWarpsOfProcessor;
  count_.resize(1);
  next_.resize(leaves);
  unsigned size = kSlotsOnChip, count = static_cast<unsigned>(leaves);
  for (bool on_chip = true; count > 0; on_chip = false) {
    const std::size_t bytes = size * Table::kBytesOfSlot;
    std::size_t warps = std::min<std::size_t>(count, resident);
    if (!on_chip) {
      warps = std::max<std::size_t>(1, std::min(warps, kMostMemory / bytes));
      memory_.resize(warps * bytes);
      now_.swap(next_);
      next_.resize(count);
    }
    check(cudaMemsetAsync(count_.data(), 0, sizeof(unsigned), stream), "following edges");
    launch(TablesView{on_chip ? nullptr : memory_.data(), size, static_cast<Index>(warps),
                      on_chip ? nullptr : now_.data(), count, next_.data(), count_.data()},
           static_cast<unsigned>(warps), on_chip ? bytes : 0);
    check(cudaGetLastError(), "following edges");
    check(cudaMemcpyAsync(&count, count_.data(), sizeof(count), cudaMemcpyDeviceToHost, stream), "following edges");
    context_.finish();
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
    check(cudaMemsetAsync(used_.data(), 0, sizeof(unsigned long long), context_.stream()), "preparing rings");
    tables.with(tree.leaves, [&](const TablesView& view, unsigned blocks, std::size_t bytes) {
      reach_rings<<<blocks, kBlock, bytes, context_.stream()>>>(
          tree, edges, view, rings, squared_limit, {entries_.data(), of_leaves_.data(), used_.data(), entries_.size()},
          stop);
    });
    unsigned long long used = 0;
    check(cudaMemcpyAsync(&used, used_.data(), sizeof(used), cudaMemcpyDeviceToHost, context_.stream()),
          "following edges");
    context_.finish();
    if (used <= entries_.size()) return;
    entries_.resize(used);
  }
}

}  // namespace pointfair::cuda
