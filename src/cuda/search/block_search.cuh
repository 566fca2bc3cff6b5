// SPDX-License-Identifier: Apache-2.0
// The k <= 1024 nearest points of one place, exact, in the order of point::precedes: a block to a query, where few
// queries would leave the card idle with a warp to each. All points within a radius are collected, level by level of
// the tree, and sorted; the radius is guessed, and grows or shrinks until it holds k and no more than fit.
#pragma once

#include <cub/block/block_merge_sort.cuh>

#include "cuda/runtime/network.cuh"
#include "cuda/search/single_search.cuh"

namespace pointfair::cuda {

template <int kThreads>
class BlockSearch {
 public:
  static constexpr int kLargest = 1024, kCapacity = 8 * kThreads;
  static constexpr int kNodes = 1024;  // of a level
  static_assert(kCapacity >= kLargest);

  struct Memory {
    union {
      Key keys[kCapacity];
      typename cub::BlockMergeSort<Key, kThreads, kCapacity / kThreads>::TempStorage sort;
      std::byte list[SharedList::bytes(kLargest)];
    };
    Index nodes[2][kNodes];
    int counts[kMaxLevels + 1];
    SingleWalk walk;
  };

  // All threads of the block, as run(). `original` names the point that is not its own neighbour; `root`: of its
  // cloud.
  __device__ BlockSearch(const Tree& tree, Index root, Memory& memory, Vec position, Index original, int k)
      : tree_(tree), root_(root), memory_(memory), position_(position), original_(original), k_(k) {}

  // For run(), by a leaf near by.
  __device__ float guess() const {
    Index node = root_;
    for (int level = tree_.levels - 1; level >= 0; --level)
      node = tree_.first_child(level, node) + nearest_child(tree_.group(level, node));
    const Key key = key_of_lane(node);
    RegisterList list(tree_.points);
    list.offer(key != kNoKey, key);
    const int known = min(8, __popc(__ballot_sync(kAllLanes, key != kNoKey)));
    if (known == 0) return 1;
    return scaled(point::key_squared_distance(list.key(known - 1)), static_cast<float>(known));
  }
  // The same by the squared distance of the `known`-th nearest, as on a surface.
  __device__ float scaled(float squared, float known) const {
    return fminf(squared * kWanted * static_cast<float>(k_) / known, kFarthest);
  }

  // `squared`: of a radius that may hold a few more than k. Afterwards memory.keys holds k, sorted, kNoKey at the end.
  __device__ void run(float squared) {
    constexpr int kTries = 12;
    const Index wanted = min(static_cast<Index>(k_), tree_.valid_under(root_) - 1);
    float low = 0, high = 0;
    for (int n = 0; n < kTries; ++n) {
      const Index count = collect(squared);
      if (count <= kCapacity && count >= wanted) return sort(static_cast<int>(count));
      (count > kCapacity ? high : low) = squared;
      const float by_ratio = scaled(squared, static_cast<float>(max(count, 1u)));
      const bool is_bracketed = low > 0 && high > 0;
      if (is_bracketed && (n % 2 == 1 || by_ratio <= low || by_ratio >= high)) {
        squared = sqrtf(low) * sqrtf(high);  // where the density jumps, ratios overshoot to and fro
      } else {
        squared = fminf(fmaxf(by_ratio, squared / 16), squared * 16);
        if (squared <= low) squared = 2 * low;
      }
    }
    search_alone();
  }

 private:
  static constexpr int kWarps = kThreads / kWarp;
  static constexpr float kFarthest = 1e38f;
  // Points, of k. If they fill a volume there are more, but a radius that grew by the ratio of a surface still fits
  // them.
  static constexpr float kWanted = 1.25f;

  __device__ static Index warp_number() { return threadIdx.x / kWarp; }
  __device__ float gap_of_lane(const BoxGroup& group) const {
    return squared_gap(box_of_lane(group), {position_, position_});
  }
  // Of the lane's point in a leaf.
  __device__ Key key_of_lane(Index leaf) const {
    const Index at = leaf * kLeafSize + lane_number();
    const float4 p = tree_.points[at];
    const float distance = point::squared_length(position_of(p) - position_);
    const bool counts = is_present(p) && original_of(p) != original_;
    return counts ? point::neighbor_key(distance, at) : kNoKey;
  }

  // Of boxes equally near, which may hold the query, the one whose farthest corner is nearest.
  __device__ Index nearest_child(const BoxGroup& group) const {
    const Box box = box_of_lane(group);
    const Vec corner = {fmaxf(box.max.x - position_.x, position_.x - box.min.x),
                        fmaxf(box.max.y - position_.y, position_.y - box.min.y),
                        fmaxf(box.max.z - position_.z, position_.z - box.min.z)};
    const unsigned gap = __float_as_uint(gap_of_lane(group)), nearest = warp_min(gap);
    const unsigned reach = gap == nearest ? __float_as_uint(point::squared_length(corner)) : ~0u,
                   least = warp_min(reach);
    return __ffs(static_cast<int>(__ballot_sync(kAllLanes, reach == least))) - 1;
  }

  // The points within a radius. Returns how many there are, all in memory.keys if that is no more than kCapacity; where
  // there are too many boxes, how many these hold.
  __device__ Index collect(float squared) {
    __syncthreads();
    if (threadIdx.x <= kMaxLevels) memory_.counts[threadIdx.x] = 0;
    if (threadIdx.x == 0) memory_.nodes[0][0] = root_;
    __syncthreads();
    int nodes = 1, turn = 0;
    for (int level = tree_.levels - 1; level >= 0; --level, turn ^= 1) {
      for (Index n = warp_number(); n < nodes; n += kWarps) {
        const Index node = memory_.nodes[turn][n];
        const bool near = gap_of_lane(tree_.group(level, node)) <= squared;
        append<kNodes>(near, tree_.first_child(level, node) + lane_number(), memory_.nodes[turn ^ 1],
                       memory_.counts[level + 1]);
      }
      __syncthreads();
      nodes = memory_.counts[level + 1];
      if (nodes > kNodes) {
        float points = static_cast<float>(nodes) * kLeafSize;
        for (int below = 0; below < level; ++below) points *= kLeafSize;
        return static_cast<Index>(fminf(points, 4e9f));
      }
    }
    constexpr int kAtOnce = 4;  // on their way
    for (int first = warp_number(); first < nodes; first += kAtOnce * kWarps) {
      Key keys[kAtOnce];
#pragma unroll
      for (int n = 0; n < kAtOnce; ++n) {
        const int at = first + n * kWarps;
        keys[n] = at < nodes ? key_of_lane(memory_.nodes[turn][at]) : kNoKey;
      }
#pragma unroll
      for (int n = 0; n < kAtOnce; ++n)
        append<kCapacity>(keys[n] != kNoKey && point::key_squared_distance(keys[n]) <= squared, keys[n], memory_.keys,
                          memory_.counts[0]);
    }
    __syncthreads();
    return static_cast<Index>(memory_.counts[0]);
  }

  // Values of lanes to the end of a list, as far as they fit.
  template <int kRoom, class T>
  __device__ void append(bool joins, T value, T* list, int& count) {
    const unsigned joining = __ballot_sync(kAllLanes, joins);
    int place = 0;
    if (lane_number() == 0 && joining != 0) place = atomicAdd(&count, __popc(joining));
    place = __shfl_sync(kAllLanes, place, 0) + __popc(joining & lanes_below());
    if (joins && place < kRoom) list[place] = value;
  }

  // By the keys as numbers, then those equally far by position where there are such.
  __device__ void sort(int count) {
    if (count <= 2 * kThreads) {
      sort_items<2>(count);
    } else if (count <= 4 * kThreads) {
      sort_items<4>(count);
    } else {
      sort_items<kCapacity / kThreads>(count);
    }
    order_ties(count);
  }
  // Keys are in order as numbers. Runs of equal distances are mostly short: a thread orders one.
  __device__ void order_ties(int count) {
    constexpr int kLongestRun = 15, kRoomOfRun = 4;  // bits
    static_assert(kCapacity / kThreads * kRoomOfRun <= 64);
    Key* const keys = memory_.keys;
    const auto tied = [&](int i) { return i > 0 && i < count && keys[i] >> 32 == keys[i - 1] >> 32; };
    unsigned long long runs = 0;  // lengths less one of those that begin at this thread's places
    bool any = false, any_long = false;
    for (int n = 0, i = static_cast<int>(threadIdx.x); i < count; i += kThreads, ++n) {
      if (tied(i)) continue;
      int more = 0;
      while (tied(i + more + 1) && more <= kLongestRun) ++more;
      any |= more > 0;
      any_long |= more > kLongestRun;
      runs |= static_cast<unsigned long long>(min(more, kLongestRun)) << (kRoomOfRun * n);
    }
    if (__syncthreads_or(any) == 0) return;
    const Precedes precedes{tree_.points};
    if (__syncthreads_or(any_long) != 0) {
      sort_by_block(static_cast<std::size_t>(count), kThreads, [&](std::size_t i, std::size_t j) {
        const Key a = keys[i], b = keys[j];
        if (!precedes(b, a)) return;
        keys[i] = b;
        keys[j] = a;
      });
      return;
    }
    for (int i = static_cast<int>(threadIdx.x); runs != 0; i += kThreads, runs >>= kRoomOfRun) {
      const int last = i + static_cast<int>(runs & kLongestRun);
      for (int j = i + 1; j <= last; ++j) {
        const Key key = keys[j];
        int to = j;
        for (; to > i && precedes(key, keys[to - 1]); --to) keys[to] = keys[to - 1];
        keys[to] = key;
      }
    }
    __syncthreads();
  }
  template <int kItems>
  __device__ void sort_items(int count) {
    using Sort = cub::BlockMergeSort<Key, kThreads, kItems>;
    static_assert(sizeof(typename Sort::TempStorage) <= sizeof(memory_.sort));
    Key keys[kItems];
    const int first = static_cast<int>(threadIdx.x) * kItems;
#pragma unroll
    for (int i = 0; i < kItems; ++i) keys[i] = first + i < count ? memory_.keys[first + i] : kNoKey;
    __syncthreads();
    Sort(reinterpret_cast<typename Sort::TempStorage&>(memory_.sort)).Sort(keys, [](Key a, Key b) { return a < b; });
    __syncthreads();
#pragma unroll
    for (int i = 0; i < kItems; ++i) memory_.keys[first + i] = keys[i];
    // places up to k that no item fills
    for (int i = kItems * kThreads + static_cast<int>(threadIdx.x); i < k_; i += kThreads) memory_.keys[i] = kNoKey;
    __syncthreads();
  }

  // By the first warp, nearest box first: where more points than fit lie at one distance, as from far away.
  __device__ void search_alone() {
    __syncthreads();
    if (warp_number() == 0) {
      SharedList list(tree_.points, memory_.list, SharedList::size_for(k_));
      SingleSearch<SharedList>(tree_, memory_.walk, list, position_, original_, k_, __int_as_float(0x7f800000))
          .run(root_);
    }
    __syncthreads();
  }

  const Tree& tree_;
  Index root_;
  Memory& memory_;
  Vec position_;
  Index original_;
  int k_;
};

}  // namespace pointfair::cuda
