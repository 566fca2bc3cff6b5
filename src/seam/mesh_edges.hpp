// SPDX-License-Identifier: Apache-2.0
// The edges of a mesh over the uploaded points. Points at one place are one vertex, which is named by the first of them
// in upload order; the others have no edges of their own.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace pointfair {

struct MeshEdges {
  std::vector<std::uint32_t> vertex;      // of each point
  std::vector<std::uint64_t> begin;       // of each point's neighbours; one more at the end
  std::vector<std::uint32_t> neighbors;   // vertices, ascending
  std::vector<std::uint8_t> is_boundary;  // of each point

  std::span<const std::uint32_t> neighbors_of(std::uint32_t its_vertex) const {
    return {neighbors.data() + begin[its_vertex], neighbors.data() + begin[its_vertex + 1]};
  }
};

}  // namespace pointfair
