// SPDX-License-Identifier: Apache-2.0
// The Gaussian-weighted normal of one point: paper eq. 3-5, Eq. 3-5 of docs/how-it-works.md.
// Two rounds over the neighbours, in neighbour order: first their weighted centroid, then the covariance about it.
// Offsets are v_j - v_i, so nothing large is ever subtracted from something large. `inside` is false for what is no
// neighbour, an empty place of a list for instance; whatever finite offset it has, it adds exact zeros.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

struct NormalWeights {
  using Kernel = Gaussian;
  float inverse_two_sigma2;  // 1 / (2 sigma^2), for w_g
  float inverse_sigma2;      // 1 / sigma^2, for the square of w_g in eq. 3
};

POINTFAIR_INLINE NormalWeights normal_weights(float sigma) {
  const float sigma2 = sigma * sigma;
  return {0.5f / sigma2, 1.0f / sigma2};
}

// NormalWeights that may differ from point to point.
template <class F, class Its>
struct LocalNormalWeights {
  using Kernel = Its;
  F inverse_two_sigma2, inverse_sigma2;
};

// Paper eq. 4, normalised.
template <class F>
struct CentroidSum {
  F weight{};
  Vec3<F> moment{};

  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> offset, Mask inside, Weights weights) {
    const F w = select(inside, Weights::Kernel::of(squared_length(offset) * weights.inverse_two_sigma2), F{});
    weight = weight + w;
    moment = moment + w * offset;
  }
  POINTFAIR_INLINE Vec3<F> centroid() const {
    const F inverse = select(weight > F{}, F(1.0f) / weight, F{});
    return inverse * moment;
  }
};

// Paper eq. 3: the weight appears twice, so squared.
template <class F>
struct CovarianceSum {
  Sym3<F> sum{};

  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> centroid, Mask inside, Weights weights) {
    const Vec3<F> d = offset - centroid;
    const F w2 = select(inside, Weights::Kernel::of(squared_length(d) * weights.inverse_sigma2), F{});
    const Vec3<F> wd = w2 * d;
    sum.xx = sum.xx + wd.x * d.x;
    sum.xy = sum.xy + wd.x * d.y;
    sum.xz = sum.xz + wd.x * d.z;
    sum.yy = sum.yy + wd.y * d.y;
    sum.yz = sum.yz + wd.y * d.z;
    sum.zz = sum.zz + wd.z * d.z;
  }
  POINTFAIR_INLINE Direction<F> normal() const { return least_eigenvector(sum); }
};

// 1 / (1 - cos angle), up to 120 degrees: with it, turn_exponent is 1 for normals that differ by `degrees`; 0 for no
// weight.
POINTFAIR_INLINE float inverse_turn(int degrees) {
  if (degrees == 0) return 0.0f;
  const float half = cosine_to_sixty_degrees(0.00872664626f * static_cast<float>(degrees));
  return 0.5f / (1.0f - half * half);  // 1 - cos a = 2 (1 - cos^2(a / 2))
}

// The exponent of a Gaussian over how far two unit normals of arbitrary sign differ, 1 - |cos|.
template <class F>
POINTFAIR_INLINE F turn_exponent(F cosine, float inverse_turn) {
  const F turn = (F(1.0f) - absolute(cosine)) * inverse_turn;
  return turn * turn;
}

// One round of bilateral filtering of the normals (Jones, Durand and Zwicker 2004; Zheng and others 2011), Eq. 9 of
// docs/how-it-works.md: neighbours count by distance and by how little their normal differs.
template <class F>
struct FilteredNormal {
  Vec3<F> normal;  // of the point itself
  Vec3<F> sum;

  POINTFAIR_INLINE explicit FilteredNormal(Vec3<F> its_normal) : normal(its_normal), sum(its_normal) {}

  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> offset, Vec3<F> there, Mask inside, Weights weights, float inverse_turn) {
    const F cosine = dot(normal, there);
    const F exponent = squared_length(offset) * weights.inverse_two_sigma2 + turn_exponent(cosine, inverse_turn);
    const F w = select(inside, Weights::Kernel::of(exponent), F{});
    sum = sum + select(cosine < F{}, -w, w) * there;  // whichever of the two opposites makes the smaller angle
  }
  // zero where there was no normal
  POINTFAIR_INLINE Vec3<F> unit() const {
    const F squared = squared_length(sum);
    const F inverse = select(squared > F{}, F(1.0f) / square_root(squared), F{});
    return select<F>(squared_length(normal) > F{}, inverse * sum, Vec3<F>{});
  }
};

// From one unit vector a share of the way to another that makes an acute angle with it; zero stays zero.
template <class F>
POINTFAIR_INLINE Vec3<F> turned(Vec3<F> from, Vec3<F> to, F share) {
  const Vec3<F> between = from + share * (to - from);
  const F squared = squared_length(between);
  const F inverse = select(squared > F{}, F(1.0f) / square_root(squared), F{});
  return select<F>(share < F(1.0f), inverse * between, to);
}

// How far the normals of a neighbourhood turn from that of its point, and what its radius grows by where that is next
// to nothing: Eq. 20 of docs/how-it-works.md.
template <class F>
struct MeanTurn {
  F sum{}, count{};

  // cosine of the two normals, of any sign; 0 where a point has none
  template <class Mask>
  POINTFAIR_INLINE void add(F cosine, Mask inside) {
    sum = sum + select(inside, F(1.0f) - absolute(cosine), F{});
    count = count + select(inside, F(1.0f), F{});
  }
  // Up to `most`, and to a squared radius of `squared_widest` (Radii::squared_widest).
  POINTFAIR_INLINE F squared_growth(float most, F squared_radius, float squared_widest) const {
    constexpr float kFlat = 0.001f, kBent = 0.003f;  // 1 - cosine: of 2.6 and of 4.4 degrees
    const F share = (F(kBent) * count - sum) / (F(kBent - kFlat) * larger(count, F(1.0f)));
    const F growth = F(1.0f) + F(most - 1.0f) * smaller(larger(share, F{}), F(1.0f));
    return larger(F(1.0f), smaller(growth, F(squared_widest) / squared_radius));
  }
};

}  // namespace pointfair::point
