// SPDX-License-Identifier: Apache-2.0
// What is given for each point by the attributes of the inputs: which points are ignored or may move, and their noise.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "estimate/given_noise.hpp"
#include "scale/plan.hpp"

namespace pointfair::scale {

/// A cloud of points of the file from `first` on, which knows their attributes.
Cloud part_of(const std::shared_ptr<const Source>& source, std::uint64_t first, std::span<const Point> points);

/// 1 for each point that one of the selections holds. Empty without selections.
std::vector<std::uint8_t> held_by_any(const std::vector<Selection>& selections, const Cloud& cloud);

/// The points of a block relative to the source's origin, ignored ones as NaN; returns how many finite points these
/// are. The positions of all are offered to `sample`.
std::uint64_t place_seen(const std::shared_ptr<const Source>& source, std::size_t block, const Limits& limits,
                         std::span<Point> points, io::OriginSample& sample);

/// Throws Error(usage) if a file has not the attributes that the limits and the noise are read from.
void check_attributes(const std::shared_ptr<const Source>& source, const Limits& limits, const std::string& noise);

/// The noise that an attribute of the inputs gives, as if all points were in memory: reads them some times over. Throws
/// Error(usage) if no value is positive.
GivenNoise noise_of_attribute(Inputs& inputs, const Plan& plan, unsigned threads, const std::stop_token& stop);

}  // namespace pointfair::scale
