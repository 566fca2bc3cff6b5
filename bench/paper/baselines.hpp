// SPDX-License-Identifier: Apache-2.0
// What pointfair on a card is measured against, on the same card: the paper's own design and brute force in two ways.
// Only the search differs: normals and fairing are the same formulas (src/point) in the same order, so that faired
// points agree with pointfair's to the bit exactly where all neighbour lists agree.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"

namespace paper {

enum class Search {
  dense_grid,   // the paper, III.B and III.C: a grid over the bounding box, linked lists, a box grown per point
  brute_force,  // Garcia, Debreuve and Barlaud 2008: all distances, each query inserts into its own sorted list
  two_kernels,  // Liang and others 2009 (CUKNN): a matrix of distances, then a block a query selects from its row
};

struct Settings {
  Search search = Search::dense_grid;
  int k = 8;           // other points: one of kListLengths
  int resolution = 0;  // dense_grid: cells along the longest side of the bounding box
  float normal_sigma = 0, closeness_sigma = 0, similarity_sigma = 0;  // of eq. 5 and 6; area weight: squared
};

inline constexpr int kListLengths[] = {8, 16, 24, 32};

// Milliseconds on the card, each from the end of the stage before.
struct StageTimes {
  float upload = 0, index = 0, search = 0, normals = 0, fairing = 0, download = 0;
};

// One card, and device memory that is kept from run to run.
class CudaBaseline {
 public:
  CudaBaseline();  // on the card that is current; throws std::runtime_error in a build without CUDA
  ~CudaBaseline();
  CudaBaseline(const CudaBaseline&) = delete;
  CudaBaseline& operator=(const CudaBaseline&) = delete;

  // Index, neighbours, normals (eq. 3 to 5) and one fairing step (eq. 1 and 6), from array to array. More than k finite
  // points, as many in `out`. Throws std::runtime_error if a CUDA call fails, out of memory included.
  void run(std::span<const pointfair::Point> points, const Settings& settings, std::span<pointfair::Point> out);

  const StageTimes& times() const;  // of the last run

  // Neighbours of the last run, row after row of k, nearest first, in the order of pointfair's.
  std::vector<std::uint32_t> neighbors() const;

  // Whether the dense grid of these points, 4 bytes a cell, takes at most half of the card's free memory.
  static bool fits(std::span<const pointfair::Point> points, int resolution);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace paper
