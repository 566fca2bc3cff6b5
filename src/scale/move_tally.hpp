// SPDX-License-Identifier: Apache-2.0
// How far points moved, summed up in any order by many threads: the same numbers each time, since only whole numbers
// are added.
#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "pointfair/tiled_run.hpp"

namespace pointfair::scale {

class MoveTally {
 public:
  MoveTally() : bins_(kBins) {}

  void add(std::span<const float> lengths);
  /// What numbers() gave.
  void add_numbers(std::span<const double> numbers);
  /// All of it, for a file.
  std::vector<double> numbers() const;
  Displacement displacement() const;

 private:
  // Lengths with the same upper half of their bits: they differ by less than 1 %.
  struct Bin {
    std::uint64_t count = 0, lower_halves = 0;  // the sum of those
  };
  static constexpr std::size_t kBins = std::size_t{1} << 15;
  static double mean_of(std::size_t bin, const Bin& its);

  mutable std::mutex mutex_;
  std::vector<Bin> bins_;
  float max_ = 0;
};

}  // namespace pointfair::scale
