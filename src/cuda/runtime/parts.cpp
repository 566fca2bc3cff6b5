// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/parts.hpp"

#include <algorithm>
#include <array>

#include "point/neighbors.h"

namespace pointfair {
namespace {

constexpr std::size_t kUnit = 1 << 15, kLargeUnit = 1 << 20;  // points; whole subtrees
constexpr std::size_t kLeastApart = 24 * kUnit;               // not worth trees of their own
constexpr std::size_t kLarge = 1 << 24;
constexpr std::size_t kLargestPart = 1 << 24;  // more are too many for sort keys of 10 bits an axis
constexpr int kSampled = 16;                   // of a part

struct SampledPart {
  std::array<Point, kSampled> points;
  int count = 0;
  Point min{}, max{};

  void add(const Point& p) {
    if (count == 0) min = max = p;
    min = {std::min(min.x, p.x), std::min(min.y, p.y), std::min(min.z, p.z)};
    max = {std::max(max.x, p.x), std::max(max.y, p.y), std::max(max.z, p.z)};
    points[std::size_t(count++)] = p;
  }
  bool surrounds(const Point& p) const {
    return count > 0 && p.x >= min.x && p.x <= max.x && p.y >= min.y && p.y <= max.y && p.z >= min.z && p.z <= max.z;
  }
};

// Whether a point lies in the boxes of few other parts. In random order it lies in most of them; where parts follow
// each other in space, in one or two.
bool lie_apart(std::span<const Point> points, const Parts& parts) {
  std::vector<SampledPart> sampled(parts.count());
  for (std::size_t part = 0; part < parts.count(); ++part)
    for (std::size_t i = 0; i < kSampled; ++i) {
      const Point& p = points[parts.begin(part) + (2 * i + 1) * parts.size(part) / (2 * kSampled)];
      if (point::is_indexable(p)) sampled[part].add(p);
    }
  std::size_t asked = 0, others = 0;
  for (const SampledPart& its : sampled) {
    asked += std::size_t(its.count);
    for (int i = 0; i < its.count; ++i)
      for (const SampledPart& other : sampled) others += &other != &its && other.surrounds(its.points[std::size_t(i)]);
  }
  return 4 * others <= asked * (parts.count() - 1);
}

// A few parts where kernels are short, more where copies are long.
Parts parts_to_lie_apart(std::size_t points) {
  const std::size_t unit = points < kLarge ? kUnit : kLargeUnit, wanted = points < kLarge ? 4 : 16;
  const std::size_t each = std::min((points + wanted - 1) / wanted, kLargestPart);
  return Parts::of(points, (each + unit - 1) / unit * unit);
}

}  // namespace

Parts Parts::of(std::size_t points, std::size_t each) {
  Parts parts;
  for (std::size_t end = each; end < points; end += each) parts.ends.push_back(end);
  parts.ends.push_back(points);
  return parts;
}

Parts plan_parts(std::span<const Point> points, bool may_lie_apart) {
  const std::size_t count = points.size();
  if (may_lie_apart && count >= kLeastApart) {
    Parts parts = parts_to_lie_apart(count);
    if (lie_apart(points, parts)) return parts;
  }
  return Parts{{count}};
}

}  // namespace pointfair
