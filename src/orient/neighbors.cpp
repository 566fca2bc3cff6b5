// SPDX-License-Identifier: Apache-2.0
#include "orient/neighbors.hpp"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <new>
#include <numeric>
#include <string>
#include <vector>

#include "pointfair/neighbors.hpp"

namespace pointfair::orient {
namespace {

constexpr std::size_t kLeaf = 12, kParallel = 1 << 14, kBlock = 1024;

float coordinate(const Point& p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

float squared_distance(const Point& a, const Point& b) {
  const float x = a.x - b.x, y = a.y - b.y, z = a.z - b.z;
  return x * x + y * y + z * z;
}

// A balanced tree: the halves of a node are the lower and the upper half of its points along its longest axis. Nodes
// have the numbers of a heap.
class Tree {
 public:
  /// Of no use once the stop is triggered, which who builds it has to ask.
  Tree(std::span<const Point> points, const std::stop_token& stop)
      : points_(points), stop_(stop), order_(points.size()), sorted_(points.size()) {
    std::iota(order_.begin(), order_.end(), 0U);
    std::size_t nodes = 1;
    for (std::size_t most = points.size(); most > kLeaf; most -= most / 2) nodes = 2 * nodes + 1;
    cuts_.resize(nodes);
    build(0, 0, order_.size());
    for (std::size_t i = 0; i < order_.size(); ++i) sorted_[i] = points_[order_[i]];
  }

  struct Found {
    float squared;
    std::uint32_t index;
    bool operator<(const Found& other) const {
      return squared != other.squared ? squared < other.squared : index < other.index;
    }
  };

  /// The nearest of the point at `at` of the order of the tree, in `found`, which has room for k.
  std::uint32_t find(std::size_t at, std::span<Found> found) const {
    std::ranges::fill(found, Found{std::numeric_limits<float>::infinity(), kNone});
    visit(0, 0, order_.size(), Query{sorted_[at], order_[at], found});
    return order_[at];
  }

 private:
  struct Cut {
    int axis = 0;
    float low = 0, high = 0;  // the upper end of the lower half, the lower end of the upper one
  };
  struct Query {
    Point here;
    std::uint32_t index;
    std::span<Found> found;
  };

  int longest_axis(std::size_t first, std::size_t last) const {
    std::array<float, 3> low, high;
    low.fill(std::numeric_limits<float>::infinity());
    high.fill(-std::numeric_limits<float>::infinity());
    for (std::size_t i = first; i < last; ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        const float c = coordinate(points_[order_[i]], axis);
        low[std::size_t(axis)] = std::min(low[std::size_t(axis)], c);
        high[std::size_t(axis)] = std::max(high[std::size_t(axis)], c);
      }
    }
    int best = 0;
    for (int axis = 1; axis < 3; ++axis) {
      const auto a = std::size_t(axis), b = std::size_t(best);
      if (high[a] - low[a] > high[b] - low[b]) best = axis;
    }
    return best;
  }

  void build(std::size_t node, std::size_t first, std::size_t last) {
    if (last - first <= kLeaf || stop_.stop_requested()) return;
    const int axis = longest_axis(first, last);
    const std::size_t middle = first + (last - first) / 2;
    const auto value = [&](std::uint32_t i) { return coordinate(points_[i], axis); };
    const auto less = [&](std::uint32_t a, std::uint32_t b) {
      return value(a) != value(b) ? value(a) < value(b) : a < b;
    };
    const auto at = [&](std::size_t i) { return order_.begin() + std::ptrdiff_t(i); };
    std::nth_element(at(first), at(middle), at(last), less);
    cuts_[node] = {axis, value(*std::max_element(at(first), at(middle), less)), value(order_[middle])};
    const auto lower = [&] { build(2 * node + 1, first, middle); };
    const auto upper = [&] { build(2 * node + 2, middle, last); };
    if (last - first > kParallel) {
      tbb::parallel_invoke(lower, upper);
    } else {
      lower();
      upper();
    }
  }

  void visit(std::size_t node, std::size_t first, std::size_t last, const Query& query) const {
    if (last - first <= kLeaf) {
      for (std::size_t i = first; i < last; ++i) offer({squared_distance(sorted_[i], query.here), order_[i]}, query);
      return;
    }
    const std::size_t middle = first + (last - first) / 2;
    const Cut& cut = cuts_[node];
    const float here = coordinate(query.here, cut.axis);
    const float below = std::max(0.0F, here - cut.low), above = std::max(0.0F, cut.high - here);
    const bool lower_first = below <= above;
    for (const bool lower : {lower_first, !lower_first}) {
      const float gap = lower ? below : above;
      if (gap * gap > query.found.back().squared) continue;
      lower ? visit(2 * node + 1, first, middle, query) : visit(2 * node + 2, middle, last, query);
    }
  }

  static void offer(const Found& candidate, const Query& query) {
    if (candidate.index == query.index || !(candidate < query.found.back())) return;
    std::size_t slot = query.found.size() - 1;
    for (; slot > 0 && candidate < query.found[slot - 1]; --slot) query.found[slot] = query.found[slot - 1];
    query.found[slot] = candidate;
  }

  std::span<const Point> points_;
  const std::stop_token& stop_;
  std::vector<std::uint32_t> order_;  // of the leaves
  std::vector<Point> sorted_;
  std::vector<Cut> cuts_;
};

}  // namespace

std::vector<std::uint32_t> nearest_neighbors(std::span<const Point> points, std::size_t k,
                                             const std::stop_token& stop) {
  const Tree tree(points, stop);
  std::vector<std::uint32_t> result(points.size() * k);
  tbb::parallel_for(std::size_t{0}, (points.size() + kBlock - 1) / kBlock, [&](std::size_t block) {
    if (stop.stop_requested()) return;
    std::vector<Tree::Found> found(k);
    for (std::size_t i = block * kBlock; i < std::min(points.size(), (block + 1) * kBlock); ++i) {
      std::uint32_t* const to = result.data() + tree.find(i, found) * k;
      for (std::size_t slot = 0; slot < k; ++slot) to[slot] = found[slot].index;
    }
  });
  if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
  return result;
}

}  // namespace pointfair::orient

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
