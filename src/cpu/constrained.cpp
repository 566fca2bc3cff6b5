// SPDX-License-Identifier: Apache-2.0
#include "cpu/constrained.h"

#include <algorithm>

namespace pointfair::cpu {
namespace {

constexpr int kLargestPool = 1024;

}  // namespace

ConstrainedSearch::ConstrainedSearch(const Kernels& kernels, const NeighborSettings& settings, float squared_limit)
    : kernels_(kernels), settings_(settings), squared_limit_(squared_limit), first_pool_(std::max(16, 2 * settings.k)) {
  if (!settings.constraint) return;
  candidates_.resize(std::size_t(kLargestPool) * kLeafSize);
  members_.resize(std::size_t(settings.k));
}

void ConstrainedSearch::find(const IndexView& index, Index leaf, Index* list) {
  kernels_.nearest(index, leaf, first_pool_, squared_limit_, candidates_.data());
  const Index first = leaf * kLeafSize;
  std::vector<Index> again;
  for (int lane = 0; lane < kLeafSize; ++lane) {
    for (int slot = 0; slot < settings_.k; ++slot) list[slot * kLeafSize + lane] = point::kNoNeighbor;
    if (first + Index(lane) >= index.points) continue;
    if (!grow(index, first + Index(lane), candidates_.data() + lane, kLeafSize, first_pool_, list, lane))
      again.push_back(Index(lane));
  }
  for (const Index lane : again) {
    int pool = first_pool_;
    do {
      pool = std::min(2 * pool, kLargestPool);
      kernels_.nearest_of_one(index, first + lane, pool, squared_limit_, candidates_.data());
    } while (!grow(index, first + lane, candidates_.data(), 1, pool, list, int(lane)) && pool < kLargestPool);
  }
}

// Returns false if candidates beyond those given could still join.
bool ConstrainedSearch::grow(const IndexView& index, Index position, const Index* candidates, int stride, int count,
                             Index* list, int lane) {
  int given = 0;
  while (given < count && candidates[given * stride] != point::kNoNeighbor) ++given;
  const point::Vec3<float> here = {index.x[position], index.y[position], index.z[position]};
  int accepted = 0;
  const auto offset = [&](int i) {
    const Index at = candidates[i * stride];
    return point::Vec3<float>{index.x[at], index.y[at], index.z[at]} - here;
  };
  const point::ConstrainedGrowth growth = point::grow_constrained(
      given, settings_.k, settings_.reach, given < count, offset,
      [&](int i) {
        members_[accepted] = offset(i);
        list[accepted++ * kLeafSize + lane] = candidates[i * stride];
      },
      [&](int i) { return members_[i]; });
  const bool final = growth.complete || count == kLargestPool;
  if (final && growth.accepted < settings_.k) ++short_neighborhoods_;
  return growth.complete;
}

}  // namespace pointfair::cpu
