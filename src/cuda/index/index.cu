// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "cuda/index/boxes.cuh"
#include "cuda/index/cloud_batch.cuh"
#include "cuda/index/index.cuh"
#include "cuda/index/sort_keys.cuh"
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

DeviceIndex::DeviceIndex(Context& context)
    : context_(context),
      state_(context),
      points_(context),
      share_(context),
      valid_of_clouds_(context),
      groups_(context) {}

Tree DeviceIndex::without_top() const {
  const Index leaves = static_cast<Index>(leaves_);
  Tree tree{points_.data(),
            state_.data(),
            leaves,
            leaves,
            std::min(levels_.count, levels_.own),
            groups_.data(),
            {},
            share_.data(),
            groups_of_cloud_ == 0 ? Index{kLeafSize} : groups_of_cloud_,
            leaves_of_cloud_,
            valid_of_clouds_.data(),
            settings_};
  std::copy_n(levels_.first_group, kMaxLevels, tree.first_group);
  return tree;
}
Tree DeviceIndex::tree_with_top(std::size_t top) const {
  Tree tree = without_top();
  tree.levels = levels_.count;
  for (int level = levels_.own; level < levels_.count; ++level)
    tree.first_group[level] += static_cast<Index>(top) * levels_.groups_of_top;
  return tree;
}

void DeviceIndex::make_room(std::size_t count) {
  count_ = count;
  leaves_ = (count + kLeafSize - 1) / kLeafSize;
  state_.resize(1);
  points_.resize(leaves_ * kLeafSize);
  share_.release();
  leaves_of_cloud_ = groups_of_cloud_ = 0;
  settings_ = nullptr;
}

void DeviceIndex::lay_out_levels(int own_levels, std::size_t tops, std::size_t whole_top) {
  levels_ = {};
  levels_.own = own_levels;
  std::size_t groups = blocks_for(leaves_, kLeafSize), all = 0;
  for (;; groups = blocks_for(groups, kLeafSize)) {
    levels_.first_group[levels_.count] = static_cast<Index>(all);
    levels_.groups[levels_.count++] = static_cast<Index>(groups);
    all += groups;
    if (groups == 1) break;
  }
  const bool has_tops = own_levels < levels_.count;
  if (has_tops) levels_.groups_of_top = static_cast<Index>(all) - levels_.first_group[own_levels];
  whole_top_ = has_tops ? whole_top : 0;
  groups_.resize(all + (has_tops ? tops - 1 : 0) * levels_.groups_of_top);
}

void DeviceIndex::build(const Point* points, std::size_t count, const std::optional<Frame>& frame) {
  make_room(count);
  Sorted sorted(context_);
  constexpr std::size_t kManyPoints = 1 << 24;  // from here on cells of 2^10 steps an axis hold too many points each
  if (frame) {
    const auto [x, y, z] = frame->reference;
    lay_grid(context_, point::curve_cube({x, y, z}, frame->side), state_.data());
    sort<std::uint64_t, kCurveBits>(points, sorted);
  } else if (count < kManyPoints) {
    sort<CoarseKey, 10>(points, sorted);
  } else {
    sort<std::uint64_t, 13>(points, sorted);
  }
  build_boxes(points, sorted);
  if (frame) hash_positions(*frame);
}

void DeviceIndex::build(const Point* points, const CloudBatch& batch) {
  const std::size_t groups = std::size_t(batch.clouds) * batch.groups_of_cloud();
  make_room(groups * kGroupPoints);
  count_ = batch.uploaded;
  settings_ = batch.settings;
  valid_of_clouds_.resize(std::max<std::size_t>(batch.clouds, 1));
  leaves_of_cloud_ = static_cast<Index>(batch.groups_of_cloud() * kLeafSize);
  groups_of_cloud_ = static_cast<Index>(batch.groups_of_cloud());
  levels_ = {};
  levels_.count = groups_of_cloud_ > 1 ? 2 : 1;
  levels_.first_group[1] = levels_.groups[0] = static_cast<Index>(groups);
  levels_.groups[1] = batch.clouds;
  groups_.resize(groups + (groups_of_cloud_ > 1 ? batch.clouds : 0));
  build_batch_index(context_, points, batch, tree(), {points_.data(), state_.data(), valid_of_clouds_.data()});
  if (batch.settings == nullptr) return;
  share_.resize(points_.size());
  cuda::hash_positions(context_, tree(), share_.data());
}

void DeviceIndex::hash_positions(const Frame& frame) {
  share_.resize(points_.size());
  find_shares<<<blocks_for(points_.size(), kHashBlock), kHashBlock, 0, context_.stream()>>>(
      points_.data(), points_.size(), {frame.corner.x, frame.corner.y, frame.corner.z}, share_.data());
  check(cudaGetLastError(), "hashing positions");
}

template <class Key, int kBits>
void DeviceIndex::sort(const Point* points, Sorted& sorted) {
  KeyGrid* const grid = &state_.data()->grid;
  if constexpr (kBits != kCurveBits) lay_grid(context_, points, count_, float(1 << kBits), grid, state_.data());
  if (count_ == 0) return;
  KeySort<Key, kBits> sorter(context_, points, count_, state_.data());
  sorter.find_keys(0, count_, grid);
  if constexpr (std::is_same_v<Key, CoarseKey>) {
    if (count_ < kFewPoints) {
      sorter.sort(count_, kRefinedBits);
      return sorter.take_coarse(sorted);
    }
  }
  sorter.sort(count_);
  if constexpr (kBits == kCurveBits) {
    sorter.take_ordered(count_, sorted);
  } else {
    sorter.take(sorted);
  }
}

void DeviceIndex::build_boxes(const Point* points, const Sorted& from) {
  lay_out_levels(kMaxLevels, 1, 0);
  gather_points(context_, points, 0, count_, from.order.data(), from.coarse.data(), tree(), points_.data());
  if (levels_.count > 1) build_upper_levels(context_, tree(), 0, levels_.groups[0]);
}

}  // namespace pointfair::cuda
