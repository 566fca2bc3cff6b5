// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/collected.cuh"
#include "cuda/stages/surroundings.cuh"
#include "pointfair/cloud.hpp"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = kBlock / kWarp;
constexpr double kExpectedParts = 24;  // of a leaf; the first guess
constexpr double kMoreParts = 1.125;   // of those that were wanted the time before

// Points that wait for a group, the first in first. Lanes of a group know the same counts.
class WaitingPoints {
 public:
  static constexpr unsigned kRoom = 128;
  using Shared = Index[kGroups][kRoom];
  __device__ __forceinline__ explicit WaitingPoints(Shared& shared) : waiting_(shared[group_of_lane()]) {}

  // Those points of a leaf that have a bit in `which`; there must be room for them.
  __device__ __forceinline__ void add(Index leaf, unsigned which) {
    constexpr unsigned kOfLane = kWarp / kGroup;
    const unsigned first = kOfLane * lane_in_group();
    unsigned place = end_ + __popc(which & ((1u << first) - 1));
#pragma unroll
    for (unsigned i = 0; i < kOfLane; ++i)
      if ((which >> (first + i) & 1u) != 0) waiting_[place++ % kRoom] = leaf * kLeafSize + first + i;
    end_ += __popc(which);
  }
  __device__ __forceinline__ unsigned count() const { return end_ - begin_; }
  __device__ __forceinline__ bool lacks_room() const { return count() > kRoom - kLeafSize; }  // for those of a leaf
  __device__ __forceinline__ Index at(unsigned i) const {
    return i < count() ? waiting_[(begin_ + i) % kRoom] : point::kNoNeighbor;
  }
  __device__ __forceinline__ void drop(unsigned some) { begin_ += some; }

 private:
  Index* waiting_;
  unsigned begin_ = 0, end_ = 0;
};

// The parts of a leaf's groups, as a warp collects them: what is near the box of a group waits until it is known in
// whose neighbourhoods it lies.
class Collection {
 public:
  struct Shared {
    Box box[kGroups];  // of the groups' points
    float farthest[kGroups];
    WaitingPoints::Shared near;
    float4 place[kGroups][kWarp + 1];  // of those looked at, and their hashes
    unsigned slot_of[kWarp];           // of the leaf's points among these, kWarp where they are not
    Index kept[kGroups][2 * kWarp];
  };
  __device__ __forceinline__ Collection(const Tree& tree, const PartsRoom& room, const Reach& reach, Index at,
                                        bool active, Shared& shared)
      : tree_(tree),
        room_(room),
        reach_(reach),
        at_(at),
        here_(position_of(tree.points[at])),
        link_(room.first + at / kGroup),
        shared_(shared),
        near_(shared.near),
        kept_(shared.kept[group_of_lane()]),
        most_share_(unordered(warp_max(ordered(reach.share)))) {
    constexpr float kInfinity = __builtin_inff();
    Box box{here_, here_};
    if (!active) box = {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
    float farthest = reach.squared_radius;
#pragma unroll
    for (int step = 1; step < kGroup; step *= 2) {
      const auto over = [step](float v) { return __shfl_xor_sync(kAllLanes, v, step); };
      box.min = {fminf(box.min.x, over(box.min.x)), fminf(box.min.y, over(box.min.y)),
                 fminf(box.min.z, over(box.min.z))};
      box.max = {fmaxf(box.max.x, over(box.max.x)), fmaxf(box.max.y, over(box.max.y)),
                 fmaxf(box.max.z, over(box.max.z))};
      farthest = fmaxf(farthest, over(farthest));
    }
    shared_.box[group_of_lane()] = box;
    shared_.farthest[group_of_lane()] = farthest;
    __syncwarp();
  }

  // The points of a leaf, of which this lane has one.
  __device__ __forceinline__ void add(Index leaf) {
    const Index mine = leaf * kLeafSize + lane_number();
    const Vec its = position_of(tree_.points[mine]);
    const bool counts = !reach_.is_thinned || tree_.share[mine] < most_share_;
    unsigned of_group = 0;
#pragma unroll
    for (unsigned group = 0; group < kGroups; ++group) {
      const bool is_near = squared_gap(shared_.box[group], {its, its}) <= shared_.farthest[group];
      const unsigned those = __ballot_sync(kAllLanes, is_near && counts);
      if (group == group_of_lane()) of_group = those;
    }
    near_.add(leaf, of_group);
    __syncwarp();
    if (__all_sync(kAllLanes, near_.count() >= kWarp) || __any_sync(kAllLanes, near_.lacks_room())) keep_some();
  }
  __device__ __forceinline__ void finish() {
    while (__any_sync(kAllLanes, near_.count() > 0)) keep_some();
    if (__any_sync(kAllLanes, held_ > 0)) write(held_ > 0);
    if (lane_in_group() == 0) *link_ = point::kNoNeighbor;
  }

 private:
  static constexpr unsigned kReserved = kGroups;          // parts at a time, since all leaves count in one place
  static constexpr unsigned kFirstOfGroups = 0x01010101;  // lanes
  static constexpr unsigned kRows = kWarp / kGroup;       // of 32 points

  // Of the first that wait, a bit for each that is a neighbour of this lane's point.
  __device__ __forceinline__ unsigned inside() const {
    float4* const place = shared_.place[group_of_lane()];
    shared_.slot_of[lane_number()] = kWarp;
    __syncwarp();
#pragma unroll
    for (unsigned row = 0; row < kRows; ++row) {
      const unsigned slot = row * kGroup + lane_in_group();
      const Index position = near_.at(slot);
      const Index there = position == point::kNoNeighbor ? at_ - lane_number() : position;  // any valid point
      const float4 p = tree_.points[there];
      place[slot] = {p.x, p.y, p.z, reach_.is_thinned ? tree_.share[there] : 0.0f};
      if (position / kGroup == at_ / kGroup) shared_.slot_of[position % kWarp] = slot;
    }
    __syncwarp();
    unsigned result = 0;
#pragma unroll
    for (int i = 0; i < kWarp; ++i) {
      const float4 p = place[i];
      const bool is_inside =
          point::squared_length(position_of(p) - here_) <= reach_.squared_radius && p.w < reach_.share;
      result |= is_inside ? 1u << i : 0u;
    }
    const unsigned own = shared_.slot_of[lane_number()], count = near_.count();
    if (own < kWarp) result &= ~(1u << own);  // none is its own neighbour
    return count < kWarp ? result & ((1u << count) - 1) : result;
  }

  // Keeps those of the first that wait that are some point's neighbours.
  __device__ __forceinline__ void keep_some() {
    unsigned bits = inside(), used = bits;
#pragma unroll
    for (int step = 1; step < kGroup; step *= 2) used |= __shfl_xor_sync(kAllLanes, used, step);
#pragma unroll
    for (unsigned row = 0; row < kRows; ++row) {
      const unsigned slot = row * kGroup + lane_in_group();
      if ((used >> slot & 1u) != 0)
        kept_[(begin_ + held_ + __popc(used & ((1u << slot) - 1))) % (2 * kWarp)] = near_.at(slot);
    }
    // closes the gaps that the others leave, from the last one on
    unsigned unused = used == 0 ? 0 : ~used & (~0u >> __clz(static_cast<int>(used)));
    while (unused != 0) {
      const unsigned below = (0x80000000u >> __clz(static_cast<int>(unused))) - 1;
      bits = (bits & below) | (bits >> 1 & ~below);
      unused &= below;
    }
    inside_ |= bits << held_;
    next_inside_ = held_ == 0 ? 0 : bits >> (kWarp - held_);
    held_ += __popc(used);
    near_.drop(min(near_.count(), unsigned(kWarp)));
    __syncwarp();
    if (__any_sync(kAllLanes, held_ >= kWarp)) write(held_ >= kWarp);
  }

  // A part of each group that has `some`.
  __device__ __forceinline__ void write(bool some) {
    const unsigned writers = __ballot_sync(kAllLanes, some) & kFirstOfGroups, wanted = __popc(writers);
    if (reserved_ < wanted) {
      if (lane_number() == 0) free_ = atomicAdd(room_.count, kReserved);
      free_ = __shfl_sync(kAllLanes, free_, 0);
      reserved_ = kReserved;
    }
    const Index part = free_ + __popc(writers & ((1u << (lane_number() & ~(kGroup - 1u))) - 1));
    free_ += wanted;
    reserved_ -= wanted;
    if (some && part < room_.capacity) {
      NeighborPart& its = room_.parts[part];
#pragma unroll
      for (unsigned row = 0; row < kRows; ++row) {
        const unsigned slot = row * kGroup + lane_in_group();
        its.position[slot] = slot < held_ ? kept_[(begin_ + slot) % (2 * kWarp)] : point::kNoNeighbor;
      }
      its.inside[lane_in_group()] = inside_;
      if (lane_in_group() == 0) *link_ = part;
      link_ = room_.next + part;
    }
    if (some) {
      const unsigned written = min(held_, unsigned(kWarp));
      begin_ += written;
      held_ -= written;
      inside_ = next_inside_;
      next_inside_ = 0;
    }
    __syncwarp();
  }

  const Tree& tree_;
  const PartsRoom& room_;
  const Reach& reach_;
  Index at_;
  Vec here_;
  Index* link_;  // where the number of the group's next part goes
  Shared& shared_;
  WaitingPoints near_;
  Index* kept_;
  float most_share_;
  unsigned begin_ = 0, held_ = 0;          // of those kept
  unsigned inside_ = 0, next_inside_ = 0;  // of this lane's point, over the first 32 of them and over those behind
  Index free_ = 0;                         // the next of the parts that are reserved
  unsigned reserved_ = 0;
};

__global__ void __launch_bounds__(kBlock)
    collect_neighbors(const __grid_constant__ Tree tree, point::Radii radii, const __grid_constant__ PartsRoom room,
                      const __grid_constant__ Stop stop) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  __shared__ Collection::Shared shared[kWarps];
  const bool valid = tree.holds(at);
  const Reach reach(tree, radii, Index(at), valid);
  const Vec here = position_of(tree.points[at]);
  const WarpReach warp(here, valid, reach.squared_radius);
  ReachedLeaves leaves(tree, stop, Index(at), here, reach.squared_radius, warp);
  Collection collection(tree, room, reach, Index(at), valid, shared[threadIdx.x / kWarp]);
  for (Index leaf = leaves.next(); leaf != point::kNoNeighbor; leaf = leaves.next()) collection.add(leaf);
  collection.finish();
}

}  // namespace

void CollectedRoom::empty() {
  if (holder_ != nullptr) holder_->set_aside();
}

bool CollectedRoom::make(std::size_t parts) {
  try {
    parts_.resize(parts);
    next_.resize(parts);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::memory) throw;
    return false;
  }
  return true;
}

NeighborCollector::NeighborCollector(Context& context, CollectedRoom& room)
    : context_(context), room_(room), first_(context), count_(context), parts_of_leaf_(kExpectedParts) {}

CollectedNeighbors NeighborCollector::collected() const {
  return {complete_ ? room_.parts_.data() : nullptr, room_.next_.data(), first_.data()};
}

void NeighborCollector::release() {
  complete_ = is_aside_ = false;
  if (room_.holder_ != this) return;
  room_.holder_ = nullptr;
  room_.parts_.release();
  room_.next_.release();
}

void NeighborCollector::set_aside() {
  const bool was_there = complete_ || is_aside_;
  release();
  is_aside_ = was_there;
}

std::size_t NeighborCollector::run(const std::function<void(const PartsRoom&)>& launch) {
  count_.clear("preparing neighbourhoods");
  const Index capacity = static_cast<Index>(std::min<std::size_t>(room_.parts_.size(), point::kNoNeighbor));
  launch({room_.parts_.data(), room_.next_.data(), first_.data(), count_.data(), capacity});
  check(cudaGetLastError(), "collecting neighbourhoods");
  return count_.first("collecting neighbourhoods");
}

void NeighborCollector::collect(const Tree& tree, const point::Radii& radii, std::size_t largest, const Stop& stop) {
  collect(tree, largest, [&](const PartsRoom& room) {
    collect_neighbors<<<blocks_for(tree.leaves, kWarps), kBlock, 0, context_.stream()>>>(tree, radii, room, stop);
  });
}

bool NeighborCollector::collect(const Tree& tree, std::size_t largest,
                                const std::function<void(const PartsRoom&)>& launch) {
  release();
  room_.empty();
  room_.holder_ = this;
  first_.resize(std::max<std::size_t>(tree.leaves, 1) * kGroups);
  count_.resize(1);
  const std::size_t most = largest / (sizeof(NeighborPart) + sizeof(Index));
  const auto fall_back = [&] {
    release();
    return false;
  };
  if (!room_.make(std::min(most, std::size_t(parts_of_leaf_ * double(tree.leaves)) + kGroups))) return fall_back();
  const std::size_t wanted = run(launch);
  if (wanted > room_.parts_.size()) {
    if (wanted > most || !room_.make(wanted)) return fall_back();
    run(launch);
  }
  if (tree.leaves > 0) parts_of_leaf_ = kMoreParts * double(wanted) / double(tree.leaves);
  return complete_ = true;
}

}  // namespace pointfair::cuda
