// SPDX-License-Identifier: Apache-2.0
// The results of every stage of one pass on the card.
// Memory, bytes a point: index 17, lists 4 k, normals 12, faired positions 12, places 4; mean distances 4 once an area
// weight is asked for; while neighbours are found, 4, and with the constraint 4 more for each of 2 k candidates; while
// a large cloud is faired, 16.
#pragma once

#include <limits>

#include "backend.hpp"
#include "cuda/index.cuh"
#include "cuda/search.cuh"
#include "cuda/stages.cuh"

namespace pointfair::cuda {

class Chain {
 public:
  explicit Chain(Context& context);

  // `points` on the card, in upload order; they stay there as long as the chain is used.
  void build_index(const Point* points, std::size_t count, std::stop_token stop);
  void find_neighbors(const NeighborSettings& settings, std::stop_token stop);
  void estimate_normals(const NormalSettings& settings, std::stop_token stop);
  void fair(const FairingSettings& settings, std::stop_token stop);

  // Start the work and return before it is done.
  void restore_normals(Point* out);
  void sample_neighborhoods(const Index* queries, std::size_t count, int k, Point* rows);

  DeviceArray<Point>& faired() { return faired_; }  // in upload order
  CloudState state() const;                         // waits for all work
  std::size_t points() const { return index_.points(); }

 private:
  void measure_areas();
  void find_places();
  Lists lists() const { return {neighbors_.k, lists_.data()}; }
  // The squared radius stays finite: infinite are only places that hold no point.
  Neighborhoods neighborhoods() const {
    return {lists(), std::min(neighbors_.radius * neighbors_.radius, std::numeric_limits<float>::max())};
  }
  Normals normals() const;

  Context& context_;
  const Point* input_ = nullptr;
  DeviceIndex index_;
  NeighborSettings neighbors_;
  DeviceArray<Index> lists_;
  DeviceArray<float> normals_, mean_distance_;
  bool areas_measured_ = false;
  DeviceArray<Point> faired_;
  DeviceArray<Index> place_of_;  // of large clouds only
  bool places_known_ = false;
};

}  // namespace pointfair::cuda
