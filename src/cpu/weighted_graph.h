// SPDX-License-Identifier: Apache-2.0
// The neighbours of all points as one graph whose edges weigh alike from both ends (docs/methods.md, "implicit").
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <vector>

#include "cpu/kernels.h"
#include "point/graph.h"
#include "seam/settings.hpp"

namespace pointfair::cpu {

// Where edges come from: lists of k, or a mesh, along which lists are not read.
struct GraphSource {
  const IndexView& index;
  NeighborView lists;
  const MeshEdges* mesh = nullptr;
  const MeshFaces* faces = nullptr;  // with `mesh`
};

// By sorted position. Memory: 8 bytes an entry, 40 bytes a point.
struct WeightedGraph {
  using Entry = point::GraphEntry;
  std::vector<unsigned long long> begin;
  std::vector<Index> count;
  std::vector<Entry> entries;      // of each row ascending, each neighbour once
  std::vector<double> mass;        // of each point, M of Eq. 28; 0: the point stays
  std::vector<double> weight_sum;  // of each row
  double unit = 1;                 // of lambda: Eq. 28 is solved with lambda times this

  std::size_t points() const { return count.size(); }
  std::span<const Entry> row(std::size_t i) const { return {entries.data() + begin[i], count[i]}; }
  point::GraphView view() const { return {begin.data(), count.data(), entries.data(), mass.data(), weight_sum.data()}; }
};

// Rows of fewer than 3 neighbours, and along a mesh all points of a vertex but one, are left empty or without mass.
WeightedGraph weighted_graph(const GraphSource& source, const FairingSettings& settings, const std::stop_token& stop);

// Of each vertex the sorted position of its first point, kNoNeighbor where that is not in the index.
std::vector<Index> sorted_positions(const IndexView& index, const MeshEdges& mesh);

}  // namespace pointfair::cpu
