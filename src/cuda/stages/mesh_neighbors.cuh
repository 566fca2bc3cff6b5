// SPDX-License-Identifier: Apache-2.0
// Neighbours along the edges of a mesh: a warp finds what the points of a leaf reach together, with a bit for each of
// them, in a table of its own. Which vertices are reached does not depend on the order of the visits, and all that is
// stored is sorted.
#pragma once

#include "cuda/runtime/stop.cuh"
#include "cuda/stages/collected.cuh"
#include "cuda/stages/mesh_on_card.cuh"

namespace pointfair::cuda {

// The memory of tables of leaves that reach more than a table on the chip holds, and which those are.
class MeshTables {
 public:
  explicit MeshTables(Context& context)
      : context_(context), memory_(context), count_(context), now_(context), next_(context) {}

  // Calls launch(view, blocks, bytes of shared memory) with tables on the chip, and then with ever larger ones for the
  // leaves whose tables were full. Waits for the card.
  template <class Launch>
  void with(std::size_t leaves, const Launch& launch);

 private:
  Context& context_;
  DeviceArray<std::byte> memory_;
  DeviceArray<unsigned> count_;
  DeviceArray<Index> now_, next_;  // leaves
};

// What edges reach from each point within `growth` of its radius, at most kMaxNeighbors, as parts.
void find_balls(Context& context, MeshTables& tables, const Tree& tree, const SortedEdgesView& edges,
                const point::Radii& radii, float growth, const PartsRoom& room, const Stop& stop);

// Lists of a length of its own for each leaf. Memory: 4 bytes an entry.
class RingLists {
 public:
  explicit RingLists(Context& context) : context_(context), entries_(context), of_leaves_(context), used_(context) {}

  // Vertices up to `rings` edges away that lie within the squared limit, or with 0 rings those that paths reach which
  // stay within it: at most kMaxNeighbors, nearest first. Waits for the card.
  void find(MeshTables& tables, const Tree& tree, const SortedEdgesView& edges, int rings, float squared_limit,
            const Stop& stop);
  void release() {
    entries_.release();
    of_leaves_.release();
  }
  const Index* entries() const { return entries_.data(); }
  const LeafList* of_leaves() const { return of_leaves_.data(); }

 private:
  Context& context_;
  DeviceArray<Index> entries_;
  DeviceArray<LeafList> of_leaves_;
  DeviceArray<unsigned long long> used_;
};

}  // namespace pointfair::cuda
