// SPDX-License-Identifier: Apache-2.0
#include "cpu/single_search.h"

#include <algorithm>
#include <array>

namespace pointfair::cpu {

void SingleSearch::find(const IndexView& index, Index at, int k, float squared_limit, Index* out) {
  index_ = &index;
  at_ = at;
  here_ = position_of(index, at);
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
  std::sort(found_.begin(), found_.end(), [this](Key a, Key b) { return precedes(a, b); });
  for (std::size_t slot = 0; slot < k_; ++slot)
    out[slot] = slot < found_.size() ? point::key_index(found_[slot]) : point::kNoNeighbor;
}

void find_alone(const IndexView& index, Index at, int k, float squared_limit, Index* list) {
  std::vector<Index> nearest(std::size_t(k), 0);
  SingleSearch().find(index, at, k, squared_limit, nearest.data());
  for (std::size_t slot = 0; slot < nearest.size(); ++slot) list[slot * kLeafSize] = nearest[slot];
}

bool SingleSearch::precedes(Key a, Key b) const {
  return point::precedes(a, b, [this](Index at) { return position_of(*index_, at); });
}

// Whether a box may, of which no point is nearer than its gap or lies before its corner.
bool SingleSearch::may_hold_neighbors(float gap, point::Vec3<float> corner) const {
  const float farthest = point::key_squared_distance(last_);
  if (gap != farthest || point::key_index(last_) == point::kNoNeighbor) return gap <= farthest;
  return point::lies_before(corner, position_of(*index_, point::key_index(last_)));
}

// Nearest child first, of equally near ones the one whose points may lie before the others'.
void SingleSearch::visit_children(int level, Index group_number, Index skipped) {
  struct Child {
    float gap;
    point::Vec3<float> corner;
    Index number;
  };
  const BoxGroup& group = index_->level[level][group_number];
  std::array<Child, kLeafSize> children;
  std::size_t near = 0;
  for (int c = 0; c < kLeafSize; ++c) {
    const point::Vec3<float> low = low_corner(group, c), high = {group.max_x[c], group.max_y[c], group.max_z[c]};
    const float gap = point::squared_gap(low, high, here_, here_);
    const bool exists = low.x <= high.x;
    if (exists && Index(c) != skipped && may_hold_neighbors(gap, low)) children[near++] = {gap, low, Index(c)};
  }
  std::sort(children.begin(), children.begin() + near, [](const Child& a, const Child& b) {
    return a.gap != b.gap ? a.gap < b.gap : point::lies_before(a.corner, b.corner);
  });
  for (std::size_t i = 0; i < near && may_hold_neighbors(children[i].gap, children[i].corner); ++i) {
    const Index child = group_number * kLeafSize + children[i].number;
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
  for (Index i = 0; i < kLeafSize; ++i) squared[i] = point::squared_length(position_of(*index_, first + i) - here_);
  for (Index i = 0; i < count; ++i) {
    const Key key = point::neighbor_key(squared[i], first + i);
    if (first + i != at_ && precedes(key, last_)) found_.push_back(key);
  }
  if (found_.size() >= 2 * k_) keep_nearest();
}

void SingleSearch::keep_nearest() {
  if (found_.size() <= k_) return;
  const auto kth = found_.begin() + std::ptrdiff_t(k_) - 1;
  std::nth_element(found_.begin(), kth, found_.end(), [this](Key a, Key b) { return precedes(a, b); });
  found_.resize(k_);
  last_ = found_.back();
}

}  // namespace pointfair::cpu
