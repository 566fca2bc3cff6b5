// SPDX-License-Identifier: Apache-2.0
#include "cpu/single_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>

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
  sort_found();
  order_ties();
  for (std::size_t slot = 0; slot < k_; ++slot)
    out[slot] = slot < found_.size() ? point::key_index(found_[slot]) : point::kNoNeighbor;
}

void find_alone(const IndexView& index, Index at, int k, float squared_limit, Index* list) {
  std::vector<Index> nearest(std::size_t(k), 0);
  SingleSearch(best_kernels()).find(index, at, k, squared_limit, nearest.data());
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
  const BoxGroup& group = index_->level[level][group_number];
  float gaps[kLeafSize];
  unsigned left = kernels_.child_gaps(group, here_, point::key_squared_distance(last_), gaps) & ~(1u << skipped);
  const auto precedes = [&](int a, int b) {
    return gaps[a] < gaps[b] || (gaps[a] == gaps[b] && point::lies_before(low_corner(group, a), low_corner(group, b)));
  };
  prefetch_children(level, group_number, left);
  while (left != 0) {
    int next = std::countr_zero(left);
    for (unsigned others = left & (left - 1); others != 0; others &= others - 1)
      if (const int other = std::countr_zero(others); precedes(other, next)) next = other;
    left &= ~(1u << next);
    if (!may_hold_neighbors(gaps[next], low_corner(group, next))) return;
    const Index child = group_number * kLeafSize + Index(next);
    if (level > 0) {
      visit_children(level - 1, child, kLeafSize);
    } else {
      visit_leaf(child);
    }
  }
}

// Places are far from each other, so little of what a search visits is in a cache.
void SingleSearch::prefetch_children(int level, Index group_number, unsigned children) const {
  for (; children != 0; children &= children - 1) {
    const Index child = group_number * kLeafSize + Index(std::countr_zero(children));
    if (level > 0) {
      const BoxGroup& group = index_->level[level - 1][child];
      for (const float* line : {group.min_x, group.min_y, group.min_z, group.max_x, group.max_y, group.max_z})
        __builtin_prefetch(line);
    } else {
      for (const float* axis : {index_->x, index_->y, index_->z}) __builtin_prefetch(axis + child * kLeafSize);
    }
  }
}

void SingleSearch::visit_leaf(Index leaf) {
  float squared[kLeafSize];  // NaN behind the last point
  unsigned near = kernels_.leaf_distances(*index_, leaf, here_, point::key_squared_distance(last_), squared);
  for (; near != 0; near &= near - 1) {
    const int i = std::countr_zero(near);
    const Key key = point::neighbor_key(squared[i], leaf * kLeafSize + Index(i));
    if (point::key_index(key) != at_ && precedes(key, last_)) found_.push_back(key);
  }
  if (found_.size() >= 2 * k_) keep_nearest();
}

void SingleSearch::count_in_buckets() {
  Key least = found_.front(), most = least;
  for (const Key key : found_) {
    least = std::min(least, key);
    most = std::max(most, key);
  }
  nearest_ = distance_bits(least);
  shift_ = std::max(0, int(std::bit_width(distance_bits(most) - nearest_)) - int(std::bit_width(kBuckets - 1)));
  before_.fill(0);
  for (const Key key : found_) ++before_[bucket_of(key) + 1];
  std::partial_sum(before_.begin(), before_.end(), before_.begin());
}

// Keys order by distance and then by index, which is faster to compare and differs where distances tie.
void SingleSearch::keep_nearest() {
  if (found_.size() <= k_) return;
  // those in the bucket of the k-th, behind those in nearer ones
  std::size_t nearer = 0, end_of_bucket = found_.size();
  if (found_.size() >= kMany) {
    count_in_buckets();
    const std::size_t bucket = std::size_t(std::ranges::lower_bound(before_, k_) - before_.begin()) - 1;
    std::size_t as_near = 0;
    space_.resize(found_.size());
    for (const Key key : found_) {
      const std::size_t its = bucket_of(key);
      found_[nearer] = space_[as_near] = key;
      nearer += its < bucket;
      as_near += its == bucket;
    }
    end_of_bucket = nearer + as_near;
    std::copy_n(space_.begin(), as_near, found_.begin() + std::ptrdiff_t(nearer));
  }
  const auto first = found_.begin() + std::ptrdiff_t(nearer), kth = found_.begin() + std::ptrdiff_t(k_) - 1,
             end = found_.begin() + std::ptrdiff_t(end_of_bucket);
  std::nth_element(first, kth, end);
  const auto as_far = [distance = distance_bits(*kth)](Key key) { return distance_bits(key) == distance; };
  if (std::count_if(first, end, as_far) > 1)
    std::nth_element(first, kth, end, [this](Key a, Key b) { return precedes(a, b); });
  last_ = *kth;
  found_.resize(k_);
}

void SingleSearch::sort_found() {
  if (found_.size() < kMany) {
    std::ranges::sort(found_);
    return;
  }
  count_in_buckets();
  space_.resize(found_.size());
  for (const Key key : found_)
    space_[before_[bucket_of(key)]++] = key;  // ends of buckets, that is the next ones' begins
  for (std::size_t first = 0, bucket = 0; first < space_.size(); ++bucket) {
    const std::size_t end = before_[bucket];
    if (end - first > 1) std::sort(space_.begin() + std::ptrdiff_t(first), space_.begin() + std::ptrdiff_t(end));
    first = end;
  }
  found_.swap(space_);
}

// Of keys that are sorted as numbers.
void SingleSearch::order_ties() {
  for (auto begin = found_.begin(); begin != found_.end();) {
    const auto end =
        std::find_if(begin + 1, found_.end(), [begin](Key key) { return distance_bits(key) != distance_bits(*begin); });
    if (end - begin > 1) std::sort(begin, end, [this](Key a, Key b) { return precedes(a, b); });
    begin = end;
  }
}

}  // namespace pointfair::cpu
