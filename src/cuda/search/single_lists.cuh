// SPDX-License-Identifier: Apache-2.0
// Where the exact search of one query keeps the keys of the nearest it has found. Every lane of the warp offers a
// candidate at a time.
#pragma once

#include <cstddef>

#include "cuda/index/tree.cuh"

namespace pointfair::cuda {

// Up to 32, lane i holding the i-th.
class RegisterList {
 public:
  static constexpr int kCapacity = kWarp;

  __device__ explicit RegisterList(const float4* points) : precedes_{points} {}

  __device__ void offer(bool joins, Key key) {
    unsigned joining = __ballot_sync(kAllLanes, joins);
    constexpr int kFew = 10;  // more are sorted and merged at once
    if (__popc(joining) > kFew) return merge(joins ? key : kNoKey);
    for (; joining != 0; joining &= joining - 1)
      insert(__shfl_sync(kAllLanes, key, __ffs(static_cast<int>(joining)) - 1));
  }
  __device__ void finish() {}
  __device__ Key key(int place) const { return __shfl_sync(kAllLanes, key_, place); }
  // Calls visit(place, key) in one lane for each of the first `count` places.
  template <class Visit>
  __device__ void for_each(int count, Visit visit) const {
    if (static_cast<int>(lane_number()) < count) visit(static_cast<int>(lane_number()), key_);
  }

 private:
  __device__ void insert(Key key) {
    const int rank = __popc(__ballot_sync(kAllLanes, precedes_(key_, key))), lane = static_cast<int>(lane_number());
    const Key key_below = __shfl_up_sync(kAllLanes, key_, 1);
    key_ = lane < rank ? key_ : lane == rank ? key : key_below;
  }
  __device__ void merge(Key key) {
    Key merged = key_, left = key;
    merge_sorted(merged, left, [](Key a, Key b) { return a < b; });
    // As numbers, keys of equal distance are not in order: where that matters, once more.
    const unsigned distance = distance_bits(merged), before = __shfl_up_sync(kAllLanes, distance, 1),
                   last = __shfl_sync(kAllLanes, distance, kWarp - 1);
    const bool tied_within = lane_number() > 0 && distance == before && merged != kNoKey;
    const bool tied_beyond = distance_bits(left) == last && left != kNoKey;
    if (!__any_sync(kAllLanes, tied_within || tied_beyond)) {
      key_ = merged;
    } else {
      merge_with_ties(key);
    }
  }
  __device__ static unsigned distance_bits(Key key) { return static_cast<unsigned>(key >> 32); }

  // `list` is in order. It becomes the first 32 of both, in order, and `others` what is left, in any.
  template <class Before>
  __device__ __forceinline__ static void merge_sorted(Key& list, Key& others, Before before) {
    const int lane = static_cast<int>(lane_number());
#pragma unroll
    for (int size = 2; size <= kWarp; size *= 2) {
#pragma unroll
      for (int distance = size / 2; distance > 0; distance /= 2)
        exchange(others, distance, ((lane & size) == 0) == ((lane & distance) == 0), before);
    }
    const Key mirrored = __shfl_sync(kAllLanes, others, kWarp - 1 - lane);
    const bool takes = before(mirrored, list);
    others = takes ? list : mirrored;
    list = takes ? mirrored : list;
#pragma unroll
    for (int distance = kWarp / 2; distance > 0; distance /= 2)
      exchange(list, distance, (lane & distance) == 0, before);
  }
  // Keeps the earlier or the later of this lane's key and that of lane ^ distance.
  template <class Before>
  __device__ __forceinline__ static void exchange(Key& key, int distance, bool keep_earlier, Before before) {
    const Key other = __shfl_xor_sync(kAllLanes, key, distance);
    if (other != key && before(other, key) == keep_earlier) key = other;
  }
  // Merges one key at a time: a network that compared positions at ties in each step would be too much code.
  __device__ __noinline__ void merge_with_ties(Key key) {
#pragma unroll 1
    for (int lane = 0; lane < kWarp; ++lane) {
      const Key offered = __shfl_sync(kAllLanes, key, lane);
      if (offered != kNoKey) insert(offered);
    }
  }

  Precedes precedes_;
  Key key_ = kNoKey;
};

// Any number up to `size`, a power of two: a sorted list in shared memory, and a buffer as long that is sorted and
// merged when it is full.
class SharedList {
 public:
  static constexpr int kLeastSize = 64;

  static constexpr std::size_t bytes(int size) { return 2 * std::size_t(size) * sizeof(Key); }
  __host__ __device__ static int size_for(int k) {
    int size = kLeastSize;
    while (size < k) size *= 2;
    return size;
  }

  __device__ SharedList(const float4* points, std::byte* memory, int size)
      : precedes_{points}, keys_(reinterpret_cast<Key*>(memory)), size_(size) {
    for (int i = static_cast<int>(lane_number()); i < size_; i += kWarp) keys_[i] = kNoKey;
    __syncwarp();
  }

  __device__ void offer(bool joins, Key key) {
    const unsigned joining = __ballot_sync(kAllLanes, joins);
    if (joins) keys_[size_ + waiting_ + __popc(joining & lanes_below())] = key;
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
    for (int i = static_cast<int>(lane_number()); i < count; i += kWarp) visit(i, keys_[i]);
  }

 private:
  __device__ void exchange(int i, int j) {
    const Key a = keys_[i], b = keys_[j];
    if (!precedes_(b, a)) return;
    keys_[i] = b;
    keys_[j] = a;
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

  Precedes precedes_;
  Key* keys_;  // list, then buffer
  int size_;
  int waiting_ = 0;  // in the buffer
};

}  // namespace pointfair::cuda
