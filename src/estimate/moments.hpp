// SPDX-License-Identifier: Apache-2.0
// How the nearest points of a sample lie: along a line, or in a plane.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "estimate/constants.hpp"
#include "point/sample.h"
#include "pointfair/cloud.hpp"

namespace pointfair {

// The points of a row that are known, the sample first, from the sample.
inline std::vector<point::Offset> offsets_of(std::span<const Point> row) {
  std::vector<point::Offset> offsets;
  for (const Point& p : row)
    if (!std::isnan(p.x)) offsets.push_back(point::offset_between(row[0], p));
  return offsets;
}

// Second moments of points about their centroid.
struct Moments {
  point::Offset centroid{};
  point::Sym3<double> second{};

  Moments() = default;
  explicit Moments(std::span<const point::Offset> offsets) {
    for (const point::Offset& o : offsets) centroid = centroid + (1.0 / double(offsets.size())) * o;
    for (const point::Offset& o : offsets) {
      const point::Offset d = o - centroid;
      add({d.x * d.x, d.x * d.y, d.x * d.z, d.y * d.y, d.y * d.z, d.z * d.z});
    }
  }
  void add(const point::Sym3<double>& m) {
    point::Sym3<double>& s = second;
    s = {s.xx + m.xx, s.xy + m.xy, s.xz + m.xz, s.yy + m.yy, s.yz + m.yz, s.zz + m.zz};
  }
  double trace() const { return second.xx + second.yy + second.zz; }
  // By the product of the greater two eigenvalues, the principal minors, and the sum of their squares.
  bool lie_along_a_line() const {
    const point::Sym3<double>& m = second;
    const double minors = m.xx * m.yy - m.xy * m.xy + m.xx * m.zz - m.xz * m.xz + m.yy * m.zz - m.yz * m.yz;
    return minors <= constants::kRoundness * (trace() * trace() - 2 * minors);
  }
};

}  // namespace pointfair
