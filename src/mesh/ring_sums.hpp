// SPDX-License-Identifier: Apache-2.0
// Loops over the vertices of a mesh, and sums over what lies around each.
#pragma once

#include <cstddef>
#include <cstdint>

#include "mesh/blocks.hpp"
#include "mesh/ordered_faces.hpp"

namespace pointfair {

// Calls body(v) for each of `vertices` vertices, many at once.
template <class Body>
void for_vertices(std::size_t vertices, const ForEach& for_each, const Body& body) {
  for_mesh_blocks(vertices, for_each, [&](std::size_t first, std::size_t last, std::size_t) {
    for (auto v = std::uint32_t(first); v < last; ++v) body(v);
  });
}

// Replaces each vertex's value by the sum of its own and those of the vertices beside it in its faces, so many times:
// a value counts once for each path of faces that leads to it. Value::add(other) sums.
template <class Value>
void sum_over_rings(const OrderedFaces& faces, int rings, platform::LargeVector<Value>& values,
                    const ForEach& for_each) {
  platform::LargeVector<Value> around(values.size());
  for (int ring = 0; ring < rings; ++ring) {
    for_vertices(values.size(), for_each, [&](std::uint32_t v) {
      around[v] = values[v];
      for (const OrderedFaces::Beside& its : faces.beside(v))
        around[v].add(values[its.after]), around[v].add(values[its.before]);
    });
    values.swap(around);
  }
}

}  // namespace pointfair
