// SPDX-License-Identifier: Apache-2.0
// The body of each stage over any neighbourhood (src/point/neighborhoods.h): a backend adds the walk to the neighbours
// and what is run at once. `Vectors` has at(there), `Scalars` of(there), for the handle of a neighbour.
#pragma once

#include "point/fairing.h"
#include "point/neighborhoods.h"
#include "point/noise_field.h"
#include "point/normal.h"
#include "point/outliers.h"
#include "point/sensor.h"
#include "point/settings.h"

namespace pointfair::point {

template <class Neighbors>
using NumberOf = typename Neighbors::Number;

template <class Neighbors>
using KernelOf = typename Neighbors::Kernel;

template <class Neighbors>
POINTFAIR_INLINE auto weights_of(const NormalSettings& settings, const Neighbors& neighbors) {
  using F = NumberOf<Neighbors>;
  constexpr float kScale = KernelOf<Neighbors>::kScale;
  const NormalWeights weights = normal_weights(settings.sigma);
  const F own = F(weights.inverse_two_sigma2 * kScale), twice = F(weights.inverse_sigma2 * kScale);
  using Weights = LocalNormalWeights<F, KernelOf<Neighbors>>;
  if (!settings.of_radius) return Weights{own, twice};
  return Weights{own / neighbors.squared_radius(), twice / neighbors.squared_radius()};
}

template <class Neighbors>
POINTFAIR_INLINE auto weights_of(const FairingSettings& settings, const Neighbors& neighbors,
                                 NumberOf<Neighbors> squared_level) {
  using F = NumberOf<Neighbors>;
  constexpr float kScale = KernelOf<Neighbors>::kScale;
  const BilateralWeights weights = bilateral_weights(settings.closeness_sigma, settings.similarity_sigma);
  const F closeness = F(weights.inverse_two_closeness2 * kScale),
          similarity = F(weights.inverse_two_similarity2 * kScale);
  return LocalBilateralWeights<F, KernelOf<Neighbors>>{
      settings.closeness_of_radius ? closeness / neighbors.squared_radius() : closeness,
      settings.similarity_follows ? similarity / squared_level : similarity};
}

// The normal by Eq. 3 to 5.
template <class F, class Count>
struct NormalOfPoint {
  Vec3<F> unit;  // zero where there is none
  Count found;   // neighbours
};

template <class Neighbors, class Weights>
POINTFAIR_DEVICE_INLINE auto normal_of(const Neighbors& neighbors, Weights weights) {
  using F = NumberOf<Neighbors>;
  using Count = typename Neighbors::Count;
  CentroidSum<F> centroid_sum;
  Count found{};
  neighbors(LoadNothing{}, [&](Vec3<F> offset, Nothing, auto inside) {
    centroid_sum.add(offset, inside, weights);
    found = counted(found, inside);
  });
  const Vec3<F> centroid = centroid_sum.centroid();
  CovarianceSum<F> covariance;
  neighbors(LoadNothing{},
            [&](Vec3<F> offset, Nothing, auto inside) { covariance.add(offset, centroid, inside, weights); });
  const auto enough = Count(static_cast<float>(kLeastNeighbors - 1)) < found;
  return NormalOfPoint<F, Count>{select<F>(enough, covariance.normal().unit, Vec3<F>{}), found};
}

// What the filter of normals reads of the point itself.
template <class F>
struct OwnNormal {
  Vec3<F> unit;
  F share;  // share of the filter that the point takes (further_share)
};

// Eq. 9, and what Eq. 20 multiplies the squared radius by, up to a radius of the square `squared_widest`.
template <class F>
struct FilteredOfPoint {
  Vec3<F> unit;
  F squared_growth;
};

template <bool kGrows, class Neighbors, class Vectors>
POINTFAIR_DEVICE_INLINE FilteredOfPoint<NumberOf<Neighbors>> filtered_normal_of(const Neighbors& neighbors,
                                                                                const NormalSettings& settings,
                                                                                OwnNormal<NumberOf<Neighbors>> own,
                                                                                const Vectors& normals,
                                                                                float squared_widest) {
  using F = NumberOf<Neighbors>;
  const auto weights = weights_of(settings, neighbors);
  const float inverse_turn = point::inverse_turn(settings.crease_angle) * KernelOf<Neighbors>::kRootScale;
  FilteredNormal<F> filtered(own.unit);
  MeanTurn<F> turn;
  neighbors([&](auto there) { return normals.at(there); },
            [&](Vec3<F> offset, Vec3<F> normal, auto inside) {
              filtered.add(offset, normal, inside, weights, inverse_turn);
              if constexpr (kGrows) turn.add(dot(own.unit, normal), inside);
            });
  return {turned(own.unit, filtered.unit(), own.share),
          turn.squared_growth(settings.flat_scale * settings.flat_scale, neighbors.squared_radius(), squared_widest)};
}

// What the sums read of a neighbour beside its place: a vector, and its area's weight.
template <class F>
struct alignas(sizeof(F) == 4 ? 16 : alignof(F)) WithArea {
  Vec3<F> vector;
  F area;
};

// d_i of Eq. 6; `visited` sees the offset of each neighbour too.
template <class Neighbors, class Weights, class Areas, class Visited>
POINTFAIR_DEVICE_INLINE NumberOf<Neighbors> paper_distance(const Neighbors& neighbors, Weights weights,
                                                           Vec3<NumberOf<Neighbors>> normal, const Areas& areas,
                                                           Visited visited) {
  using F = NumberOf<Neighbors>;
  BilateralSum<F> sum;
  neighbors([&](auto there) { return areas.of(there); },
            [&](Vec3<F> offset, F area, auto inside) {
              visited(offset, inside);
              sum.add(offset, normal, area, inside, weights);
            });
  return sum.distance();
}

// d_i of Eq. 10.
template <class Neighbors, class Weights, class Vectors, class Areas, class Visited>
POINTFAIR_DEVICE_INLINE NumberOf<Neighbors> symmetric_distance(const Neighbors& neighbors, Weights weights,
                                                               int turn_angle, Vec3<NumberOf<Neighbors>> normal,
                                                               const Vectors& normals, const Areas& areas,
                                                               Visited visited) {
  using F = NumberOf<Neighbors>;
  const float inverse_turn = point::inverse_turn(turn_angle) * KernelOf<Neighbors>::kRootScale;
  SymmetricSum<F> sum;
  neighbors(
      [&](auto there) {
        return WithArea<F>{normals.at(there), areas.of(there)};
      },
      [&](Vec3<F> offset, const WithArea<F>& there, auto inside) {
        visited(offset, inside);
        sum.add(offset, normal, there.vector, there.area, inside, weights, inverse_turn);
      });
  return sum.distance();
}

// The distance of Eq. 6 or of Eq. 10. GCC 12 would call a lambda of the caller for each pack, with its arguments in
// memory, so this is a function of its own.
template <class Neighbors, class Weights, class Vectors, class Areas, class Visited>
POINTFAIR_DEVICE_INLINE NumberOf<Neighbors> bilateral_distance(const Neighbors& neighbors,
                                                               const FairingSettings& settings, Weights weights,
                                                               Vec3<NumberOf<Neighbors>> normal, const Vectors& normals,
                                                               const Areas& areas, Visited visited) {
  return settings.symmetric
             ? symmetric_distance(neighbors, weights, settings.turn_angle, normal, normals, areas, visited)
             : paper_distance(neighbors, weights, normal, areas, visited);
}

// A mean of an outlier's neighbours (PullSum). `squared_radii` are not read for lists.
template <class Neighbors, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> pull_of(const Neighbors& neighbors,
                                                          NumberOf<Neighbors> inverse_two_closeness2,
                                                          const Scalars& squared_radii) {
  using F = NumberOf<Neighbors>;
  PullSum<F> sum;
  if constexpr (!Neighbors::kListed) {
    const F own = neighbors.squared_radius();
    neighbors([&](auto there) { return squared_radii.of(there); },
              [&](Vec3<F> offset, F there, auto inside) { sum.add_by_density(offset, inside, own, there); });
  } else {
    neighbors(LoadNothing{}, [&](Vec3<F> offset, Nothing, auto inside) {
      sum.add_by_closeness(offset, inside, inverse_two_closeness2);
    });
  }
  return sum.mean();
}

// A displacement d > limit becomes limit^2 / d, as in limited() of outliers.h.
template <class F>
POINTFAIR_INLINE F softly_limited(F distance, F limit) {
  return select(distance * distance > limit * limit, limit * limit / distance, distance);
}

// What the bilateral step reads of the point itself.
template <class F>
struct OwnPlace {
  F squared_level;  // of the noise
  F further_share;  // of the displacement, in iterations after the first; else 1
  Vec3<F> here, normal;
  Vec3<F> to_sensor;  // read where settings.reads_sensor()
};

// Whether a point is an outlier, and why.
template <class F>
struct Verdict {
  using Mask = decltype(F() < F());
  Mask is_outlier;
  F reason;  // place_of(Outlier), where it is one
};

// `distance` along the normal; `squared_distance` is that of outliers at the point.
template <bool kSees, class Neighbors, class Mask, class F = NumberOf<Neighbors>>
POINTFAIR_DEVICE_INLINE Verdict<F> verdict_of(const Neighbors& neighbors, const FairingSettings& settings,
                                              const Agreement<F>& agreement, const BeamNeighbors<F>& beam_neighbors,
                                              Mask is_sparse, F distance, F squared_distance) {
  Verdict<F> verdict{
      typename Verdict<F>::Mask(agreement.is_missing(is_sparse)),
      select(agreement.is_isolated(is_sparse), F(place_of(Outlier::isolated)), F(place_of(Outlier::off_surface)))};
  if constexpr (kSees) {
    if (settings.along_ray) {  // what limited() sees of points that move along the normal
      verdict.reason = select(verdict.is_outlier, verdict.reason, F(place_of(Outlier::off_surface)));
      verdict.is_outlier = verdict.is_outlier | (distance * distance > squared_distance);
    }
    if (settings.seeks_mixed_pixels()) {
      // lists have all neighbours up to their last
      const F horizon = Neighbors::kListed ? beam_neighbors.squared_farthest : neighbors.squared_horizon();
      const auto is_mixed = beam_neighbors.is_mixed_pixel(horizon, agreement.lacks_plane());
      verdict.reason = select(is_mixed, F(place_of(Outlier::mixed_pixel)), verdict.reason);
      verdict.is_outlier = verdict.is_outlier | is_mixed;
    }
  }
  return verdict;
}

// Where a point is after its step of `distance`.
template <bool kSees, class F>
POINTFAIR_DEVICE_INLINE Vec3<F> place_after(const FairingSettings& settings, const OwnPlace<F>& own, F distance) {
  const F strength = own.further_share * settings.strength;
  if constexpr (kSees) {
    if (settings.along_ray) {
      if (settings.farthest > 0)
        distance =
            softly_limited(distance, settings.farthest_follows ? square_root(own.squared_level) * settings.farthest
                                                               : F(settings.farthest));
      return own.here + along_ray((F{} - distance * strength) * own.normal, own.to_sensor);
    }
  }
  return moved(own.here, own.normal, distance * strength);
}

// Where a point goes by the bilateral method: along its normal or its ray, by the share that noise justifies; an
// outlier becomes NaN or goes to a mean of its neighbours. More than one instance: what outliers, shares and sensors
// need would take registers from the loop that does without.
template <bool kSeeksOutliers, bool kShares, bool kSees, class Neighbors, class Vectors, class Areas, class Scalars>
POINTFAIR_DEVICE_INLINE Vec3<NumberOf<Neighbors>> faired_point(const Neighbors& neighbors,
                                                               const FairingSettings& settings,
                                                               const OwnPlace<NumberOf<Neighbors>>& own,
                                                               const Vectors& normals, const Areas& areas,
                                                               const Scalars& squared_radii) {
  using F = NumberOf<Neighbors>;
  const F squared_level = own.squared_level;
  const Vec3<F> normal = own.normal;
  const auto weights = weights_of(settings, neighbors, squared_level);
  Agreement<F> agreement;
  HeightSpread<F> spread;
  const F squared_outlier_distance =
      larger(F(settings.outlier_distance * settings.outlier_distance),
             squared_level * (settings.level_outlier_distance * settings.level_outlier_distance));
  const F own_core = neighbors.squared_core();
  const F squared_core = larger(own_core, squared_outlier_distance);
  const auto is_sparse = own_core > F(point::squared_core(settings.outlier_radius * settings.outlier_radius));
  const F squared_slab =
      select(is_sparse, larger(squared_outlier_distance, own_core * F(kSparseSlab)), squared_outlier_distance);
  BeamNeighbors<F> beam_neighbors(own.to_sensor, settings.beam_width * settings.beam_width, squared_outlier_distance);
  F distance =
      bilateral_distance(neighbors, settings, weights, normal, normals, areas, [&](Vec3<F> offset, auto inside) {
        if constexpr (kSeeksOutliers && kSees) beam_neighbors.add(offset, inside);
        if constexpr (kSeeksOutliers || kShares) {
          const F height = dot(normal, offset);
          if constexpr (kShares) spread.add(height, inside);
          if constexpr (kSeeksOutliers) agreement.add(offset, height, inside, squared_slab, squared_core);
        }
      });
  if constexpr (kShares)
    distance = distance * noise_share(spread.variance(), squared_level * (settings.noise * settings.noise),
                                      settings.is_further ? kNoiseLeft : 1.0f, settings.damage,
                                      settings.trusted * settings.trusted);
  const Vec3<F> there = place_after<kSees>(settings, own, distance);
  if constexpr (!kSeeksOutliers) {
    return there;
  } else {
    const Verdict<F> verdict = verdict_of<kSees>(neighbors, settings, agreement, beam_neighbors, is_sparse, distance,
                                                 squared_outlier_distance);
    // a point without a normal keeps its place
    const auto is_outlier = verdict.is_outlier & (squared_length(normal) > F{});
    if (!neighbors.any(is_outlier)) return there;
    if (!settings.pull_outliers) return select<F>(is_outlier, {verdict.reason, verdict.reason, verdict.reason}, there);
    const Vec3<F> pull =
        pull_of(neighbors, weights.inverse_two_closeness2 * F(1 / KernelOf<Neighbors>::kScale), squared_radii);
    return select<F>(is_outlier, own.here + F(settings.strength) * pull, there);
  }
}

// How many neighbours a point has, and the least of `values` over it and them.
template <class F>
struct Survey {
  F count, least;
};

template <class Neighbors, class Scalars>
POINTFAIR_DEVICE_INLINE Survey<NumberOf<Neighbors>> survey_of(const Neighbors& neighbors, NumberOf<Neighbors> own,
                                                              const Scalars& values) {
  using F = NumberOf<Neighbors>;
  Survey<F> survey{F{}, own};
  neighbors([&](auto there) { return values.of(there); },
            [&](Vec3<F>, F value, auto inside) {
              survey.count = survey.count + select(inside, F(1.0f), F{});
              survey.least = select(inside, smaller(survey.least, value), survey.least);
            });
  return survey;
}

}  // namespace pointfair::point
