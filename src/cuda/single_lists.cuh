// SPDX-License-Identifier: Apache-2.0
// Where the exact search of one query keeps the nearest it has found: 64-bit keys (squared distance, original index)
// with their sorted positions. Every lane of the warp offers a candidate at a time.
#pragma once

#include <cstddef>

#include "cuda/tree.cuh"

namespace pointfair::cuda {

using Key = unsigned long long;
inline constexpr Key kNoKey = ~0ull;

// Up to 32, lane i holding the i-th.
class RegisterList {
 public:
  static constexpr int kCapacity = kWarp;

  __device__ void offer(bool joins, Key key, Index position) {
    unsigned joining = __ballot_sync(kAllLanes, joins);
    constexpr int kFew = 10;  // more are sorted and merged at once
    if (__popc(joining) > kFew) return merge(joins ? key : kNoKey, position);
    for (; joining != 0; joining &= joining - 1) {
      const int lane = __ffs(static_cast<int>(joining)) - 1;
      insert(__shfl_sync(kAllLanes, key, lane), __shfl_sync(kAllLanes, position, lane));
    }
  }
  __device__ void finish() {}
  __device__ Key key(int place) const { return __shfl_sync(kAllLanes, key_, place); }
  // Calls visit(place, key, position) in one lane for each of the first `count` places.
  template <class Visit>
  __device__ void for_each(int count, Visit visit) const {
    if (static_cast<int>(lane_number()) < count) visit(static_cast<int>(lane_number()), key_, position_);
  }

 private:
  __device__ void insert(Key key, Index position) {
    const int rank = __popc(__ballot_sync(kAllLanes, key_ < key)), lane = static_cast<int>(lane_number());
    const Key key_below = __shfl_up_sync(kAllLanes, key_, 1);
    const Index position_below = __shfl_up_sync(kAllLanes, position_, 1);
    key_ = lane < rank ? key_ : lane == rank ? key : key_below;
    position_ = lane < rank ? position_ : lane == rank ? position : position_below;
  }
  // Keeps the smaller or the larger of this lane's pair and that of lane ^ distance.
  __device__ static void exchange(Key& key, Index& position, int distance, bool keep_smaller) {
    const Key other = __shfl_xor_sync(kAllLanes, key, distance);
    const Index other_position = __shfl_xor_sync(kAllLanes, position, distance);
    const bool take = (other < key) == keep_smaller && other != key;
    key = take ? other : key;
    position = take ? other_position : position;
  }
  __device__ void merge(Key key, Index position) {
    const int lane = static_cast<int>(lane_number());
#pragma unroll
    for (int size = 2; size <= kWarp; size *= 2) {
#pragma unroll
      for (int distance = size / 2; distance > 0; distance /= 2) {
        const bool ascending = (lane & size) == 0;
        exchange(key, position, distance, ascending == ((lane & distance) == 0));
      }
    }
    const Key mirrored = __shfl_sync(kAllLanes, key, kWarp - 1 - lane);
    const Index mirrored_position = __shfl_sync(kAllLanes, position, kWarp - 1 - lane);
    position_ = mirrored < key_ ? mirrored_position : position_;
    key_ = mirrored < key_ ? mirrored : key_;
#pragma unroll
    for (int distance = kWarp / 2; distance > 0; distance /= 2)
      exchange(key_, position_, distance, (lane & distance) == 0);
  }

  Key key_ = kNoKey;
  Index position_ = point::kNoNeighbor;
};

// Any number up to `size`, a power of two: a sorted list in shared memory, and a buffer as long that is sorted and
// merged when it is full.
class SharedList {
 public:
  static constexpr int kLeastSize = 64;

  static constexpr std::size_t bytes(int size) { return 2 * std::size_t(size) * (sizeof(Key) + sizeof(Index)); }
  __host__ __device__ static int size_for(int k) {
    int size = kLeastSize;
    while (size < k) size *= 2;
    return size;
  }

  __device__ SharedList(std::byte* memory, int size)
      : keys_(reinterpret_cast<Key*>(memory)), positions_(reinterpret_cast<Index*>(keys_ + 2 * size)), size_(size) {
    for (int i = static_cast<int>(lane_number()); i < size_; i += kWarp) keys_[i] = kNoKey;
    __syncwarp();
  }

  __device__ void offer(bool joins, Key key, Index position) {
    const unsigned joining = __ballot_sync(kAllLanes, joins);
    if (joins) {
      const int place = size_ + waiting_ + __popc(joining & lanes_below());
      keys_[place] = key;
      positions_[place] = position;
    }
    waiting_ += __popc(joining);
    __syncwarp();
    if (waiting_ > size_ - kWarp) finish();
  }
  // Brings what waits in the buffer into the list.
  __device__ void finish() {
    for (int i = waiting_ + static_cast<int>(lane_number()); i < size_; i += kWarp) keys_[size_ + i] = kNoKey;
    __syncwarp();
    for (int run = 2; run <= size_; run *= 2) {
      exchange_mirrored(size_, run);
      for (int stride = run / 4; stride > 0; stride /= 2) exchange_all(size_, stride);
    }
    for (int i = static_cast<int>(lane_number()); i < size_; i += kWarp) exchange(i, 2 * size_ - 1 - i);
    __syncwarp();
    for (int stride = size_ / 2; stride > 0; stride /= 2) exchange_all(0, stride);
    waiting_ = 0;
  }
  __device__ Key key(int place) const { return keys_[place]; }
  template <class Visit>
  __device__ void for_each(int count, Visit visit) const {
    for (int i = static_cast<int>(lane_number()); i < count; i += kWarp) visit(i, keys_[i], positions_[i]);
  }
  __device__ const Index* positions() const { return positions_; }

 private:
  __device__ void exchange(int i, int j) {
    const Key a = keys_[i], b = keys_[j];
    if (a <= b) return;
    keys_[i] = b;
    keys_[j] = a;
    const Index at = positions_[i];
    positions_[i] = positions_[j];
    positions_[j] = at;
  }
  // One step of bitonic merges of the list (from 0) or of the buffer (from size_).
  __device__ void exchange_all(int first, int stride) {
    for (int n = static_cast<int>(lane_number()); n < size_ / 2; n += kWarp) {
      const int i = first + 2 * n - (n & (stride - 1));  // strides are powers of two
      exchange(i, i + stride);
    }
    __syncwarp();
  }
  // The first step of each merge compares mirrored places, so that all runs ascend.
  __device__ void exchange_mirrored(int first, int run) {
    for (int n = static_cast<int>(lane_number()); n < size_ / 2; n += kWarp) {
      const int i = n & (run / 2 - 1), start = first + 2 * (n - i);
      exchange(start + i, start + run - 1 - i);
    }
    __syncwarp();
  }

  Key* keys_;         // list, then buffer
  Index* positions_;  // of the keys
  int size_;
  int waiting_ = 0;  // in the buffer
};

}  // namespace pointfair::cuda
