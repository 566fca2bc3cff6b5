// SPDX-License-Identifier: Apache-2.0
#include "estimate/pools.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace pointfair {
namespace {

using constants::kPool;

constexpr std::size_t kAtOnce = 32;  // places that one core takes

// Writes the pool of the n-th place along x, which is looked for along x.
void find_pool(const std::vector<Point>& places, const std::vector<std::uint32_t>& along_x, std::size_t n,
               std::uint32_t* pool) {
  std::array<std::pair<double, std::uint32_t>, kPool> nearest;  // squared distances, and whose
  nearest.fill({std::numeric_limits<double>::infinity(), 0});
  // false: from here on all are too far
  const auto offer = [&](std::uint32_t i) {
    const point::Offset o = point::offset_between(places[along_x[n]], places[i]);
    const std::pair found{point::squared_length(o), i};
    if (found < nearest.back()) {
      const auto at = std::ranges::upper_bound(nearest, found);
      std::move_backward(at, nearest.end() - 1, nearest.end());
      *at = found;
    }
    return o.x * o.x <= nearest.back().first;
  };
  for (std::size_t i = n; i < along_x.size() && offer(along_x[i]);) ++i;
  for (std::size_t i = n; i > 0 && offer(along_x[i - 1]);) --i;
  for (std::size_t i = 0; i < kPool; ++i) pool[i] = nearest[i].second;
}

}  // namespace

std::vector<std::uint32_t> pools_of(const std::vector<Point>& places, const ForEach& for_each) {
  std::vector<std::uint32_t> along_x(places.size()), pools(places.size() * kPool);
  std::iota(along_x.begin(), along_x.end(), std::uint32_t(0));
  std::ranges::sort(along_x, [&](std::uint32_t a, std::uint32_t b) {
    return places[a].x != places[b].x ? places[a].x < places[b].x : a < b;
  });
  for_each((places.size() + kAtOnce - 1) / kAtOnce, [&](std::size_t block) {
    for (std::size_t n = block * kAtOnce; n < std::min(places.size(), (block + 1) * kAtOnce); ++n)
      find_pool(places, along_x, n, &pools[along_x[n] * kPool]);
  });
  return pools;
}

double median_known(std::span<const std::uint32_t> pool, const std::vector<double>& values) {
  std::array<double, kPool> known;
  std::size_t count = 0;
  for (const std::uint32_t i : pool)
    if (!std::isnan(values[i])) known[count++] = values[i];
  if (count == 0) return std::numeric_limits<double>::quiet_NaN();
  std::nth_element(known.begin(), known.begin() + std::ptrdiff_t(count / 2), known.begin() + std::ptrdiff_t(count));
  return known[count / 2];
}

}  // namespace pointfair
