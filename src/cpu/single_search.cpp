// SPDX-License-Identifier: Apache-2.0
#include "cpu/single_search.h"

#include <algorithm>
#include <array>
#include <utility>

namespace pointfair::cpu {

void SingleSearch::find(const IndexView& index, Index at, int k, float squared_limit, Index* out) {
  index_ = &index;
  at_ = at;
  here_ = {index.x[at], index.y[at], index.z[at]};
  k_ = std::size_t(k);
  last_ = point::neighbor_key(squared_limit, point::kNoNeighbor);
  found_.clear();
  Index node = at / kLeafSize;
  visit_leaf(node);
  for (int level = 0; level < index.levels; ++level) {
    visit_children(level, node / kLeafSize, node % kLeafSize);
    node /= kLeafSize;
  }
  keep_nearest();
  std::sort(found_.begin(), found_.end());
  for (std::size_t slot = 0; slot < k_; ++slot)
    out[slot] = slot < found_.size() ? found_[slot].position : point::kNoNeighbor;
}

// Nearest child first.
void SingleSearch::visit_children(int level, Index group_number, Index skipped) {
  const BoxGroup& group = index_->level[level][group_number];
  std::array<float, kLeafSize> gaps;
  for (int c = 0; c < kLeafSize; ++c)
    gaps[c] = point::squared_gap<float>({group.min_x[c], group.min_y[c], group.min_z[c]},
                                        {group.max_x[c], group.max_y[c], group.max_z[c]}, here_, here_);
  std::array<std::pair<unsigned long long, Index>, kLeafSize> order;
  std::size_t near = 0;
  for (Index c = 0; c < kLeafSize; ++c) {
    const unsigned long long key = point::neighbor_key(gaps[c], group.least_original[c]);
    const bool exists = group.min_x[c] <= group.max_x[c];
    if (exists && c != skipped && key <= last_) order[near++] = {key, c};
  }
  std::sort(order.begin(), order.begin() + near);
  for (std::size_t i = 0; i < near && order[i].first <= last_; ++i) {
    const Index child = group_number * kLeafSize + order[i].second;
    if (level > 0) {
      visit_children(level - 1, child, kLeafSize);
    } else {
      visit_leaf(child);
    }
  }
}

void SingleSearch::visit_leaf(Index leaf) {
  const Index first = leaf * kLeafSize, count = std::min<Index>(kLeafSize, index_->points - first);
  std::array<float, kLeafSize> squared;
  for (Index i = 0; i < kLeafSize; ++i) {
    const point::Vec3<float> there = {index_->x[first + i], index_->y[first + i], index_->z[first + i]};
    squared[i] = point::squared_length(there - here_);
  }
  for (Index i = 0; i < count; ++i) {
    const unsigned long long key = point::neighbor_key(squared[i], index_->original[first + i]);
    if (key < last_ && first + i != at_) found_.push_back({key, first + i});
  }
  if (found_.size() >= 2 * k_) keep_nearest();
}

void SingleSearch::keep_nearest() {
  if (found_.size() <= k_) return;
  std::nth_element(found_.begin(), found_.begin() + std::ptrdiff_t(k_) - 1, found_.end());
  found_.resize(k_);
  last_ = std::min(last_, found_.back().key);
}

}  // namespace pointfair::cpu
