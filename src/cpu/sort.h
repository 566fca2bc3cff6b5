// SPDX-License-Identifier: Apache-2.0
// Sorts points along a Hilbert curve that is as fine as the points are dense.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>

#include "cpu/kernels.h"
#include "pointfair/cloud.hpp"

namespace pointfair::cpu {

// The low half of each element is a place in `points`; on return the elements lie along the curve, their high halves
// spent. `core` is the box that the coarsest curve covers; points outside it count as on its border. Where more than a
// leaf of points share a cell, the cell gets a curve of its own, and so on, until only identical points are together;
// those keep the order of their places. `scratch` has the size of `elements`. O(N) for sampled surfaces.
void sort_along_curve(std::span<const Point> points, std::span<std::uint64_t> elements,
                      std::span<std::uint64_t> scratch, const Box& core, const Kernels& kernels,
                      const std::stop_token& stop);

// The same along the curve of src/point/curve.h, where points of one cell are in the order of point::lies_before. The
// positions follow each other alike on every device and whatever the order of the points, and those of a part of the
// points as in the whole.
void sort_along_curve(std::span<const Point> points, std::span<std::uint64_t> elements,
                      std::span<std::uint64_t> scratch, const point::CurveCube& cube, const Kernels& kernels,
                      const std::stop_token& stop);

}  // namespace pointfair::cpu
