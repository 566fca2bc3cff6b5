// SPDX-License-Identifier: Apache-2.0
// What the points of a leaf reach along the edges of a mesh, found by a warp in a table of its own.
#pragma once

#include "cuda/stages/mesh_on_card.cuh"
#include "cuda/stages/surroundings.cuh"
#include "point/mesh_ball.h"

namespace pointfair::cuda {

// Slots by a hash of sorted positions. At most half of them are taken, and a warp more.
struct ReachTable {
  static constexpr std::size_t kBytesOfSlot = 6 * sizeof(unsigned);

  Index* at;  // kNoNeighbor: free
  // Of each slot, bits of the leaf's points: that have reached it, whose limit holds it, that have reached it in the
  // last round, and are reaching it in this one.
  unsigned *reached, *within, *fresh, *next;
  unsigned* used;  // taken slots, in the order in which they were taken
  Key* sorted;     // in the place of `fresh` and `next`, once nothing spreads any more
  unsigned size;   // a power of two

  __device__ ReachTable(std::byte* memory, unsigned slots) : size(slots) {
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

  __device__ Reaching(const Tree& tree, const SortedEdgesView& edges, const ReachTable& table, Shared& shared)
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
  const ReachTable& table_;
  Shared& shared_;
  unsigned settled_ = 0;
};

}  // namespace pointfair::cuda
