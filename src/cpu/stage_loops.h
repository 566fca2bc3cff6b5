// SPDX-License-Identifier: Apache-2.0
// The formulas of src/point over the points of one leaf, a pack at a time; neighbours from a list or, without a list,
// by a walk over everything within a radius in sorted order. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/pack.h"
#include "cpu/search.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// Calls visit(offset, position, inside) for each listed neighbour of the pack at `start`, slot by slot.
// Lists fill from the front, so the walk ends at the first slot that is empty in every lane.
template <class Visit>
POINTFAIR_INLINE void for_listed(const IndexView& index, Index start, const Index* pack_list, int k, Visit visit) {
  const point::Vec3<Floats> here = {load(index.x + start), load(index.y + start), load(index.z + start)};
  const Ints empty = broadcast(int(point::kNoNeighbor));
  for (int slot = 0; slot < k; ++slot) {
    const Ints listed = load(pack_list + slot * kLeafSize);
    const Mask inside = listed != empty;
    if (!any(inside)) return;
    const Ints at = select(inside, listed, broadcast(0));
    const point::Vec3<Floats> there = {gather(index.x, at), gather(index.y, at), gather(index.z, at)};
    visit(there - here, at, inside);
  }
}

// Walks the tree from the root in sorted order, so that sums have one order whatever the instruction set.
template <class Visit>
class BallWalk {
 public:
  POINTFAIR_INLINE BallWalk(const IndexView& index, Index start, Ball ball, Visit visit)
      : index_(index),
        queries_(make_queries(index, start,
                              lanes_between(0, kLanes) & (lane_numbers() < broadcast(int(index.points - start))),
                              broadcast(ball.squared_radius))),
        visit_(visit),
        squared_radius_(ball.squared_radius) {}

  void run() { descend(index_.levels - 1, 0); }

 private:
  void descend(int level, Index group_number) {
    const BoxGroup& group = index_.level[level][group_number];
    unsigned near = 0;
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const point::Vec3<Floats> min = {load(group.min_x + c), load(group.min_y + c), load(group.min_z + c)};
      const point::Vec3<Floats> max = {load(group.max_x + c), load(group.max_y + c), load(group.max_z + c)};
      near |= bits(point::squared_gap(min, max, queries_.min, queries_.max) <= broadcast(squared_radius_)) << c;
    }
    for (; near != 0; near &= near - 1) {
      const Index child = group_number * kLeafSize + Index(__builtin_ctz(near));
      if (level > 0) {
        descend(level - 1, child);
      } else {
        visit_leaf(child);
      }
    }
  }

  void visit_leaf(Index leaf) {
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const Index first = leaf * kLeafSize + Index(c);
      const point::Vec3<Floats> p = {load(index_.x + first), load(index_.y + first), load(index_.z + first)};
      unsigned near = bits(point::squared_gap(p, p, queries_.min, queries_.max) <= broadcast(squared_radius_));
      for (; near != 0; near &= near - 1) {
        const Index position = first + Index(__builtin_ctz(near));
        const point::Vec3<Floats> offset =
            spread(index_.x[position], index_.y[position], index_.z[position]) - queries_.position;
        const Ints at = broadcast(int(position));
        const Mask inside = (point::squared_length(offset) <= queries_.limit) & (at != queries_.at);
        if (any(inside)) visit_(offset, at, inside);
      }
    }
  }

  const IndexView& index_;
  Queries queries_;
  Visit visit_;
  float squared_radius_;
};

inline void mean_distances(const IndexView& index, Index leaf, const Index* list, int count, float* out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    Floats sum = broadcast(0.0f), found = broadcast(0.0f);
    for_listed(index, leaf * kLeafSize + Index(part), list + part, count,
               [&](point::Vec3<Floats> offset, Ints, Mask inside) {
                 sum = sum + select(inside, square_root(point::squared_length(offset)), broadcast(0.0f));
                 found = found + select(inside, broadcast(1.0f), broadcast(0.0f));
               });
    store(out + part, point::mean_distance(sum, larger(found, broadcast(1.0f))));
  }
}

// `for_neighbors(visit)` runs over the neighbours of the pack, the same way each time it is called.
template <class ForNeighbors>
POINTFAIR_INLINE Floats normals_of_pack(ForNeighbors for_neighbors, point::NormalWeights weights, Index start,
                                        NormalsOut out) {
  point::CentroidSum<Floats> centroid_sum;
  Floats found = broadcast(0.0f);
  for_neighbors([&](point::Vec3<Floats> offset, Ints, Mask inside) {
    centroid_sum.add(offset, inside, weights);
    found = found + select(inside, broadcast(1.0f), broadcast(0.0f));
  });
  const point::Vec3<Floats> centroid = centroid_sum.centroid();
  point::CovarianceSum<Floats> covariance;
  for_neighbors(
      [&](point::Vec3<Floats> offset, Ints, Mask inside) { covariance.add(offset, centroid, inside, weights); });
  const point::Direction<Floats> normal = covariance.normal();
  const Mask enough = ~(found < broadcast(float(point::kLeastNeighbors)));
  const point::Vec3<Floats> unit = point::select<Floats>(enough, normal.unit, point::Vec3<Floats>{});
  store(out.x + start, unit.x);
  store(out.y + start, unit.y);
  store(out.z + start, unit.z);
  return found;
}

inline void normals(const IndexView& index, Index leaf, NeighborView neighbors, point::NormalWeights weights,
                    NormalsOut out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    const Index* list = neighbors.list + std::size_t(leaf) * neighbors.stored * kLeafSize + part;
    normals_of_pack([&](auto visit) { for_listed(index, start, list, neighbors.k, visit); }, weights, start, out);
  }
}

inline void normals_in_ball(const IndexView& index, Index leaf, Ball ball, point::NormalWeights weights, NormalsOut out,
                            unsigned* neighbor_counts) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    if (start >= index.points) return;
    const Floats found =
        normals_of_pack([&](auto visit) { BallWalk(index, start, ball, visit).run(); }, weights, start, out);
    for (int lane = 0; lane < kLanes; ++lane) neighbor_counts[part + lane] = unsigned(found.v[lane]);
  }
}

POINTFAIR_INLINE Floats area_weight(AreaView area, Ints at) {
  if (area.power == 0) return broadcast(1.0f);
  const Floats length = gather(area.mean_distance, at);
  return area.power == 1 ? length : length * length;
}

// Moved positions of the pack, point after point into `xyz`; a zero normal leaves a point where it is.
template <class ForNeighbors>
POINTFAIR_INLINE void fair_pack(ForNeighbors for_neighbors, const IndexView& index, Index start, NormalsView normals,
                                AreaView area, point::BilateralWeights weights, float* xyz) {
  const point::Vec3<Floats> here = {load(index.x + start), load(index.y + start), load(index.z + start)};
  const point::Vec3<Floats> normal = {load(normals.x + start), load(normals.y + start), load(normals.z + start)};
  point::BilateralSum<Floats> sum;
  for_neighbors([&](point::Vec3<Floats> offset, Ints at, Mask inside) {
    sum.add(offset, normal, area_weight(area, at), inside, weights);
  });
  const point::Vec3<Floats> there = point::moved(here, normal, sum.distance());
  for (int lane = 0; lane < kLanes; ++lane) {
    xyz[3 * lane] = there.x.v[lane];
    xyz[3 * lane + 1] = there.y.v[lane];
    xyz[3 * lane + 2] = there.z.v[lane];
  }
}

inline void fair(const IndexView& index, Index leaf, NeighborView neighbors, NormalsView normals, AreaView area,
                 point::BilateralWeights weights, float* xyz) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    const Index* list = neighbors.list + std::size_t(leaf) * neighbors.stored * kLeafSize + part;
    fair_pack([&](auto visit) { for_listed(index, start, list, neighbors.k, visit); }, index, start, normals, area,
              weights, xyz + 3 * part);
  }
}

inline void fair_in_ball(const IndexView& index, Index leaf, Ball ball, NormalsView normals, AreaView area,
                         point::BilateralWeights weights, float* xyz) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    if (start >= index.points) return;
    fair_pack([&](auto visit) { BallWalk(index, start, ball, visit).run(); }, index, start, normals, area, weights,
              xyz + 3 * part);
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
