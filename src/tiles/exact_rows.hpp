// SPDX-License-Identifier: Apache-2.0
// Samples of neighbourhoods of a cloud of which only parts are loaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "tiles/tile_run.hpp"

namespace pointfair {

// Rows of the k nearest as Sampling::sample_neighborhoods() gives them.
struct ExactRows {
  int k;
  std::span<const Point> queries;
  std::span<Point> out;
  // Where a query is among the points that the worker has loaded.
  std::function<std::uint32_t(const TileWorker& worker, std::size_t query)> find;
  CopyRule copies{};  // which no row has; a query that is one gets the row of its first

  // Fills the rows of some queries, with what lies so far around them at first, and twice as far around those whose
  // rows would not be the same with the whole cloud. Where what lies around all of them does not fit, halves follow.
  void fill(PointStore& store, TileWorker& worker, std::vector<std::size_t> some, double halo) const;

 private:
  void fill_from_nearest(PointStore& store, TileWorker& worker, std::size_t query) const;
  template <class SquaredGap>
  std::vector<std::size_t> fill_exact(const TileWorker& worker, const std::vector<std::size_t>& asked,
                                      const SquaredGap& squared_gap) const;
};

}  // namespace pointfair
