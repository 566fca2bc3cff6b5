// SPDX-License-Identifier: Apache-2.0
#include "sampling.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "vec3.hpp"

namespace pointfair::cli {
namespace {

// Random numbers that are the same on every machine: integers, IEEE + - * / and square roots, nothing of the standard
// library's distributions or logarithms, whose last digits differ between machines.

// Natural logarithm of a positive normal number, to about 2e-16 of max(1, |result|).
// ln(2^n m) = n ln 2 + 2 artanh((m - 1) / (m + 1)), 1/sqrt(2) <= m < sqrt(2), by the series of artanh.
double portable_log(double value) {
  const std::uint64_t bits = std::bit_cast<std::uint64_t>(value);
  double exponent = static_cast<double>(static_cast<int>(bits >> 52) - 1023);
  double mantissa = std::bit_cast<double>((bits & 0x000fffffffffffffu) | 0x3ff0000000000000u);
  if (mantissa > 1.4142135623730951) {
    mantissa *= 0.5;
    exponent += 1;
  }
  const double z = (mantissa - 1) / (mantissa + 1);
  const double z2 = z * z;  // at most 0.0295, so 11 terms reach 1e-17
  double series = 0;
  for (int n = 21; n >= 1; n -= 2) series = series * z2 + 1.0 / n;
  return exponent * 0.6931471805599453 + 2 * z * series;
}

// e^value for value in [-700, 700], to about 4e-16 of the result: 2^n e^r with |r| <= ln(2) / 2, by Taylor's series.
double portable_exp(double value) {
  const double n = std::floor(value * 1.4426950408889634 + 0.5);
  const double r = (value - n * 0.693147180369123816490) - n * 1.90821492927058770002e-10;  // ln 2 in two parts
  double series = 1;
  for (int i = 14; i >= 1; --i) series = 1 + series * r / i;
  return series * std::bit_cast<double>(static_cast<std::uint64_t>(static_cast<int>(n) + 1023) << 52);
}

// A counter-based generator: every (seed, purpose, index) names a stream of its own, so that points can be drawn in
// any order by any number of threads. The mixing function is that of SplitMix64 (Steele, Lea, Flood 2014).
class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t purpose, std::uint64_t index)
      : state_(mix(mix(mix(seed + kStep) + purpose * kStep) + index * kStep)) {}

  std::uint64_t bits() { return mix(state_ += kStep); }

  // Uniform in [0, 1), a multiple of 2^-53.
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  // Two independent numbers of a standard normal distribution, by Marsaglia's polar method (1964).
  struct Pair {
    double first, second;
  };
  Pair normal_pair() {
    for (;;) {
      const double u = 2 * uniform() - 1;
      const double v = 2 * uniform() - 1;
      const double s = u * u + v * v;
      if (s >= 1 || s == 0) continue;
      const double factor = std::sqrt(-2 * portable_log(s) / s);
      return {u * factor, v * factor};
    }
  }

 private:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15u;  // 2^64 / golden ratio

  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }

  std::uint64_t state_;
};

// Purposes of random streams.
enum : std::uint64_t { kPlaces, kNoise, kChoices, kOutliers };

Vec3 vec(const Point& p) { return {p.x, p.y, p.z}; }

Point point(Vec3 v) { return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}; }

template <class F>
void for_each_index(std::uint64_t count, const F& body) {
  tbb::parallel_for(tbb::blocked_range<std::uint64_t>(0, count, 4096), [&](const auto& range) {
    for (std::uint64_t i = range.begin(); i != range.end(); ++i) body(i);
  });
}

// Density over the surface, in [1 / ratio, 1]: ratio^(t - 1), t running from 0 to 1 along the longest axis.
class Density {
 public:
  Density(const Box& box, double ratio) : log_ratio_(portable_log(ratio)) {
    for (int axis = 1; axis < 3; ++axis)
      if (box.max[axis] - box.min[axis] > box.max[axis_] - box.min[axis_]) axis_ = axis;
    start_ = box.min[axis_];
    length_ = box.max[axis_] - start_;
  }
  bool even() const { return log_ratio_ == 0 || !(length_ > 0); }
  double log_at(Vec3 v) const { return ((coordinate(v, axis_) - start_) / length_ - 1) * log_ratio_; }

 private:
  int axis_ = 0;
  double start_ = 0, length_ = 0, log_ratio_;
};

class TriangleSampler {
 public:
  TriangleSampler(std::span<const Point> vertices, std::span<const TriangleIndices> triangles, double ratio)
      : vertices_(vertices), triangles_(triangles), density_(bounding_box(vertices), ratio) {
    cumulative_.reserve(triangles.size());
    double sum = 0;
    for (const TriangleIndices& t : triangles) {
      const double w = weight(t);
      if (w > 0 && std::isfinite(w)) sum += w;
      cumulative_.push_back(sum);
    }
    if (!(sum > 0)) throw Error(ErrorKind::failed, "the faces have no area to sample");
  }

  // A triangle by its area times the highest density on it, a place on it, kept with the share of that density.
  Vec3 draw(Random& random) const {
    for (;;) {
      const double target = random.uniform() * cumulative_.back();
      const auto found = std::ranges::upper_bound(cumulative_, target);
      const auto index = std::min<std::ptrdiff_t>(found - cumulative_.begin(), std::ssize(cumulative_) - 1);
      const TriangleIndices& t = triangles_[static_cast<std::size_t>(index)];
      const Vec3 place = place_on(t, random);
      if (density_.even()) return place;
      const double chance = random.uniform();
      if (chance > 0 && portable_log(chance) < density_.log_at(place) - highest_log_density(t)) return place;
    }
  }

 private:
  Vec3 corner(std::uint32_t index) const { return vec(vertices_[index]); }

  Vec3 place_on(const TriangleIndices& t, Random& random) const {
    double u = random.uniform(), v = random.uniform();
    if (u + v > 1) {  // the other half of the parallelogram
      u = 1 - u;
      v = 1 - v;
    }
    const Vec3 a = corner(t[0]);
    return a + u * (corner(t[1]) - a) + v * (corner(t[2]) - a);
  }

  double highest_log_density(const TriangleIndices& t) const {
    return std::max({density_.log_at(corner(t[0])), density_.log_at(corner(t[1])), density_.log_at(corner(t[2]))});
  }

  double weight(const TriangleIndices& t) const {
    const Vec3 a = corner(t[0]);
    const double area = length(cross(corner(t[1]) - a, corner(t[2]) - a)) / 2;
    return density_.even() ? area : area * portable_exp(highest_log_density(t));
  }

  std::span<const Point> vertices_;
  std::span<const TriangleIndices> triangles_;
  Density density_;
  std::vector<double> cumulative_;
};

// Chebyshev's polynomial cos(6 arccos x): six bumps between -1 and 1.
double chebyshev6(double x) {
  const double s = x * x;
  return ((32 * s - 48) * s + 18) * s - 1;
}

// Uniform on the unit sphere: the direction of a point of the unit ball.
Vec3 draw_direction(Random& random) {
  for (;;) {
    const Vec3 v = {2 * random.uniform() - 1, 2 * random.uniform() - 1, 2 * random.uniform() - 1};
    const double s = squared_length(v);
    if (s <= 1 && s > 1e-6) return (1 / std::sqrt(s)) * v;
  }
}

}  // namespace

double Box::diagonal() const {
  if (min[0] > max[0]) return 0;
  return length(Vec3{max[0], max[1], max[2]} - Vec3{min[0], min[1], min[2]});
}

Box bounding_box(std::span<const Point> points) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Box box = {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}};
  for (const Point& p : points) {
    if (!is_finite(p)) continue;
    for (int axis = 0; axis < 3; ++axis) {
      box.min[axis] = std::min(box.min[axis], coordinate(vec(p), axis));
      box.max[axis] = std::max(box.max[axis], coordinate(vec(p), axis));
    }
  }
  return box;
}

std::vector<Point> sample_surface(std::span<const Point> vertices, std::span<const TriangleIndices> triangles,
                                  std::uint64_t count, double ratio, std::uint64_t seed) {
  const TriangleSampler sampler(vertices, triangles, ratio);
  std::vector<Point> points(count);
  for_each_index(count, [&](std::uint64_t i) {
    Random random(seed, kPlaces, i);
    points[i] = point(sampler.draw(random));
  });
  return points;
}

std::vector<Point> sample_bumpy_sphere(std::uint64_t count, std::uint64_t seed) {
  std::vector<Point> points(count);
  for_each_index(count, [&](std::uint64_t i) {
    Random random(seed, kPlaces, i);
    const Vec3 d = draw_direction(random);
    const double bump = chebyshev6(d.x) + chebyshev6(d.y) + chebyshev6(d.z);
    points[i] = point((1 + 0.05 / 3 * bump) * d);
  });
  return points;
}

void add_noise(std::span<Point> points, double sigma, std::uint64_t seed) {
  for_each_index(points.size(), [&](std::uint64_t i) {
    if (!is_finite(points[i])) return;
    Random random(seed, kNoise, i);
    const Random::Pair xy = random.normal_pair();
    const Random::Pair z = random.normal_pair();
    points[i] = point(vec(points[i]) + sigma * Vec3{xy.first, xy.second, z.first});
  });
}

// Algorithm S of Knuth, The Art of Computer Programming 2, 3.4.2: each point in turn is chosen with the chance wanted /
// remaining, which makes the number exact.
void add_outliers(std::span<Point> points, double share, std::uint64_t seed) {
  auto remaining = static_cast<double>(std::ranges::count_if(points, [](const Point& p) { return is_finite(p); }));
  double wanted = std::floor(share * remaining + 0.5);
  const Box box = bounding_box(points);
  for (std::uint64_t i = 0; i < points.size() && wanted > 0; ++i) {
    if (!is_finite(points[i])) continue;
    const bool chosen = Random(seed, kChoices, i).uniform() * remaining < wanted;
    remaining -= 1;
    if (!chosen) continue;
    wanted -= 1;
    Random random(seed, kOutliers, i);
    double place[3];
    for (int axis = 0; axis < 3; ++axis) {
      const double extent = box.max[axis] - box.min[axis];
      place[axis] = box.min[axis] + (1.1 * random.uniform() - 0.05) * extent;
    }
    points[i] = point({place[0], place[1], place[2]});
  }
}

}  // namespace pointfair::cli
