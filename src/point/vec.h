// SPDX-License-Identifier: Apache-2.0
// Small vectors and matrices over a number type F: `float` in CUDA and scalar code, a SIMD pack of floats in the CPU
// backend. A pack type brings its own `select`, `square_root`, `absolute`, `power_of_two_times` and comparison results,
// so every formula here and in the other headers of this folder exists once. No fused multiply-add anywhere (the build
// forbids the compiler to make one), so that all instruction sets and the GPU round alike.
#pragma once

#if defined(__CUDACC__)
#define POINTFAIR_INLINE __host__ __device__ __forceinline__
#define POINTFAIR_DEVICE_INLINE __device__ __forceinline__  // calls what a card alone can run
#else
#define POINTFAIR_INLINE inline __attribute__((always_inline))
#define POINTFAIR_DEVICE_INLINE POINTFAIR_INLINE
#endif

namespace pointfair::point {

// What F must offer, for F = float, and what of it F = double needs.
POINTFAIR_INLINE float select(bool condition, float yes, float no) { return condition ? yes : no; }
POINTFAIR_INLINE double select(bool condition, double yes, double no) { return condition ? yes : no; }
POINTFAIR_INLINE int counted(int count, bool one_more) { return count + one_more; }
POINTFAIR_INLINE float square_root(float x) { return __builtin_sqrtf(x); }
POINTFAIR_INLINE double square_root(double x) { return __builtin_sqrt(x); }
POINTFAIR_INLINE float absolute(float x) { return __builtin_fabsf(x); }

// `value` times 2^n, where `shifted` is n + 1.5 * 2^23: the low bits of that sum are n.
POINTFAIR_INLINE float power_of_two_times(float value, float shifted) {
  union {
    float f;
    unsigned u;
  } bits = {shifted}, result = {value};
  result.u += bits.u << 23;
  return result.f;
}

template <class F>
POINTFAIR_INLINE F smaller(F a, F b) {
  return select(b < a, b, a);
}
template <class F>
POINTFAIR_INLINE F larger(F a, F b) {
  return select(a < b, b, a);
}

template <class F>
struct Vec3 {
  F x, y, z;
};

template <class F>
POINTFAIR_INLINE Vec3<F> operator+(Vec3<F> a, Vec3<F> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class F>
POINTFAIR_INLINE Vec3<F> operator-(Vec3<F> a, Vec3<F> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class F>
POINTFAIR_INLINE Vec3<F> operator*(F s, Vec3<F> a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class F>
POINTFAIR_INLINE F dot(Vec3<F> a, Vec3<F> b) {
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}
template <class F>
POINTFAIR_INLINE Vec3<F> cross(Vec3<F> a, Vec3<F> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// The one place where a squared distance is rounded: neighbour order, box tests and brute force all agree to the bit.
// Monotone in each |coordinate|, so the distance to a box computed with it is never above that to a point inside.
template <class F>
POINTFAIR_INLINE F squared_length(Vec3<F> a) {
  return (a.x * a.x + a.y * a.y) + a.z * a.z;
}

template <class F>
POINTFAIR_INLINE Vec3<F> select(decltype(F() < F()) condition, Vec3<F> yes, Vec3<F> no) {
  return {select(condition, yes.x, no.x), select(condition, yes.y, no.y), select(condition, yes.z, no.z)};
}

// exp(-t) for t >= 0; 0 from t = 87 on, where exp(-t) nears the smallest normal float; NaN gives 0.
// Relative error below 2e-7 (1 + t), of which t * 6e-8 come from rounding t itself (tests/test_point.cpp). 2^-f on
// [-1/2, 1/2] by a polynomial of least largest relative error, 9e-8, that is 1 at 0 (Lawson's iteration).
template <class F>
POINTFAIR_INLINE F gaussian(F t) {
  const F shift = F(12582912.0f);  // 1.5 * 2^23: a number added to it is rounded to an integer
  const F binary = t * 1.44269504f;
  const F shifted = shift - binary;
  const F f = binary + (shifted - shift);
  F p = f * -1.32647273e-3f + 9.67151299e-3f;
  p = p * f + -5.55073358e-2f;
  p = p * f + 2.40222424e-1f;
  p = p * f + -6.93147004e-1f;
  p = p * f + 1.0f;
  return select(t < F(87.0f), power_of_two_times(p, shifted), F{});
}

// How a sum makes a weight of an exponent t. The factors that t is made of are multiplied by kScale once a point, so
// that of() gets t times kScale.
struct Gaussian {
  static constexpr float kScale = 1, kRootScale = 1;
  template <class F>
  POINTFAIR_INLINE static F of(F t) {
    return gaussian(t);
  }
};

// (1 - t / 17)^16 (Eq. 26 of docs/how-it-works.md): within 3 % of exp(-t) up to t = 2, for a third of its operations. 0
// where it is below 2^-64, and for NaN: what is left of it times any factor is no subnormal number, so that scaling a
// cloud changes no bit.
struct CompactGaussian {
  static constexpr float kScale = 1 / 17.0f, kRootScale = 0.242535625f, kEnd = 0.9375f;
  template <class F>
  POINTFAIR_INLINE static F of(F scaled) {
    const F root = F(1.0f) - scaled, square = root * root, fourth = square * square, eighth = fourth * fourth;
    return select(scaled < F(kEnd), eighth * eighth, F{});
  }
};

// A symmetric matrix.
template <class F>
struct Sym3 {
  F xx, xy, xz, yy, yz, zz;
};

// A direction and whether there is one.
template <class F>
struct Direction {
  Vec3<F> unit;  // zero where there is none
  decltype(F() < F()) exists;
};

// arccos of x in [-1, 1], absolute error 2e-8 before rounding (Abramowitz and Stegun 4.4.46).
template <class F>
POINTFAIR_INLINE F arc_cosine(F x) {
  const F a = larger(x, -x);
  F p = a * -0.0012624911f + 0.0066700901f;
  p = p * a + -0.0170881256f;
  p = p * a + 0.0308918810f;
  p = p * a + -0.0501743046f;
  p = p * a + 0.0889789874f;
  p = p * a + -0.2145988016f;
  p = p * a + 1.5707963050f;
  const F angle = square_root(1.0f - a) * p;
  return select(x < F{}, 3.14159265f - angle, angle);
}

// Cosine of an angle in [0, pi/3], by its Taylor series.
template <class F>
POINTFAIR_INLINE F cosine_to_sixty_degrees(F angle) {
  const F t = angle * angle;
  F p = t * -2.75573192e-7f + 2.48015873e-5f;
  p = p * t + -1.38888889e-3f;
  p = p * t + 4.16666667e-2f;
  p = p * t + -0.5f;
  return p * t + 1.0f;
}

// The eigenvector of the least eigenvalue of a positive semi-definite matrix; none where the two least eigenvalues
// agree to about 5e-4 of the trace (points on a line, or all identical): every direction would do as well, and a double
// root is not known better than to the square root of the rounding.
// The eigenvalue in closed form (O. K. Smith, "Eigenvalues of a symmetric 3 x 3 matrix", 1961): with q a third of the
// trace, p the size of M - q I and r = det((M - q I) / p) / 2, it is q - 2 p cos(arccos(-r) / 3). The eigenvector is
// the longest cross product of two rows of M - lambda I.
template <class F>
POINTFAIR_INLINE Direction<F> least_eigenvector(Sym3<F> m) {
  const F trace = (m.xx + m.yy) + m.zz;
  const auto sound = (trace > F(1e-36f)) & (trace < F(1e36f));
  const F scale = select(sound, F(3.0f) / trace, F{});  // the mean eigenvalue becomes 1
  const F a = m.xx * scale - 1.0f, b = m.xy * scale, c = m.xz * scale;
  const F d = m.yy * scale - 1.0f, e = m.yz * scale, f = m.zz * scale - 1.0f;
  const F p2 = (((a * a + d * d) + f * f) + 2.0f * ((b * b + c * c) + e * e)) / 6.0f;
  const F p = square_root(p2);
  const F det = (a * (d * f - e * e) - b * (b * f - c * e)) + c * (b * e - c * d);
  const F cube = p2 * p;
  const F r = select(cube > F(1e-30f), (0.5f * det) / cube, F{});
  const F angle = arc_cosine(-smaller(larger(r, F(-1.0f)), F(1.0f))) / 3.0f;
  const F lambda = (p * -2.0f) * cosine_to_sixty_degrees(angle);
  const Vec3<F> row0 = {a - lambda, b, c}, row1 = {b, d - lambda, e}, row2 = {c, e, f - lambda};
  const Vec3<F> c01 = cross(row0, row1), c02 = cross(row0, row2), c12 = cross(row1, row2);
  Vec3<F> best = c01;
  F longest = squared_length(c01);
  const F l02 = squared_length(c02), l12 = squared_length(c12);
  best = select<F>(l02 > longest, c02, best);
  longest = larger(longest, l02);
  best = select<F>(l12 > longest, c12, best);
  longest = larger(longest, l12);
  const decltype(F() < F()) exists = sound & (longest > F(1e-11f)) & (longest > 1e-5f * (p2 * p2));
  const F inverse = select(exists, F(1.0f) / square_root(longest), F{});
  return {select<F>(exists, inverse * best, Vec3<F>{}), exists};
}

}  // namespace pointfair::point
