// SPDX-License-Identifier: Apache-2.0
// The edges of a mesh in the card's memory, and between sorted points.
#pragma once

#include <cstdint>
#include <memory>

#include "cuda/stages/list_stages.cuh"
#include "seam/mesh_edges.hpp"

namespace pointfair::cuda {

// As MeshEdges.
struct MeshView {
  const Index *vertex, *first;
  const std::uint64_t* begin;
  const Index* neighbors;
  const std::uint8_t* is_boundary;
  std::size_t vertices, edge_ends;
};

// Memory, bytes: 4 a point, 13 a vertex, 4 for each end of an edge.
class MeshOnCard {
 public:
  explicit MeshOnCard(Context& context);

  // Uploads the edges unless they are those of the call before.
  MeshView of(const std::shared_ptr<const MeshEdges>& edges);

 private:
  std::shared_ptr<const MeshEdges> edges_;  // which are in
  DeviceArray<Index> vertex_, first_, neighbors_;
  DeviceArray<std::uint64_t> begin_;
  DeviceArray<std::uint8_t> is_boundary_;
};

// Of a sorted point, as its vertex has them.
struct alignas(16) SortedEnds {
  unsigned long long begin;  // of its neighbours
  unsigned count;            // also of those that are lost
  Index own;                 // where its vertex is, as below
};
struct SortedEdgesView {
  const SortedEnds* of;
  const Index* there;  // sorted positions; kNoNeighbor of a vertex that is lost
};

// Memory, bytes: 16 a point, 4 for each end of an edge, and 4 a vertex.
class SortedEdges {
 public:
  explicit SortedEdges(Context& context) : context_(context), of_(context), there_(context), place_(context) {}
  SortedEdgesView find(const Tree& tree, const MeshView& mesh);

 private:
  Context& context_;
  DeviceArray<SortedEnds> of_;
  DeviceArray<Index> there_, place_;
};

// Puts vertices of the boundary back to where they were, in `faired`, in upload order; adds those that have a normal
// to `held`, on the card.
void keep_boundary(Context& context, const Tree& tree, const MeshView& mesh, Normals normals, Point* faired,
                   unsigned long long* held);

}  // namespace pointfair::cuda
