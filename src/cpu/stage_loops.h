// SPDX-License-Identifier: Apache-2.0
// The stages of src/point/stages.h over the points of one leaf, a pack at a time. Part of src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/neighbor_walks.h"
#include "cpu/pack.h"
#include "point/stages.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// Squared distances to what is listed for each point of a leaf, as nearest_distances gives them.
inline void listed_distances(const IndexView& index, Index leaf, const Index* list, int count, float* out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Vectors positions{{index.x, index.y, index.z}};
    const point::Vec3<Floats> here = positions.at(Own{leaf * kLeafSize + Index(part)});
    for (int slot = 0; slot < count; ++slot) {
      const Ints listed = load(list + slot * kLeafSize + part);
      const Mask exists = listed != broadcast(int(point::kNoNeighbor));
      const Floats squared = point::squared_length(positions.at(Gathered{select(exists, listed, broadcast(0))}) - here);
      store(out + slot * kLeafSize + part, select(exists, squared, broadcast(kInfinity)));
    }
  }
}

inline void mean_distances(const float* squared, int count, float* out) {
  for (int part = 0; part < kLeafSize; part += kLanes) {
    Floats sum = broadcast(0.0f), found = broadcast(0.0f);
    for (int slot = 0; slot < count; ++slot) {
      const Floats here = load(squared + slot * kLeafSize + part);
      const Mask exists = here < broadcast(kInfinity);
      sum = sum + select(exists, square_root(here), broadcast(0.0f));
      found = counted(found, exists);
    }
    store(out + part, point::mean_distance(sum, larger(found, broadcast(1.0f))));
  }
}

inline void squared_radii(const IndexView& index, Index leaf, const float* squared, const point::Radii& radii,
                          const float* squared_reach_level, float* out) {
  const auto farthest_of = [&](int part, int count) {  // the last of each lane's that exists
    Floats last = broadcast(0.0f);
    for (int slot = 0; slot < count; ++slot) {
      const Floats here = load(squared + slot * kLeafSize + part);
      last = select(here < broadcast(kInfinity), here, last);
    }
    return last;
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

// As point::NodePlace of each lane.
struct NodePlaces {
  Ints below;
  Floats above;
};
POINTFAIR_INLINE NodePlaces node_places(const point::NodeField& field, Floats coordinate, float first) {
  Floats place = (coordinate - first) * field.nodes_per_unit;
  place = select(place > broadcast(0.0f), place, broadcast(0.0f));
  place = smaller(place, broadcast(float(field.nodes - 1)));
  const Ints below = smaller(truncated(place), broadcast(field.nodes - 2));
  return {below, place - as_numbers(below)};
}

// The squares of point::node_value.
inline void squared_levels(const IndexView& index, Index leaf, const point::NodeField& field, float* out) {
  const auto between = [](Floats from, Floats to, Floats share) { return from + share * (to - from); };
  const int row = field.nodes, face = row * row;
  for (int part = 0; part < kLeafSize; part += kLanes) {
    const Index start = leaf * kLeafSize + Index(part);
    const NodePlaces x = node_places(field, load(index.x + start), field.first.x),
                     y = node_places(field, load(index.y + start), field.first.y),
                     z = node_places(field, load(index.z + start), field.first.z);
    const Ints corner{(z.below.v * row + y.below.v) * row + x.below.v};
    const auto along_x = [&](const float* values) {
      return between(gather(values, corner), gather(values + 1, corner), x.above);
    };
    const auto in_face = [&](const float* values) { return between(along_x(values), along_x(values + row), y.above); };
    const Floats level = between(in_face(field.values), in_face(field.values + face), z.above);
    store(out + part, level * level);
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

inline void normals(const IndexView& index, Index leaf, Neighborhoods neighborhoods,
                    const point::NormalSettings& settings, VectorsOut out, unsigned* neighbor_counts, Notes& notes) {
  for_packs(index, leaf, neighborhoods, [&](Index start, const auto& neighbors) {
    const auto normal = point::normal_of(neighbors, point::weights_of(settings, neighbors));
    store_vector(out, start, normal.unit);
    for (int lane = 0; lane < kLanes; ++lane)
      neighbor_counts[start % kLeafSize + Index(lane)] = unsigned(normal.found.v[lane]);
    if constexpr (requires { neighbors.note(notes); })
      if (notes.next != nullptr) neighbors.note(notes);
  });
}

template <bool kGrows>
__attribute__((noinline)) void filter_leaf(const IndexView& index, Index leaf, const Neighborhoods& neighborhoods,
                                           const point::NormalSettings& settings, VectorsView from,
                                           const float* further_share, VectorsOut out, float* squared_growth,
                                           Notes& notes) {
  for_noted_packs(index, leaf, neighborhoods, notes, [&](Index start, const auto& neighbors) {
    const Vectors normals{from};
    const point::OwnNormal<Floats> own{normals.at(Own{start}), value_or_one(further_share, start)};
    const point::FilteredOfPoint<Floats> filtered =
        point::filtered_normal_of<kGrows>(neighbors, settings, own, normals, neighborhoods.radii.squared_widest);
    store_vector(out, start, filtered.unit);
    if constexpr (kGrows) store(squared_growth + start, filtered.squared_growth);
  });
}

inline void filter_normals(const IndexView& index, Index leaf, Neighborhoods neighborhoods,
                           const point::NormalSettings& settings, VectorsView from, const float* further_share,
                           VectorsOut out, float* squared_growth, Notes& notes) {
  const auto filter = squared_growth == nullptr ? filter_leaf<false> : filter_leaf<true>;
  filter(index, leaf, neighborhoods, settings, from, further_share, out, squared_growth, notes);
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
                                         VectorsView normals, AreaView area, const point::FairingSettings& settings,
                                         const point::Sensors& sensors, point::Levels levels, Notes& notes,
                                         float* xyz) {
  for_noted_packs(index, leaf, neighborhoods, notes, [&](Index start, const auto& neighbors) {
    const Vectors of_points{normals};
    point::OwnPlace<Floats> own{value_or_one(levels.squared_noise, start),
                                value_or_one(levels.further_share, start),
                                load_vector(index.x, index.y, index.z, start),
                                of_points.at(Own{start}),
                                {}};
    if constexpr (kSees) own.to_sensor = to_sensors(index, sensors, start, own.here);
    const point::Vec3<Floats> there = point::faired_point<kSeeksOutliers, kShares, kSees>(
        neighbors, settings, own, of_points, Areas{area}, Scalars{neighborhoods.radii.squared_radius});
    store_points(there, xyz + 3 * (start % kLeafSize));
  });
}

template <bool kSees>
POINTFAIR_INLINE auto fairing_of(const point::FairingSettings& settings) {
  const bool shares = settings.shares();
  return settings.seeks_outliers() ? (shares ? fair_leaf<true, true, kSees> : fair_leaf<true, false, kSees>)
                                   : (shares ? fair_leaf<false, true, kSees> : fair_leaf<false, false, kSees>);
}

// Moved positions, point after point into `xyz`; a zero normal leaves a point where it is.
inline void fair(const IndexView& index, Index leaf, Neighborhoods neighborhoods, VectorsView normals, AreaView area,
                 const point::FairingSettings& settings, point::Sensors sensors, point::Levels levels, Notes& notes,
                 float* xyz) {
  const auto fair_points = settings.reads_sensor() ? fairing_of<true>(settings) : fairing_of<false>(settings);
  fair_points(index, leaf, neighborhoods, normals, area, settings, sensors, levels, notes, xyz);
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
