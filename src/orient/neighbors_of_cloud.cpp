// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <new>
#include <string>
#include <vector>

#include "orient/neighbors.hpp"
#include "pointfair/neighbors.hpp"

namespace pointfair {

namespace {

[[noreturn]] void fail_by_memory(std::size_t points, std::size_t k) {
  throw Error(ErrorKind::memory, "the " + std::to_string(k) + " nearest of each of " + std::to_string(points) +
                                     " points do not fit into memory; ask for fewer, or cut the cloud");
}

std::vector<std::uint32_t> nearest_of_all(std::span<const Point> points, std::size_t k, const std::stop_token& stop) {
  static_assert(kNoNeighbor == orient::kNone);
  std::vector<std::uint32_t> places;  // of the finite points
  std::vector<Point> finite;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) continue;
    places.push_back(std::uint32_t(i));
    finite.push_back(p);
  }
  std::vector<std::uint32_t> found = k > 0 ? orient::nearest_neighbors(finite, k, stop) : std::vector<std::uint32_t>{};
  if (finite.size() == points.size()) return found;
  std::vector<std::uint32_t> result(points.size() * k, kNoNeighbor);
  for (std::size_t i = 0; i < finite.size(); ++i)
    std::transform(found.begin() + i * k, found.begin() + (i + 1) * k, result.begin() + places[i] * k,
                   [&](std::uint32_t j) { return j == kNoNeighbor ? j : places[j]; });
  return result;
}

}  // namespace

std::vector<std::uint32_t> nearest_neighbors(std::span<const Point> points, std::size_t k, std::stop_token stop) {
  std::size_t entries = 0;
  if (__builtin_mul_overflow(points.size(), k, &entries) || entries > PTRDIFF_MAX / sizeof(std::uint32_t))
    fail_by_memory(points.size(), k);
  try {
    return nearest_of_all(points, k, stop);
  } catch (const std::bad_alloc&) {
    fail_by_memory(points.size(), k);
  }
}

}  // namespace pointfair
