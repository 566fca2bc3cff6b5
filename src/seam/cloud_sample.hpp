// SPDX-License-Identifier: Apache-2.0
// How every backend draws the same sample of a cloud: of the cells that hold points, those with the least hashes, and
// of each the point that lies before the others.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "point/neighbors.h"
#include "point/position.h"
#include "seam/sampling.hpp"

namespace pointfair {

// A valid point whose cell has a hash up to the limit asked for.
struct SampleCandidate {
  std::uint32_t hash, index;
  Point point;
};

inline bool is_indexed(const Point& p) { return point::is_indexable(p); }
inline point::Vec3<float> to_vec3(const Point& p) { return {p.x, p.y, p.z}; }

inline constexpr float kUnbounded = __builtin_inff();
inline constexpr Bounds kNoBounds{{kUnbounded, kUnbounded, kUnbounded}, {-kUnbounded, -kUnbounded, -kUnbounded}, 0};
// Inline, since it is called for each point.
inline void unite(Bounds& bounds, const Bounds& with) {
  bounds.min = {std::min(bounds.min.x, with.min.x), std::min(bounds.min.y, with.min.y),
                std::min(bounds.min.z, with.min.z)};
  bounds.max = {std::max(bounds.max.x, with.max.x), std::max(bounds.max.y, with.max.y),
                std::max(bounds.max.z, with.max.z)};
  bounds.valid += with.valid;
}
double diagonal_of(const Bounds& bounds);
// The largest difference of a coordinate within the bounds from the next float; 0 if no coordinate is rounded to these.
double float_step_of(const Bounds& bounds, const std::array<double, 3>& origin);
inline void include(Bounds& bounds, const Point& p) { unite(bounds, {p, p, 1}); }

// The valid points to look for: those whose cells, `refinement` times refined, have hashes up to `limit`.
struct Candidates {
  std::uint32_t limit;
  int refinement;
};
// Returns all candidates, in any order.
using Collect = std::function<std::vector<SampleCandidate>(Candidates wanted)>;
CloudSample draw_sample(const Bounds& bounds, std::size_t count, const Collect& collect);
// What draw_sample() asks `collect` for first, and mostly only, in a cloud of `valid` valid points.
Candidates first_candidates(std::uint64_t valid, std::size_t count);
// What draw_sample() asks for next where these are too few: more of the same cells or, where few cells hold points,
// smaller ones.
Candidates with_more(Candidates wanted);
Candidates refined(Candidates wanted);

// Leaves one candidate of each cell, in the order in which they are drawn.
void order_candidates(std::vector<SampleCandidate>& candidates);

// On the host: two passes over `points` points, each of which point_at(i) gives with its index in upload order.
template <class PointAt>
CloudSample sample_points(std::size_t points, const PointAt& point_at, std::size_t count, const ForEach& for_each) {
  constexpr std::size_t kBlock = 1 << 14;
  const std::size_t blocks = (points + kBlock - 1) / kBlock;
  const auto for_block = [&](std::size_t block, const auto& body) {
    for (std::size_t i = block * kBlock; i < std::min(points, (block + 1) * kBlock); ++i) {
      const auto [p, index] = point_at(i);
      if (is_indexed(p)) body(p, index);
    }
  };
  std::vector<Bounds> of_block(blocks, kNoBounds);
  for_each(blocks, [&](std::size_t block) {
    Bounds bounds = kNoBounds;
    for_block(block, [&](const Point& p, std::uint32_t) { include(bounds, p); });
    of_block[block] = bounds;
  });
  Bounds bounds = kNoBounds;
  for (const Bounds& its : of_block) unite(bounds, its);
  if (bounds.valid == 0) return {};
  return draw_sample(bounds, count, [&](Candidates wanted) {
    const double cells = point::cells_per_unit(to_vec3(bounds.min), to_vec3(bounds.max), wanted.refinement);
    std::vector<std::vector<SampleCandidate>> found(blocks);
    for_each(blocks, [&](std::size_t block) {
      for_block(block, [&](const Point& p, std::uint32_t index) {
        const std::uint32_t hash = point::cell_hash(to_vec3(p), to_vec3(bounds.min), cells);
        if (hash <= wanted.limit) found[block].push_back({hash, index, p});
      });
      order_candidates(found[block]);  // of many points in one cell, one
    });
    std::vector<SampleCandidate> all;
    for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
    return all;
  });
}

}  // namespace pointfair
