// SPDX-License-Identifier: Apache-2.0
#include "quantise.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace pointfair::viewer {
namespace {

constexpr float kUnit = 32767;
constexpr std::size_t kBlock = 16384;
constexpr std::size_t kExceptionShare = 50;  // one point in so many may be an exception before 6 bytes are cheaper

float sign_of(float x) { return x < 0 ? -1.0f : 1.0f; }

// The lower or upper side of the octahedron, unfolded into the corners of the square; its own inverse.
void fold(float& u, float& v) {
  const float folded = (1 - std::abs(v)) * sign_of(u);
  v = (1 - std::abs(u)) * sign_of(v);
  u = folded;
}

// To the nearest, ties to even, as std::lrint, which is a call for each number: 1.5 * 2^23 leaves no bits behind the
// point.
std::int16_t to_steps(float x) {
  constexpr float kNoFraction = 12582912;
  const float within = x > kUnit ? kUnit : x >= -kUnit ? x : -kUnit;
  return static_cast<std::int16_t>(within + kNoFraction - kNoFraction);
}

Point minus(const Point& a, const Point& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
float dot(const Point& a, const Point& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// Indices of places one after the other, and those of places to come: the order leaps through memory, so what is needed
// soon is asked for now.
class Walk {
 public:
  Walk(const Order& order, std::size_t place, std::size_t count)
      : order_(order), index_(order.index(place)), ahead_(order.index((place + kAhead) % count)) {}
  std::uint32_t index() const { return index_; }
  std::uint32_t ahead() const { return ahead_; }
  void step() {
    index_ = order_.next(index_);
    ahead_ = order_.next(ahead_);
  }

 private:
  static constexpr std::size_t kAhead = 24;
  const Order& order_;
  std::uint32_t index_, ahead_;
};

void prefetch(const Point* point) { __builtin_prefetch(point); }

// What one block of places gave.
struct Block {
  std::vector<std::uint32_t> places;
  std::vector<float> exceptions;
  double sum = 0, squares = 0, largest = 0;
  std::size_t finite = 0;
};

struct Encoder {
  std::span<const Point> before, after;
  const Order& order;
  std::span<const std::int16_t> normals;
  float step;

  // In steps; 0 where a point is not finite.
  Point displacement(std::uint32_t i, Block& block) const {
    const Point d = minus(after[i], before[i]);
    if (!is_finite(d)) return {0, 0, 0};
    const double squared = double{d.x} * d.x + double{d.y} * d.y + double{d.z} * d.z, length = std::sqrt(squared);
    block.sum += length;
    block.squares += squared;
    block.largest = std::max(block.largest, length);
    ++block.finite;
    return {d.x / step, d.y / step, d.z / step};
  }

  void except(std::size_t place, const Point& d, Block& block) const {
    block.places.push_back(static_cast<std::uint32_t>(place));
    block.exceptions.insert(block.exceptions.end(), {d.x * step, d.y * step, d.z * step});
  }

  void encode(std::size_t place, std::uint32_t index, Block& block, std::int16_t* out,
              std::bool_constant<true> /*along normals*/) const {
    const Point d = displacement(index, block);
    const Point n = decode_normal({normals[2 * place], normals[2 * place + 1]});
    const std::int16_t steps = to_steps(dot(d, n));
    const Point off = minus(d, {n.x * steps, n.y * steps, n.z * steps});
    const bool close = dot(off, off) <= kTolerance * kTolerance;
    out[place] = close ? steps : std::int16_t{0};
    if (!close) except(place, d, block);
  }

  void encode(std::size_t place, std::uint32_t index, Block& block, std::int16_t* out,
              std::bool_constant<false>) const {
    const Point d = displacement(index, block);
    const bool close = std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)}) <= kUnit;
    out[3 * place] = close ? to_steps(d.x) : std::int16_t{0};
    out[3 * place + 1] = close ? to_steps(d.y) : std::int16_t{0};
    out[3 * place + 2] = close ? to_steps(d.z) : std::int16_t{0};
    if (!close) except(place, d, block);
  }
};

Displacements joined(std::vector<Block>& blocks, std::vector<std::int16_t> values, bool along_normals) {
  Displacements result;
  result.along_normals = along_normals;
  result.values = std::move(values);
  Block all;
  for (const Block& block : blocks) {
    result.places.insert(result.places.end(), block.places.begin(), block.places.end());
    result.exceptions.insert(result.exceptions.end(), block.exceptions.begin(), block.exceptions.end());
    all.sum += block.sum;
    all.squares += block.squares;
    all.largest = std::max(all.largest, block.largest);
    all.finite += block.finite;
  }
  const double finite = std::max<double>(1, static_cast<double>(all.finite));
  result.mean = all.sum / finite;
  result.rms = std::sqrt(all.squares / finite);
  result.max = all.largest;
  return result;
}

template <bool along_normals>
Displacements encode_all(const Encoder& encoder, std::size_t count) {
  std::vector<std::int16_t> values(count * (along_normals ? 1 : 3));
  std::vector<Block> blocks((count + kBlock - 1) / kBlock);
  tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t b) {
    Walk walk(encoder.order, b * kBlock, count);
    for (std::size_t place = b * kBlock; place < std::min(count, (b + 1) * kBlock); ++place, walk.step()) {
      prefetch(&encoder.before[walk.ahead()]);
      prefetch(&encoder.after[walk.ahead()]);
      encoder.encode(place, walk.index(), blocks[b], values.data(), std::bool_constant<along_normals>{});
    }
  });
  return joined(blocks, std::move(values), along_normals);
}

// The length that 95 % of the displacements of the first places do not exceed.
double most_lengths(const Encoder& encoder, std::size_t count) {
  constexpr std::size_t kSample = 4096;
  std::vector<float> lengths;
  for (std::size_t place = 0; place < std::min(count, kSample); ++place) {
    const std::uint32_t i = encoder.order.index(place);
    const Point d = minus(encoder.after[i], encoder.before[i]);
    if (is_finite(d)) lengths.push_back(std::sqrt(dot(d, d)));
  }
  if (lengths.empty()) return 0;
  const auto most = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() * 95 / 100);
  std::nth_element(lengths.begin(), most, lengths.end());
  return *most;
}

}  // namespace

float displacement_step(double spacing, double diagonal) {
  const double length = spacing > 0 ? spacing : diagonal > 0 ? diagonal / 1000 : 1;
  return std::max(static_cast<float>(length / 128), std::numeric_limits<float>::min());
}

OctNormal encode_normal(const Point& n) {
  const float length = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
  if (!(length > 0)) return kNoNormal;
  float u = n.x / length, v = n.y / length;
  if (n.z < 0) fold(u, v);
  return {to_steps(u * kUnit), to_steps(v * kUnit)};
}

Point decode_normal(OctNormal normal) {
  if (normal.u == kNoNormal.u) return {0, 0, 0};
  float u = normal.u / kUnit, v = normal.v / kUnit;
  const float z = 1 - std::abs(u) - std::abs(v);
  if (z < 0) fold(u, v);
  const float scale = 1 / std::sqrt(u * u + v * v + z * z);
  return {u * scale, v * scale, z * scale};
}

std::vector<std::int16_t> encode_normals(std::span<const Point> normals, const Order& order, std::size_t count) {
  std::vector<std::int16_t> result(2 * count);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kBlock), [&](const auto& range) {
    Walk walk(order, range.begin(), count);
    for (std::size_t place = range.begin(); place < range.end(); ++place, walk.step()) {
      prefetch(&normals[walk.ahead()]);
      const OctNormal normal = encode_normal(normals[walk.index()]);
      result[2 * place] = normal.u;
      result[2 * place + 1] = normal.v;
    }
  });
  return result;
}

Displacements encode_displacements(std::span<const Point> before, std::span<const Point> after, const Order& order,
                                   std::size_t count, std::span<const std::int16_t> normals, float step) {
  const Encoder encoder{before, after, order, normals, step};
  const bool has_normals = normals.size() == 2 * count && count > 0;
  Displacements result = has_normals ? encode_all<true>(encoder, count) : encode_all<false>(encoder, count);
  if (has_normals && result.places.size() > count / kExceptionShare) result = encode_all<false>(encoder, count);
  result.p95 = most_lengths(encoder, count);
  return result;
}

}  // namespace pointfair::viewer
