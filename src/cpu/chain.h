// SPDX-License-Identifier: Apache-2.0
// The results of every stage of one iteration. Memory, bytes a point: index 18, lists 4 k, W_a lengths 4, normals 12,
// faired positions 12; 46 + 4 k in all. Without lists squared radii 4, and 4 more where they grow; where something
// follows the noise, its levels 4, and where the reach differs, shares 4. While a method other than the bilateral one
// runs, 12 more; within a radius, 12 for notes from the normals to the bilateral step.
#pragma once

#include "cpu/index.h"
#include "cpu/kernels.h"
#include "cpu/memory.h"
#include "cpu/mesh_lists.h"
#include "point/region.h"
#include "seam/backend.hpp"
#include "seam/rules.hpp"

namespace pointfair::cpu {

// Leaves between two looks at the stop token: at most about 10 ms of work where neighbourhoods are as wide as they can
// be.
inline constexpr std::size_t kLeavesABlock = 32;

class Chain {
 public:
  explicit Chain(MemoryMeter& meter);

  void build_index(std::span<const Point> points, std::span<const Index> originals, const std::optional<Frame>& frame,
                   SortSpace& space, const Kernels& kernels, const std::stop_token& stop);
  void find_neighbors(const NeighborSettings& settings, const Kernels& kernels, const std::stop_token& stop);
  void estimate_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop);
  void fair(const FairingSettings& settings, const Kernels& kernels, const std::stop_token& stop);
  const SolverReport& solver_report() const { return solver_; }  // of the last fair() by Method::implicit

  // As Exactness::outcomes.
  void outcomes(const point::Region& loaded, const Kernels& kernels, std::span<unsigned char> out) const;

  // In sorted order, one for each valid point.
  std::span<const Point> faired() const { return {faired_.data(), std::size_t(index_.view().points)}; }
  const SpatialIndex& index() const { return index_; }
  VectorsView normals() const;
  const Counts& counts() const { return counts_; }

  // Gives back what only the stages after the index fill, so that a further iteration never holds more than two chains.
  void release_small_results();
  // The faired positions' memory also serves the uploaded points, which are of no use once there is an index.
  void swap_faired(Buffer<Point>& other) { std::swap(faired_, other); }

 private:
  Neighborhoods neighborhoods() const;
  Neighborhoods grown_neighborhoods() const;  // of the bilateral step
  bool radii_grow() const { return pointfair::radii_grow(neighbors_, normal_settings_); }
  bool by_list() const { return neighbors_.k > 0; }
  bool prefix_suffices(const NeighborSettings& settings) const;
  void measure_levels(const Kernels& kernels, const std::stop_token& stop);
  const float* squared_levels() const { return neighbors_.levels ? squared_level_.data() : nullptr; }
  const float* further_shares() const {
    return neighbors_.reach_levels && !by_list() ? further_share_.data() : nullptr;
  }
  std::size_t list_row() const { return std::size_t(stored_k_) * kLeafSize; }  // of the lists of a leaf
  void measure_areas(const Kernels& kernels, const std::stop_token& stop);
  void keep_boundary(const MeshEdges& mesh, const std::stop_token& stop);
  void find_lists(const Kernels& kernels, const std::stop_token& stop);
  void measure_radii(const Kernels& kernels, const std::stop_token& stop);
  void plane_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop);
  void face_normals(const MeshFaces& faces, const std::stop_token& stop);
  void filter_normals(const NormalSettings& settings, const Kernels& kernels, const std::stop_token& stop);
  void fair_bilaterally(const FairingSettings& settings, AreaView area, const Kernels& kernels,
                        const std::stop_token& stop);
  Notes notes_of(std::size_t block);  // of leaves
  void fair_otherwise(const FairingSettings& settings, AreaView area, const Kernels& kernels,
                      const std::stop_token& stop);
  SolverReport fair_at_once(const FairingSettings& settings, const std::stop_token& stop);
  void count_short(const std::stop_token& stop);

  SpatialIndex index_;
  Buffer<Index> lists_;
  MeshLists mesh_lists_;  // in place of those, where neighbours follow a mesh
  Buffer<float> mean_distance_;
  Buffer<float> squared_level_;                            // of the noise, where something follows it
  Buffer<float> further_share_;                            // of the levels of reach, where there are any
  Buffer<float> squared_radius_;                           // without a list
  Buffer<float> squared_growth_;                           // of those, where those of flat places grow
  Buffer<float> displaced_x_, displaced_y_, displaced_z_;  // displacements
  Buffer<std::uint8_t> notes_;  // of what the walks for the normals met, until the points are faired
  Buffer<Point> normals_;       // three arrays; each round of their filter goes into the memory of the faired positions
  Buffer<Point> faired_;
  NeighborSettings neighbors_;
  NormalSettings normal_settings_;
  FairingSettings fairing_settings_;
  int stored_k_ = 0;        // length of the stored lists; a smaller k is a prefix of them
  bool has_lists_ = false;  // of the present index
  bool has_areas_ = false;  // the lengths of W_a, with those
  Counts counts_;
  SolverReport solver_;
};

}  // namespace pointfair::cpu
