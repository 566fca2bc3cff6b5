// SPDX-License-Identifier: Apache-2.0
// The stages of src/point/stages.h over the points of one leaf, a pack at a time; neighbours from a list or, without a
// list, by a walk over everything within a radius in sorted order. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/pack.h"
#include "cpu/search.h"
#include "point/stages.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// Handles of neighbours, by sorted position: another one in each lane, the same in all, or the pack's own points.
struct Gathered {
  Ints at;
  POINTFAIR_INLINE Floats of(const float* values) const { return gather(values, at); }
};
struct Shared {
  Index at;
  POINTFAIR_INLINE Floats of(const float* values) const { return broadcast(values[at]); }
};
struct Own {
  Index start;
  POINTFAIR_INLINE Floats of(const float* values) const { return load(values + start); }
};

// What belongs to a point, for those handles.
struct Vectors {
  VectorsView view;
  template <class There>
  POINTFAIR_INLINE point::Vec3<Floats> at(There there) const {
    return {there.of(view.x), there.of(view.y), there.of(view.z)};
  }
};
struct Scalars {
  const float* values;
  template <class There>
  POINTFAIR_INLINE Floats of(There there) const {
    return there.of(values);
  }
};
struct Areas {
  AreaView area;
  template <class There>
  POINTFAIR_INLINE Floats of(There there) const {
    if (area.power == 0) return broadcast(1.0f);
    const Floats length = there.of(area.mean_distance);
    return area.power == 1 ? length : length * length;
  }
};

// Lists fill from the front, so the walk ends at the first slot that is empty in every lane.
class ListWalk {
 public:
  using Number = Floats;
  using Count = Floats;

  // list[slot * 16] is the first lane's entry
  POINTFAIR_INLINE ListWalk(const IndexView& index, Index start, const Index* list, int k)
      : index_(index), start_(start), list_(list), k_(k) {}

  template <class Load, class Visit>
  POINTFAIR_INLINE void operator()(Load load_there, Visit visit) const {
    const point::Vec3<Floats> here = {load(index_.x + start_), load(index_.y + start_), load(index_.z + start_)};
    const Ints empty = broadcast(int(point::kNoNeighbor));
    for (int slot = 0; slot < k_; ++slot) {
      const Ints listed = load(list_ + slot * kLeafSize);
      const Mask inside = listed != empty;
      if (!any(inside)) return;
      const Gathered at{select(inside, listed, broadcast(0))};
      const point::Vec3<Floats> there = {at.of(index_.x), at.of(index_.y), at.of(index_.z)};
      visit(there - here, load_there(at), inside);
    }
  }
  POINTFAIR_INLINE Floats squared_radius() const { return broadcast(1.0f); }  // lists have no width of their own
  POINTFAIR_INLINE Floats squared_core() const { return broadcast(__builtin_inff()); }
  POINTFAIR_INLINE Floats squared_horizon() const { return broadcast(0.0f); }
  POINTFAIR_INLINE static bool any(Mask mask) { return cpu::POINTFAIR_ISA::any(mask); }

 private:
  const IndexView& index_;
  Index start_;
  const Index* list_;
  int k_;
};

POINTFAIR_INLINE Floats value_or_one(const float* values, Index start) {
  return values == nullptr ? broadcast(1.0f) : load(values + start);
}

// For a function that writes to members which its callers, inlined elsewhere, read: GCC 12, which sees through
// noinline, kept what such a caller had read before the call (with SSE2 and AVX2; -fno-ipa-modref or
// -fno-strict-aliasing cure it).
#if __has_attribute(noipa)
#define POINTFAIR_OPAQUE __attribute__((noinline, noipa))
#else
#define POINTFAIR_OPAQUE __attribute__((noinline))
#endif

// Walks the tree from the root in sorted order, so that sums have one order whatever the instruction set. The
// neighbours are first found and then visited, in a loop that keeps the sums of `visit` in registers and has no branch
// to guess.
class RadiusWalk {
 public:
  using Number = Floats;
  using Count = Floats;

  POINTFAIR_INLINE RadiusWalk(const IndexView& index, Index start, const point::Radii& radii) : index_(index) {
    const Mask active = lane_numbers() < broadcast(int(index.points - start));
    const Floats own = load(radii.squared_radius + start);
    const Floats grown = radii.squared_growth == nullptr ? own : own * load(radii.squared_growth + start);
    queries_ = make_queries(index, start, active, grown);
    farthest_ = largest(queries_.limit);
    share_ = broadcast(1.0f);
    if (radii.min_neighbors > 0)
      share_ = select(active, point::kept_share(radii, value_or_one(radii.squared_level, start), own, queries_.limit),
                      broadcast(0.0f));
    largest_share_ = largest(share_);
    is_thinned_ = smallest(select(active, share_, broadcast(1.0f))) < 1.0f;
  }

  template <class Load, class Visit>
  POINTFAIR_INLINE void operator()(Load load_there, Visit visit) const {
    bool begins = true;
    do {
      if (!found_.has_all) search(begins);
      begins = false;
      for (int i = 0; i < found_.count; ++i) {
        const Index at = found_.at[i];
        const point::Vec3<Floats> there = spread(index_.x[at], index_.y[at], index_.z[at]);
        visit(there - queries_.position, load_there(Shared{at}), found_.inside[i]);
      }
    } while (!place_.is_end());
  }
  POINTFAIR_INLINE Floats squared_radius() const { return queries_.limit; }
  POINTFAIR_INLINE Floats squared_core() const { return point::squared_core(queries_.limit); }
  POINTFAIR_INLINE Floats squared_horizon() const {
    return select(share_ < broadcast(1.0f), broadcast(0.0f), queries_.limit);
  }
  POINTFAIR_INLINE static bool any(Mask mask) { return cpu::POINTFAIR_ISA::any(mask); }

 private:
  // Some of the neighbours of the pack's points, in sorted order: position and lanes.
  struct Found {
    static constexpr int kRoom = 512;
    Index at[kRoom];
    Mask inside[kRoom];
    int count = 0;
    bool has_all = false;  // a further walk visits them again
  };
  // Points that may be neighbours, by sorted position.
  struct Waiting {
    static constexpr int kRoom = 128;
    int at[kRoom + kLanes];
    int count = 0;
  };
  // What of the tree is still to be seen: on each level from the lowest, a group and its children that are near.
  struct Place {
    Index group[kMaxLevels];
    unsigned near[kMaxLevels];
    int level, levels;
    bool is_end() const { return level == levels; }
  };

  // Fills `found_` with the first neighbours, or with the next.
  POINTFAIR_OPAQUE void search(bool begins) const {
    if (begins) {
      place_.levels = index_.levels;
      place_.level = index_.levels - 1;
      enter(place_.level, 0);
    }
    found_.count = 0;
    while (!place_.is_end() && found_.count <= Found::kRoom - Waiting::kRoom) {
      Waiting waiting;
      collect(waiting);
      is_thinned_ ? keep_inside<true>(waiting) : keep_inside<false>(waiting);
    }
    found_.has_all = begins && place_.is_end();
  }

  // Points that are near the pack, until no further leaf may fit.
  void collect(Waiting& waiting) const {
    while (!place_.is_end() && waiting.count <= Waiting::kRoom - kLeafSize) {
      unsigned& near = place_.near[place_.level];
      if (near == 0) {
        ++place_.level;
        continue;
      }
      const Index child = place_.group[place_.level] * kLeafSize + Index(__builtin_ctz(near));
      near &= near - 1;
      if (place_.level > 0) {
        enter(--place_.level, child);
      } else {
        collect_leaf(child, waiting);
      }
    }
  }

  void enter(int level, Index group_number) const {
    const BoxGroup& group = index_.level[level][group_number];
    unsigned near = 0;
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const point::Vec3<Floats> min = {load(group.min_x + c), load(group.min_y + c), load(group.min_z + c)};
      const point::Vec3<Floats> max = {load(group.max_x + c), load(group.max_y + c), load(group.max_z + c)};
      near |= bits(point::squared_gap(min, max, queries_.min, queries_.max) <= broadcast(farthest_)) << c;
    }
    place_.group[level] = group_number;
    place_.near[level] = near;
  }

  void collect_leaf(Index leaf, Waiting& waiting) const {
    for (int c = 0; c < kLeafSize; c += kLanes) {
      const Index first = leaf * kLeafSize + Index(c);
      const point::Vec3<Floats> p = {load(index_.x + first), load(index_.y + first), load(index_.z + first)};
      Mask near = point::squared_gap(p, p, queries_.min, queries_.max) <= broadcast(farthest_);
      if (is_thinned_) near = near & (load(index_.share + first) < broadcast(largest_share_));
      waiting.count += append(waiting.at + waiting.count, int(first), near);
    }
  }

  // Those of them that are neighbours of a point of the pack.
  template <bool kThinned>
  void keep_inside(const Waiting& waiting) const {
    int count = found_.count;
    for (int i = 0; i < waiting.count; ++i) {
      const int at = waiting.at[i];
      const point::Vec3<Floats> offset = spread(index_.x[at], index_.y[at], index_.z[at]) - queries_.position;
      Mask inside = (point::squared_length(offset) <= queries_.limit) & ~(queries_.at == broadcast(at));
      if constexpr (kThinned) inside = inside & (broadcast(index_.share[at]) < share_);
      found_.at[count] = Index(at);
      found_.inside[count] = inside;
      count += any(inside);
    }
    found_.count = count;
  }

  const IndexView& index_;
  Queries queries_;
  float farthest_;  // the largest squared radius of the lanes
  Floats share_;    // of the neighbours that count
  float largest_share_;
  bool is_thinned_;
  mutable Found found_;
  mutable Place place_;
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
      body(start, RadiusWalk(index, start, neighborhoods.radii));
    }
  }
}

inline void mean_distances(const IndexView& index, Index leaf, const Index* list, int count, float* out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    Floats sum = broadcast(0.0f), found = broadcast(0.0f);
    const ListWalk listed(index, leaf * kLeafSize + Index(part), list + part, count);
    listed(point::LoadNothing{}, [&](point::Vec3<Floats> offset, point::Nothing, Mask inside) {
      sum = sum + select(inside, square_root(point::squared_length(offset)), broadcast(0.0f));
      found = found + select(inside, broadcast(1.0f), broadcast(0.0f));
    });
    store(out + part, point::mean_distance(sum, larger(found, broadcast(1.0f))));
  }
}

inline void squared_radii(const IndexView& index, Index leaf, const Index* list, const point::Radii& radii,
                          const float* squared_reach_level, float* out) {
  const auto farthest_of = [&](int part, int count) {  // the last that a lane's list has
    const Index start = leaf * kLeafSize + Index(part);
    Ints last = Ints{lane_numbers().v + int(start)};
    for (int slot = 0; slot < count; ++slot) {
      const Ints listed = load(list + slot * kLeafSize + part);
      last = select(listed != broadcast(int(point::kNoNeighbor)), listed, last);
    }
    const Vectors positions{{index.x, index.y, index.z}};
    return point::squared_length(positions.at(Gathered{last}) - positions.at(Own{start}));
  };
  const auto is_crowded = [&](Index at) {
    return at < index.points && point::is_crowded(at, 0, index.points, [&](Index i) {
             return index.x[i] == index.x[at] && index.y[i] == index.y[at] && index.z[i] == index.z[at];
           });
  };
  const int least = radii.min_neighbors < point::kLeastReached ? radii.min_neighbors : point::kLeastReached;
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    const Floats level = value_or_one(radii.squared_level, start), reach = farthest_of(part, radii.min_neighbors);
    store(out + part,
          point::squared_radius(reach, farthest_of(part, least), value_or_one(squared_reach_level, Index(part)),
                                level * radii.squared_base, radii.squared_widest));
    for (unsigned left = bits(reach <= broadcast(0.0f)); left != 0; left &= left - 1) {
      const Index lane = Index(__builtin_ctz(left));
      if (is_crowded(start + lane)) out[Index(part) + lane] = point::kNoSquaredRadius;
    }
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
// Point after point.
POINTFAIR_INLINE void store_points(point::Vec3<Floats> p, float* xyz) {
  for (int lane = 0; lane < kLanes; ++lane) {
    xyz[3 * lane] = p.x.v[lane];
    xyz[3 * lane + 1] = p.y.v[lane];
    xyz[3 * lane + 2] = p.z.v[lane];
  }
}

inline void normals(const IndexView& index, Index leaf, Neighborhoods neighborhoods, point::NormalRule rule,
                    VectorsOut out, unsigned* neighbor_counts) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const auto normal = point::normal_of(neighbors, point::weights_of(rule, neighbors.squared_radius()));
    store_vector(out, start, normal.unit);
    for (int lane = 0; lane < kLanes; ++lane)
      neighbor_counts[start % kLeafSize + Index(lane)] = unsigned(normal.found.v[lane]);
  });
}

template <bool kGrows>
__attribute__((noinline)) void filter_leaf(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods,
                                           const point::NormalRule& rule, float inverse_turn, VectorsView from,
                                           const float* further_share, VectorsOut out, GrowthOut growth) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const Vectors normals{from};
    const point::OwnNormal<Floats> own{normals.at(Own{start}), value_or_one(further_share, start)};
    const point::FilteredOfPoint<Floats> filtered =
        point::filtered_normal_of<kGrows>(neighbors, rule, inverse_turn, own, normals, growth.rule);
    store_vector(out, start, filtered.unit);
    if constexpr (kGrows) store(growth.squared_growth + start, filtered.squared_growth);
  });
}

inline void filter_normals(const IndexView& index, Index leaf, Neighborhoods neighborhoods, point::NormalRule rule,
                           float inverse_turn, VectorsView from, const float* further_share, VectorsOut out,
                           GrowthOut growth) {
  const auto filter = growth.squared_growth == nullptr ? filter_leaf<false> : filter_leaf<true>;
  filter(index, leaf, neighborhoods, rule, inverse_turn, from, further_share, out, growth);
}

inline void survey(const IndexView& index, Index leaf, Neighborhoods neighborhoods, const float* values, float* counts,
                   float* least) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const point::Survey<Floats> survey = point::survey_of(neighbors, load(values + start), Scalars{values});
    store(counts + start, survey.count);
    store(least + start, survey.least);
  });
}

// From the points of a pack to their sensors. Lanes past the last point get some place.
POINTFAIR_INLINE point::Vec3<Floats> to_sensors(const IndexView& index, const point::Sensors& sensors, Index start,
                                                point::Vec3<Floats> here) {
  if (sensors.each == nullptr) return spread(sensors.place.x, sensors.place.y, sensors.place.z) - here;
  float x[kLanes], y[kLanes], z[kLanes];
  for (Index lane = 0; lane < Index(kLanes); ++lane) {
    const Index at = start + lane < index.points ? start + lane : index.points - 1;
    const float* const its = sensors.each + 3 * std::size_t(index.original[at]);
    x[lane] = its[0], y[lane] = its[1], z[lane] = its[2];
  }
  return load_vector(x, y, z, 0) - here;
}

template <bool kSeeksOutliers, bool kShares, bool kSees>
__attribute__((noinline)) void fair_leaf(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods,
                                         VectorsView normals, AreaView area, const point::FairingRule& rule,
                                         const point::Sensors& sensors, point::Levels levels, float* xyz) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const Vectors of_points{normals};
    point::OwnPlace<Floats> own{value_or_one(levels.squared_noise, start),
                                value_or_one(levels.further_share, start),
                                load_vector(index.x, index.y, index.z, start),
                                of_points.at(Own{start}),
                                {}};
    if constexpr (kSees) own.to_sensor = to_sensors(index, sensors, start, own.here);
    const point::Vec3<Floats> there = point::faired_point<kSeeksOutliers, kShares, kSees>(
        neighbors, rule, own, of_points, Areas{area}, Scalars{neighborhoods.radii.squared_radius});
    store_points(there, xyz + 3 * (start % kLeafSize));
  });
}

template <bool kSees>
POINTFAIR_INLINE auto fairing_of(const point::FairingRule& rule) {
  const bool shares = rule.noise_variance > 0;
  return rule.squared_outlier_distance > 0 ? (shares ? fair_leaf<true, true, kSees> : fair_leaf<true, false, kSees>)
                                           : (shares ? fair_leaf<false, true, kSees> : fair_leaf<false, false, kSees>);
}

// Moved positions, point after point into `xyz`; a zero normal leaves a point where it is.
inline void fair(const IndexView& index, Index leaf, Neighborhoods neighborhoods, VectorsView normals, AreaView area,
                 point::FairingRule rule, point::Sensors sensors, point::Levels levels, float* xyz) {
  const auto fair_points = rule.sees() ? fairing_of<true>(rule) : fairing_of<false>(rule);
  fair_points(index, leaf, neighborhoods, normals, area, rule, sensors, levels, xyz);
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
