// SPDX-License-Identifier: Apache-2.0
#include "cpu/volume.h"

#include <cmath>
#include <numeric>

#include "portable.hpp"

namespace pointfair::cpu {
namespace {

using Vec = point::Vec3<double>;

Vec place(const IndexView& index, std::size_t i) { return {index.x[i], index.y[i], index.z[i]}; }

// Connected parts of a mesh, each named by one of its vertices.
class Parts {
 public:
  explicit Parts(std::size_t points) : parent_(points) { std::iota(parent_.begin(), parent_.end(), 0u); }
  Index of(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(Index a, Index b) {
    a = of(a), b = of(b);
    parent_[std::max(a, b)] = std::min(a, b);  // the name does not depend on the order
  }

 private:
  std::vector<Index> parent_;
};

struct Part {
  Vec sum{};
  double count = 0, before = 0, after = 0;  // volumes
  double factor = 1;
  Vec center() const { return (1 / count) * sum; }
};

double volume_under(const Vec& a, const Vec& b, const Vec& c) { return dot(a, cross(b, c)) / 6; }

}  // namespace

void keep_volumes(const GraphSource& source, std::vector<Vec>& displacements) {
  const IndexView& index = source.index;
  const std::vector<Index> at = sorted_positions(index, *source.mesh);
  const MeshFaces& faces = *source.faces;
  Parts parts(index.points);
  std::vector<bool> is_vertex(index.points);
  for (std::size_t f = 0; f < faces.size(); ++f)
    for (const std::uint32_t corner : faces.of(f)) {
      const Index i = at[corner], first = at[faces.of(f).front()];
      if (i == point::kNoNeighbor || first == point::kNoNeighbor) return;  // a hole where an outlier was
      is_vertex[i] = true;
      parts.join(first, i);
    }
  const auto moved = [&](Index i) { return place(index, i) + displacements[i]; };
  std::vector<Part> of_parts(index.points);
  for (Index i = 0; i < index.points; ++i)
    if (is_vertex[i]) {
      Part& part = of_parts[parts.of(i)];
      part.sum = part.sum + moved(i);
      ++part.count;
    }
  for (std::size_t f = 0; f < faces.size(); ++f) {
    const auto corners = faces.of(f);
    const Index first = at[corners[0]];
    Part& part = of_parts[parts.of(first)];
    const Vec center = part.center();
    for (std::size_t c = 2; c < corners.size(); ++c) {
      const Index second = at[corners[c - 1]], third = at[corners[c]];
      part.before +=
          volume_under(place(index, first) - center, place(index, second) - center, place(index, third) - center);
      part.after += volume_under(moved(first) - center, moved(second) - center, moved(third) - center);
    }
  }
  for (Part& part : of_parts)
    if (part.before / part.after > 0 && std::isfinite(part.before / part.after))
      part.factor = portable::pow(part.before / part.after, 1.0 / 3);
  for (Index i = 0; i < index.points; ++i) {
    if (!is_vertex[i]) continue;
    const Part& part = of_parts[parts.of(i)];
    const Vec center = part.center();
    displacements[i] = center + part.factor * (moved(i) - center) - place(index, i);
  }
}

}  // namespace pointfair::cpu
