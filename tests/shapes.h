// SPDX-License-Identifier: Apache-2.0
// Seeded clouds with known geometry. Only + - * / and square roots, so that a seed gives the same bits everywhere.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair::shapes {

using Points = std::vector<Point>;

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

// splitmix64 (Steele, Lea, Flood 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
  std::uint64_t below(std::uint64_t limit) { return bits() % limit; }
  double uniform() { return double(bits() >> 11) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  // Mean 0, deviation 1, by the sum of twelve uniforms; its tails end at 6.
  double normal() {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += uniform();
    return sum;
  }

 private:
  std::uint64_t state_;
};

inline double distance(const Point& a, const Point& b) {
  return std::hypot(double(a.x) - b.x, double(a.y) - b.y, double(a.z) - b.z);
}
// How far the points of one cloud lie from those of another on average.
inline double mean_distance(const Points& a, const Points& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += distance(a[i], b[i]);
  return sum / double(a.size());
}

// Of a per-point error: the root of the mean square, and the mean of the absolute values.
template <class Error>
double rms(const Points& points, const Error& error) {
  double sum = 0;
  for (const Point& p : points) sum += std::pow(double(error(p)), 2);
  return std::sqrt(sum / double(points.size()));
}
template <class Error>
double mean_error(const Points& points, const Error& error) {
  double sum = 0;
  for (const Point& p : points) sum += std::abs(double(error(p)));
  return sum / double(points.size());
}

inline Point make_point(double x, double y, double z) { return {float(x), float(y), float(z)}; }

template <class Make>
Points generate(int count, std::uint64_t seed, Make make) {
  Random random(seed);
  Points points;
  points.reserve(std::size_t(count));
  for (int i = 0; i < count; ++i) points.push_back(make(random));
  return points;
}

// The unit square at z = 0.
inline Points plane(int count, std::uint64_t seed = 1) {
  return generate(count, seed, [](Random& r) {
    const double x = r.uniform();
    return make_point(x, r.uniform(), 0);
  });
}

// Each point so many times, one after the other, each coordinate off by up to `rounding`.
inline Points repeated(const Points& points, int times, double rounding) {
  Points all;
  Random random(6);
  for (const Point& p : points)
    for (int i = 0; i < times; ++i) {
      Point copy = p;
      for (float* value : {&copy.x, &copy.y, &copy.z})
        *value = float(double(*value) + rounding * (2 * random.uniform() - 1));
      all.push_back(copy);
    }
  return all;
}

// A smooth hill and valley over the unit square.
inline Points waves(int count, std::uint64_t seed = 1) {
  return generate(count, seed, [](Random& r) {
    const double x = r.uniform(), y = r.uniform();
    return make_point(x, y, 1.6 * x * (1 - x) * (y - 0.5));
  });
}

// Radius 1 about 0.
inline Points sphere(int count, std::uint64_t seed = 1) {
  return generate(count, seed, [](Random& r) {
    for (;;) {
      const double x = r.uniform(-1, 1), y = r.uniform(-1, 1), z = r.uniform(-1, 1);
      const double length = std::sqrt(x * x + y * y + z * z);
      if (length > 0.1 && length < 1) return make_point(x / length, y / length, z / length);
    }
  });
}

// The surface of [0, 1]^3.
inline Points cube(int count, std::uint64_t seed = 1) {
  return generate(count, seed, [](Random& r) {
    const std::uint64_t side = r.below(6);
    const double u = r.uniform(), v = r.uniform(), w = double(side % 2);
    if (side / 2 == 0) return make_point(w, u, v);
    return side / 2 == 1 ? make_point(u, w, v) : make_point(u, v, w);
  });
}

// Two unit squares, at z = 0 (even indices) and z = gap (odd ones).
inline Points two_sheets(int count, double gap, std::uint64_t seed = 1) {
  Points points = plane(count, seed);
  for (std::size_t i = 1; i < points.size(); i += 2) points[i].z = float(gap);
  return points;
}

// Along (1, 2, 3).
inline Points line(int count, std::uint64_t seed = 1) {
  return generate(count, seed, [](Random& r) {
    const float t = float(r.below(1 << 20)) * 0x1p-20f;  // so that 2 t and 3 t are exact
    return Point{t, 2 * t, 3 * t};
  });
}

inline Points identical(int count) { return Points(std::size_t(count), Point{0.25f, -3.0f, 7.5f}); }

// waves whose density along x falls by `ratio` from end to end, smoothly.
inline Points uneven(int count, double ratio, std::uint64_t seed = 1) {
  return generate(count, seed, [ratio](Random& r) {
    const double a = ratio - 1, u = r.uniform();  // density 1 + a x, integrated and inverted
    const double x = (std::sqrt(1 + u * (2 * a + a * a)) - 1) / a, y = r.uniform();
    return make_point(x, y, 1.6 * x * (1 - x) * (y - 0.5));
  });
}

// side^3 points at integer coordinates: nothing but ties.
inline Points grid(int side) {
  Points points;
  for (int z = 0; z < side; ++z)
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x) points.push_back({float(x), float(y), float(z)});
  return points;
}

// side^2 points at integer coordinates with z = 0.
inline Points flat_grid(int side) {
  Points points = grid(side);
  points.resize(std::size_t(side) * side);
  return points;
}

inline Points with_noise(Points points, double sigma, std::uint64_t seed = 7) {
  Random random(seed);
  for (Point& p : points) {
    p.x += float(sigma * random.normal());
    p.y += float(sigma * random.normal());
    p.z += float(sigma * random.normal());
  }
  return points;
}

// At the height over the plane.
template <class Height>
Points lifted(Points points, const Height& height) {
  for (Point& p : points) p.z = float(height(p.x, p.y));
  return points;
}

inline Points with_stray(Points points, float distance) {
  points.push_back({distance, distance, distance});
  return points;
}

// Every `step`-th point becomes invalid, in turn by NaN, by infinity, and by a coordinate too large to be squared.
inline Points with_invalid(Points points, int step) {
  const float infinity = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < points.size(); i += step) {
    const float bad[] = {std::numeric_limits<float>::quiet_NaN(), infinity, -infinity, 1e30f};
    (&points[i].x)[i / step % 3] = bad[i / step % 4];
  }
  return points;
}

inline Points shifted(Points points, Point by) {
  for (Point& p : points) p = {p.x + by.x, p.y + by.y, p.z + by.z};
  return points;
}

inline Points scaled(Points points, float factor) {
  for (Point& p : points) p = {p.x * factor, p.y * factor, p.z * factor};
  return points;
}

// order[i] is where the i-th point of a shuffled cloud comes from.
inline std::vector<std::uint32_t> shuffle_order(std::size_t count, std::uint64_t seed) {
  Random random(seed);
  std::vector<std::uint32_t> order(count);
  for (std::size_t i = 0; i < count; ++i) order[i] = std::uint32_t(i);
  for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[random.below(i)]);
  return order;
}

inline Points permuted(const Points& points, const std::vector<std::uint32_t>& order) {
  Points result;
  for (const std::uint32_t from : order) result.push_back(points[from]);
  return result;
}

// At UTM-like coordinates, as a file with doubles is read: small offsets from a large origin.
inline Cloud at_utm(Points points) { return {.origin = {448262.125, 5411932.5, 312.25}, .points = std::move(points)}; }

inline Cloud as_cloud(Points points) { return {.points = std::move(points)}; }

}  // namespace pointfair::shapes
