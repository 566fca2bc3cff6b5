// SPDX-License-Identifier: Apache-2.0
// Projection of one point onto its moving-least-squares surface: a quadratic polynomial over a local plane (Levin 2003;
// Alexa and others 2003), Eq. 16 of docs/methods.md.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

inline constexpr int kQuadricTerms = 6;
// Added to the diagonal of the normal equations, as a share of it, constant term aside: where the neighbours do not
// determine a term, it vanishes and a plane remains; elsewhere it is below the rounding of float sums.
inline constexpr float kQuadricRidge = 1e-4f;

// The weighted least-squares polynomial of the heights over the plane through q = v_i + height n_i, n_i its normal, in
// coordinates along the plane in units of sqrt(2) sigma_c. Weights are by distance from q; v_i is one of the samples.
template <class F>
class QuadricFit {
 public:
  template <class Weights>
  POINTFAIR_INLINE QuadricFit(Vec3<F> normal, F height, F own_area, Weights weights)
      : normal_(normal), height_(height), scale_(square_root(F(1.0f) * weights.inverse_two_closeness2)) {
    // an orthonormal basis without a branch (Duff and others 2017)
    const F sign = select(normal.z < F{}, F(-1.0f), F(1.0f));
    const F a = F(-1.0f) / (sign + normal.z), b = normal.x * normal.y * a;
    u_ = {sign * normal.x * normal.x * a + 1.0f, sign * b, -(sign * normal.x)};
    v_ = {b, normal.y * normal.y * a + sign, -normal.y};
    add(Vec3<F>{}, own_area, F{} < F(1.0f), weights);
  }

  // offset is v_j - v_i; area is W_a(v_j)
  template <class Mask, class Weights>
  POINTFAIR_INLINE void add(Vec3<F> offset, F area, Mask inside, Weights weights) {
    const Vec3<F> from_q = select<F>(inside, offset - height_ * normal_, Vec3<F>{});
    const F closeness = gaussian(squared_length(from_q) * weights.inverse_two_closeness2);
    const F w = select(inside, closeness * (area * weights.inverse_two_closeness2), F{});
    const F u = dot(u_, from_q) * scale_, v = dot(v_, from_q) * scale_, h = dot(normal_, from_q);
    const F terms[kQuadricTerms] = {F(1.0f), u, v, u * u, u * v, v * v};
    for (int row = 0; row < kQuadricTerms; ++row) {
      const F weighted = w * terms[row];
      for (int column = 0; column <= row; ++column)
        products_[row][column] = products_[row][column] + weighted * terms[column];
      moments_[row] = moments_[row] + weighted * h;
    }
  }

  // Height of the polynomial above v_i, where the normal through v_i meets it; 0 where all weights vanish.
  POINTFAIR_INLINE F height() const {
    const F weight = products_[0][0];
    const F inverse = select(weight > F{}, F(1.0f) / weight, F{});
    F a[kQuadricTerms][kQuadricTerms], x[kQuadricTerms];
    for (int row = 0; row < kQuadricTerms; ++row) {
      for (int column = 0; column <= row; ++column) a[row][column] = products_[row][column] * inverse;
      if (row > 0) a[row][row] = a[row][row] * (1.0f + kQuadricRidge);
      x[row] = moments_[row] * inverse;
    }
    return select(weight > F{}, height_ + constant_term(a, x), F{});
  }

 private:
  // Elimination without pivoting: the matrix is positive definite, or its pivots vanish and their terms with them.
  static POINTFAIR_INLINE F constant_term(F (&a)[kQuadricTerms][kQuadricTerms], F (&x)[kQuadricTerms]) {
    for (int p = 0; p < kQuadricTerms; ++p) {
      const F inverse = select(a[p][p] > F(1e-30f), F(1.0f) / a[p][p], F{});
      for (int row = p + 1; row < kQuadricTerms; ++row) {
        const F factor = a[row][p] * inverse;
        for (int column = p + 1; column <= row; ++column) a[row][column] = a[row][column] - factor * a[column][p];
        x[row] = x[row] - factor * x[p];
      }
      a[p][p] = inverse;
    }
    for (int p = kQuadricTerms - 1; p >= 0; --p) {
      for (int row = p + 1; row < kQuadricTerms; ++row) x[p] = x[p] - a[row][p] * x[row];
      x[p] = x[p] * a[p][p];
    }
    return x[0];
  }

  Vec3<F> normal_, u_, v_;
  F height_, scale_;
  F products_[kQuadricTerms][kQuadricTerms] = {};  // the lower triangle
  F moments_[kQuadricTerms] = {};
};

}  // namespace pointfair::point
