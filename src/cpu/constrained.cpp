// SPDX-License-Identifier: Apache-2.0
#include "cpu/constrained.h"

#include <algorithm>

namespace pointfair::cpu {
namespace {

constexpr int kLargestPool = 1024;

}  // namespace

ConstrainedSearch::ConstrainedSearch(const Kernels& kernels, const NeighborSettings& settings, float squared_limit)
    : kernels_(kernels),
      settings_(settings),
      squared_limit_(squared_limit),
      first_pool_(std::max(16, 2 * settings.k)),
      single_(kernels) {
  if (!settings.constraint) return;
  candidates_.resize(std::size_t(first_pool_) * kLeafSize);
  more_candidates_.resize(kLargestPool);
  members_.resize(std::size_t(settings.k));
}

const Index* ConstrainedSearch::find(const IndexView& index, Index leaf, Index* list) {
  kernels_.nearest(index, leaf, first_pool_, squared_limit_, candidates_.data());
  const unsigned complete =
      kernels_.grow(index, leaf, candidates_.data(), first_pool_, settings_.k, settings_.reach, list);
  const Index first = leaf * kLeafSize;
  for (Index lane = 0; lane < kLeafSize; ++lane) {
    if ((complete >> lane & 1) != 0) continue;
    int pool = first_pool_;
    do {
      pool = std::min(2 * pool, kLargestPool);
      single_.find(index, first + lane, pool, squared_limit_, more_candidates_.data());
    } while (!grow(index, first + lane, pool, list + lane) && pool < kLargestPool);
  }
  return candidates_.data();
}

// Returns false if candidates beyond those given could still join.
bool ConstrainedSearch::grow(const IndexView& index, Index position, int count, Index* list) {
  const auto end = std::find(more_candidates_.begin(), more_candidates_.begin() + count, point::kNoNeighbor);
  const int given = int(end - more_candidates_.begin());
  const point::Vec3<float> here = {index.x[position], index.y[position], index.z[position]};
  int accepted = 0;
  const auto offset = [&](int i) {
    const Index at = more_candidates_[i];
    return point::Vec3<float>{index.x[at], index.y[at], index.z[at]} - here;
  };
  const auto accept = [&](int i) {
    members_[accepted] = offset(i);
    list[accepted++ * kLeafSize] = more_candidates_[i];
  };
  return point::grow_constrained(given, settings_.k, settings_.reach, given < count, offset, accept,
                                 [&](int i) { return members_[i]; })
      .complete;
}

}  // namespace pointfair::cpu
