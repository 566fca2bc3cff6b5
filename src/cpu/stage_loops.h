// SPDX-License-Identifier: Apache-2.0
// The formulas of src/point over the points of one leaf, a pack at a time; neighbours from a list or, without a list,
// by a walk over everything within a radius in sorted order. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/pack.h"
#include "cpu/search.h"
#include "point/noise_field.h"
#include "point/outliers.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// What belongs to a neighbour, read by its sorted position: another one in each lane, or the same in all.
struct Gathered {
  Ints at;
  POINTFAIR_INLINE Floats of(const float* values) const { return gather(values, at); }
};
struct Shared {
  Index at;
  POINTFAIR_INLINE Floats of(const float* values) const { return broadcast(values[at]); }
};

// Each of the two ways to the neighbours of a pack calls visit(offset, there, inside) for each of them, always in the
// same order; `squared_radius` is that of their neighbourhoods.

// Lists fill from the front, so the walk ends at the first slot that is empty in every lane.
class ListWalk {
 public:
  // list[slot * 16] is the first lane's entry
  POINTFAIR_INLINE ListWalk(const IndexView& index, Index start, const Index* list, int k)
      : index_(index), start_(start), list_(list), k_(k) {}

  template <class Visit>
  POINTFAIR_INLINE void operator()(Visit visit) const {
    const point::Vec3<Floats> here = {load(index_.x + start_), load(index_.y + start_), load(index_.z + start_)};
    const Ints empty = broadcast(int(point::kNoNeighbor));
    for (int slot = 0; slot < k_; ++slot) {
      const Ints listed = load(list_ + slot * kLeafSize);
      const Mask inside = listed != empty;
      if (!any(inside)) return;
      const Gathered at{select(inside, listed, broadcast(0))};
      const point::Vec3<Floats> there = {at.of(index_.x), at.of(index_.y), at.of(index_.z)};
      visit(there - here, at, inside);
    }
  }
  POINTFAIR_INLINE Floats squared_radius() const { return broadcast(1.0f); }  // lists have no width of their own
  POINTFAIR_INLINE Floats squared_core() const { return broadcast(__builtin_inff()); }

 private:
  const IndexView& index_;
  Index start_;
  const Index* list_;
  int k_;
};

// 1 without levels.
POINTFAIR_INLINE Floats squared_level(const float* level, Index start) {
  if (level == nullptr) return broadcast(1.0f);
  const Floats here = load(level + start);
  return here * here;
}
// Of a radius that follows the noise.
POINTFAIR_INLINE Floats squared_base_of(float squared_base, const float* level, Index start) {
  return squared_base * squared_level(level, start);
}

// Walks the tree from the root in sorted order, so that sums have one order whatever the instruction set.
class BallWalk {
 public:
  POINTFAIR_INLINE BallWalk(const IndexView& index, Index start, const Ball& ball) : index_(index) {
    const Mask active = lane_numbers() < broadcast(int(index.points - start));
    const Floats own = load(ball.squared_radius + start);
    const Floats grown = ball.squared_growth == nullptr ? own : own * load(ball.squared_growth + start);
    queries_ = make_queries(index, start, active, grown);
    farthest_ = largest(queries_.limit);
    share_ = broadcast(1.0f);
    if (ball.widening > 0) {  // a surface holds widening * R^2 / r^2 points
      const Floats squared_widening = own - squared_base_of(ball.squared_base, ball.level, start);
      const Floats holds =
          select(squared_widening > broadcast(0.0f), queries_.limit / squared_widening, broadcast(1.0f));
      share_ = select(active, broadcast(kBallPoints / float(ball.widening)) / holds, broadcast(0.0f));
    }
    largest_share_ = largest(share_);
    is_thinned_ = smallest(select(active, share_, broadcast(1.0f))) < 1.0f;
  }

  template <class Visit>
  POINTFAIR_INLINE void operator()(Visit visit) const {
    descend(index_.levels - 1, 0, visit);
  }
  POINTFAIR_INLINE Floats squared_radius() const { return queries_.limit; }
  POINTFAIR_INLINE Floats squared_core() const { return point::squared_core(queries_.limit); }

 private:
  template <class Visit>
  void descend(int level, Index group_number, Visit& visit) const {
    const BoxGroup& group = index_.level[level][group_number];
    unsigned near = 0;
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const point::Vec3<Floats> min = {load(group.min_x + c), load(group.min_y + c), load(group.min_z + c)};
      const point::Vec3<Floats> max = {load(group.max_x + c), load(group.max_y + c), load(group.max_z + c)};
      near |= bits(point::squared_gap(min, max, queries_.min, queries_.max) <= broadcast(farthest_)) << c;
    }
    for (; near != 0; near &= near - 1) {
      const Index child = group_number * kLeafSize + Index(__builtin_ctz(near));
      if (level > 0) {
        descend(level - 1, child, visit);
      } else {
        visit_leaf(child, visit);
      }
    }
  }

  template <class Visit>
  void visit_leaf(Index leaf, Visit& visit) const {
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const Index first = leaf * kLeafSize + Index(c);
      const point::Vec3<Floats> p = {load(index_.x + first), load(index_.y + first), load(index_.z + first)};
      unsigned near = bits(point::squared_gap(p, p, queries_.min, queries_.max) <= broadcast(farthest_));
      if (is_thinned_) near &= bits(load(index_.share + first) < broadcast(largest_share_));
      for (; near != 0; near &= near - 1) {
        const Index position = first + Index(__builtin_ctz(near));
        const float hash = is_thinned_ ? index_.share[position] : 0.0f;
        const point::Vec3<Floats> offset =
            spread(index_.x[position], index_.y[position], index_.z[position]) - queries_.position;
        const Mask inside = (point::squared_length(offset) <= queries_.limit) &
                            (queries_.at != broadcast(int(position))) & (broadcast(hash) < share_);
        if (any(inside)) visit(offset, Shared{position}, inside);
      }
    }
  }

  const IndexView& index_;
  Queries queries_;
  float farthest_;  // the largest squared radius of the lanes
  Floats share_;    // of the neighbours that count
  float largest_share_;
  bool is_thinned_;
};

// Calls body(start, neighbours) for each pack of the leaf.
template <class Body>
POINTFAIR_INLINE void for_packs(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods, Body body) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    if (neighborhoods.lists.k > 0) {
      const NeighborView& lists = neighborhoods.lists;
      const Index* list = lists.list + std::size_t(leaf) * std::size_t(lists.stored) * kLeafSize + part;
      body(start, ListWalk(index, start, list, lists.k));
    } else if (start < index.points) {
      body(start, BallWalk(index, start, neighborhoods.ball));
    }
  }
}

inline void mean_distances(const IndexView& index, Index leaf, const Index* list, int count, float* out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    Floats sum = broadcast(0.0f), found = broadcast(0.0f);
    const ListWalk listed(index, leaf * kLeafSize + Index(part), list + part, count);
    listed([&](point::Vec3<Floats> offset, Gathered, Mask inside) {
      sum = sum + select(inside, square_root(point::squared_length(offset)), broadcast(0.0f));
      found = found + select(inside, broadcast(1.0f), broadcast(0.0f));
    });
    store(out + part, point::mean_distance(sum, larger(found, broadcast(1.0f))));
  }
}

inline void squared_radii(const IndexView& index, Index leaf, const Index* list, int widening, float squared_base,
                          const float* level, float* out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    Floats farthest = broadcast(0.0f);
    const ListWalk listed(index, leaf * kLeafSize + Index(part), list + part, widening);
    listed([&](point::Vec3<Floats> offset, Gathered, Mask inside) {
      farthest = select(inside, point::squared_length(offset), farthest);
    });
    store(out + part, farthest + squared_base_of(squared_base, level, leaf * kLeafSize + Index(part)));
  }
}

POINTFAIR_INLINE point::Vec3<Floats> load_vector(const float* x, const float* y, const float* z, Index start) {
  return {load(x + start), load(y + start), load(z + start)};
}
POINTFAIR_INLINE void store_vector(VectorsOut out, Index start, point::Vec3<Floats> v) {
  store(out.x + start, v.x);
  store(out.y + start, v.y);
  store(out.z + start, v.z);
}
template <class There>
POINTFAIR_INLINE point::Vec3<Floats> vector_of(There there, VectorsView v) {
  return {there.of(v.x), there.of(v.y), there.of(v.z)};
}

template <class Neighbors, class Weights>
POINTFAIR_INLINE Floats normals_of_pack(const Neighbors& neighbors, Weights weights, Index start, VectorsOut out) {
  point::CentroidSum<Floats> centroid_sum;
  Floats found = broadcast(0.0f);
  neighbors([&](point::Vec3<Floats> offset, auto, Mask inside) {
    centroid_sum.add(offset, inside, weights);
    found = found + select(inside, broadcast(1.0f), broadcast(0.0f));
  });
  const point::Vec3<Floats> centroid = centroid_sum.centroid();
  point::CovarianceSum<Floats> covariance;
  neighbors([&](point::Vec3<Floats> offset, auto, Mask inside) { covariance.add(offset, centroid, inside, weights); });
  const point::Direction<Floats> normal = covariance.normal();
  const Mask enough = ~(found < broadcast(float(point::kLeastNeighbors)));
  store_vector(out, start, point::select<Floats>(enough, normal.unit, point::Vec3<Floats>{}));
  return found;
}

inline void normals(const IndexView& index, Index leaf, Neighborhoods neighborhoods, NormalRule rule, VectorsOut out,
                    unsigned* neighbor_counts) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const Floats found =
        rule.of_radius
            ? normals_of_pack(neighbors, point::local_weights(rule.weights, neighbors.squared_radius()), start, out)
            : normals_of_pack(neighbors, rule.weights, start, out);
    for (int lane = 0; lane < kLanes; ++lane)
      neighbor_counts[start % kLeafSize + Index(lane)] = unsigned(found.v[lane]);
  });
}

template <class Neighbors, class Weights>
POINTFAIR_INLINE void filter_pack(const Neighbors& neighbors, Weights weights, float inverse_turn, Index start,
                                  VectorsView from, VectorsOut out, GrowthOut growth) {
  point::FilteredNormal<Floats> filtered(load_vector(from.x, from.y, from.z, start));
  if (growth.squared_growth == nullptr) {
    neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
      filtered.add(offset, vector_of(there, from), inside, weights, inverse_turn);
    });
  } else {
    point::MeanTurn<Floats> turn;
    neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
      const point::Vec3<Floats> normal = vector_of(there, from);
      filtered.add(offset, normal, inside, weights, inverse_turn);
      turn.add(point::dot(filtered.normal, normal), inside);
    });
    store(growth.squared_growth + start, turn.squared_growth(growth.most));
  }
  store_vector(out, start, filtered.unit());
}

inline void filter_normals(const IndexView& index, Index leaf, Neighborhoods neighborhoods, NormalRule rule,
                           float inverse_turn, VectorsView from, VectorsOut out, GrowthOut growth) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    if (rule.of_radius) {
      filter_pack(neighbors, point::local_weights(rule.weights, neighbors.squared_radius()), inverse_turn, start, from,
                  out, growth);
    } else {
      filter_pack(neighbors, rule.weights, inverse_turn, start, from, out, growth);
    }
  });
}

template <class There>
POINTFAIR_INLINE Floats area_weight(AreaView area, There there) {
  if (area.power == 0) return broadcast(1.0f);
  const Floats length = there.of(area.mean_distance);
  return area.power == 1 ? length : length * length;
}

// How far the points of the pack move against their normals; `visited` sees each neighbour's offset too.
template <class Neighbors, class Weights, class Visited>
POINTFAIR_INLINE Floats bilateral_distance(const Neighbors& neighbors, Weights weights, const FairingRule& rule,
                                           point::Vec3<Floats> normal, VectorsView normals, AreaView area,
                                           Visited visited) {
  if (rule.two_planes) {
    point::TwoPlaneSum<Floats> sum;
    neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
      visited(offset, inside);
      sum.add(offset, normal, vector_of(there, normals), area_weight(area, there), inside, weights, rule.inverse_turn);
    });
    return sum.distance();
  }
  point::BilateralSum<Floats> sum;
  neighbors([&](point::Vec3<Floats> offset, auto there, Mask inside) {
    visited(offset, inside);
    sum.add(offset, normal, area_weight(area, there), inside, weights);
  });
  return sum.distance();
}

// Where the points of the pack go: along their normals, by the share that noise justifies; outliers become NaN or go to
// a mean of their neighbours.
template <bool kSeeksOutliers, bool kShares, class Neighbors, class Weights>
POINTFAIR_INLINE point::Vec3<Floats> fair_pack(const Neighbors& neighbors, Weights weights, const FairingRule& rule,
                                               point::Vec3<Floats> here, point::Vec3<Floats> normal,
                                               VectorsView normals, AreaView area, Index start) {
  point::Agreement<Floats> agreement;
  point::HeightSpread<Floats> spread;
  const Floats level = squared_level(rule.level, start);
  const Floats squared_outlier_distance =
      larger(broadcast(rule.squared_outlier_distance), rule.squared_level_outlier_distance * level);
  const Floats squared_core = larger(neighbors.squared_core(), squared_outlier_distance);
  Floats distance =
      bilateral_distance(neighbors, weights, rule, normal, normals, area, [&](point::Vec3<Floats> offset, Mask inside) {
        if constexpr (kSeeksOutliers || kShares) {
          const Floats height = dot(normal, offset);
          if constexpr (kShares) spread.add(height, inside);
          if constexpr (kSeeksOutliers) agreement.add(offset, height, inside, squared_outlier_distance, squared_core);
        }
      });
  if constexpr (kShares) {
    distance = distance * point::noise_share(spread.variance(), broadcast(rule.noise_variance) * level, rule.noise_left,
                                             rule.damage);
  }
  const point::Vec3<Floats> there = point::moved(here, normal, distance * rule.strength);
  if constexpr (!kSeeksOutliers) return there;
  // a point without a normal keeps its place
  const Mask is_sparse = neighbors.squared_core() > broadcast(rule.squared_sparse_core);
  const Mask outlier = agreement.is_missing(is_sparse) & (point::squared_length(normal) > broadcast(0.0f));
  if (!any(outlier)) return there;
  const Floats nan = broadcast(__builtin_nanf(""));
  if (!rule.pull_outliers) return point::select<Floats>(outlier, {nan, nan, nan}, there);
  point::PullSum<Floats> sum;
  if (rule.squared_radius == nullptr) {
    neighbors([&](point::Vec3<Floats> offset, auto, Mask inside) {
      sum.add_by_closeness(offset, inside, weights.inverse_two_closeness2);
    });
  } else {
    neighbors([&](point::Vec3<Floats> offset, auto at, Mask inside) {
      sum.add_by_density(offset, inside, neighbors.squared_radius(), at.of(rule.squared_radius));
    });
  }
  return point::select<Floats>(outlier, here + broadcast(rule.strength) * sum.mean(), there);
}

// Point after point.
POINTFAIR_INLINE void store_points(point::Vec3<Floats> p, float* xyz) {
  for (int lane = 0; lane < kLanes; ++lane) {
    xyz[3 * lane] = p.x.v[lane];
    xyz[3 * lane + 1] = p.y.v[lane];
    xyz[3 * lane + 2] = p.z.v[lane];
  }
}

inline void survey(const IndexView& index, Index leaf, Neighborhoods neighborhoods, const float* values, float* counts,
                   float* least) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    Floats count = broadcast(0.0f), lowest = load(values + start);
    neighbors([&](point::Vec3<Floats>, auto there, Mask inside) {
      count = count + select(inside, broadcast(1.0f), broadcast(0.0f));
      lowest = select(inside, smaller(lowest, there.of(values)), lowest);
    });
    store(counts + start, count);
    store(least + start, lowest);
  });
}

template <class Neighbors>
POINTFAIR_INLINE point::LocalBilateralWeights<Floats> weights_of(const FairingRule& rule, const Neighbors& neighbors,
                                                                 Index start) {
  const Floats closeness = broadcast(rule.weights.inverse_two_closeness2),
               similarity = broadcast(rule.weights.inverse_two_similarity2);
  return {rule.of_radius ? closeness / neighbors.squared_radius() : closeness,
          rule.similarity_follows ? similarity / squared_level(rule.level, start) : similarity};
}

// Functions of their own: what outliers and shares need would take registers from the loop that does without.
template <bool kSeeksOutliers, bool kShares>
__attribute__((noinline)) void fair_leaf(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods,
                                         VectorsView normals, AreaView area, const FairingRule& rule, float* xyz) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const point::Vec3<Floats> here = load_vector(index.x, index.y, index.z, start);
    const point::Vec3<Floats> normal = load_vector(normals.x, normals.y, normals.z, start);
    store_points(fair_pack<kSeeksOutliers, kShares>(neighbors, weights_of(rule, neighbors, start), rule, here, normal,
                                                    normals, area, start),
                 xyz + 3 * (start % kLeafSize));
  });
}

// Moved positions, point after point into `xyz`; a zero normal leaves a point where it is.
inline void fair(const IndexView& index, Index leaf, Neighborhoods neighborhoods, VectorsView normals, AreaView area,
                 FairingRule rule, float* xyz) {
  const bool seeks = rule.squared_outlier_distance > 0, shares = rule.noise_variance > 0;
  const auto body = seeks ? (shares ? fair_leaf<true, true> : fair_leaf<true, false>)
                          : (shares ? fair_leaf<false, true> : fair_leaf<false, false>);
  body(index, leaf, neighborhoods, normals, area, rule, xyz);
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
