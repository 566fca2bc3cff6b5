// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "cuda/boxes.cuh"
#include "cuda/index.cuh"
#include "cuda/sort_keys.cuh"
#include "point/curve.h"
#include "point/position.h"

namespace pointfair::cuda {
namespace {

constexpr int kHashBlock = 256;

__global__ void __launch_bounds__(kHashBlock)
    find_shares(const float4* points, std::size_t count, point::Vec3<float> corner, float* share) {
  const std::size_t i = std::size_t(blockIdx.x) * kHashBlock + threadIdx.x;
  if (i < count) share[i] = point::share_of_hash(point::position_hash(position_of(points[i]), corner));
}

}  // namespace

// Room to sort the largest part; each has a grid of its own for its keys, so that 10 bits an axis suffice.
class PartSort {
 public:
  using Keys = KeySort<CoarseKey, 10>;
  static constexpr float kSteps = 1 << 10;

  PartSort(Context& context, const Point* points, const Parts& parts, CloudState* state)
      : keys(context, points, parts.size(0), state), grids(context) {
    keys.reserve(parts.size(0));
    grids.resize(parts.count());
  }

  Keys keys;
  DeviceArray<KeyGrid> grids;
};

DeviceIndex::DeviceIndex(Context& context)
    : context_(context), state_(context), points_(context), share_(context), groups_(context) {}
DeviceIndex::~DeviceIndex() { side_.reset(); }  // waits; then memory may be released

Tree DeviceIndex::tree() const { return own_levels_ < levels_ ? tree_with_top(parts_.count() - 1) : subtrees(); }

// The levels that no top is made for.
Tree DeviceIndex::subtrees() const {
  const Index leaves = static_cast<Index>(leaves_);
  Tree tree{points_.data(), state_.data(), leaves, leaves, std::min(levels_, own_levels_), groups_.data(), {},
            share_.data()};
  std::copy_n(first_group_, kMaxLevels, tree.first_group);
  return tree;
}
Tree DeviceIndex::tree_with_top(std::size_t top) const {
  Tree tree = subtrees();
  tree.levels = levels_;
  for (int level = own_levels_; level < levels_; ++level)
    tree.first_group[level] += static_cast<Index>(top) * groups_of_top_;
  return tree;
}

LeafRange DeviceIndex::leaves_of(std::size_t part) const {
  return {static_cast<Index>(parts_.begin(part) / kLeafSize),
          static_cast<Index>((parts_.ends[part] + kLeafSize - 1) / kLeafSize)};
}
Tree DeviceIndex::tree_until(std::size_t part) const {
  Tree tree = tree_with_top(part);
  tree.leaves_there = leaves_of(part).end;
  return tree;
}
Tree DeviceIndex::tree_after(std::size_t part) const { return tree_with_top(parts_.count() + part); }

void DeviceIndex::join() {
  if (!is_in_parts()) return;
  side_->join();
  sort_.reset();
}

void DeviceIndex::build(const Point* points, std::size_t count, const std::optional<Frame>& frame,
                        const Arrival* arrival) {
  join();
  count_ = count;
  leaves_ = (count + kLeafSize - 1) / kLeafSize;
  state_.resize(1);
  points_.resize(leaves_ * kLeafSize);
  own_levels_ = kMaxLevels;
  groups_of_top_ = 0;
  share_.release();
  if (arrival != nullptr && arrival->parts.apart && !frame) return build_parts(points, *arrival);
  Sorted sorted(context_);
  constexpr std::size_t kManyPoints = 1 << 24;  // from here on cells of 2^10 steps an axis hold too many points each
  if (frame) {
    const auto [x, y, z] = frame->reference;
    lay_grid(context_, point::curve_cube({x, y, z}, frame->side), state_.data());
    sort<std::uint64_t, kCurveBits>(points, arrival, sorted);
  } else if (count < kManyPoints) {
    sort<CoarseKey, 10>(points, arrival, sorted);
  } else {
    sort<std::uint64_t, 13>(points, arrival, sorted);
  }
  build_boxes(points, sorted);
  if (!frame) return;
  share_.resize(points_.size());
  find_shares<<<blocks_for(points_.size(), kHashBlock), kHashBlock, 0, context_.stream()>>>(
      points_.data(), points_.size(), {frame->corner.x, frame->corner.y, frame->corner.z}, share_.data());
  check(cudaGetLastError(), "hashing positions");
}

// While the second part of a cloud arrives, the first gets its keys, and is sorted if that takes longer than the
// latency of a second sort and a merge, which at 1M points are as long as a sort of the whole.
template <class Key, int kBits>
void DeviceIndex::sort(const Point* points, const Arrival* arrival, Sorted& sorted) {
  constexpr std::size_t kWorthMerging = 1 << 24;
  KeyGrid* const grid = &state_.data()->grid;
  if constexpr (kBits != kCurveBits)
    lay_grid(context_, points, count_, arrival, float(1 << kBits), grid, state_.data());
  if (count_ == 0) return;
  KeySort<Key, kBits> sorter(context_, points, count_, state_.data());
  const std::size_t first_part = arrival != nullptr && arrival->parts.count() > 1 ? arrival->parts.ends[0] : 0;
  const bool merges = first_part > 0 && count_ >= kWorthMerging;
  typename KeySort<Key, kBits>::Part first{};
  if (first_part > 0) {
    context_.wait_for(arrival->there[0]);
    sorter.find_keys(0, first_part, grid);
    if (merges) first = sorter.sort(0, first_part);
  }
  if (arrival != nullptr) context_.wait_for(arrival->all());
  sorter.find_keys(first_part, count_, grid);
  if (merges) {
    sorter.merge(first, sorter.sort(first_part, count_), sorted);
    return;
  }
  if constexpr (std::is_same_v<Key, CoarseKey>) {
    if (count_ < kFewPoints) return sorter.take_coarse(sorter.sort(0, count_, kRefinedBits), sorted);
  }
  const auto whole = sorter.sort(0, count_);
  if constexpr (kBits == kCurveBits) {
    sorter.take_ordered(whole, sorted);
  } else {
    sorter.take(whole, sorted);
  }
}

void DeviceIndex::lay_out_levels() {
  std::size_t groups = blocks_for(leaves_, kLeafSize), all = 0;
  for (levels_ = 0;; groups = blocks_for(groups, kLeafSize)) {
    first_group_[levels_] = static_cast<Index>(all);
    groups_of_[levels_++] = static_cast<Index>(groups);
    all += groups;
    if (groups == 1) break;
  }
  std::size_t tops = 1;
  if (own_levels_ < levels_) {
    groups_of_top_ = static_cast<Index>(all) - first_group_[own_levels_];
    tops = 2 * parts_.count() - 1;
  }
  groups_.resize(all + (tops - 1) * groups_of_top_);
}

void DeviceIndex::build_boxes(const Point* points, const Sorted& from) {
  lay_out_levels();
  gather_points(context_, points, 0, count_, from.order.data(), from.coarse.data(), tree(), points_.data());
  if (levels_ > 1) build_upper_levels(context_, tree(), 0, groups_of_[0]);
}

void DeviceIndex::build_parts(const Point* points, const Arrival& arrival) {
  parts_ = arrival.parts;
  const std::size_t each = parts_.size(0);
  own_levels_ = 1;
  for (std::size_t whole = kGroupPoints * kLeafSize; each % whole == 0; whole *= kLeafSize) ++own_levels_;
  lay_out_levels();
  sort_ = std::make_unique<PartSort>(context_, points, parts_, state_.data());
  if (!side_) side_.emplace(context_, Urgency::high);
  side_->fork();
  const OnStream side(context_, *side_);
  for (std::size_t part = 0; part < parts_.count(); ++part) {
    side_->wait_for(arrival.there[part]);
    build_part(points, part);
    ready_.record(part, side_->stream());
  }
  const Index own = static_cast<Index>(own_levels_), all = groups_of_[own - 1];
  const Index subtrees_each = leaves_of(0).count() >> (5 * own);
  build_tops_after(context_, tree_after(0), own_levels_ - 1, all, subtrees_each, groups_of_top_, parts_.count() - 1);
  ready_.record(parts_.count(), side_->stream());
}

void DeviceIndex::build_part(const Point* points, std::size_t part) {
  const std::size_t begin = parts_.begin(part), end = parts_.ends[part];
  KeyGrid* const grid = sort_->grids.data() + part;
  lay_grid(context_, points + begin, end - begin, nullptr, PartSort::kSteps, grid, part == 0 ? state_.data() : nullptr);
  sort_->keys.find_keys(begin, end, grid, begin);
  const bool refines = end - begin < kFewPoints;
  const auto sorted = sort_->keys.sort(0, end - begin, refines ? kRefinedBits : 0);
  const Index first = static_cast<Index>(begin / kGroupPoints), last = blocks_for(end, kGroupPoints);
  gather_points(context_, points, begin, end, sort_->keys.order(sorted), refines ? sort_->keys.keys(sorted) : nullptr,
                subtrees(), points_.data());
  if (own_levels_ > 1) build_upper_levels(context_, subtrees(), first, last);
  const Index all = groups_of_[own_levels_ - 1];
  Index until = blocks_for(leaves_of(part).end, kLeafSize);
  for (int level = 1; level < own_levels_; ++level) until = blocks_for(until, kLeafSize);
  build_top(context_, tree_with_top(part), own_levels_ - 1, all, until);
}

}  // namespace pointfair::cuda
