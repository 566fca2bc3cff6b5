// SPDX-License-Identifier: Apache-2.0
// The k <= 1024 nearest points of one place: a warp to a query, exact, ties by original index. Visits the tree nearest
// box first. Found points are 64-bit keys (squared distance, original index) in shared memory: a sorted list of `size`
// places, and a buffer of as many that is sorted and merged when it is full.
#pragma once

#include "cuda/tree.cuh"

namespace pointfair::cuda {

using Key = unsigned long long;
inline constexpr Key kNoKey = ~0ull;
inline constexpr int kLeastSize = 64;

// One warp's share of shared memory; `size` is a power of two.
struct SingleMemory {
  Key* keys;         // 2 * size
  Index* positions;  // 2 * size
  unsigned* gaps;    // kMaxLevels * 32: bits of squared distances to the boxes still to be visited
  Index* groups;     // kMaxLevels
  int size;

  static constexpr std::size_t bytes(int size) {
    return 2 * std::size_t(size) * (sizeof(Key) + sizeof(Index)) + kMaxLevels * (kWarp + 2) * sizeof(unsigned);
  }
  __device__ SingleMemory(std::byte* memory, int its_size)
      : keys(reinterpret_cast<Key*>(memory)),
        positions(reinterpret_cast<Index*>(keys + 2 * its_size)),
        gaps(positions + 2 * its_size),
        groups(gaps + kMaxLevels * kWarp),
        size(its_size) {}
};

__host__ __device__ inline int single_size(int k) {
  int size = kLeastSize;
  while (size < k) size *= 2;
  return size;
}

class SingleSearch {
 public:
  __device__ SingleSearch(const Tree& tree, SingleMemory memory, Vec position, Index original, int k,
                          float squared_limit)
      : tree_(tree), memory_(memory), position_(position), original_(original), k_(k), squared_limit_(squared_limit) {}

  // Afterwards the list holds the nearest, sorted, kNoKey at the end.
  __device__ void run() {
    for (int i = int(lane_number()); i < memory_.size; i += kWarp) memory_.keys[i] = kNoKey;
    __syncwarp();
    int level = tree_.levels - 1;
    enter(level, 0);
    while (level < tree_.levels) {
      const unsigned gap = memory_.gaps[level * kWarp + lane_number()];
      const unsigned nearest = warp_min(gap);
      if (nearest == kVisited || !may_hold(nearest)) {
        ++level;
        continue;
      }
      const int child = __ffs(static_cast<int>(__ballot_sync(kAllLanes, gap == nearest))) - 1;
      if (int(lane_number()) == child) memory_.gaps[level * kWarp + lane_number()] = kVisited;
      const Index node = memory_.groups[level] * kLeafSize + Index(child);
      __syncwarp();
      if (nearest == last_bits() &&
          tree_.group(level, node / kLeafSize).least_original[node % kLeafSize] > last_original())
        continue;
      if (level == 0) {
        visit_leaf(node);
      } else {
        enter(--level, node);
      }
    }
    merge();
  }

  __device__ Key key(int i) const { return memory_.keys[i]; }
  __device__ Index position(int i) const { return memory_.positions[i]; }

 private:
  static constexpr unsigned kVisited = ~0u;

  __device__ unsigned last_bits() const { return static_cast<unsigned>(last_ >> 32); }
  __device__ Index last_original() const { return static_cast<Index>(last_); }
  __device__ bool may_hold(unsigned gap) const { return gap <= last_bits() && __uint_as_float(gap) <= squared_limit_; }

  __device__ void enter(int level, Index group) {
    const Box box = box_of_lane(tree_.group(level, group));
    const float gap = squared_gap(box, {position_, position_});
    memory_.gaps[level * kWarp + lane_number()] = gap < __int_as_float(0x7f800000) ? __float_as_uint(gap) : kVisited;
    memory_.groups[level] = group;
    __syncwarp();
  }

  __device__ void visit_leaf(Index leaf) {
    const Index at = leaf * kLeafSize + lane_number();
    const float4 p = tree_.points[at];
    const float distance = point::squared_length(position_of(p) - position_);
    const Key key = point::neighbor_key(distance, original_of(p));
    const bool joins = distance <= squared_limit_ && distance < __int_as_float(0x7f800000) &&
                       original_of(p) != original_ && key < last_;
    const unsigned joining = __ballot_sync(kAllLanes, joins);
    if (joins) {
      const int place = memory_.size + waiting_ + __popc(joining & lanes_below());
      memory_.keys[place] = key;
      memory_.positions[place] = at;
    }
    waiting_ += __popc(joining);
    __syncwarp();
    if (waiting_ > memory_.size - kWarp) merge();
  }

  __device__ void exchange(int i, int j) {
    const Key a = memory_.keys[i], b = memory_.keys[j];
    if (a <= b) return;
    memory_.keys[i] = b;
    memory_.keys[j] = a;
    const Index at = memory_.positions[i];
    memory_.positions[i] = memory_.positions[j];
    memory_.positions[j] = at;
  }

  // Sorts the part of a bitonic sequence, or the whole of the buffer, by passes of exchanges at distance `stride`.
  __device__ void exchange_all(int first, int stride) {
    for (int n = int(lane_number()); n < memory_.size / 2; n += kWarp) {
      const int i = first + (n / stride) * 2 * stride + n % stride;
      exchange(i, i + stride);
    }
    __syncwarp();
  }
  // The first step of each bitonic merge compares mirrored places, so all runs ascend.
  __device__ void exchange_mirrored(int first, int run) {
    for (int n = int(lane_number()); n < memory_.size / 2; n += kWarp) {
      const int start = first + (n / (run / 2)) * run, i = n % (run / 2);
      exchange(start + i, start + run - 1 - i);
    }
    __syncwarp();
  }

  __device__ void merge() {
    const int size = memory_.size;
    for (int i = waiting_ + int(lane_number()); i < size; i += kWarp) memory_.keys[size + i] = kNoKey;
    __syncwarp();
    for (int run = 2; run <= size; run *= 2) {
      exchange_mirrored(size, run);
      for (int stride = run / 4; stride > 0; stride /= 2) exchange_all(size, stride);
    }
    for (int i = int(lane_number()); i < size; i += kWarp) exchange(i, 2 * size - 1 - i);
    __syncwarp();
    for (int stride = size / 2; stride > 0; stride /= 2) exchange_all(0, stride);
    waiting_ = 0;
    last_ = memory_.keys[k_ - 1];
  }

  const Tree& tree_;
  SingleMemory memory_;
  Vec position_;
  Index original_;
  int k_;
  float squared_limit_;
  Key last_ = kNoKey;  // the k-th found so far
  int waiting_ = 0;    // in the buffer
};

}  // namespace pointfair::cuda
