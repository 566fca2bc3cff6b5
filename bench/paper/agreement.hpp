// SPDX-License-Identifier: Apache-2.0
// Whether a baseline found the right neighbours and moved the points as pointfair does. Its time counts only then.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "pointfair/cloud.hpp"

namespace paper {

// Empty if all faired points agree to the bit: so do then the lists that they were made from, each neighbour having its
// weight in its place of the sums.
std::string compare_points(std::span<const pointfair::Point> found, std::span<const pointfair::Point> expected);

// Empty if the lists of 200 points spread over the cloud are those that a plain loop over all points finds, in order.
// `rows`: k a point.
std::string compare_samples(std::span<const pointfair::Point> points, int k, std::span<const std::uint32_t> rows);

// The sum over all points of the distance to the last of their k neighbours: one wrong k-th neighbour changes it.
double sum_of_last_distances(std::span<const pointfair::Point> points, int k, std::span<const std::uint32_t> rows);

}  // namespace paper
